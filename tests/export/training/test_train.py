"""The training loop on tiny rendered panoramas: it learns, it resumes, it keeps places apart; then ONNX and figures."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from click.testing import CliRunner

from export.__main__ import cli
from export.crops.surroundings import CELLS
from export.data.labels import label_panorama, write_labels
from export.data.panoramas import DataError, Panorama, read_index
from export.data.synthetic import write_dataset
from export.evaluation.evaluate import best_constant, by_name, evaluate
from export.networks.averaging import merge
from export.networks.network import Said, Served, encode
from export.networks.onnx import (
    ROUNDED,
    export,
    parity,
    read_network,
)
from export.networks.runs import RECORD, describe_data, history, read_record, read_spec
from export.training.train import (
    Batch,
    Crops,
    Run,
    TrainConfig,
    averaged_weights,
    learning_rate,
    load_sources,
    losses,
    split_places,
    train,
)
from lighting.errors import LightingError
from lighting.geometry import angle_between, direction
from lighting.model import Model
from tests.conftest import write_network


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of rendered panoramas and its labels."""
    folder = tmp_path_factory.mktemp("data")
    write_dataset(folder, 12, height=64)
    write_labels([label_panorama(p) for p in read_index(folder)], folder / "labels.csv")
    return folder


@pytest.fixture(scope="module")
def config(data: Path, tmp_path_factory: pytest.TempPathFactory) -> TrainConfig:
    out = tmp_path_factory.mktemp("run")
    return TrainConfig(str(data), str(data / "labels.csv"), str(out), crops=16, batch=4, workers=0, tune_share=0.3)


@pytest.fixture(scope="module")
def trained(config: TrainConfig) -> Path:
    train(config)
    return Path(config.out)


@pytest.fixture(scope="module")
def network(trained: Path) -> Path:
    target = trained / "outdoor.onnx"
    export([trained], target, temperature=1.3)
    return target


def test_a_run_leaves_what_reproduces_it(trained: Path, config: TrainConfig) -> None:
    record = json.loads((trained / "config.json").read_text())
    assert record["config"]["crops"] == config.crops
    assert set(record["panoramas"]["train"]).isdisjoint(record["panoramas"]["tune"])
    assert not {p.name for p in read_index(config.data, "val")} & set(record["panoramas"]["train"])
    last = json.loads((trained / "log.jsonl").read_text().splitlines()[-1])
    assert last["step"] == 4
    assert np.isfinite(last["sun"])


def test_a_batch_can_be_learnt_by_heart(config: TrainConfig) -> None:
    torch.manual_seed(1)
    run = Run(replace(config, learning_rate=2e-3, warmup=0.0, crops=1000))
    sources = load_sources(read_index(config.data, "train"), config.labels)
    batch = next(run.batches(Crops(sources, run.spec, run.config)))
    run.network.train()
    history = [run.update(batch) for _ in range(12)]
    for name in ("sun", "parameters"):
        assert float(history[-1][name]) < 0.8 * float(history[0][name])


def test_a_killed_run_goes_on_where_it_stopped(config: TrainConfig, tmp_path: Path) -> None:
    first = Run(replace(config, out=str(tmp_path)))
    sources = load_sources(read_index(config.data, "train"), config.labels)
    for batch in first.batches(Crops(sources, first.spec, replace(config, crops=8))):
        first.update(batch)
    first.save()
    second = Run(first.config)
    second.resume()
    assert second.step == 2
    torch.testing.assert_close(second.network.state_dict(), first.network.state_dict())
    torch.testing.assert_close(second.average.state_dict(), first.average.state_dict())


def test_a_run_is_resumed_with_its_own_settings_alone(config: TrainConfig, tmp_path: Path) -> None:
    own = replace(config, out=str(tmp_path), crops=8, batch=4)
    train(own)
    record = json.loads((tmp_path / RECORD).read_text())
    with pytest.raises(DataError, match=r"holds a run with another crops and licensed_only; choose another --out"):
        train(replace(own, crops=4, licensed_only=True))
    train(replace(own, workers=0, checkpoint_minutes=9.0))
    again = json.loads((tmp_path / RECORD).read_text())
    assert again["commit"] == record["commit"]
    assert again["config"] == {**record["config"], "workers": 0, "checkpoint_minutes": 9.0}
    moved = shutil.copytree(tmp_path, tmp_path / "moved")
    train(replace(own, out=str(moved)))
    assert json.loads((moved / RECORD).read_text())["commit"] == record["commit"]


def test_networks_of_one_name_and_version_are_not_compared(tmp_path: Path) -> None:
    first, second = (Model.load(write_network(tmp_path / name)) for name in ("a.onnx", "b.onnx"))
    with pytest.raises(DataError, match="Two of the networks are"):
        by_name([first, second])


def test_a_run_starts_from_the_averaged_weights_of_another_and_sees_other_crops(
    config: TrainConfig, tmp_path: Path
) -> None:
    first = Run(replace(config, out=str(tmp_path)))
    sources = load_sources(read_index(config.data, "train"), config.labels)
    first.update(next(first.batches(Crops(sources, first.spec, config))))
    first.save()
    later = replace(config, out=str(tmp_path / "later"), start=str(tmp_path))
    second = Run(later)
    torch.testing.assert_close(second.network.state_dict(), first.average.module.state_dict())
    photos = [Crops(sources, first.spec, c)[0].photo for c in (config, later)]
    assert not torch.equal(*photos)


def test_where_the_sun_is_seen_can_be_learnt_alone(config: TrainConfig, trained: Path, tmp_path: Path) -> None:
    train(replace(config, out=str(tmp_path), start=str(trained), only_seen=True, aimed=1.0, crops=8))
    before, after = averaged_weights(trained), averaged_weights(tmp_path)
    changed = {name for name, value in before.items() if not torch.equal(value, after[name])}
    assert changed
    assert all(name.startswith("seen.") for name in changed)
    assert [run["crops"] for run in history(read_record(tmp_path))] == [16, 8]


def test_a_crop_number_is_the_same_crop_every_time(config: TrainConfig) -> None:
    sources = load_sources(read_index(config.data, "train"), config.labels)
    spec = Run(config).spec
    one, two = Crops(sources, spec, config)[5], Crops(sources, spec, config)[5]
    for a, b in zip(one, two, strict=True):
        torch.testing.assert_close(a, b, equal_nan=True)


def test_two_places_may_share_a_crop_and_the_light_around_is_learnt(config: TrainConfig, tmp_path: Path) -> None:
    both = replace(config, out=str(tmp_path / "run"), crops=8, joined=1.0, surroundings=True)
    sources = load_sources(read_index(config.data, "train"), config.labels)
    run = Run(both)
    alone, joined = (Crops(sources, run.spec, c) for c in (config, both))
    assert {len(joined._drawn(index)) for index in range(8)} == {2}
    assert all(joined._drawn(index)[0] == alone._drawn(index)[0] for index in range(8))
    assert [tuple(part.shape) for part in (alone[0].around, joined[0].around)] == [(0,), (2 * CELLS,)]
    assert not torch.equal(alone[0].photo, joined[0].photo)
    train(both)
    assert json.loads((Path(both.out) / "log.jsonl").read_text())["around"] > 0
    export([Path(both.out)], tmp_path / "x.onnx")
    assert not any("around" in t.name for t in onnx.load(tmp_path / "x.onnx").graph.initializer)
    train(replace(both, out=str(tmp_path / "next"), start=both.out, joined=0.0, surroundings=False, only_seen=True))


def test_unknown_targets_cost_nothing() -> None:
    nan = float("nan")
    parameters = torch.tensor([[nan, nan, 5.0, 1.0, 50.0, nan], [3.0, 2.0, 5.0, 1.0, 50.0, 1.0]])
    sun = torch.tensor([[0.0, 0.0], [0.5, 0.5]])
    raw = torch.cat([encode(torch.nan_to_num(parameters[:, :5], nan=1.0)), torch.zeros(2, 1)], dim=1)
    raw[0, :2] = 100.0
    raw.requires_grad_()
    logits = torch.tensor([[50.0, -50.0], [1.0, 1.0]])
    nothing = logits[:, :0]
    batch = Batch(torch.zeros(2, 3, 1, 1), sun, parameters, seen=sun, around=nothing)
    parts = losses(Said(logits, raw, seen=logits, around=nothing), batch)
    found = {name: part.item() for name, part in parts.items()}
    expected = {"sun": np.log(2), "parameters": 0.0, "visibility": np.log(2), "seen": np.log(2)}
    assert found == pytest.approx(expected, abs=1e-6)
    assert "seen" not in losses(Said(logits, raw, seen=nothing, around=nothing), batch)
    torch.autograd.backward(sum(parts.values(), torch.zeros(())))
    assert raw.grad is not None
    assert torch.isfinite(raw.grad).all()
    assert (raw.grad[0, [0, 1, 5]] == 0).all()


def test_places_are_held_out_whole_and_by_name() -> None:
    panoramas = [
        Panorama(f"{place}-{i}", Path("x"), "ldr", f"place {place}", "train") for place in range(60) for i in range(3)
    ]
    kept, held_out = split_places(panoramas, 0.2)
    assert {p.place for p in kept}.isdisjoint({p.place for p in held_out})
    assert 3 < len({p.place for p in held_out}) < 24
    assert [p.name for p in split_places(panoramas[:90], 0.2)[1]] == [p.name for p in held_out if p in panoramas[:90]]


def test_the_learning_rate_rises_and_falls_to_zero() -> None:
    factors = [learning_rate(step, 100, 0.1) for step in range(100)]
    assert factors[9] == 1.0
    assert factors == sorted(factors[:10]) + sorted(factors[10:], reverse=True)
    assert factors[-1] < 1e-3


def test_onnx_and_torch_agree(trained: Path, network: Path) -> None:
    model = Model.load(network)
    metadata = model.session.get_modelmeta().custom_metadata_map
    assert parity(Served([read_network(trained)], read_spec(trained).sun_grid, 1.3).eval(), network) < ROUNDED
    assert float(metadata["parity"]) < ROUNDED
    assert metadata["license"] == "Apache-2.0"
    assert "16 crops" in model.spec.training_data
    (settings,) = json.loads(metadata["training"])
    assert [(run["crops"], run["learning_rate"], run["commit"]) for run in settings] == [(16, 8e-4, metadata["commit"])]
    assert str(trained) not in metadata["training"]
    for count in (1, 3):
        answers = model.predict(np.zeros((count, 3, model.spec.height, model.spec.width), np.float32))
        assert [a.sun_probability.sum() for a in answers] == pytest.approx([1.0] * count, rel=1e-5)


def test_two_runs_answer_together_in_one_file(trained: Path, network: Path, tmp_path: Path) -> None:
    """The same run twice says what it says alone, and nothing is computed or stored twice."""
    target = tmp_path / "two.onnx"
    export([trained, trained], target, temperature=1.3, version="2.0.0")
    one, two = Model.load(network), Model.load(target)
    photo = np.random.default_rng(0).normal(size=(2, 3, 224, 224)).astype(np.float32)
    for a, b in zip(one.predict(photo), two.predict(photo), strict=True):
        np.testing.assert_allclose(a.sun_probability, b.sun_probability, rtol=1e-3)
    assert two.spec.version == "2.0.0"
    assert target.stat().st_size < 1.05 * network.stat().st_size
    files = [onnx.load(path).graph for path in (network, target)]
    assert len(files[1].initializer) == len(files[0].initializer)
    stored = {tensor.data_type for tensor in files[1].initializer}
    assert {onnx.TensorProto.INT8, onnx.TensorProto.FLOAT16} <= stored
    assert not any(node.metadata_props for node in files[1].node)


def test_merged_runs_have_the_mean_of_their_weights(trained: Path, tmp_path: Path) -> None:
    other, merged = tmp_path / "other", tmp_path / "merged"
    shutil.copytree(trained, other)
    state = torch.load(other / "checkpoint.pt", weights_only=True)
    for name, value in state["average"].items():
        if value.is_floating_point():
            state["average"][name] = value + 2.0
    torch.save(state, other / "checkpoint.pt")
    record = read_record(other)
    record["config"]["crops"] = 32
    (other / "config.json").write_text(json.dumps(record))
    merge([trained, other], merged)
    one, mean = averaged_weights(trained), averaged_weights(merged)
    assert one.keys() == mean.keys()
    for name, value in one.items():
        torch.testing.assert_close(mean[name], value + 1.0 if value.is_floating_point() else value)
    assert [run["crops"] for run in history(read_record(merged))] == [16, 32]
    assert [run["crops"] for run in history(read_record(merged), read_record(other))] == [16, 32]
    assert "48 crops" in describe_data(read_record(merged))
    with pytest.raises(LightingError, match="already holds a run"):
        merge([trained, other], merged)


def test_runs_of_different_networks_do_not_answer_together(trained: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    shutil.copytree(trained, other)
    record = json.loads((other / "config.json").read_text())
    record["spec"]["mean"] = [0.1, 0.2, 0.3]
    (other / "config.json").write_text(json.dumps(record))
    with pytest.raises(LightingError, match="do not expect the same photos"):
        export([trained, other], tmp_path / "x.onnx", temperature=1.0)
    assert not (tmp_path / "x.onnx").exists()
    with pytest.raises(LightingError, match="have no mean"):
        merge([trained, other], tmp_path / "merged")
    assert not (tmp_path / "merged").exists()


def test_a_wrong_export_is_refused(
    trained: Path, network: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file on disk is traced at another temperature than the network that it is compared with."""
    model = onnx.load(network)
    model.ClearField("metadata_props")
    monkeypatch.setattr("export.networks.onnx.trace", lambda *_: model)
    with pytest.raises(LightingError, match="differ"):
        export([trained], tmp_path / "x.onnx", temperature=3.0)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_evaluation_reports_every_method_and_group(data: Path, network: Path, tmp_path: Path) -> None:
    everything = dict.fromkeys(("with_metadata", "with_mirror", "failures"), True)
    report = evaluate(data, data / "labels.csv", [network], tmp_path, **everything)
    for part in ("`paper`", "`phone`", "| zenith |", "| random azimuth |", "| constant direction |"):
        assert part in report
    for part in ("## Metadata, protocol `phone`", "| pixels + time+place |", "| 8, headings unknown |", "| half A |"):
        assert part in report
    for part in (
        "in 90 % region",
        "mirror averaged |",
        "## Reliability",
        "## Temperature",
        "## Turbidity, protocol `paper`",
        "## Where it fails",
        "## Sun in the picture: ",
    ):
        assert part in report
    for name in ("reliability.png", "failures.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "failures.csv").read_text().startswith("panorama,azimuth,error,")
    assert (tmp_path / "report.md").read_text() == report
    lines = (tmp_path / "crops-paper.csv").read_text().splitlines()
    assert len(lines) == 1 + 8 * len(read_index(data, "val"))


def test_the_best_constant_beats_other_constants() -> None:
    elevation = np.array([70.0, 75.0, 80.0])
    suns = direction(np.linspace(-180, 180, 72, endpoint=False)[:, None], elevation)
    best = np.median(angle_between(suns, direction(0.0, best_constant(elevation))))
    assert all(
        best <= np.median(angle_between(suns, direction(30.0, other))) + 1e-9 for other in (0.0, 40.0, 75.0, 90.0)
    )


@pytest.mark.parametrize("option", ["--only-seen", "--surroundings"])
def test_the_baseline_has_no_such_heads(data: Path, tmp_path: Path, option: str) -> None:
    arguments = ["train", "--data", str(data), "--out", str(tmp_path / "run"), "--network", "cvpr2017", option]
    result = CliRunner().invoke(cli, arguments)
    assert result.exit_code == 2
    assert "not of cvpr2017" in result.output
    assert not (tmp_path / "run").exists()


def test_commands_say_what_is_missing_in_one_sentence(data: Path, tmp_path: Path) -> None:
    runner = CliRunner()
    for arguments in (
        ["label", "--data", str(tmp_path / "none"), "--out", str(tmp_path / "l.csv")],
        ["train", "--data", str(data), "--labels", str(tmp_path / "none.csv"), "--out", str(tmp_path / "run")],
        ["onnx", str(tmp_path / "none")],
        ["evaluate", "--data", str(data), "--labels", str(data / "labels.csv"), "--model", str(tmp_path / "none.onnx")],
    ):
        result = runner.invoke(cli, arguments)
        assert isinstance(result.exception, DataError | LightingError), (arguments, result.output)
        assert "\n" not in str(result.exception)

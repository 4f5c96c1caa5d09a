"""The training loop and its settings."""

import json
import shutil
from dataclasses import asdict, fields, replace
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch

from export.crops.crops import load_sources
from export.crops.targets import CELLS
from export.data.panoramas import DataError, read_index
from export.networks import outdoor_transformer
from export.networks.backbone import NetworkOutput
from export.networks.onnx_export import write_onnx
from export.networks.outdoor import (
    camera_bin_targets,
    decode_parameters,
    encode_parameters,
    mean_of_camera_bins,
    network_specs,
)
from export.networks.weights import (
    CHECKPOINT,
    RUN_RECORD,
    averaged_weights,
    read_network,
    read_record,
    training_history,
)
from export.training.dataset import MAY_CHANGE, Batch, TrainConfig, TrainingCrops
from export.training.loop import _earlier_commits, _learning_rate, _Run, train_network
from export.training.losses import TeacherEnsemble, add_mirror_images, blend_pictures, blended_shares, training_losses
from export.training.onnx_import import unpack_network
from lighting.errors import LightingError


def test_a_run_leaves_what_reproduces_it(trained: Path, config: TrainConfig) -> None:
    record = json.loads((trained / "config.json").read_text())
    assert record["config"]["crops"] == config.crops
    assert set(record["panoramas"]["train"]).isdisjoint(record["panoramas"]["tune"])
    assert not {p.name for p in read_index(config.data, "val")} & set(record["panoramas"]["train"])
    last = json.loads((trained / "log.jsonl").read_text().splitlines()[-1])
    assert last["step"] == 4
    assert np.isfinite(last["sun"])


def test_a_run_is_resumed_with_its_own_settings_alone(
    config: TrainConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    short = replace(config, out=str(tmp_path), crops=8, batch=4)
    train_network(short)
    record = json.loads((tmp_path / RUN_RECORD).read_text())
    with pytest.raises(DataError, match=r"holds a run with another crops and licensed_only; choose another --out"):
        train_network(replace(short, crops=4, licensed_only=True))
    train_network(replace(short, workers=0, checkpoint_minutes=9.0))
    again = json.loads((tmp_path / RUN_RECORD).read_text())
    assert again["commit"] == record["commit"]
    assert again["config"] == {**record["config"], "workers": 0, "checkpoint_minutes": 9.0}
    monkeypatch.setitem(train_network.__globals__, "commit", lambda: "one that trained nothing")
    moved = shutil.copytree(tmp_path, tmp_path / "moved")
    train_network(replace(short, out=str(moved)))
    assert json.loads((moved / RUN_RECORD).read_text())["commit"] == record["commit"]


def test_networks_that_are_no_runs_are_to_be_started_from(
    config: TrainConfig, trained_network: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = tmp_path / "read"
    monkeypatch.setattr("export.training.onnx_import._CROPS", 0)
    unpack_network(trained_network, 0, replace(config, out=str(read)))
    before = (read / RUN_RECORD).read_bytes()
    with pytest.raises(DataError, match="was read back from a file; give it as --start and choose another --out"):
        train_network(replace(config, out=str(read)))
    assert (read / RUN_RECORD).read_bytes() == before


def test_a_damaged_checkpoint_is_one_sentence(config: TrainConfig, trained: Path, tmp_path: Path) -> None:
    for share in (0.0, 0.01, 0.6):
        run = tmp_path / f"run {share}"
        shutil.copytree(trained, run)
        whole = (trained / CHECKPOINT).read_bytes()
        (run / CHECKPOINT).write_bytes(whole[: int(share * len(whole))])
        again = replace(config, out=str(run))
        with pytest.raises(DataError, match=r"checkpoint\.pt is cut short or damaged\.$"):
            train_network(again)


def test_what_belongs_to_another_network_or_time_is_one_sentence(
    config: TrainConfig, trained: Path, tmp_path: Path
) -> None:
    mixed = shutil.copytree(trained, tmp_path / "mixed")
    state = torch.load(mixed / CHECKPOINT, weights_only=True)
    others = {part: {f"{name}.more": value for name, value in state[part].items()} for part in ("network", "average")}
    torch.save(state | others, mixed / CHECKPOINT)
    with pytest.raises(DataError, match="are of another network than this one"):
        train_network(replace(config, out=str(tmp_path / "later"), start=str(mixed)))
    assert not (tmp_path / "later").exists()
    with pytest.raises(DataError, match=r"checkpoint\.pt is of another network than the run's\.$"):
        train_network(replace(config, out=str(mixed)))
    record = json.loads((mixed / RUN_RECORD).read_text())
    (mixed / RUN_RECORD).write_text(json.dumps({**record, "config": {**record["config"], "older": 1}}))
    with pytest.raises(DataError, match="holds a run with a setting that is unknown here, older; choose another --out"):
        train_network(replace(config, out=str(mixed)))


def test_a_path_may_be_written_another_way_when_a_run_is_resumed(
    config: TrainConfig, trained: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    short = replace(config, out=str(trained))
    folder = Path(config.data)
    monkeypatch.chdir(folder.parent)
    relative = replace(short, data=folder.name, labels=f"{folder.name}/../{folder.name}/labels.csv")
    assert _earlier_commits(relative) == _earlier_commits(short)
    assert relative.data == folder.name  # as it was written, for a folder that moves with its data
    monkeypatch.chdir(tmp_path)
    with pytest.raises(DataError, match="another data and labels"):
        _earlier_commits(replace(short, data=folder.name, labels=f"{folder.name}/labels.csv"))
    with pytest.raises(DataError, match="another teachers and start"):
        _earlier_commits(replace(short, start=".", teachers=(".",)))


def test_a_batch_can_be_learnt_by_heart(config: TrainConfig) -> None:
    run = _Run(replace(config, learning_rate=2e-3, warmup=0.0, crops=1000))
    sources = load_sources(read_index(config.data, "train"), config.labels)
    batch = next(run.batches(TrainingCrops(sources, run.spec, run.config)))
    run.network.train()
    history = [run.update(batch) for _ in range(18)]
    for name in ("sun", "parameters"):
        assert float(history[-1][name]) < 0.8 * float(history[0][name])


def test_a_killed_run_goes_on_where_it_stopped(config: TrainConfig, tmp_path: Path) -> None:
    first = _Run(replace(config, out=str(tmp_path)))
    sources = load_sources(read_index(config.data, "train"), config.labels)
    crops = TrainingCrops(sources, first.spec, replace(config, crops=12))
    first.network.train()
    for batch in first.batches(crops):
        first.update(batch)
        if first.step == 2:
            first.save()
    second = _Run(first.config)
    second.resume()
    assert second.step == 2
    second.network.train()
    for batch in second.batches(crops, first=8):
        second.update(batch)
    assert second.step == first.step == 3
    torch.testing.assert_close(second.network.state_dict(), first.network.state_dict(), rtol=0, atol=1e-6)
    torch.testing.assert_close(second.average.state_dict(), first.average.state_dict(), rtol=0, atol=1e-6)


def test_a_run_starts_from_the_averaged_weights_of_another_and_sees_other_crops(
    config: TrainConfig, tmp_path: Path
) -> None:
    first = _Run(replace(config, out=str(tmp_path)))
    sources = load_sources(read_index(config.data, "train"), config.labels)
    first.update(next(first.batches(TrainingCrops(sources, first.spec, config))))
    first.save()
    later = replace(config, out=str(tmp_path / "later"), start=str(tmp_path))
    second = _Run(later)
    torch.testing.assert_close(second.network.state_dict(), first.average.module.state_dict())
    photos = [TrainingCrops(sources, first.spec, c)[0].photo for c in (config, later)]
    assert not torch.equal(*photos)


def test_the_learning_rate_rises_and_falls_to_zero() -> None:
    factors = [_learning_rate(step, 100, 0.1) for step in range(100)]
    assert factors[9] == 1.0
    assert factors == sorted(factors[:10]) + sorted(factors[10:], reverse=True)
    assert factors[-1] < 1e-3


def test_what_a_killed_save_left_is_deleted(config: TrainConfig, tmp_path: Path) -> None:
    left, other = tmp_path / ".0123456789abcdef.pt", tmp_path / "other.pt"
    left.write_bytes(b"half")
    other.write_bytes(b"whole")
    _Run(replace(config, out=str(tmp_path))).resume()
    assert [*tmp_path.iterdir()] == [other]


def test_the_camera_can_be_learnt_alone(config: TrainConfig, trained: Path, tmp_path: Path) -> None:
    train_network(replace(config, out=str(tmp_path), start=str(trained), only_camera=True, crops=8))
    before, after = averaged_weights(trained), averaged_weights(tmp_path)
    changed = {name.split(".")[0] for name, value in before.items() if not torch.equal(value, after[name])}
    assert {"backbone", "values", "camera"} <= changed
    assert "sun" not in changed


def test_a_transformer_learns_the_later_blocks_and_goes_on(
    config: TrainConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in {"DEPTH": 2, "_READ": (1, 2), "_FROZEN": 1}.items():
        monkeypatch.setattr(outdoor_transformer, name, value)
    settings = replace(config, network="transformer", pretrained=False, crops=8, out=str(tmp_path / "run"))
    before = {name: value.clone() for name, value in _Run(settings).network.state_dict().items()}
    train_network(settings)
    network = read_network(tmp_path / "run")
    changed = {name for name, value in network.state_dict().items() if not torch.equal(value, before[name])}
    assert {"sun.1.weight", "reduce.weight", "trunk.blocks.1.fc1.weight"} <= changed
    assert not any(name.startswith(("trunk.blocks.0.", "trunk.patch.")) for name in changed)
    assert json.loads((tmp_path / "run" / "config.json").read_text())["config"]["network"] == "transformer"


@pytest.mark.usefixtures("small_backbone")
def test_two_places_may_share_a_crop_and_the_light_around_is_learnt(config: TrainConfig, tmp_path: Path) -> None:
    both = replace(config, out=str(tmp_path / "run"), crops=8, joined=1.0, surroundings=True)
    sources = load_sources(read_index(config.data, "train"), config.labels)
    run = _Run(both)
    alone, joined = (TrainingCrops(sources, run.spec, c) for c in (config, both))
    assert {len(joined._draw_sources(index)) for index in range(8)} == {2}
    assert all(joined._draw_sources(index)[0] == alone._draw_sources(index)[0] for index in range(8))
    assert [tuple(part.shape) for part in (alone[0].surroundings, joined[0].surroundings)] == [(0,), (3 * CELLS,)]
    assert not torch.equal(alone[0].photo, joined[0].photo)
    train_network(both)
    assert json.loads((Path(both.out) / "log.jsonl").read_text())["around"] > 0
    write_onnx([Path(both.out)], tmp_path / "x.onnx")
    assert {"light", "around"} < {output.name for output in onnx.load(tmp_path / "x.onnx").graph.output}
    train_network(replace(both, out=str(tmp_path / "next"), start=both.out, joined=0.0, surroundings=False))


def test_a_run_that_would_train_nothing_is_refused_and_leaves_no_folder(config: TrainConfig, tmp_path: Path) -> None:
    requested = replace(config, out=str(tmp_path / "run"), crops=8)
    with pytest.raises(DataError, match=r"8 crops do not fill one step of 32, so nothing would be trained\.$"):
        train_network(replace(requested, batch=32))
    with pytest.raises(DataError, match="no photo to learn from"):
        train_network(replace(requested, photos_share=0.5))
    with pytest.raises(DataError, match="cannot be read"):
        train_network(replace(requested, labels=str(tmp_path / "none.csv")))
    assert not (tmp_path / "run").exists()


def test_a_run_s_crops_depend_on_the_name_of_its_start_and_not_on_where_that_lies(config: TrainConfig) -> None:
    sources = load_sources(read_index(config.data, "train"), config.labels)
    spec = network_specs("1.0.0")["outdoor"]
    photos = [
        TrainingCrops(sources, spec, replace(config, start=start))[0].photo
        for start in ("/home/me/runs/first", "runs/first/", "runs/second")
    ]
    assert torch.equal(photos[0], photos[1])
    assert not torch.equal(photos[0], photos[2])


def test_settings_are_plain_values_that_json_keeps() -> None:
    config = TrainConfig("data", "labels.csv", "out")
    assert TrainConfig(**json.loads(json.dumps(asdict(config)))) == config
    assert config.target_width == 4.0


def test_what_may_change_decides_no_crop_and_no_weight() -> None:
    assert set(MAY_CHANGE) <= {field.name for field in fields(TrainConfig)}
    assert not set(MAY_CHANGE) & {"data", "crops", "batch", "learning_rate", "start"}


def test_unknown_targets_cost_nothing() -> None:
    nan = float("nan")
    parameters = torch.tensor([[nan, nan, 5.0, 1.0, 50.0, nan], [3.0, 2.0, 5.0, 1.0, 50.0, 1.0]])
    sun = torch.tensor([[0.0, 0.0], [0.5, 0.5]])
    raw = torch.cat([encode_parameters(torch.nan_to_num(parameters[:, :5], nan=1.0)), torch.zeros(2, 1)], dim=1)
    raw[0, :2] = 100.0
    raw.requires_grad_()
    logits = torch.tensor([[50.0, -50.0], [1.0, 1.0]])
    nothing = logits[:, :0]
    batch = Batch(torch.zeros(2, 3, 1, 1), sun, parameters, sun, nothing, nothing, torch.tensor([False, False]))
    predicted = NetworkOutput(logits, raw, logits, nothing, nothing, nothing, nothing)
    parts = training_losses(predicted, batch)
    costs = {name: part.item() for name, part in parts.items()}
    expected = {"sun": np.log(2), "parameters": 0.0, "visibility": np.log(2), "seen": np.log(2)}
    assert costs == pytest.approx(expected, abs=1e-6)
    assert "seen" not in training_losses(predicted._replace(sun_in_view=nothing), batch)
    torch.autograd.backward(sum(parts.values(), torch.zeros(())))
    assert raw.grad is not None
    assert torch.isfinite(raw.grad).all()
    assert (raw.grad[0, [0, 1, 5]] == 0).all()


def test_a_likelihood_is_met_by_any_sharp_answer_inside_it() -> None:
    """Two of four cells agree with what is known: a sure answer of one of them costs as little as an even one."""
    known = torch.tensor([[0.5, 0.5, 0.0, 0.0]])
    costs = {}
    for name, logits in {"sure": [30.0, 0, 0, 0], "even": [30.0, 30.0, 0, 0], "wrong": [0, 0, 30.0, 0]}.items():
        predicted = NetworkOutput(torch.tensor([logits]), torch.zeros(1, 6), *[torch.zeros(1, 0)] * 5)
        nan = torch.full((1, 6), float("nan"))
        batch = Batch(
            torch.zeros(1, 3, 1, 1), known, nan, known[:, :0], known[:, :0], known[:, :0], torch.tensor([True])
        )
        costs[name] = training_losses(predicted, batch)["sun"].item()
    assert costs["sure"] == pytest.approx(costs["even"], abs=1e-4)
    assert costs["wrong"] > costs["sure"] + 10


def test_light_and_camera_cost_nothing_where_they_are_right_or_unknown() -> None:
    raw = torch.zeros(1, 6)
    parameters = decode_parameters(raw)
    empty = torch.zeros(1, 0)
    light = torch.tensor([[0.1, 0.2, 0.3, -1.0, -1.1, -1.2, float("nan")]])
    around = torch.zeros(1, 6)
    bins = camera_bin_targets(raw[:, 2:5]).clamp_min(1e-9).log()
    predicted = NetworkOutput(empty, raw, empty, around, bins, light.nan_to_num(), empty)
    batch = Batch(torch.zeros(1, 3, 1, 1), empty, parameters, empty, around, light, torch.tensor([False]))
    parts = training_losses(predicted, batch)
    assert parts["light"].item() == pytest.approx(0.0, abs=1e-6)
    assert parts["around"].item() == pytest.approx(0.0, abs=1e-6)
    off = training_losses(predicted._replace(camera=bins.flip(2).roll(9, 2)), batch)
    assert off["camera"].item() > parts["camera"].item() + 0.5


@pytest.mark.parametrize("around", [float("nan"), 3.0])
def test_the_light_around_the_camera_changes_no_other_cost(around: float) -> None:
    raw = torch.tensor([[0.1, -0.2, 0.3, -0.4, 0.5, 0.0]])
    empty = torch.zeros(1, 0)
    light = torch.full((1, 7), 0.1)
    bins = torch.linspace(-1, 1, camera_bin_targets(raw[:, 2:5]).numel()).reshape(1, 3, -1)
    predicted = NetworkOutput(empty, raw, empty, torch.zeros(1, 6), bins, light, empty)
    target = torch.full((1, 6), around)
    batch = Batch(torch.zeros(1, 3, 1, 1), empty, decode_parameters(raw), empty, target, light, torch.tensor([False]))
    parts = training_losses(predicted, batch)
    without = training_losses(predicted._replace(surroundings=empty), batch)
    assert set(parts) == {*without, "around"}
    for name, cost in without.items():
        assert parts[name].item() == pytest.approx(cost.item()), name
        assert np.isfinite(cost.item())


@pytest.fixture
def batch(config: TrainConfig) -> Batch:
    run = _Run(config)
    sources = load_sources(read_index(config.data, "train"), config.labels)
    return next(run.batches(TrainingCrops(sources, run.spec, replace(config, surroundings=True))))


def test_the_target_is_the_mean_of_the_teachers_answers(trained: Path, batch: Batch) -> None:
    network = read_network(trained)
    spec = _Run(TrainConfig("", "", "")).spec
    alone = TeacherEnsemble([trained], spec, batch.photo.device, surroundings=False).targets(batch.photo)
    with torch.inference_mode():
        predicted = network(batch.photo)
    torch.testing.assert_close(alone.sun, (predicted.sun / 0.9).softmax(dim=1))
    torch.testing.assert_close(alone.parameters[:, 2:5], _camera(predicted))
    assert alone.surroundings.shape == alone.light.shape == (len(batch.photo), 0)
    twice = TeacherEnsemble([trained, trained], spec, batch.photo.device, surroundings=False).targets(batch.photo)
    torch.testing.assert_close(twice.sun, alone.sun)


def _camera(predicted: NetworkOutput) -> torch.Tensor:
    return decode_parameters(
        torch.cat([predicted.raw[:, :2], mean_of_camera_bins(predicted.camera), predicted.raw[:, 5:]], dim=1)
    )[:, 2:5]


def test_of_blended_pictures_nothing_is_known_and_of_the_others_all(batch: Batch) -> None:
    torch.manual_seed(0)
    mixed = blend_pictures(batch, blended_shares(len(batch.photo), 0.5, mirrored=False))
    same = (mixed.photo == batch.photo).flatten(1).all(dim=1)
    assert 0 < int(same.sum()) < len(same)
    for name in ("sun", "parameters", "sun_in_view", "surroundings", "light"):
        torch.testing.assert_close(getattr(mixed, name)[same], getattr(batch, name)[same], equal_nan=True)
    assert (mixed.sun[~same] == 0).all()
    assert (mixed.sun_in_view[~same] == 0).all()
    assert mixed.parameters[~same].isnan().all()
    assert mixed.light[~same].isnan().all()
    torch.testing.assert_close(blend_pictures(batch, torch.zeros(len(batch.photo))).photo, batch.photo)


def test_of_a_mirror_image_the_camera_is_known_and_the_sun_is_not(batch: Batch) -> None:
    count = len(batch.photo)
    both = add_mirror_images(batch)
    for one, doubled in zip(batch, both, strict=True):
        torch.testing.assert_close(doubled[:count], one, equal_nan=True)
    torch.testing.assert_close(both.photo[count:], batch.photo.flip(3))
    signs = torch.tensor([1.0, 1, 1, -1, 1, 1])  # the roll alone turns round
    torch.testing.assert_close(both.parameters[count:], signs * batch.parameters, equal_nan=True)
    assert not both.sun[count:].any()
    assert not both.sun_in_view[count:].any()
    assert both.surroundings[count:].isnan().all()
    assert both.light[count:].isnan().all()
    torch.testing.assert_close(blended_shares(4, 0.4, mirrored=True), torch.tensor([0.4, 0.4, 0.8, 0.8]))


def test_a_network_that_answers_as_its_teacher_has_nothing_to_learn_from_it(trained: Path, batch: Batch) -> None:
    network = read_network(trained)
    taught = TeacherEnsemble([trained], _Run(TrainConfig("", "", "")).spec, batch.photo.device, surroundings=False)
    answers = taught.targets(batch.photo)
    predicted = network(batch.photo)
    cooled = predicted._replace(sun=predicted.sun / 0.9)
    loss = training_losses(cooled, answers)["sun"]
    entropy = -(answers.sun * answers.sun.log()).sum(dim=1).mean()
    assert loss.item() == pytest.approx(entropy.item(), rel=1e-3)
    (slope,) = torch.autograd.grad(loss, predicted.sun)
    assert slope.abs().max() < 1e-6


def test_a_run_is_taught_and_says_by_whom(config: TrainConfig, trained: Path, tmp_path: Path) -> None:
    taught_config = replace(
        config, out=str(tmp_path), teachers=(str(trained),), crops=8, batch=4, tune_share=0.0, mirrored=True
    )
    train_network(taught_config)
    logged = json.loads((tmp_path / "log.jsonl").read_text())
    assert logged["taught sun"] > 0
    assert [run["crops"] for run in training_history(read_record(tmp_path))] == [16, 8]
    train_network(replace(taught_config, workers=0))  # a finished run is taken up again with the same teachers
    with pytest.raises(DataError, match="another teachers"):
        train_network(replace(taught_config, teachers=()))


def test_who_has_not_learnt_it_cannot_teach_it(config: TrainConfig, trained: Path, tmp_path: Path) -> None:
    taught_config = replace(config, out=str(tmp_path), teachers=(str(trained),))
    with pytest.raises(LightingError, match="cannot teach --surroundings"):
        train_network(replace(taught_config, surroundings=True))
    for settings in ({"teachers": (str(tmp_path / "none"),)}, {"start": str(tmp_path / "none"), "teachers": ()}):
        with pytest.raises(LightingError, match="not the folder of a training run"):
            train_network(replace(taught_config, **settings))

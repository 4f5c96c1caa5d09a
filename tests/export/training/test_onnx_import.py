"""Networks read back from an ONNX file answer as they did, before and after their statistics are restored."""

from collections.abc import Callable
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from onnx import helper, numpy_helper
from PIL import Image
from torch import nn

from export.data.panoramas import DataError
from export.networks import outdoor_transformer
from export.networks.onnx_export import write_onnx
from export.networks.outdoor import Outdoor, network_specs, reduce_light_heads
from export.networks.weights import CHECKPOINT, read_network, read_record, training_history, write_run
from export.training import onnx_import
from export.training.dataset import TrainConfig
from export.training.onnx_import import unpack_network
from lighting.model import packaged_model

ROUNDED = 0.1  # of the largest value: the file's weights are bytes, and these networks have hardly learnt to tell apart


@pytest.fixture
def unpack(config: TrainConfig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    """A function that reads a network back into a new folder, with statistics of a few crops, or of none."""

    def read_back(file: Path, number: int, crops: int = 0) -> Path:
        monkeypatch.setattr(onnx_import, "_CROPS", crops)
        out = tmp_path / f"network {number} {crops}"
        unpack_network(file, number, replace(config, out=str(out)))
        return out

    return read_back


@pytest.mark.usefixtures("small_backbone")
def test_shared_first_layers_are_found_under_the_other_networks_names(
    trained: Path, tmp_path: Path, unpack: Callable[..., Path]
) -> None:
    """A network beside a camera's network whose first layers are the same."""
    file, run, camera = (tmp_path / name for name in ("outdoor.onnx", "run", "camera"))
    torch.manual_seed(7)
    weights = Outdoor(network_specs("1.0.0")["outdoor"]).state_dict()
    for value in weights.values():
        if value.ndim == 1:  # of new layers all alike, which are stored once
            value.add_(0.05 * torch.randn_like(value))
    kept = (".stem.", ".blocks.0.", ".blocks.1.", ".blocks.2.")
    changed = {name: value if any(part in name for part in kept) else value * 1.125 for name, value in weights.items()}
    write_run(run, read_record(trained), weights)
    write_run(camera, read_record(trained), changed)
    write_onnx([run], file, cameras=[camera])
    network = read_network(unpack(file, 0))
    photo = torch.randn(1, 3, 224, 224)
    with torch.inference_mode():
        expected, answer = read_network(run)(photo), network(photo)
    assert (answer.sun - expected.sun).abs().max() < ROUNDED * expected.sun.abs().max()


@pytest.mark.usefixtures("small_backbone")
def test_heads_of_the_light_that_a_file_has_in_two_layers_are_read_back(
    trained: Path, tmp_path: Path, unpack: Callable[..., Path]
) -> None:
    file, runs = tmp_path / "outdoor.onnx", [tmp_path / "first", tmp_path / "sun"]
    torch.manual_seed(8)
    for run in runs:
        network: nn.Module = Outdoor(network_specs("1.0.0")["outdoor"], has_surroundings=True)
        for value in network.state_dict().values():
            if value.ndim == 1:  # of new layers all alike, which are stored once
                value.add_(0.05 * torch.randn_like(value))
        write_run(run, read_record(trained), network.state_dict())
    write_onnx(runs[:1], file, suns=runs[1:])
    written = {tensor.name for tensor in onnx.load(str(file), load_external_data=False).graph.initializer}
    assert any(name.startswith("suns.0.around.1.1.weight") for name in written)
    photo = torch.randn(2, 3, 224, 224)
    expected = read_network(runs[1]).eval()
    reduce_light_heads(expected)
    network = read_network(unpack(file, 1))
    with torch.inference_mode():
        wanted, answer = expected(photo), network(photo)
    assert (answer.light - wanted.light).abs().max() < ROUNDED * wanted.light.abs().max()
    assert (answer.surroundings - wanted.surroundings).abs().max() < ROUNDED * wanted.surroundings.abs().max()


def test_of_the_package_the_convolutional_networks_are_read_back(unpack: Callable[..., Path]) -> None:
    """The first is a transformer, the second says the sun and the light, the third the camera alone."""
    photo = torch.randn(1, 3, 224, 224)
    runs = [unpack(packaged_model(), number) for number in (1, 2)]
    sun, camera = map(read_network, runs)
    with torch.inference_mode():
        assert sun(photo).sun.std() > 0.3
        assert camera(photo).camera.std() > 1
    assert sun.around is not None
    assert camera.around is None
    assert all("panoramas" in read_record(run)["training_data"] for run in runs)
    with pytest.raises(DataError, match="no network number 3"):
        unpack(packaged_model(), 3)


def test_a_transformer_read_back_answers_as_the_file(
    monkeypatch: pytest.MonkeyPatch, unpack: Callable[..., Path], tmp_path: Path
) -> None:
    """And its weights are those that learned, without the constants that the file has multiplied out."""
    for name, value in {"DEPTH": 2, "_READ": (1, 2), "_FROZEN": 1}.items():
        monkeypatch.setattr(outdoor_transformer, name, value)
    torch.manual_seed(3)
    run, file, spec = tmp_path / "run", tmp_path / "outdoor.onnx", network_specs("1.0.0")["transformer"]
    first = outdoor_transformer.OutdoorTransformer(spec, has_surroundings=True).eval()
    with torch.no_grad():
        for name, value in first.named_parameters():
            if "scale" in name:
                value.uniform_(0.2, 0.6)
            elif name.startswith("trunk.") or value.ndim == 1:
                value.add_(0.02 * torch.randn_like(value))  # else equal ones are stored once
    record = {"spec": asdict(spec), "config": asdict(TrainConfig("", "", "", network="transformer"))}
    write_run(run, {**record, "commit": "", "torch": "", "panoramas": {"train": []}}, first.state_dict())
    write_onnx([run], file)
    wheel = first.trunk.state_dict()
    monkeypatch.setattr(outdoor_transformer, "load_wheel", lambda trunk: trunk.load_state_dict(wheel))
    network = read_network(unpack(file, 0))
    photo = torch.randn(2, 3, 224, 224)
    with torch.inference_mode():
        expected, answer = first(photo), network(photo)
    assert (answer.light - expected.light).abs().max() < ROUNDED * expected.light.abs().max()
    assert (answer.surroundings - expected.surroundings).abs().max() < ROUNDED * expected.surroundings.abs().max()
    weights = network.state_dict()
    for name, weight in wheel.items():
        assert (weights[f"trunk.{name}"] - weight).abs().max() < 0.02 * weight.abs().max(), name


def test_a_network_read_back_answers_as_before(
    trained: Path, trained_network: Path, unpack: Callable[..., Path]
) -> None:
    run, again = unpack(trained_network, 0), unpack(trained_network, 0, 4)
    plain, network = read_network(run), read_network(again)
    photo = torch.randn(4, 3, 224, 224)
    with torch.inference_mode():
        expected, answer, with_statistics = (each(photo) for each in (read_network(trained), plain, network))
        assert (answer.sun - expected.sun).abs().max() < ROUNDED * expected.sun.abs().max()
        assert (answer.raw - expected.raw).abs().max() < ROUNDED * expected.raw.abs().max()
    torch.testing.assert_close(with_statistics.sun, answer.sun, rtol=1e-3, atol=1e-4)
    for module in network.modules():
        if isinstance(module, nn.BatchNorm2d) and module.weight.requires_grad:
            assert module.running_mean is not None
            assert module.running_mean.abs().max() > 0
    assert training_history(read_record(run)) == training_history(read_record(trained))
    assert isinstance(network, Outdoor)
    with pytest.raises(DataError, match="already holds a run"):
        unpack(trained_network, 0)
    with pytest.raises(DataError, match="no network number 1"):
        unpack(trained_network, 1)


def test_what_is_no_network_of_ours_is_refused_in_one_sentence(tmp_path: Path) -> None:
    picture = tmp_path / "photo.onnx"
    Image.new("RGB", (40, 30)).save(picture, "JPEG")
    model = helper.make_model(helper.make_graph([], "none", [], []))
    other, baseline, bare = (tmp_path / f"{name}.onnx" for name in ("other", "baseline", "bare"))
    onnx.save(model, str(other))
    entry = model.metadata_props.add()
    entry.key, entry.value = "spec", replace(network_specs("1.0.0")["outdoor"], name="cvpr2017").to_json()
    onnx.save(model, str(baseline))
    entry.value = network_specs("1.0.0")["outdoor"].to_json()
    model.graph.initializer.append(numpy_helper.from_array(np.zeros(2, np.float32), "networks.0.x.weight"))
    onnx.save(model, str(bare))
    for file, words in (
        (picture, "is not an ONNX file, or damaged"),
        (other, "is not a lighting network: its metadata has no 'spec'"),
        (baseline, "holds the network cvpr2017; only the network outdoor can be read back"),
        (bare, r"does not hold all weights of network number 0: backbone\.\S+ is missing"),
    ):
        with pytest.raises(DataError, match=words):
            unpack_network(file, 0, TrainConfig("data", "labels.csv", str(tmp_path / "run")))


def test_a_folder_that_cannot_take_a_run_is_refused_before_the_file_is_read(tmp_path: Path) -> None:
    (tmp_path / CHECKPOINT).touch()
    for out, words in ((tmp_path, "already holds a run"), (tmp_path / CHECKPOINT, "is a file; a run takes a folder")):
        with pytest.raises(DataError, match=words):
            unpack_network(tmp_path / "none.onnx", 0, TrainConfig("data", "labels.csv", str(out)))

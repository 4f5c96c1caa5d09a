"""The outside peer: its network's shape, its steps before and after, and what is said where it is missing."""

from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

from export.crops.crops import PHONE_ASPECTS, Camera, load_source
from export.data.labels import label_panorama, write_labels
from export.data.panoramas import read_index
from export.data.synthetic import write_dataset
from export.evaluation import suncompass
from export.evaluation.evaluate import evaluate
from export.evaluation.suncompass import (
    ResNet18,
    SunCompass,
    azimuth,
    canvas,
    crop_pictures,
    load,
    parts,
    photo_picture,
    suns,
    window,
)
from lighting.errors import ModelError
from lighting.geometry import angles
from lighting.photo.read import Photo


def install(site: Path, version: str = "0.0.1", weights: dict[str, torch.Tensor] | None = None) -> None:
    """Put into `site` what pip would: the package's record, and its weights beside it."""
    record = site / f"suncompass-{version}.dist-info"
    record.mkdir(parents=True)
    (record / "METADATA").write_text(f"Metadata-Version: 2.1\nName: suncompass\nVersion: {version}\n", encoding="utf-8")
    (site / "suncompass").mkdir()
    (site / "suncompass" / "__init__.py").write_text("import torchvision\n", encoding="utf-8")
    if weights is not None:
        torch.save(weights, site / suncompass.WEIGHTS)


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
    said = parts(peer, [picture])
    handle.remove()
    weight, bias = (p.detach().numpy() for p in peer.fc_end.parameters())
    logits = np.maximum(scores[0].numpy(), 0) @ weight.T + bias
    np.testing.assert_allclose(said, np.tanh(logits / 2), atol=1e-5)


def test_forward_and_left_become_an_azimuth_to_the_right() -> None:
    forward_and_left = np.array([[1.0, 0.0], [0.0, -0.5], [0.0, 0.5], [-1.0, -1e-9], [0.2, -0.2]])
    np.testing.assert_allclose(azimuth(forward_and_left), [0.0, 90.0, -90.0, 180.0, 45.0], atol=1e-6)


def test_suns_stand_at_the_elevation_given(peer: SunCompass) -> None:
    pictures = [np.full((300, 400, 3), value, np.uint8) for value in (20, 200)]
    found, elevation = angles(suns(peer, pictures, 35.0))
    np.testing.assert_allclose(elevation, 35.0)
    np.testing.assert_allclose(found, azimuth(parts(peer, pictures)))


def test_batches_change_nothing(peer: SunCompass) -> None:
    pictures = [np.full((300, 300, 3), value, np.uint8) for value in (0, 90, 255)]
    np.testing.assert_allclose(parts(peer, pictures, batch=2), parts(peer, pictures), atol=1e-6)


def test_the_window_is_the_middle_of_the_picture() -> None:
    picture = np.zeros((320, 500, 3), np.uint8)
    picture[10:310, 100:400] = (255, 0, 51)
    seen = window(picture)
    assert seen.shape == (3, 224, 224)
    np.testing.assert_allclose(seen.min(axis=(1, 2)), [1.0, 0.0, 0.2], atol=1e-6)
    np.testing.assert_allclose(seen.max(axis=(1, 2)), [1.0, 0.0, 0.2], atol=1e-6)


def test_the_network_sees_the_middle_in_imagenets_colours() -> None:
    mean = torch.tensor(suncompass.IMAGENET_MEAN)[None, :, None, None]
    frame = mean.repeat(1, 1, 224, 224)
    frame[..., :13, :] = 1.0  # 13 of 224 rows are 14.9 of 256, and 16 are cut off
    seen = suncompass._as_imagenet(frame)
    assert seen.shape == (1, 3, 224, 224)
    np.testing.assert_allclose(seen.numpy(), 0.0, atol=1e-5)


@pytest.mark.parametrize("aspect", PHONE_ASPECTS)
def test_crops_and_photos_have_300_pixels_along_their_shorter_side(tmp_path: Path, aspect: float) -> None:
    spec = canvas(aspect)
    assert min(spec.width, spec.height) == 300
    assert spec.width / spec.height == pytest.approx(aspect, rel=0.005)
    write_dataset(tmp_path, 1, 32)
    (panorama,) = read_index(tmp_path)
    source = load_source(panorama, label_panorama(panorama))
    (crop,) = crop_pictures([(source, Camera(0.0, 0.0, 0.0, 50.0, aspect))])
    photo = Photo(np.zeros((1440, round(1440 * aspect), 3), np.uint8), round(1440 * aspect), 1440, "PNG")
    assert crop.shape == photo_picture(photo).shape == (spec.height, spec.width, 3)
    assert crop.dtype == np.uint8


def test_weights_are_found_without_importing_the_package(
    tmp_path: Path, peer: SunCompass, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(tmp_path, weights=peer.state_dict())
    monkeypatch.syspath_prepend(str(tmp_path))
    loaded = load()
    assert not loaded.training
    assert all(torch.equal(a, b) for a, b in zip(loaded.state_dict().values(), peer.state_dict().values(), strict=True))


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


@pytest.mark.slow
def test_the_peer_is_in_every_table_and_its_note_in_the_report(
    network: Path, tmp_path: Path, peer: SunCompass, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_dataset(tmp_path, 8, height=64)
    write_labels([label_panorama(p) for p in read_index(tmp_path)], tmp_path / "labels.csv")
    Image.new("RGB", (640, 480), (90, 120, 200)).save(tmp_path / "photo.png")
    (tmp_path / "photos.csv").write_text("file,group,sun_azimuth,sun_elevation\nphoto.png,a,20,30\n", encoding="utf-8")
    monkeypatch.setattr(suncompass, "load", lambda: peer)
    report = evaluate(tmp_path, tmp_path / "labels.csv", [network], tmp_path / "out", with_suncompass=True)
    rows = [line.split(" | ") for line in report.splitlines() if line.startswith(f"| {suncompass.NAME} |")]
    assert [len(row) for row in rows] == [14, 6, 14, 6, 4]  # sun and intervals of both protocols, then real photos
    assert all(row[11:] == ["-", "-", "- |"] for row in rows if len(row) == 14)
    assert "-" not in rows[-1]
    assert suncompass.NOTE in report

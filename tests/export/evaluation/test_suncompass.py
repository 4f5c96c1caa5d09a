"""The outside peer: the pictures it gets, the suns it gives, its rows in the report."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from export.crops.cameras import PHONE_ASPECTS, Camera
from export.crops.sources import load_source
from export.data.labelling import label_panorama
from export.data.labels import write_labels
from export.data.panoramas import read_index
from export.data.synthetic import write_dataset
from export.evaluation import Options, suncompass
from export.evaluation.evaluate import evaluate
from export.evaluation.suncompass import Peer, azimuth, canvas, crop_pictures, photo_picture, suns, window
from lighting.geometry import angles
from lighting.photo import Photo


@pytest.fixture
def peer() -> Peer:
    """Answers made of each window's colours: forward is its red, left its blue less a half."""
    return lambda windows: np.array([[w[0].mean(), w[2].mean() - 0.5] for w in windows])


def test_forward_and_left_become_an_azimuth_to_the_right() -> None:
    forward_and_left = np.array([[1.0, 0.0], [0.0, -0.5], [0.0, 0.5], [-1.0, -1e-9], [0.2, -0.2]])
    np.testing.assert_allclose(azimuth(forward_and_left), [0.0, 90.0, -90.0, 180.0, 45.0], atol=1e-6)


def test_suns_stand_at_the_elevation_given(peer: Peer) -> None:
    pictures = [np.full((300, 400, 3), value, np.uint8) for value in (20, 200)]
    found, elevation = angles(suns(peer, pictures, 35.0))
    np.testing.assert_allclose(elevation, 35.0)
    np.testing.assert_allclose(found, azimuth(peer(map(window, pictures))))


def test_the_window_is_the_middle_of_the_picture() -> None:
    picture = np.zeros((320, 500, 3), np.uint8)
    picture[10:310, 100:400] = (255, 0, 51)
    seen = window(picture)
    assert seen.shape == (3, 224, 224)
    np.testing.assert_allclose(seen.min(axis=(1, 2)), [1.0, 0.0, 0.2], atol=1e-6)
    np.testing.assert_allclose(seen.max(axis=(1, 2)), [1.0, 0.0, 0.2], atol=1e-6)


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


@pytest.mark.slow
def test_the_peer_is_in_every_table_and_its_note_in_the_report(
    network: Path, tmp_path: Path, peer: Peer, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_dataset(tmp_path, 8, height=64)
    write_labels([label_panorama(p) for p in read_index(tmp_path)], tmp_path / "labels.csv")
    Image.new("RGB", (640, 480), (90, 120, 200)).save(tmp_path / "photo.png")
    (tmp_path / "photos.csv").write_text("file,group,sun_azimuth,sun_elevation\nphoto.png,a,20,30\n", encoding="utf-8")
    monkeypatch.setattr(suncompass, "load", lambda: peer)
    options = Options(tmp_path, tmp_path / "labels.csv", (network,), tmp_path / "out", suncompass=True)
    report = evaluate(options).report
    rows = [line.split(" | ") for line in report.splitlines() if line.startswith(f"| {suncompass.NAME} |")]
    # of both protocols sun, intervals and figures by place, then real photos
    assert [len(row) for row in rows] == [14, 6, 10, 14, 6, 10, 5]
    assert all(row[11:] == ["-", "-", "- |"] for row in rows if len(row) == 14)
    assert "-" not in rows[-1]
    assert suncompass.NOTE in report

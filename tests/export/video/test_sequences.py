"""Clips of panoramas: what a camera sees, how it is turned, and what crosses the picture."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from export.data import Panorama
from export.video import KINDS
from export.video.sequences import HEIGHT, RATE, SECONDS, WIDTH, Pixels, gained, look, sequences
from lighting.colour import srgb_decode
from lighting.files import encode_png
from lighting.geometry import Pinhole, camera_directions, sample_latlong
from tests.lighting.video.clips import panorama

cv2 = pytest.importorskip("cv2")

COUNT = round(RATE * SECONDS)


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Panorama:
    path = tmp_path_factory.mktemp("clips") / "0.png"
    path.write_bytes(encode_png(panorama()))
    return Panorama("p0", path, "ldr", "place0", "val", "visible", 30.0, 40.0, 2.0)


def test_a_camera_sees_what_its_pinhole_does() -> None:
    picture: Pixels = cv2.GaussianBlur(panorama(), (0, 0), 6.0)
    rays = camera_directions(Pinhole(64, 36, 50.0, 170.0, 12.0, -7.0))  # across the seam
    expected = sample_latlong(picture.astype(np.float32), rays)
    seen = look(picture, (170.0, 12.0, -7.0), 50.0, (64, 36))
    assert seen.shape == (36, 64, 3)
    assert np.abs(seen - expected).mean() < 0.6


def test_a_clip_is_the_same_in_every_run_and_told_from_others(shown: Panorama) -> None:
    first, again = (next(sequences([shown], "pan")) for _ in range(2))
    assert all(np.array_equal(a, b) for a, b in zip(first.path, again.path, strict=True))
    assert first.sun == (30.0, 40.0)
    other = next(sequences([replace(shown, name="p1")], "pan"))
    assert not np.array_equal(first.path[0], other.path[0])
    assert [frame.index for frame in first.frames(90)] == [0, 90]


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "walk"])
def test_each_kind_is_hard_in_what_its_name_says(shown: Panorama, kind: str) -> None:
    clip = next(sequences([shown], kind))
    azimuth, elevation, _ = clip.path
    assert len(clip.time) == len(azimuth) == len(clip.gain) == len(clip.zoom) == COUNT
    assert clip.zoom[0] == 1.0
    assert (clip.zoom[-1] in (0.5, 2.0)) == (kind == "zoom")
    assert bool(np.ptp(clip.gain) > 0.1) == (kind == "exposure")
    assert clip.gain.max() == 1.0
    assert bool(np.ptp(elevation) > 20.0) == (kind == "tilt")
    assert np.ptp(azimuth) > {"tilt": 5.0, "hand": 10.0, "motion blur": 170.0}.get(kind, 18.0)


def test_things_and_crowds_hide_a_part_of_a_pan(shown: Panorama) -> None:
    for kind, least, most in (("moving things", 0.01, 0.3), ("crowd", 0.05, 0.6)):
        clip = next(sequences([shown], kind))
        bare = look(panorama(), (clip.path[0][0], clip.path[1][0], clip.path[2][0]), clip.vertical_fov)
        hidden = (clip.picture(0) != bare).any(axis=-1).mean()
        assert least < hidden < most
        assert not np.array_equal(clip.picture(0), clip.picture(COUNT - 1))
        assert clip.picture(0).shape == (HEIGHT, WIDTH, 3)


def test_motion_blurs_across_the_way_and_keeps_the_brightness(shown: Panorama, tmp_path: Path) -> None:
    grain = np.random.default_rng(0).integers(0, 256, (512, 1024, 3), dtype=np.uint8)
    (tmp_path / "grain.png").write_bytes(encode_png(grain))
    clip = next(sequences([replace(shown, path=tmp_path / "grain.png")], "motion blur"))
    middle = COUNT // 2  # where the camera turns fastest
    sharp = look(grain, (clip.path[0][middle], clip.path[1][middle], clip.path[2][middle]), clip.vertical_fov)
    blurred = clip.picture(middle)
    across, down = ([np.abs(np.diff(p.astype(int), axis=axis)).mean() for p in (sharp, blurred)] for axis in (1, 0))
    assert across[1] < 0.6 * across[0]
    assert down[1] / down[0] > 1.3 * across[1] / across[0]
    light = [srgb_decode(p / 255.0).mean() for p in (sharp, blurred)]
    assert light[1] == pytest.approx(light[0], rel=0.03)


def test_a_gain_is_of_linear_values() -> None:
    picture = np.arange(256, dtype=np.uint8).repeat(3).reshape(16, 16, 3)
    assert gained(picture, np.ones(3)) is picture
    halved = srgb_decode(gained(picture, np.array([0.5, 1.0, 0.25])) / 255.0)
    known = srgb_decode(picture / 255.0)
    assert np.abs(halved / np.array([0.5, 1.0, 0.25]) - known).max() < 0.02

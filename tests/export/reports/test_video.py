"""Clips of panoramas, measured against their truth."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from export import CLIP_KINDS
from export.data.panoramas import DataError, Panorama, write_index
from export.evaluation.metrics import figures_table
from export.reports.clips import (
    CLIP_HEIGHT,
    CLIP_RATE,
    CLIP_SECONDS,
    CLIP_WIDTH,
    Pixels,
    RenderedClip,
    film_panorama,
    view_panorama,
)
from export.reports.video import MEDIANS, _choose_panoramas, _kind_figures, _measure_clip
from lighting.color import srgb_decode
from lighting.files.deflate import encode_png
from lighting.geometry import Pinhole, camera_directions, sample_latlong
from lighting.model import Model
from lighting.video.observation import observe_shots
from lighting.video.shot import solve_shot
from lighting.video.tracking import ClipMetadata
from tests.helpers.clips import FOV, SIZE, panorama

COUNT = round(CLIP_RATE * CLIP_SECONDS)


@pytest.fixture(scope="module")
def sunny(tmp_path_factory: pytest.TempPathFactory) -> Panorama:
    path = tmp_path_factory.mktemp("clips") / "0.png"
    path.write_bytes(encode_png(panorama()))
    return Panorama("p0", path, "ldr", "place0", "val", "visible", 30.0, 40.0, 2.0)


def test_a_camera_sees_what_its_pinhole_does() -> None:
    picture: Pixels = cv2.GaussianBlur(panorama(), (0, 0), 6.0).astype(np.uint8)
    rays = camera_directions(Pinhole(64, 36, 50.0, 170.0, 12.0, -7.0))  # across the seam
    expected = sample_latlong(picture.astype(np.float32), rays)
    seen = view_panorama(picture, (170.0, 12.0, -7.0), 50.0, (64, 36))
    assert seen.shape == (36, 64, 3)
    assert np.abs(seen - expected).mean() < 0.6


def test_a_clip_is_the_same_in_every_run_and_told_from_others(sunny: Panorama) -> None:
    first, again = (film_panorama(sunny, "pan") for _ in range(2))
    assert all(np.array_equal(a, b) for a, b in zip(first.path, again.path, strict=True))
    assert first.sun == (30.0, 40.0)
    other = film_panorama(replace(sunny, name="p1"), "pan")
    assert not np.array_equal(first.path[0], other.path[0])
    assert [frame.index for frame in first.frames(90)] == [0, 90]


@pytest.mark.parametrize("kind", CLIP_KINDS)
def test_each_kind_is_hard_in_what_its_name_says(sunny: Panorama, kind: str) -> None:
    clip = film_panorama(sunny, kind)
    azimuth, elevation, _ = clip.path
    assert len(clip.time) == len(azimuth) == len(clip.gain) == len(clip.zoom) == COUNT
    assert clip.zoom[0] == 1.0
    assert (clip.zoom[-1] in (0.5, 2.0)) == (kind == "zoom")
    assert bool(np.ptp(clip.gain) > 0.1) == (kind == "exposure")
    assert clip.gain.max() == 1.0
    assert bool(np.ptp(elevation) > 20.0) == (kind == "tilt")
    assert np.ptp(azimuth) > {"tilt": 5.0, "hand": 10.0, "motion blur": 170.0}.get(kind, 18.0)


def test_things_and_crowds_hide_a_part_of_a_pan(sunny: Panorama) -> None:
    for kind, least, most in (("moving things", 0.01, 0.3), ("crowd", 0.05, 0.6)):
        clip = film_panorama(sunny, kind)
        bare = view_panorama(panorama(), (clip.path[0][0], clip.path[1][0], clip.path[2][0]), clip.vertical_fov)
        hidden = (clip.picture(0) != bare).any(axis=-1).mean()
        assert least < hidden < most
        assert not np.array_equal(clip.picture(0), clip.picture(COUNT - 1))
        assert clip.picture(0).shape == (CLIP_HEIGHT, CLIP_WIDTH, 3)


def test_motion_blurs_across_the_way_and_keeps_the_brightness(sunny: Panorama, tmp_path: Path) -> None:
    grain = np.random.default_rng(0).integers(0, 256, (512, 1024, 3), dtype=np.uint8)
    (tmp_path / "grain.png").write_bytes(encode_png(grain))
    clip = film_panorama(replace(sunny, path=tmp_path / "grain.png"), "motion blur")
    middle = COUNT // 2  # where the camera turns fastest
    sharp = view_panorama(grain, (clip.path[0][middle], clip.path[1][middle], clip.path[2][middle]), clip.vertical_fov)
    blurred = clip.picture(middle)
    across, down = ([np.abs(np.diff(p.astype(int), axis=axis)).mean() for p in (sharp, blurred)] for axis in (1, 0))
    assert across[1] < 0.6 * across[0]
    assert down[1] / down[0] > 1.3 * across[1] / across[0]
    light = [srgb_decode(p / 255.0).mean() for p in (sharp, blurred)]
    assert light[1] == pytest.approx(light[0], rel=0.03)


def test_a_gain_is_of_linear_values() -> None:
    picture = np.arange(256, dtype=np.uint8).repeat(3).reshape(16, 16, 3)
    gains, zero = np.array([[1.0, 1.0, 1.0], [0.5, 1.0, 0.25]]), np.zeros(2)
    clip = RenderedClip(np.arange(2.0), (zero, zero, zero), gains, FOV, np.ones(2), (0.0, 30.0), lambda _: picture)
    as_it_is, darker = (frame.pixels for frame in clip.frames())
    assert np.array_equal(as_it_is, picture)
    halved = srgb_decode(darker / 255.0)
    known = srgb_decode(picture / 255.0)
    assert np.abs(halved / np.array([0.5, 1.0, 0.25]) - known).max() < 0.02


PAN_FRAMES = 40


@pytest.fixture(scope="module")
def model(network: Path) -> Model:
    return Model.load(network, threads=1)


def pan() -> RenderedClip:
    """A level camera that turns by 50 degrees and grows darker."""
    time, level = np.arange(PAN_FRAMES) / CLIP_RATE, np.zeros(PAN_FRAMES)
    azimuth = 20.0 + 50.0 * time / time[-1]
    gain = np.linspace(1.0, 0.7, PAN_FRAMES)[:, None] * np.ones(3)

    def shot(i: int) -> Pixels:
        return view_panorama(panorama(), (float(azimuth[i]), 0.0, 0.0), FOV, SIZE)

    return RenderedClip(time, (azimuth, level, level), gain, FOV, np.ones(PAN_FRAMES), (30.0, 40.0), shot)


def test_a_clip_is_measured_against_what_is_true_of_it(model: Model) -> None:
    """The same pictures, once with their own truth and once with another told of them."""
    clip = pan()
    (watched,) = observe_shots(clip.frames(), model)
    sun = solve_shot(watched, ClipMetadata()).posterior.sun
    clip = replace(clip, sun=(clip.path[0][0] + sun.azimuth, sun.elevation))
    right = _measure_clip(clip, model)
    assert right["sun"] < 1e-3
    assert right["heading, 90 %"] < 2.0
    assert right["field of view"] < 1.5
    assert right["trembling"] < 0.3
    assert right["gain"] < 3.0
    assert right["split"] == right["bridged"] == 0.0
    azimuth, level, roll = clip.path
    told = replace(clip, path=(1.2 * azimuth, level + 10.0, roll - 5.0), vertical_fov=FOV + 8.0, sun=(100.0, 40.0))
    wrong = _measure_clip(told, model)
    assert wrong["heading"] == pytest.approx(5.0, abs=1.0)
    assert wrong["elevation"] > 4.0
    assert wrong["roll"] > 3.0
    assert wrong["field of view"] == pytest.approx(8.0, abs=1.5)
    assert wrong["sun"] > 20.0


def test_a_row_has_medians_worst_cases_shares_and_counts() -> None:
    clip = dict.fromkeys((*MEDIANS, "in 50 %", "in 90 %", "bridged", "split", "doubted"), 0.0)
    clips = [clip | {"trembling": t, "sun": t, "in 50 %": 100.0 * (t < 2), "split": t < 3} for t in (1.0, 2.0, 9.0)]
    row = _kind_figures(clips)
    assert row["sun"] == 2.0
    assert row["trembling, worst"] == 9.0
    assert row["in 50 %"] == pytest.approx(100.0 / 3)
    assert row["split"] == 2.0
    assert "| 9.00 |" in figures_table({"pan": row}, digits=2)


def test_panoramas_are_of_different_places_as_long_as_there_are_some(tmp_path: Path) -> None:
    (tmp_path / "0.png").write_bytes(encode_png(panorama()))

    def row(name: str, place: str, split: str = "val", sun: str = "visible") -> Panorama:
        return Panorama(name, tmp_path / "0.png", "ldr", place, split, sun, 30.0, 40.0, 2.0)

    unfit = [row("train", "t", "train"), row("hidden", "h", sun="inferred")]
    write_index([row("a", "x"), row("b", "x"), row("c", "x"), row("d", "y"), *unfit], tmp_path)
    found = _choose_panoramas(tmp_path, 3)
    assert {p.place for p in found[:2]} == {"x", "y"}
    assert [p.name for p in found] == [p.name for p in _choose_panoramas(tmp_path, 9)[:3]]
    assert {p.name for p in _choose_panoramas(tmp_path, 9)} == {"a", "b", "c", "d"}
    write_index(unfit, tmp_path)
    with pytest.raises(DataError, match="shows a given sun"):
        _choose_panoramas(tmp_path, 3)

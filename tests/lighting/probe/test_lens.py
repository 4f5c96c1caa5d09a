"""Projections against their formulas and against themselves there and back."""

import numpy as np
import pytest

from lighting.errors import ProbeError
from lighting.geometry import angle_between, direction
from lighting.probe.lens import ABSENT, KINDS, Kind, lens_directions, lens_of, lens_pixels, pixels_per_degree

ZENITH = np.array([0.0, 1.0, 0.0])


@pytest.mark.parametrize("kind", ["equidistant", "equisolid"])
def test_a_fisheye_shows_the_zenith_in_its_middle_and_the_horizon_at_its_edge(kind: Kind) -> None:
    lens = lens_of(kind, 200, 200)
    assert lens_pixels(lens, ZENITH) == pytest.approx([100, 100])
    # Facing north and leaning back: right is east, and the lower edge is north.
    assert lens_pixels(lens, direction(90.0, 0.0)) == pytest.approx([200, 100])
    assert lens_pixels(lens, direction(0.0, 0.0)) == pytest.approx([100, 200])
    assert np.isnan(lens_pixels(lens, direction(0.0, -1.0))).all()
    assert np.isnan(lens_directions(lens, [1.0, 1.0])).all()


def test_fisheyes_place_45_degrees_by_their_formulas() -> None:
    east = direction(90.0, 45.0)
    assert lens_pixels(lens_of("equidistant", 200, 200), east)[0] == pytest.approx(150)
    expected = 100 + 100 * np.sin(np.radians(22.5)) / np.sin(np.radians(45))
    assert lens_pixels(lens_of("equisolid", 200, 200), east)[0] == pytest.approx(expected)
    assert lens_pixels(lens_of("equidistant", 200, 200, fov=220.0), east)[0] == pytest.approx(100 + 100 * 45 / 110)


def test_a_mirrored_picture_has_east_on_the_left() -> None:
    lens = lens_of("equidistant", 200, 200, mirrored=True)
    assert lens_pixels(lens, direction(90.0, 45.0))[0] == pytest.approx(50)


def test_a_ball_shows_the_camera_in_its_middle_and_what_is_behind_it_at_its_edge() -> None:
    lens = lens_of("ball", 200, 200)
    assert angle_between(lens_directions(lens, [100.0, 100.0]), direction(180.0, 0.0)) == pytest.approx(0, abs=1e-6)
    assert angle_between(lens_directions(lens, [200.0, 100.0]), direction(0.0, 0.0)) == pytest.approx(0, abs=1e-4)
    # A surface tilted by 45 deg reflects what is beside the ball.
    beside = lens_directions(lens, [100 + 100 * np.sin(np.radians(45)), 100.0])
    assert angle_between(beside, direction(90.0, 0.0)) == pytest.approx(0, abs=1e-6)
    above = lens_directions(lens, [100.0, 100 - 100 * np.sin(np.radians(45))])
    assert angle_between(above, ZENITH) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("pitch", [None, 20.0])
def test_directions_come_back_to_their_pixels(kind: Kind, mirrored: bool, pitch: float | None) -> None:
    width = 400 if kind == "latlong" else 210
    lens = lens_of(kind, width, 200, mirrored=mirrored, pitch=pitch)
    rng = np.random.default_rng(1)
    pixels = np.stack([rng.uniform(0, width, 300), rng.uniform(0, 200, 300)], axis=-1)
    towards = lens_directions(lens, pixels)
    seen = np.isfinite(towards).all(axis=-1)
    assert seen.sum() > 200
    assert np.linalg.norm(towards[seen], axis=-1) == pytest.approx(1)
    assert lens_pixels(lens, towards[seen]) == pytest.approx(pixels[seen], abs=1e-4)


def test_pixels_per_degree_are_those_of_the_axis() -> None:
    assert pixels_per_degree(lens_of("equidistant", 360, 360)) == pytest.approx(2)
    assert pixels_per_degree(lens_of("latlong", 720, 360)) == pytest.approx(2)


def test_impossible_lenses_are_refused() -> None:
    for told in ({"fov": 0.0}, {"fov": 400.0}, {"radius": 0.0}, {"centre": (500.0, 10.0)}):
        with pytest.raises(ProbeError):
            lens_of("equidistant", 200, 200, **told)
    with pytest.raises(ProbeError, match="twice as wide"):
        lens_of("latlong", 200, 200)


@pytest.mark.parametrize("kind", KINDS)
def test_what_a_lens_does_not_have_changes_nothing(kind: Kind) -> None:
    told = {"fov": 150.0, "centre": (90.0, 95.0), "radius": 80.0}
    towards = direction(80.0, 35.0)
    usual = lens_pixels(lens_of(kind, 400, 200), towards)
    for name, value in told.items():
        same = np.array_equal(lens_pixels(lens_of(kind, 400, 200, **{name: value}), towards), usual)
        assert same is (name in ABSENT.get(kind, ()))

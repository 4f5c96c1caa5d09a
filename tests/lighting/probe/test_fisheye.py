"""Projections of lenses, balls and panoramas, and maps made of them."""

from typing import get_args

import numpy as np
import pytest
from numpy.typing import NDArray

from lighting.errors import ProbeError
from lighting.geometry import angle_between, direction, latlong_pixel, latlong_solid_angle
from lighting.probe.alignment import yaw_rotation
from lighting.probe.fisheye import (
    UNUSED_LENS_OPTIONS,
    LensKind,
    make_lens,
    pixels_per_degree,
    project_to_lens,
    resample_to_latlong,
    unproject_from_lens,
)

ZENITH = np.array([0.0, 1.0, 0.0])


@pytest.mark.parametrize("kind", ["equidistant", "equisolid"])
def test_a_fisheye_shows_the_zenith_in_its_middle_and_the_horizon_at_its_edge(kind: LensKind) -> None:
    lens = make_lens(kind, 200, 200)
    assert project_to_lens(lens, ZENITH) == pytest.approx([100, 100])
    # Facing north and leaning back: right is east, and the lower edge is north.
    assert project_to_lens(lens, direction(90.0, 0.0)) == pytest.approx([200, 100])
    assert project_to_lens(lens, direction(0.0, 0.0)) == pytest.approx([100, 200])
    assert np.isnan(project_to_lens(lens, direction(0.0, -1.0))).all()
    assert np.isnan(unproject_from_lens(lens, [1.0, 1.0])).all()


def test_fisheyes_place_45_degrees_by_their_formulas() -> None:
    east = direction(90.0, 45.0)
    assert project_to_lens(make_lens("equidistant", 200, 200), east)[0] == pytest.approx(150)
    expected = 100 + 100 * np.sin(np.radians(22.5)) / np.sin(np.radians(45))
    assert project_to_lens(make_lens("equisolid", 200, 200), east)[0] == pytest.approx(expected)
    assert project_to_lens(make_lens("equidistant", 200, 200, fov=220.0), east)[0] == pytest.approx(
        100 + 100 * 45 / 110
    )


def test_a_mirrored_picture_has_east_on_the_left() -> None:
    lens = make_lens("equidistant", 200, 200, mirrored=True)
    assert project_to_lens(lens, direction(90.0, 45.0))[0] == pytest.approx(50)


def test_a_ball_shows_the_camera_in_its_middle_and_what_is_behind_it_at_its_edge() -> None:
    lens = make_lens("ball", 200, 200)
    assert angle_between(unproject_from_lens(lens, [100.0, 100.0]), direction(180.0, 0.0)) == pytest.approx(0, abs=1e-6)
    assert angle_between(unproject_from_lens(lens, [200.0, 100.0]), direction(0.0, 0.0)) == pytest.approx(0, abs=1e-4)
    # A surface tilted by 45 deg reflects what is beside the ball.
    beside = unproject_from_lens(lens, [100 + 100 * np.sin(np.radians(45)), 100.0])
    assert angle_between(beside, direction(90.0, 0.0)) == pytest.approx(0, abs=1e-6)
    above = unproject_from_lens(lens, [100.0, 100 - 100 * np.sin(np.radians(45))])
    assert angle_between(above, ZENITH) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("kind", get_args(LensKind))
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("elevation", [None, 20.0])
def test_directions_come_back_to_their_pixels(kind: LensKind, mirrored: bool, elevation: float | None) -> None:
    width = 400 if kind == "latlong" else 210
    lens = make_lens(kind, width, 200, mirrored=mirrored, elevation=elevation)
    rng = np.random.default_rng(1)
    pixels = np.stack([rng.uniform(0, width, 300), rng.uniform(0, 200, 300)], axis=-1)
    towards = unproject_from_lens(lens, pixels)
    seen = np.isfinite(towards).all(axis=-1)
    assert seen.sum() > 200
    assert np.linalg.norm(towards[seen], axis=-1) == pytest.approx(1)
    assert project_to_lens(lens, towards[seen]) == pytest.approx(pixels[seen], abs=1e-4)


def test_pixels_per_degree_are_those_of_the_axis() -> None:
    assert pixels_per_degree(make_lens("equidistant", 360, 360)) == pytest.approx(2)
    assert pixels_per_degree(make_lens("latlong", 720, 360)) == pytest.approx(2)


def test_impossible_lenses_are_refused() -> None:
    for told in ({"fov": 0.0}, {"fov": 400.0}, {"radius": 0.0}, {"center": (500.0, 10.0)}):
        with pytest.raises(ProbeError):
            make_lens("equidistant", 200, 200, **told)
    with pytest.raises(ProbeError, match="twice as wide"):
        make_lens("latlong", 200, 200)


@pytest.mark.parametrize("kind", get_args(LensKind))
def test_what_a_lens_does_not_have_changes_nothing(kind: LensKind) -> None:
    told = {"fov": 150.0, "center": (90.0, 95.0), "radius": 80.0}
    towards = direction(80.0, 35.0)
    usual = project_to_lens(make_lens(kind, 400, 200), towards)
    for name, value in told.items():
        same = np.array_equal(project_to_lens(make_lens(kind, 400, 200, **{name: value}), towards), usual)
        assert same is (name in UNUSED_LENS_OPTIONS.get(kind, ()))


NORTH = np.eye(3)


def none(height: int, width: int) -> NDArray[np.bool_]:
    return np.zeros((height, width), dtype=bool)


@pytest.mark.parametrize("size", [100, 700])
def test_an_even_dome_is_even_and_nothing_is_below(size: int) -> None:
    image, clipped = resample_to_latlong(
        np.full((size, size, 3), 2.0, np.float32), none(size, size), make_lens("equidistant", size, size), NORTH, 64
    )
    assert image[:32] == pytest.approx(2.0)
    assert not image[32:].any()
    assert not clipped.any()


@pytest.mark.parametrize(("kind", "width"), [("equidistant", 150), ("equisolid", 400), ("ball", 250), ("latlong", 400)])
def test_the_light_of_a_point_survives_at_its_place(kind: LensKind, width: int) -> None:
    height = width // 2 if kind == "latlong" else width
    lens = make_lens(kind, width, height)
    pixel = np.floor(project_to_lens(lens, direction(60.0, 35.0))).astype(int)
    picture = np.zeros((height, width, 3), np.float32)
    picture[pixel[1], pixel[0]] = 1000.0
    mask = picture[..., 0] > 0
    corners = [unproject_from_lens(lens, pixel + np.array(corner)) for corner in ((0, 0), (1, 0), (1, 1), (0, 1))]
    power = 1000 * np.linalg.norm(np.cross(corners[2] - corners[0], corners[3] - corners[1])) / 2
    image, clipped = resample_to_latlong(picture, mask, lens, yaw_rotation(-90.0), 64)
    light = image[..., 1].sum(axis=1) @ latlong_solid_angle(64)
    assert light == pytest.approx(power, rel=0.05)  # large pixels, neighbors differ in size
    row, column = np.unravel_index(int(image[..., 1].argmax()), image.shape[:2])
    there = latlong_pixel(direction(-30.0, 35.0), 64)
    assert (column, row) == pytest.approx((there[0] - 0.5, there[1] - 0.5), abs=1.5)
    if clipped.any():
        assert clipped[row, column]


def test_a_panorama_that_needs_no_turning_stays() -> None:
    rng = np.random.default_rng(0)
    smooth = np.repeat(np.repeat(rng.uniform(0.5, 1, (8, 16, 3)), 8, axis=0), 8, axis=1).astype(np.float32)
    image, _ = resample_to_latlong(smooth, none(64, 128), make_lens("latlong", 128, 64), NORTH, 64)
    assert np.abs(image - smooth)[2:-2, 4:-4].mean() < 0.02
    inside = image[4::8, 4::8]
    assert inside == pytest.approx(smooth[4::8, 4::8], abs=1e-5)

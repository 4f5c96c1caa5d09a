"""Pictures as maps: nothing lost, nothing moved."""

import numpy as np
import pytest
from numpy.typing import NDArray

from lighting.geometry import direction, latlong_pixel, latlong_solid_angle
from lighting.probe.align import yaw_rotation
from lighting.probe.lens import Kind, lens_directions, lens_of, lens_pixels
from lighting.probe.mapping import to_latlong

NORTH = np.eye(3)


def none(height: int, width: int) -> NDArray[np.bool_]:
    return np.zeros((height, width), dtype=bool)


@pytest.mark.parametrize("size", [100, 700])
def test_an_even_dome_is_even_and_nothing_is_below(size: int) -> None:
    image, clipped = to_latlong(
        np.full((size, size, 3), 2.0, np.float32), none(size, size), lens_of("equidistant", size, size), NORTH, 64
    )
    assert image[:32] == pytest.approx(2.0)
    assert not image[32:].any()
    assert not clipped.any()


@pytest.mark.parametrize(("kind", "width"), [("equidistant", 150), ("equisolid", 400), ("ball", 250), ("latlong", 400)])
def test_the_light_of_a_point_survives_at_its_place(kind: Kind, width: int) -> None:
    height = width // 2 if kind == "latlong" else width
    lens = lens_of(kind, width, height)
    pixel = np.floor(lens_pixels(lens, direction(60.0, 35.0))).astype(int)
    picture = np.zeros((height, width, 3), np.float32)
    picture[pixel[1], pixel[0]] = 1000.0
    mask = picture[..., 0] > 0
    corners = [lens_directions(lens, pixel + np.array(corner)) for corner in ((0, 0), (1, 0), (1, 1), (0, 1))]
    power = 1000 * np.linalg.norm(np.cross(corners[2] - corners[0], corners[3] - corners[1])) / 2
    image, clipped = to_latlong(picture, mask, lens, yaw_rotation(-90.0), 64)
    light = image[..., 1].sum(axis=1) @ latlong_solid_angle(64)
    assert light == pytest.approx(power, rel=0.05)  # large pixels, neighbours differ in size
    row, column = np.unravel_index(int(image[..., 1].argmax()), image.shape[:2])
    there = latlong_pixel(direction(-30.0, 35.0), 64)
    assert (column, row) == pytest.approx((there[0] - 0.5, there[1] - 0.5), abs=1.5)
    if clipped.any():
        assert clipped[row, column]


def test_a_panorama_that_needs_no_turning_stays() -> None:
    rng = np.random.default_rng(0)
    smooth = np.repeat(np.repeat(rng.uniform(0.5, 1, (8, 16, 3)), 8, axis=0), 8, axis=1).astype(np.float32)
    image, _ = to_latlong(smooth, none(64, 128), lens_of("latlong", 128, 64), NORTH, 64)
    assert np.abs(image - smooth)[2:-2, 4:-4].mean() < 0.02
    inside = image[4::8, 4::8]
    assert inside == pytest.approx(smooth[4::8, 4::8], abs=1e-5)

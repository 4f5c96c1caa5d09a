"""Where a photo has room for the balls."""

import numpy as np
import pytest
from PIL import Image

from lighting.geometry import Pinhole
from lighting.spheres.room import has_room, plain_spot

CAMERA = Pinhole(320, 240, 50.0)  # level: its horizon is the picture's middle
RADIUS, ROW = 12.5, 3.6
REACH = ROW * RADIUS


def spot_in(pixels: np.ndarray, camera: Pinhole = CAMERA) -> tuple[float, float]:
    found = plain_spot(Image.fromarray(pixels), camera, RADIUS, ROW)
    assert found is not None
    return found


def test_plain_ground_has_room_in_its_lower_middle() -> None:
    assert spot_in(np.full((240, 320, 3), 120, dtype=np.uint8)) == pytest.approx((160, 192), abs=2)


@pytest.mark.parametrize(("left", "side"), [(60, 1), (140, -1)])
def test_a_thing_is_passed_on_its_shorter_side(left: int, side: int) -> None:
    pixels = np.full((240, 320, 3), 120, dtype=np.uint8)
    pixels[120:, left : left + 120] = np.random.default_rng(1).integers(0, 255, (120, 120, 1))
    x, y = spot_in(pixels)
    edge = left + 120 if side > 0 else left
    assert (x - edge) * side > REACH - 5
    assert y == pytest.approx(192, abs=6)


def test_balls_stand_lower_than_the_camera_and_wholly_in_the_picture() -> None:
    """All but a far corner is restless, and there they would reach over the horizon or out of the picture."""
    pixels = np.random.default_rng(2).integers(0, 255, (240, 320, 3), dtype=np.uint8)
    pixels[:132, 250:] = 120
    x, y = spot_in(pixels)
    assert y - 2 * RADIUS > 120
    assert REACH <= x <= 320 - REACH


def test_a_camera_that_shows_no_ground_has_no_room() -> None:
    up = Pinhole(320, 240, 50.0, elevation=40.0)
    assert plain_spot(Image.new("RGB", (320, 240)), up, RADIUS, ROW) is None
    assert not has_room(up, RADIUS, ROW)
    assert has_room(CAMERA, RADIUS, ROW)


@pytest.mark.parametrize("size", [(1, 1), (3, 400), (400, 3)])
def test_pictures_of_few_pixels_are_taken(size: tuple[int, int]) -> None:
    camera = Pinhole(*size, 50.0, elevation=-30.0)
    plain_spot(Image.new("RGB", size), camera, 0.05 * size[1], 3.6)

"""Balls in a photo: where they are, their shadows and their light."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from PIL import Image

from lighting.color import srgb_decode, tone_map
from lighting.envmap.render import render
from lighting.geometry import Pinhole, camera_pixel
from lighting.preview.object_insertion import (
    MAX_BALL_RADIUS,
    _ball_centers,
    _ball_radius,
    _coarse_ground_points,
    _find_plain_spot,
    _has_room,
    _shadow_cells,
    _shadow_factors,
    insert_balls,
    shows_ground,
)
from lighting.preview.spheres import DIFFUSE_REFLECTANCE, SphereScene, build_sphere_scene, sphere_centers
from lighting.records import Lighting
from tests.helpers.lights import stated_light

LIGHT = replace(stated_light(40.0), sun_azimuth=-90.0, camera_elevation=-10.0)
WIDTH, HEIGHT = 160, 120
CAMERA = Pinhole(WIDTH, HEIGHT, LIGHT.vertical_fov, elevation=-10.0)
CENTERS = _ball_centers(CAMERA, (WIDTH / 2, 0.8 * HEIGHT))  # where they stand on plain ground
SUNLIT = (
    np.array(stated_light(40.0).ground_color)
    / np.pi
    * (np.array([0.4, 0.5, 0.8]) + np.sin(np.radians(40.0)) * np.array([1.9, 1.5, 0.9]))
)
SHADED = np.array([0.12, 0.11, 0.1]) / np.pi * np.array([0.4, 0.5, 0.8])


@lru_cache(maxsize=1)
def stage() -> SphereScene:
    centers = sphere_centers(4 / 3, -10.0).astype(np.float64)
    return build_sphere_scene(render(LIGHT, 64), LIGHT.sun_direction, centers)


def drawn(ground: np.ndarray) -> np.ndarray:
    """Linear values of a picture of one colour with the balls in it."""
    picture = Image.fromarray(tone_map(np.broadcast_to(ground, (HEIGHT, WIDTH, 3))))
    return srgb_decode(np.asarray(insert_balls(picture, LIGHT, stage())) / 255.0)


def test_the_balls_stand_side_by_side_on_the_ground_below_the_middle() -> None:
    centers = CENTERS
    assert np.ptp(centers[:, 1]) == pytest.approx(0.0, abs=1e-9)
    assert centers[0, 0] < centers[1, 0] < centers[2, 0]
    x, y = camera_pixel(centers[1], CAMERA)
    assert x == pytest.approx(WIDTH / 2, abs=1)
    foot = camera_pixel(centers[1] - [0.0, 1.0, 0.0], CAMERA)[1]
    assert foot == pytest.approx(0.8 * HEIGHT, abs=0.1)
    assert foot - y == pytest.approx(MAX_BALL_RADIUS * HEIGHT, rel=0.15)


def test_a_picture_without_ground_stays_as_it_is() -> None:
    up = replace(LIGHT, camera_elevation=40.0)
    picture = Image.new("RGB", (80, 60), (90, 120, 160))
    assert insert_balls(picture, up, stage()) is picture
    assert not shows_ground(replace(CAMERA, elevation=40.0))
    assert shows_ground(CAMERA)


def test_the_balls_stand_beside_what_fills_the_middle() -> None:
    """Without it they would stand at the picture's lower middle."""
    ground = np.full((HEIGHT, WIDTH, 3), 90, dtype=np.uint8)
    with_thing = ground.copy()
    with_thing[72:110, 70:130] = np.random.default_rng(0).integers(0, 255, (38, 60, 1))
    changed = {}
    for name, picture in (("plain", ground), ("thing", with_thing)):
        drawn = np.asarray(insert_balls(Image.fromarray(picture), LIGHT, stage()))
        changed[name] = np.abs(drawn.astype(int) - picture).max(axis=2) > 40
    assert changed["plain"][72:110, 70:90].any()
    assert not changed["thing"][72:110, 90:130].any()
    assert changed["thing"].any()


@pytest.mark.parametrize("size", [(32, 256), (256, 32)])
def test_a_narrow_picture_shows_the_balls(size: tuple[int, int]) -> None:
    picture = Image.new("RGB", size, (90, 120, 160))
    pasted = insert_balls(picture, LIGHT, stage())
    assert pasted.size == size
    assert pasted.getpixel((size[0] // 2, round(0.8 * size[1]) - 2)) != (90, 120, 160)


def test_a_narrow_picture_has_all_balls_inside() -> None:
    narrow = Pinhole(32, 256, LIGHT.vertical_fov, elevation=-10.0)
    x = camera_pixel(_ball_centers(narrow, (16.0, 200.0)), narrow)[:, 0]
    radius = _ball_radius(narrow)
    assert radius < MAX_BALL_RADIUS * 256
    assert x.min() - radius > 0
    assert x.max() + radius < 32


def test_balls_behind_a_camera_that_looks_straight_down_are_left_out() -> None:
    down = replace(LIGHT, camera_elevation=-90.0, vertical_fov=170.0)
    assert insert_balls(Image.new("RGB", (80, 60), (90, 120, 160)), down, stage()).size == (80, 60)


def test_sunlit_ground_gets_a_shadow_down_to_the_skys_light() -> None:
    share = drawn(SUNLIT) / SUNLIT
    right = share[70:110, 100:150, 1]  # the sun stands at the left
    assert right.min() < 1.4 * SHADED[1] / SUNLIT[1]
    assert share[:30] == pytest.approx(1.0, abs=0.1)
    left = share[88:104, 5:40, 1]
    assert left.min() > 0.8


def test_the_edges_of_shadows_are_smooth() -> None:
    """As with eight times as many rays each way, to a tenth; by a ray for two pixels they would be stairs."""
    moved = replace(stage(), centers=CENTERS)
    fine = replace(CAMERA, width=8 * WIDTH, height=8 * HEIGHT)
    dark = _shadow_cells(*_coarse_ground_points(CAMERA, moved), moved)
    many = _shadow_factors(fine, moved, np.ones((1, 1), dtype=bool)).reshape(HEIGHT, 8, WIDTH, 8).mean(axis=(1, 3))
    share = _shadow_factors(CAMERA, moved, dark)
    edge = (many > 0.01) & (many < 0.99)
    assert edge.sum() > 50
    assert np.abs(share - many)[edge].mean() < 0.12  # one ray a pixel: 0.21
    assert np.abs(share - many)[~edge].max() < 0.02


def test_ground_in_shade_is_not_darkened_by_the_sun_again() -> None:
    """The picture's right lies in shade; there the sun at the left throws the balls' shadows."""
    ground = np.broadcast_to(SUNLIT, (HEIGHT, WIDTH, 3)).copy()
    ground[:, 104:] = SHADED
    beside = (drawn(ground) / ground)[70:110, 112:150, 1]
    assert beside.min() > 0.6
    assert (drawn(SUNLIT) / SUNLIT)[70:110, 112:150, 1].min() < beside.min() - 0.2


def test_balls_on_ground_in_shade_are_in_shade() -> None:
    """Seen from where the sun is, the grey ball of the shaded picture has the sky's light alone."""
    behind = replace(LIGHT, sun_azimuth=180.0)
    centers = sphere_centers(4 / 3, -10.0).astype(np.float64)
    lit = build_sphere_scene(render(behind, 64), behind.sun_direction, centers)
    x, y = (round(float(v)) for v in camera_pixel(CENTERS[2], CAMERA))
    positions = {}
    for name, under in (("sun", SUNLIT), ("shade", SHADED)):
        ground = np.broadcast_to(SUNLIT, (HEIGHT, WIDTH, 3)).copy()
        ground[80:110, 30:130] = under
        picture = Image.fromarray(tone_map(ground))
        positions[name] = srgb_decode(np.asarray(insert_balls(picture, behind, lit)) / 255.0)[y, x]
    sky, sun = np.array([0.4, 0.5, 0.8]), np.array([1.9, 1.5, 0.9])
    assert positions["shade"][1] < positions["sun"][1] / 2
    assert positions["shade"] == pytest.approx(DIFFUSE_REFLECTANCE / np.pi * sky, rel=0.6)
    assert positions["sun"][1] - positions["shade"][1] == pytest.approx(DIFFUSE_REFLECTANCE / np.pi * sun[1], rel=0.3)


def test_the_balls_are_seen() -> None:
    linear = drawn(SHADED)
    x, y = (round(float(v)) for v in camera_pixel(CENTERS[2], CAMERA))
    assert linear[y - 2, x].mean() > 2 * SHADED.mean()


def test_a_light_of_overcast_skies_throws_no_hard_shadow() -> None:
    dull = Lighting(
        0.0, 40.0, 3.0, 1.0, camera_elevation=-10.0, sky_cover=1.0, ground_color=(0.12, 0.12, 0.12),
        sun_irradiance=(0.0, 0.0, 0.0), sky_irradiance=(0.8, 0.8, 0.8),
    )  # fmt: skip
    centers = sphere_centers(4 / 3, -10.0).astype(np.float64)
    lit = build_sphere_scene(render(dull, 64), dull.sun_direction, centers)
    level = np.full(3, 0.12 / np.pi * 0.8)
    picture = Image.fromarray(tone_map(np.broadcast_to(level, (HEIGHT, WIDTH, 3))))
    share = srgb_decode(np.asarray(insert_balls(picture, dull, lit)) / 255.0) / level
    assert share[70:110, 125:].min() > 0.75


ROOM_CAMERA = Pinhole(320, 240, 50.0)  # level: its horizon is the picture's middle
RADIUS, ROW = 12.5, 3.6
REACH = ROW * RADIUS


def spot_in(pixels: np.ndarray, camera: Pinhole = ROOM_CAMERA) -> tuple[float, float]:
    spot_of_balls = _find_plain_spot(Image.fromarray(pixels), camera, RADIUS, ROW)
    assert spot_of_balls is not None
    return spot_of_balls


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
    assert _find_plain_spot(Image.new("RGB", (320, 240)), up, RADIUS, ROW) is None
    assert not _has_room(up, RADIUS, ROW)
    assert _has_room(ROOM_CAMERA, RADIUS, ROW)


@pytest.mark.parametrize("size", [(1, 1), (3, 400), (400, 3)])
def test_pictures_of_few_pixels_are_taken(size: tuple[int, int]) -> None:
    camera = Pinhole(*size, 50.0, elevation=-30.0)
    _find_plain_spot(Image.new("RGB", size), camera, 0.05 * size[1], 3.6)

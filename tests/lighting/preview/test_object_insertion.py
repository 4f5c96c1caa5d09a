"""Balls in a photo: where they are, their shadows and their light."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from PIL import Image

from lighting.color import srgb_decode, tone_map
from lighting.envmap.render import render
from lighting.geometry import EYE_HEIGHT, Pinhole, angle_between, camera_directions, camera_pixel
from lighting.ground import OBJECT_RADIUS
from lighting.preview.object_insertion import (
    _ball_centers,
    _coarse_ground_points,
    _shadow_cells,
    _shadow_factors,
    insert_balls,
)
from lighting.preview.spheres import DIFFUSE_REFLECTANCE, SphereScene, build_sphere_scene, sphere_centers
from lighting.records import Lighting
from lighting.segmentation import SurfaceClass
from tests.helpers.predictions import stated_light

WIDTH, HEIGHT = 160, 120
BARE = replace(stated_light(40.0), sun_azimuth=-90.0, camera_elevation=-10.0)
CAMERA = Pinhole(WIDTH, HEIGHT, BARE.vertical_fov, elevation=-10.0)
SPOT = camera_directions(replace(CAMERA, width=WIDTH + 1))[round(0.8 * HEIGHT), WIDTH // 2]
LIGHT = replace(BARE, spot_pixel=(80.0, 96.0), spot_direction=tuple(SPOT.tolist()), ground_visible=0.5)
CENTERS, RADIUS = _ball_centers(CAMERA, SPOT, EYE_HEIGHT)
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


def test_the_balls_stand_side_by_side_on_the_spot() -> None:
    centers = CENTERS
    assert np.ptp(centers[:, 1]) == pytest.approx(0.0, abs=1e-9)
    assert centers[0, 0] < centers[1, 0] < centers[2, 0]
    foot = centers[1] - [0.0, 1.0, 0.0]
    assert angle_between(foot, SPOT) < 1e-6
    x, y = camera_pixel(centers[1], CAMERA)
    assert x == pytest.approx(WIDTH / 2, abs=1)
    assert camera_pixel(foot, CAMERA)[1] - y == pytest.approx(OBJECT_RADIUS * HEIGHT, rel=0.15)
    assert pytest.approx(OBJECT_RADIUS * HEIGHT) == RADIUS


def test_balls_on_far_ground_are_no_giants() -> None:
    """A metre of radius at most, however high the camera is, and none reaches above the camera."""
    far = camera_directions(replace(CAMERA, height=1200, width=1600))[420, 800]
    for height, radius in ((1.6, 0.4 * 1.6), (60.0, 1.0)):
        centers, pixels = _ball_centers(CAMERA, far, height)
        assert height / (1 - centers[1, 1]) == pytest.approx(radius)  # its radius, by the camera's height in radii
        assert pixels < OBJECT_RADIUS * HEIGHT


def test_a_picture_without_a_spot_stays_as_it_is() -> None:
    picture = Image.new("RGB", (80, 60), (90, 120, 160))
    assert insert_balls(picture, replace(BARE, ground_visible=0.0), stage()) is picture


def test_what_stands_before_the_ground_takes_no_shadow() -> None:
    """A person where the shadow falls keeps the picture's pixels; without them they are darker."""
    people = np.zeros((18, 24, 10), dtype=np.float32)
    people[..., SurfaceClass.GROUND] = 1.0
    people[8:17, 15:22] = np.eye(10, dtype=np.float32)[SurfaceClass.PERSON]
    picture = Image.fromarray(tone_map(np.broadcast_to(SUNLIT, (HEIGHT, WIDTH, 3))))
    before = np.asarray(picture).astype(int)
    with_people, plain = (
        np.abs(np.asarray(insert_balls(picture, LIGHT, stage(), segments)).astype(int) - before)[80:105, 108:124]
        for segments in (people, None)
    )
    assert plain.max() > 20
    assert with_people.max() <= 1


def test_balls_touch_whatever_the_picture_shows_at_their_feet() -> None:
    """Leaves, which else take no shadow, are darker beside a ball's foot, also where no sun shines."""
    leaves = np.zeros((18, 24, 10), dtype=np.float32)
    leaves[..., SurfaceClass.PLANTS] = 1.0
    picture = Image.fromarray(tone_map(np.broadcast_to(SUNLIT, (HEIGHT, WIDTH, 3))))
    shown = np.asarray(insert_balls(picture, replace(LIGHT, sun_visibility=0.05), stage(), leaves)).astype(int)
    darker = np.asarray(picture).astype(int) - shown
    foot = camera_pixel(np.array(LIGHT.spot_direction), CAMERA).astype(int)
    below = darker[foot[1] + 1 : foot[1] + int(RADIUS / 2), foot[0]]
    assert below.max() > 20
    assert np.abs(darker[-2:]).max() <= 1


@pytest.mark.parametrize("size", [(32, 256), (256, 32)])
def test_a_narrow_picture_shows_the_balls(size: tuple[int, int]) -> None:
    picture = Image.new("RGB", size, (90, 120, 160))
    pasted = insert_balls(picture, LIGHT, stage())
    assert pasted.size == size
    assert pasted.getpixel((size[0] // 2, round(0.8 * size[1]) - 2)) != (90, 120, 160)


def test_a_narrow_picture_has_all_balls_inside() -> None:
    narrow = Pinhole(32, 256, LIGHT.vertical_fov, elevation=-10.0)
    centers, radius = _ball_centers(narrow, SPOT, EYE_HEIGHT)
    x = camera_pixel(centers, narrow)[:, 0]
    assert radius < OBJECT_RADIUS * 256
    assert x.min() - radius > 0
    assert x.max() + radius < 32


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
        spot_pixel=LIGHT.spot_pixel, spot_direction=LIGHT.spot_direction,
    )  # fmt: skip
    centers = sphere_centers(4 / 3, -10.0).astype(np.float64)
    lit = build_sphere_scene(render(dull, 64), dull.sun_direction, centers)
    level = np.full(3, 0.12 / np.pi * 0.8)
    picture = Image.fromarray(tone_map(np.broadcast_to(level, (HEIGHT, WIDTH, 3))))
    share = srgb_decode(np.asarray(insert_balls(picture, dull, lit)) / 255.0) / level
    assert share[70:110, 125:].min() > 0.75


def test_soft_light_leaves_a_contact_shadow_at_every_ball() -> None:
    """Level ground before each foot gets less of the sky: by a third at half a radius, by none at three."""
    dull = replace(LIGHT, sun_irradiance=(0.0, 0.0, 0.0), sky_irradiance=(0.8, 0.8, 0.8), sky_cover=1.0)
    centers = sphere_centers(4 / 3, -10.0).astype(np.float64)
    lit = build_sphere_scene(render(dull, 64), dull.sun_direction, centers)
    level = np.array(LIGHT.ground_color) / np.pi * 0.8
    picture = Image.fromarray(tone_map(np.broadcast_to(level, (4 * HEIGHT, 4 * WIDTH, 3))))
    share = srgb_decode(np.asarray(insert_balls(picture, dull, lit)) / 255.0)[..., 1] / level[1]
    large = replace(CAMERA, width=4 * WIDTH, height=4 * HEIGHT)
    for center in CENTERS:
        for radii, low, high in ((0.5, 0.2, 0.65), (3.0, 0.9, 1.05)):  # from the foot towards the camera
            x, y = camera_pixel(center - [0.0, 1.0, 0.0] + [0.0, 0.0, radii], large).round().astype(int)
            assert low < share[y, x] < high

"""Tests of latlong."""

from dataclasses import replace

import numpy as np
import pytest

from lighting.envmap.latlong import (
    FACES,
    envmap_irradiance,
    irradiance_from_rows,
    prefilter_cubemap,
    remove_sun,
    row_irradiance,
    scale_colors,
    shrink_envmap,
    to_cubemap,
)
from lighting.envmap.projection import project_photo
from lighting.envmap.render import render
from lighting.geometry import Pinhole, camera_pixel, direction, latlong_directions, latlong_solid_angle
from lighting.records import Lighting
from tests.helpers.predictions import stated_light
from tests.helpers.scenes import cube_directions


def test_a_white_sky_lights_level_ground_by_pi() -> None:
    levels = row_irradiance(40)
    assert levels[:20].sum() == pytest.approx(np.pi)
    assert levels == pytest.approx(levels[::-1])
    assert irradiance_from_rows(levels[:20], np.ones((20, 80, 3), np.float32)) == pytest.approx([np.pi] * 3)


def test_a_map_is_multiplied_by_a_colour_in_place() -> None:
    image = np.random.default_rng(1).random((4, 6, 3)).astype(np.float32)
    expected = image * np.array([0.5, 2.0, 3.0], np.float32)
    scale_colors(image[1:3], np.array([0.5, 2.0, 3.0]))
    assert np.array_equal(image[1:3], expected[1:3])
    assert not np.array_equal(image, expected)


SUNNY = Lighting(35.0, 40.0, 3.0, 5.0)
SHADED = Lighting(35.0, 40.0, 3.0, 5.0, sun_visibility=0.0)


@pytest.mark.parametrize("height", [64, 128, 512])
def test_sun_is_taken_out_of_the_map_with_its_whole_power(height: int) -> None:
    envmap = render(SUNNY, height)
    sky, power = remove_sun(envmap, SUNNY.sun_direction)
    solid_angle = latlong_solid_angle(height)[:, None, None]
    half = height // 2
    expected = ((envmap - render(SHADED, height)) * solid_angle)[:half].sum(axis=(0, 1))
    np.testing.assert_allclose(power, expected, rtol=0.05)
    assert sky.max() < 0.2 * envmap.max()


def test_map_without_disc_gives_almost_no_sun() -> None:
    powers = [remove_sun(render(each, 512), each.sun_direction)[1] for each in (SUNNY, SHADED)]
    assert powers[1].max() < 0.01 * powers[0].max()


def test_only_what_a_disc_has_over_the_sky_around_it_is_the_suns() -> None:
    sun = direction(40.0, 30.0)
    bright = np.full((64, 128, 3), 5.0, np.float32)
    rest, power = remove_sun(bright, sun)
    assert power == pytest.approx([0.0] * 3)
    row, column = np.unravel_index(np.argmax(latlong_directions(64) @ sun), (64, 128))
    bright[row, column] = 105.0
    rest, power = remove_sun(bright, sun)
    assert power == pytest.approx([100.0 * latlong_solid_angle(64)[row]] * 3, rel=1e-4)
    assert rest[row, column] == pytest.approx(5.0)


@pytest.mark.parametrize(("a", "b"), [(0, 1), (1, 2), (0, 2)])
def test_irradiance_of_a_product_map(a: int, b: int) -> None:
    d = latlong_directions(64)
    envmap = np.repeat((1 + 0.5 * d[..., a] + d[..., a] * d[..., b])[..., None], 3, axis=-1).astype(np.float32)
    normals = direction(np.array([30.0, 70.0, -130.0]), np.array([20.0, 10.0, -60.0]))
    clamped_cosine = np.pi + np.pi / 3 * normals[:, a] + np.pi / 4 * normals[:, a] * normals[:, b]
    np.testing.assert_allclose(
        envmap_irradiance(envmap, normals), np.repeat(clamped_cosine[:, None], 3, axis=1), rtol=3e-3
    )


def test_shrinking_keeps_the_mean_and_never_enlarges() -> None:
    image = np.random.default_rng(0).random((12, 24, 3), dtype=np.float32)
    np.testing.assert_allclose(shrink_envmap(image, 3)[1, 2], image[4:8, 8:12].mean(axis=(0, 1)), rtol=1e-5)
    np.testing.assert_allclose(shrink_envmap(image, 5).mean(), image.mean(), rtol=1e-2)
    assert shrink_envmap(image, 12) is image
    assert shrink_envmap(image, 99) is image


@pytest.mark.parametrize("height", [500, 720, 1000])
def test_a_shrunk_map_looks_the_same_way(height: int) -> None:
    there = direction(170.0, -20.0)
    near = np.exp(50 * (latlong_directions(height) @ there - 1))[..., None].repeat(3, axis=-1).astype(np.float32)
    small = shrink_envmap(near, 128)[..., 0] * latlong_solid_angle(128)[:, None]
    mean = np.tensordot(small, latlong_directions(128), 2)
    assert np.degrees(np.arccos(mean @ there / np.linalg.norm(mean))) < 0.1


@pytest.mark.parametrize(("height", "rows"), [(384, 256), (1000, 128), (500, 499)])
def test_a_shrunk_map_keeps_the_power_of_a_single_pixel(height: int, rows: int) -> None:
    for row in range(height // 3, height // 3 + 4):
        spot = np.zeros((height, 2 * height, 3), np.float32)
        spot[row, height] = 1e5
        np.testing.assert_allclose(shrink_envmap(spot, rows).sum((0, 1)) * (height / rows) ** 2, 1e5, rtol=1e-5)


def test_faces_look_where_their_names_say() -> None:
    middles = to_cubemap((2 + latlong_directions(64)).astype(np.float32), 33)[:, 16, 16] - 2
    for name, middle in zip(FACES, middles, strict=True):
        expected = np.zeros(3)
        expected["XYZ".index(name[1])] = 1 if name[0] == "+" else -1
        assert middle == pytest.approx(expected, abs=0.01)


def test_a_map_is_the_same_as_a_cubemap() -> None:
    directions = latlong_directions(64)
    image = (1 + directions @ np.diag([0.5, 0.3, 0.2])).astype(np.float32)
    assert to_cubemap(image, 16) == pytest.approx(1 + cube_directions(16) @ np.diag([0.5, 0.3, 0.2]), abs=0.01)


def test_mirror_images_are_means_by_ggx() -> None:
    """Against the sum over all pixels of the map, direction by direction."""
    image = np.random.default_rng(3).random((96, 192, 3)).astype(np.float32)
    image[20:24, 30:36] = 50.0
    sharp, rough, roughest = prefilter_cubemap(image, 16, [0.0, 0.5, 1.0])
    assert [level.shape[1] for level in (sharp, rough, roughest)] == [16, 8, 4]
    directions, weight = latlong_directions(96).reshape(-1, 3), np.repeat(latlong_solid_angle(96), 192)
    for level, alpha, size in ((rough, 0.25, 8), (roughest, 1.0, 4)):
        for face, row, column in ((0, 1, 1), (2, 2, 1), (5, 0, 2)):
            cosine = directions @ cube_directions(size)[face, row, column]
            half2 = (1 + cosine) / 2
            share = np.maximum(cosine, 0) / (half2 * (alpha**2 - 1) + 1) ** 2 * weight
            expected = share @ image.reshape(-1, 3) / share.sum()
            assert level[face, row, column] == pytest.approx(expected, rel=0.05)


HEIGHT = 64
DARK = np.full((HEIGHT, 2 * HEIGHT, 3), 0.01, np.float32)


def halves() -> np.ndarray:
    """A picture whose left is red and whose right is blue."""
    picture = np.zeros((60, 80, 3), np.uint8)
    picture[:, :40, 0], picture[:, 40:, 2] = 200, 200
    return picture


@pytest.mark.parametrize(("elevation", "roll"), [(0.0, 0.0), (25.0, 10.0), (-30.0, -170.0), (89.0, 0.0)])
def test_the_window_is_where_the_camera_looks(elevation: float, roll: float) -> None:
    light = replace(stated_light(), camera_elevation=elevation, camera_roll=roll)
    seen = project_photo(light, halves(), HEIGHT)
    weight = np.zeros((HEIGHT, 2 * HEIGHT))
    weight[seen.rows, seen.columns] = seen.whole.weight[..., 0]
    x, y = np.moveaxis(
        camera_pixel(latlong_directions(HEIGHT), Pinhole(80, 60, 50.0, elevation=elevation, roll=roll)), -1, 0
    )
    inside = (np.abs(x / 40 - 1) < 0.8) & (np.abs(y / 30 - 1) < 0.8)
    outside = ~((np.abs(x / 40 - 1) < 1) & (np.abs(y / 30 - 1) < 1))
    assert weight[inside].min() > 0.99
    assert weight[outside].max() == 0
    picture = np.zeros((HEIGHT, 2 * HEIGHT, 3))
    picture[seen.rows, seen.columns] = seen.whole.linear
    assert (picture[inside & (x < 36)][:, 0] > 0.4).all()
    assert (picture[inside & (x > 44)][:, 2] > 0.4).all()


def test_clipped_pixels_leave_the_brighter_map() -> None:
    seen = project_photo(stated_light(), np.full((60, 80, 3), 255, np.uint8), HEIGHT)
    whole = seen.whole
    inside, dark = whole.weight[..., 0] > 0.5, DARK[whole.rows, whole.columns]
    assert whole.over(dark + 5, 1.0)[inside] == pytest.approx(5.01)
    assert whole.over(dark, 1.0)[inside] == pytest.approx(1.0)
    assert whole.over(dark, 0.5)[inside] == pytest.approx(0.5)


def test_a_half_of_it_may_hold_none() -> None:
    seen = project_photo(replace(stated_light(), camera_elevation=60.0), halves(), HEIGHT)
    assert seen.rows.stop <= HEIGHT // 2 + 8
    upper = seen.block(slice(0, 2 * HEIGHT), slice(0, HEIGHT // 2))
    assert upper is not None
    assert upper.linear.shape[0] == upper.weight.shape[0] == upper.rows.stop - upper.rows.start

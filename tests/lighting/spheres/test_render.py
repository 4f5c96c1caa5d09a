"""Light, shadow and reflections of the three spheres."""

from functools import lru_cache

import numpy as np
import pytest

from lighting.colour import luminance
from lighting.envmap import render
from lighting.geometry import Floats, Pinhole, camera_pixel, direction, latlong_directions
from lighting.records import Lighting
from lighting.spheres import render as spheres
from lighting.spheres.render import render_spheres
from lighting.spheres.shading import DIFFUSE, GLOSSY, MIRROR

WIDTH, HEIGHT, PITCH = 160, 110, -10.0


def outdoors(azimuth: float, elevation: float, visibility: float = 1.0) -> Lighting:
    return Lighting(azimuth, elevation, 3.0, 5.0, sun_visibility=visibility, camera_elevation=PITCH)


@lru_cache
def picture(azimuth: float, elevation: float, visibility: float = 1.0) -> Floats:
    lighting = outdoors(azimuth, elevation, visibility)
    return render_spheres(render(lighting, 128), lighting, WIDTH, HEIGHT, supersampling=1)


def pixel(point: Floats) -> tuple[int, int]:
    """Row and column of a point in the scene."""
    x, y = camera_pixel(point, Pinhole(WIDTH, HEIGHT, spheres.VERTICAL_FOV, elevation=PITCH))
    return int(y), int(x)


def centres() -> Floats:
    return spheres.sphere_centres(WIDTH / HEIGHT, PITCH).astype(np.float64)


def brightness(image: Floats, point: Floats) -> float:
    """Mean luminance of 3 x 3 pixels around a point in the scene."""
    row, column = pixel(point)
    return float(luminance(image[row - 1 : row + 2, column - 1 : column + 2]).mean())


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_diffuse_sphere_is_brighter_on_the_suns_side(side: float) -> None:
    image = picture(side * 110.0, 40.0)
    middle = centres()[DIFFUSE]
    lit, dark = (brightness(image, middle + np.array([s * 0.6, 0.3, 0.5])) for s in (side, -side))
    assert lit > 1.5 * dark


@pytest.mark.parametrize("azimuth", [-60.0, 60.0, 140.0, -140.0])
def test_shadow_falls_opposite_the_sun(azimuth: float) -> None:
    image = picture(azimuth, 40.0)
    foot = centres()[GLOSSY] - np.array([0.0, 1.0, 0.0])
    away = 1.8 * direction(azimuth, 0.0)
    assert brightness(image, foot - away) < 0.6 * brightness(image, foot + away)


def test_overcast_casts_no_hard_shadow() -> None:
    foot = centres()[DIFFUSE] - np.array([0.0, 1.0, 0.0])
    row = pixel(foot + np.array([0.0, 0.0, 0.2]))[0]
    steps = [np.abs(np.diff(luminance(picture(100.0, 50.0, v)[row]) / luminance(picture(100.0, 50.0, v)[-1, 0])))
             for v in (1.0, 0.1)]  # fmt: skip
    assert steps[0].max() > 0.3
    assert steps[1].max() < 0.08


def test_ground_is_darkest_under_a_sphere_without_sun() -> None:
    image = picture(100.0, 50.0, 0.1)
    foot = centres()[DIFFUSE] - np.array([0.0, 1.0, 0.0])
    near, far = brightness(image, foot + np.array([0, 0, 0.7])), brightness(image, foot + np.array([0, 0, 2.2]))
    assert near < 0.75 * far


def test_open_ground_has_the_colour_of_the_maps_ground() -> None:
    lighting = outdoors(30.0, 50.0)
    envmap = render(lighting, 128)
    image = render_spheres(envmap, lighting, WIDTH, HEIGHT, supersampling=1)
    below_horizon = pixel(np.array([0.0, -1.0, -60.0]))[0]
    np.testing.assert_allclose(image[below_horizon, 2], envmap[-1, 0], rtol=0.02)


def test_backdrop_is_the_map_behind() -> None:
    lighting = outdoors(150.0, 50.0)
    envmap = render(lighting, 128)
    image = render_spheres(envmap, lighting, WIDTH, HEIGHT, supersampling=1)
    row, column = pixel(direction(-10.0, 6.0))
    np.testing.assert_allclose(
        image[row, column], envmap[int((0.5 - 6 / 180) * 128), int((0.5 - 10 / 360) * 256)], rtol=0.05
    )


@pytest.mark.parametrize("azimuth", [-150.0, 150.0])
def test_mirror_shows_what_is_behind_the_camera_on_the_same_side(azimuth: float) -> None:
    envmap = np.where(latlong_directions(128) @ direction(azimuth, 25.0) > 0.97, 9.0, 0.1)[..., None]
    image = render_spheres(np.repeat(envmap, 3, axis=-1).astype(np.float32), outdoors(0.0, 80.0), WIDTH, HEIGHT, 1)
    row, column = pixel(centres()[MIRROR])
    reach = 14
    face = luminance(image[row - reach : row + reach, column - reach : column + reach])
    spot = np.argwhere(face > 5).mean(axis=0) - reach
    assert spot[0] < 0
    assert np.sign(spot[1]) == np.sign(azimuth)


@pytest.mark.parametrize(("azimuth", "elevation"), [(0.0, 0.0), (180.0, 90.0), (-179.9, 0.4)])
def test_extreme_suns_give_finite_pictures(azimuth: float, elevation: float) -> None:
    image = picture(azimuth, elevation)
    assert np.isfinite(image).all()
    assert image.min() >= 0

"""Mean light vectors, and modeled skies."""

from datetime import date
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from lighting.envmap.latlong import remove_sun, row_irradiance
from lighting.envmap.render import sky_irradiance, sun_light
from lighting.errors import EnvironmentMapError, ParameterError
from lighting.geometry import SUN_RADIUS, Floats, direction, latlong_angles, latlong_directions
from lighting.records import Lighting
from lighting.sky.clear_sky import sun_disc_points
from lighting.stereo.light_vectors import (
    ClockLocation,
    Skies,
    Weather,
    clear_skies,
    draw_sunshine,
    illumination_matrices,
    modelled_day,
    sky_light_vectors,
    sun_directions,
    sun_light_vectors,
)


def mean_light(envmap: NDArray[np.floating[Any]], normals: ArrayLike, sun_direction: ArrayLike | None = None) -> Floats:
    """Mean light vectors (..., 3, C) of patches with unit normals (..., 3) under one map (H, 2H, C).

    With the direction (3,) of a sun that the map shows, its disc is integrated analytically and not from pixels; the
    map has three channels then. Raises EnvironmentMapError for a map of another shape.
    """
    image = np.asarray(envmap, dtype=np.float32)[None]
    if sun_direction is None:
        skies = Skies(image, np.array([[0.0, 1.0, 0.0]]), np.zeros((1, image.shape[-1])))
    else:
        sun = np.asarray(sun_direction, dtype=np.float64)
        sky, irradiance = remove_sun(image[0], sun)
        skies = Skies(sky[None], sun[None], irradiance[None])
    return np.asarray(illumination_matrices(skies, normals)[..., 0, :, :])


def level_light(radiance: NDArray[np.floating[Any]]) -> Floats:
    """Irradiance (T, C) of level ground by the upper halves of maps (T, H, 2H, C)."""
    half = radiance.shape[1] // 2
    levels = row_irradiance(radiance.shape[1])[:half]
    return np.asarray(np.einsum("r,trcx->tx", levels, radiance[:, :half]) / radiance.shape[2])


def normals(count: int, seed: int = 1) -> Floats:
    drawn = np.random.default_rng(seed).normal(size=(count, 3))
    return np.asarray(drawn / np.linalg.norm(drawn, axis=1, keepdims=True))


def test_a_uniform_sky_shines_along_the_normal() -> None:
    n = normals(50)
    vectors = mean_light(np.ones((64, 128, 2), dtype=np.float32), n)
    assert vectors.shape == (50, 3, 2)
    # 1 / pi x the integral of w over a hemisphere is n; 64 rows integrate it to 1e-3
    np.testing.assert_allclose(vectors[..., 0], n, atol=2e-3)
    np.testing.assert_array_equal(vectors[..., 0], vectors[..., 1])


def test_a_sky_over_black_ground_lights_a_wall_half() -> None:
    sky = np.zeros((64, 128, 1), dtype=np.float32)
    sky[:32] = 1
    wall = mean_light(sky, [0, 0, -1])[:, 0]
    np.testing.assert_allclose(wall, [0, 0.5, -0.5], atol=1e-3)  # a quarter sphere: 1 / pi x pi / 2 along each axis


def test_a_smooth_sky_gives_the_brightness_of_a_fine_sum() -> None:
    def sky(height: int) -> NDArray[np.float32]:
        d = latlong_directions(height)
        return np.asarray(1 + d[..., :1] + 2 * d[..., 1:2] ** 2, dtype=np.float32)

    n = normals(40)
    coarse, fine = (np.einsum("nkc,nk->n", mean_light(sky(height), n), n) for height in (64, 512))
    np.testing.assert_allclose(coarse, fine, rtol=2e-3)


@pytest.mark.parametrize("above", [-0.3, -0.2, -0.05, 0.0, 0.1, 0.25, 0.3, 20.0, 90.0])
def test_the_disc_is_what_its_points_sum_to(above: float) -> None:
    """At `above` degrees over the plane of the patch; the disc's radius is 0.268."""
    sun = direction(30.0, 40.0)
    patch = direction(30.0, 40.0 + 90.0 - above)
    points, weight = sun_disc_points(sun, rings=200, spokes=400)
    seen = (points @ patch > 0) * weight / weight.sum()
    vector = sun_light_vectors(sun[None], np.array([[np.pi]]), patch[None])[0, 0, :, 0]
    np.testing.assert_allclose(vector, seen @ points, atol=3e-3)
    # the brightness of a grazed patch is a tenth of a percent of a lit one's: to a hundredth of that
    assert vector @ patch == pytest.approx(seen @ points @ patch, abs=2e-5)
    assert vector @ patch >= 0


def test_a_sun_is_taken_out_of_a_map_and_integrated() -> None:
    sun, n = direction(20.0, 50.0), normals(200)
    height = 128
    image = np.full((height, 2 * height, 3), 0.1, dtype=np.float32)
    plain = mean_light(image, n)
    d = latlong_directions(height)
    row, column = np.unravel_index(np.argmax(d @ sun), d.shape[:2])
    solid_angle = 2 * np.pi / (2 * height) * np.pi / height * np.hypot(d[row, column, 0], d[row, column, 2])
    image[row, column] += np.float32(5.0 * np.pi / solid_angle)
    lit = n @ sun > np.sin(np.radians(SUN_RADIUS))
    expected = plain[lit] + 5.0 * sun[:, None]
    np.testing.assert_allclose(mean_light(image, n, sun)[lit], expected, rtol=2e-3, atol=2e-3)


def test_brightness_of_rendered_patches_is_linear_in_the_scaled_normal() -> None:
    n = normals(7)
    suns = np.stack([direction(azimuth, 40.0) for azimuth in (0.0, 50.0, 100.0)])
    rng = np.random.default_rng(3)
    skies = Skies(rng.random((3, 16, 32, 3), dtype=np.float32), suns, rng.random((3, 3)))
    matrices = illumination_matrices(skies, n.reshape(7, 1, 3))
    assert matrices.shape == (7, 1, 3, 3, 3)
    step = 1e-3
    for axis in np.eye(3):  # the derivative of the brightness by x is the matrix, though the matrix depends on n
        moved = n + step * axis
        length = np.linalg.norm(moved, axis=1, keepdims=True)
        there = np.einsum("ntkc,nk->ntc", illumination_matrices(skies, moved / length), moved)
        here = np.einsum("ntkc,nk->ntc", matrices[:, 0], n)
        slope = np.einsum("ntkc,k->ntc", matrices[:, 0], axis)
        np.testing.assert_allclose((there - here) / step, slope, atol=0.06)  # a pixel at the edge costs so much


def test_shapes_are_checked() -> None:
    with pytest.raises(EnvironmentMapError, match="shape"):
        mean_light(np.ones((8, 8, 3), dtype=np.float32), [0, 1, 0])
    with pytest.raises(EnvironmentMapError, match="irradiance"):
        Skies(np.ones((1, 8, 16, 3), dtype=np.float32), np.array([[0.0, 1.0, 0.0]]), np.zeros((1, 1)))


def test_chunks_do_not_show() -> None:
    n, radiance = normals(5000), np.random.default_rng(0).random((1, 32, 64, 1))
    together, apart = sky_light_vectors(radiance, n), sky_light_vectors(radiance, n[4990:])
    np.testing.assert_allclose(together[4990:], apart, rtol=1e-5, atol=1e-6)


SUNS = direction([100.0, 180.0, 250.0], [15.0, 55.0, 30.0])


def test_suns_stand_in_the_south_at_noon_and_in_the_east_in_the_morning() -> None:
    noon, morning = sun_directions(["2026-03-20T12:07", "2026-03-20T06:30"], 48.0, 0.0)
    np.testing.assert_allclose(noon, direction(180.0, 42.0), atol=0.02)  # south is +Z
    assert morning[0] > 0.98  # east is +X


def test_clear_skies_have_the_irradiances_of_the_environment_map() -> None:
    skies = clear_skies(SUNS)
    for i, (azimuth, elevation) in enumerate(((100.0, 15.0), (180.0, 55.0), (-110.0, 30.0))):
        light = Lighting(sun_azimuth=azimuth, sun_elevation=elevation, turbidity=3.0, exposure=1.0)
        # 64 rows of the sky and 192 points of the disc
        np.testing.assert_allclose(skies.sun_irradiance[i], sun_light(light)[0], rtol=3e-3)
        np.testing.assert_allclose(level_light(skies.radiance[i : i + 1])[0], sky_irradiance(light), rtol=3e-3)


def test_level_ground_sees_its_horizontal_irradiance() -> None:
    skies = clear_skies(SUNS)
    bright = np.einsum("tkc,k->tc", illumination_matrices(skies, [0, 1, 0]), [0.0, 1, 0])
    level = level_light(skies.radiance) + skies.sun_irradiance * SUNS[:, 1:2]
    np.testing.assert_allclose(bright, level / np.pi, rtol=2e-3)
    np.testing.assert_allclose(skies.radiance[:, -1, 0], 0.3 * bright, rtol=2e-3)  # ground of albedo 0.3, lit by it


def modelled(weather: Weather) -> Skies:
    return modelled_day(ClockLocation(47.5, 9.75, 1.0), date(2026, 6, 21), weather, coarse=True).skies


def test_overcast_skies_follow_the_cie_and_hold_a_quarter_of_the_light() -> None:
    clear, dull = modelled("clear"), modelled("overcast")
    assert not dull.sun_irradiance.any()
    rows = dull.radiance.shape[1] // 2
    up = np.sin(np.radians(latlong_angles(2 * rows)[1][:rows]))
    sky = dull.radiance[:, :rows].mean(axis=(2, 3))
    np.testing.assert_allclose(sky / sky[:, :1], np.broadcast_to((1 + 2 * up) / (1 + 2 * up[0]), sky.shape), rtol=1e-4)
    level = np.array([0.0, 1.0, 0.0])
    bright = [np.einsum("tkc,k->tc", illumination_matrices(skies, level), level) for skies in (clear, dull)]
    np.testing.assert_allclose(bright[1], 0.25 * bright[0], rtol=5e-3)


def test_an_overcast_day_turns_no_mean_light_vector() -> None:
    vectors = illumination_matrices(modelled("overcast"), direction(40.0, 30.0))[..., 0]
    unit = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    np.testing.assert_allclose(unit, unit[:1].repeat(len(unit), axis=0), atol=1e-5)


def test_broken_skies_hide_the_sun_in_some_spells() -> None:
    """Half of a day's skies are those of spells without the sun, the others those with it."""
    clear, skies = modelled("clear"), modelled("mixed")
    count = len(clear)
    np.testing.assert_array_equal(skies.sun_irradiance[:count], 0)
    np.testing.assert_array_equal(skies.sun_irradiance[count:], clear.sun_irradiance)
    level = level_light(skies.radiance) + skies.sun_irradiance * skies.sun_direction[:, 1:2]
    np.testing.assert_allclose(skies.radiance[:, -1, 0], 0.3 / np.pi * level, rtol=1e-4)
    assert draw_sunshine(2000, 10, seed=1, cover=0.3).mean() == pytest.approx(0.7, abs=0.01)


def test_night_is_refused() -> None:
    with pytest.raises(ParameterError, match="below the horizon"):
        clear_skies(direction([0.0], [-5.0]))

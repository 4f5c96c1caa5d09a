"""One sphere or ray at a time: penumbra, power of the disc, reflections."""

import numpy as np
import pytest

from lighting.envmap import render
from lighting.geometry import Floats, direction
from lighting.spheres.bounces import lit_stage
from lighting.spheres.shading import DIFFUSE, MIRROR, MIRROR_REFLECTANCE, Stage, _sky, ground, shade, sunlit
from tests.previews import outdoors

CENTRES = np.array([[-2.6, 1.0, 0.0], [0.0, 1.0, 0.0], [2.6, 1.0, 0.0]])


@pytest.fixture(scope="module")
def stage() -> Stage:
    lighting = outdoors(90.0, 45.0)
    return lit_stage(render(lighting, 128), lighting.sun_direction, CENTRES)


def test_the_suns_disc_is_seen_in_full_beside_a_shadow_and_not_at_all_inside(stage: Stage) -> None:
    points = CENTRES[MIRROR] + np.array([[0.0, -1.0, 5.0], [-1.0, -1.0, 0.0]])
    assert sunlit(points, stage).tolist() == [1.0, 0.0]


def test_the_disc_carries_the_suns_power_whatever_its_size(stage: Stage) -> None:
    towards = stage.sun_direction[None]
    for radius in (0.3, 1.0):
        disc = _sky(towards, stage, radius) - _sky(towards, stage, None)
        solid_angle = 2 * np.pi * (1 - np.cos(np.radians(radius)))
        np.testing.assert_allclose(disc[0] * solid_angle, stage.sun_irradiance, rtol=1e-9)


def test_open_ground_far_away_has_the_radiance_of_the_map(stage: Stage) -> None:
    np.testing.assert_allclose(ground(np.array([[0.0, 0.0, 400.0]]), stage)[0], stage.ground, rtol=1e-3)


def test_a_mirror_shows_the_sky_that_it_reflects(stage: Stage) -> None:
    normal = np.array([[0.0, 1.0, 0.0]])
    ray = -direction(0.0, 60.0)[None]  # down onto the top, which throws it up and away from the camera
    seen = shade(MIRROR, CENTRES[MIRROR] + normal, ray, stage, mirrored=False)
    reflected = ray - 2 * (ray @ normal.T) * normal
    expected: Floats = MIRROR_REFLECTANCE * _sky(reflected, stage, None)
    np.testing.assert_allclose(seen, expected, rtol=1e-9)


def test_the_diffuse_sphere_is_lit_on_the_suns_side(stage: Stage) -> None:
    sides = np.array([[0.7, 0.7, 0.0], [-0.7, 0.7, 0.0]])
    lit, dark = shade(DIFFUSE, CENTRES[DIFFUSE] + sides, np.zeros((2, 3)), stage, mirrored=False).mean(axis=1)
    assert lit > 1.5 * dark

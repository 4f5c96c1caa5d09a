"""The objects that are relit, and the scores of their pictures."""

import math

import numpy as np
import pytest

from export.evaluation.relighting import (
    BALLS,
    HEIGHT,
    OBJECTS,
    PLANE_ALBEDO,
    _plane_points,
    object_errors,
    pool_map,
    render_object,
)
from lighting.envmap.render import render
from lighting.geometry import direction, latlong_directions, latlong_solid_angle
from lighting.records import Lighting


def lamp(azimuth: float, elevation: float) -> np.ndarray:
    """A dark map but for the pixel towards a direction, which gives unit irradiance on a surface facing it."""
    light = np.zeros((HEIGHT, 2 * HEIGHT, 3), np.float32)
    row, column = np.unravel_index(
        np.argmax(latlong_directions(HEIGHT) @ direction(azimuth, elevation)), light.shape[:2]
    )
    light[row, column] = 1 / latlong_solid_angle(HEIGHT)[row]
    return light


@pytest.mark.slow
def test_a_white_sky_lights_the_plane_by_its_albedo() -> None:
    sky = np.where(latlong_directions(HEIGHT)[..., 1:2] > 0, 1.0, 0.0) * np.ones(3)
    seen = render_object("plane", sky[None])[0]
    assert (seen < PLANE_ALBEDO).all()  # the sphere hides some of the sky
    assert seen.max() == pytest.approx(PLANE_ALBEDO, rel=0.06)


@pytest.mark.slow
@pytest.mark.parametrize("azimuth", [-120.0, 30.0, 90.0])
def test_the_shadow_falls_away_from_the_sun(azimuth: float) -> None:
    seen = render_object("plane", lamp(azimuth, 40.0)[None])[0, :, 1]
    lit = PLANE_ALBEDO / math.pi * math.sin(math.radians(40.0))
    dark = seen < 0.01 * lit
    np.testing.assert_allclose(seen[~dark], lit, rtol=0.05)
    assert np.sign(_plane_points()[dark, 0].mean()) == -np.sign(math.sin(math.radians(azimuth)))


@pytest.mark.slow
def test_pooling_keeps_the_power_of_the_sun() -> None:
    fine = render(Lighting(20.0, 30.0, 3.0, 1.0), 512, sun=True)
    small = pool_map(fine)
    power = [np.einsum("hwc,h->c", m, latlong_solid_angle(m.shape[0])) for m in (fine, small)]
    np.testing.assert_allclose(power[0], power[1], rtol=1e-5)
    assert small.shape == (HEIGHT, 2 * HEIGHT, 3)


@pytest.mark.slow
@pytest.mark.parametrize("kind", BALLS)
def test_white_light_makes_white_balls(kind: str) -> None:
    white = np.ones((1, HEIGHT, 2 * HEIGHT, 3), np.float32)
    assert render_object(kind, white) == pytest.approx(1.0, rel=0.02)


@pytest.mark.slow
def test_each_object_sees_what_lies_where_it_looks() -> None:
    behind = np.zeros((1, HEIGHT, 2 * HEIGHT, 3), np.float32)
    behind[:, :, : HEIGHT // 2] = behind[:, :, -HEIGHT // 2 :] = 1  # behind the camera, which the balls' middles face
    for kind in BALLS:
        seen = render_object(kind, behind)[0, :, 0]
        assert seen[len(seen) // 2 + 12] > 0.9  # the middle of the row below the middle
    assert render_object("plane", behind).shape[1] > 200
    assert len(OBJECTS) == 4


@pytest.mark.slow
def test_differences_that_are_known() -> None:
    truth = np.random.default_rng(0).uniform(0.5, 1.0, (2, 50, 3))
    same, double = object_errors(truth, truth), object_errors(truth, 2 * truth)
    assert same == pytest.approx(np.zeros((2, 3)), abs=1e-3)
    assert double == pytest.approx(np.array([[1.0, 0.0, 0.0]] * 2), abs=1e-3)
    red, green = np.zeros((1, 4, 3)), np.zeros((1, 4, 3))
    red[..., 0], green[..., 1] = 1, 1
    assert object_errors(red, green)[0, 2] == pytest.approx(90)

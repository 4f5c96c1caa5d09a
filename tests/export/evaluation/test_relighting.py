"""The objects and the scene that are relit, and the scores of their pictures."""

import math

import numpy as np
import pytest

from export.data.labels import Label
from export.evaluation.relighting import (
    BALLS,
    HEIGHT,
    OBJECTS,
    PLANE_ALBEDO,
    SIZE,
    _relight_report,
    constant_skies,
    mean_training_sky,
    object_errors,
    pool_map,
    relight_scene,
    render_object,
)
from lighting.envmap.render import render
from lighting.geometry import angles, direction, latlong_directions, latlong_solid_angle
from lighting.records import Lighting

CORNER = (2, 2)  # a pixel of the plane, far behind the sphere


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
    seen = relight_scene(sky)[CORNER]
    assert (seen < PLANE_ALBEDO).all()  # the sphere hides some of the sky
    np.testing.assert_allclose(seen, PLANE_ALBEDO, rtol=0.06)


@pytest.mark.slow
@pytest.mark.parametrize("azimuth", [-120.0, 30.0, 90.0])
def test_the_shadow_falls_away_from_the_sun(azimuth: float) -> None:
    seen = relight_scene(lamp(azimuth, 40.0))[..., 1]
    lit = PLANE_ALBEDO / math.pi * math.sin(math.radians(40.0))
    assert seen[CORNER] == pytest.approx(lit, rel=0.05)
    columns = np.nonzero(seen < 0.01 * lit)[1]
    across = (columns.mean() + 0.5) / SIZE * 2 - 1
    assert np.sign(across) == -np.sign(math.sin(math.radians(azimuth)))


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


def label(elevation: float, direct: str = "yes") -> Label:
    return Label("p", 70.0, elevation, 2.0, "given", 70.0, elevation, 3.0, 0.5, 0.1, True, direct)


@pytest.mark.slow
def test_the_mean_sky_knows_no_azimuth_and_the_constants_look_ahead() -> None:
    mean = mean_training_sky([label(20.0), label(60.0, "no")])
    assert np.ptp(mean, axis=1).max() == 0
    lit, shaded = constant_skies([label(20.0)])[:2]
    row, column = np.unravel_index(np.argmax(lit[..., 1]), lit.shape[:2])
    azimuth, elevation = angles(latlong_directions(HEIGHT)[row, column])
    assert abs(azimuth) < 4
    assert elevation == pytest.approx(15, abs=3)
    assert lit.max() > 50 * shaded.max()


@pytest.mark.slow
def test_the_table_sets_ours_beside_each() -> None:
    names = np.repeat([f"p{i}" for i in range(6)], 4)
    ours = np.random.default_rng(1).uniform(0.1, 0.2, (24, 3))
    text = _relight_report({"outdoor": ours, "constant": ours + 1}, names)
    assert "24 crops of 6 HDR panoramas" in text
    assert "-1.0" in text.splitlines()[-1]

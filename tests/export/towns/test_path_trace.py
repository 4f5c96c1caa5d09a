"""Radiances against what can be computed by hand."""

import numpy as np
import pytest

from export.towns.mesh import box, join
from export.towns.path_trace import RenderedPlace, despeckle
from export.towns.place import EYE
from export.towns.sky import HEIGHT, Sky
from lighting.geometry import angle_between, direction, latlong_directions
from tests.export.towns.examples import ALBEDO, NOTHING, clear, plain


@pytest.mark.usefixtures("llvm")
def test_the_sky_is_seen_where_it_is() -> None:
    sky, height = clear(), 64
    seen = RenderedPlace(plain(4.0), NOTHING, sky).panorama(height, 0)
    upper = sky.radiance[: HEIGHT // 2].reshape(height // 2, 4, 2 * height, 4, 3).mean(axis=(1, 3))
    near = angle_between(latlong_directions(height)[: height // 2], sky.lighting.sun_direction) < 12
    ratio = (seen[: height // 2] / upper)[~near]
    assert np.percentile(np.abs(ratio - 1), 90) < 0.03
    peak = latlong_directions(height).reshape(-1, 3)[seen.sum(axis=2).argmax()]
    assert angle_between(peak, sky.lighting.sun_direction) < 3.0


@pytest.mark.usefixtures("llvm")
def test_level_ground_shines_by_lambert_s_law() -> None:
    """Under an even sky L: albedo x L. Under the sun alone: albedo / pi x E x sin(elevation)."""
    even = np.where(latlong_directions(HEIGHT)[..., 1:2] > 0, 1.0, 0.0).repeat(3, axis=2).astype(np.float32)
    overcast = Sky(even, clear().lighting, 0.0)
    below = RenderedPlace(plain(), NOTHING, overcast).panorama(32, 1)[22:28]
    np.testing.assert_allclose(below.mean(axis=(0, 1)), ALBEDO, rtol=0.02)
    sunny = Sky(np.zeros_like(even) + 1e-6, clear().lighting, 1.0)
    lit = RenderedPlace(plain(), NOTHING, sunny).panorama(32, 1)[22:28].mean(axis=(0, 1))
    np.testing.assert_allclose(
        lit, np.array(ALBEDO) / np.pi * sunny.sun_irradiance * np.sin(np.radians(40.0)), rtol=0.02
    )


@pytest.mark.usefixtures("llvm")
def test_a_shadow_falls_away_from_the_sun() -> None:
    """Of a tower in the sun's direction: the ground on our side is dark, and so are we; behind us it is lit."""
    sky = clear(elevation=30.0)
    toward = direction(60.0, 0.0)[[0, 2]]
    tower = box(15 * toward, np.array([6.0, 30.0, 6.0]), -60.0, np.array(ALBEDO))
    scene = RenderedPlace(join([plain(), tower]), NOTHING, sky)
    here, aside = np.array([[0.0, EYE, 0.0]]), np.array([[*(20 * toward[::-1] * [1, -1])]])
    aside = np.array([[aside[0, 0], EYE, aside[0, 1]]])
    assert scene.sunlit(here) == 0.0
    assert scene.sunlit(aside) == 1.0
    assert scene.sunlit(np.concatenate([here, aside])) == 0.5
    assert scene.is_clear()


@pytest.mark.usefixtures("llvm")
def test_a_camera_in_a_corner_is_not_clear() -> None:
    wall = box(np.array([0.0, 0.9]), np.array([8.0, 3.0, 0.4]), 0.0, np.array(ALBEDO))
    assert not RenderedPlace(join([plain(), wall]), NOTHING, clear()).is_clear()


def test_single_bright_and_dark_pixels_go_and_edges_stay() -> None:
    image = np.ones((20, 30, 3), np.float32)
    image[:, 15:] = 5.0
    speckled = image.copy()
    speckled[4, 4], speckled[9, 22] = 80.0, 0.0
    np.testing.assert_array_equal(despeckle(speckled), image)

"""Masks of shade against the truth of rendered places."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from export.reports.shadow_mask import (
    _format_masks,
    _GroundScene,
    _predicted_mask,
    _render_scenes,
    _shade_figures,
    _shadow_error,
)
from lighting.color import tone_map
from lighting.model import Model
from tests.helpers.lights import SHADED_GROUND, SUNLIT_GROUND, stated_light

LIGHT = stated_light(40.0, camera_elevation=0.0)


def halves(width: int = 320, height: int = 240) -> _GroundScene:
    """Ground of which the right half lies in shade."""
    linear = np.full((height, width, 3), 0.8)
    lit = np.ones((height, width), dtype=bool)
    lit[:, width // 2 :] = False
    ground = np.zeros_like(lit)
    ground[height // 2 :] = True
    linear[ground] = np.where(lit[ground][:, None], SUNLIT_GROUND, SHADED_GROUND)
    weights = np.array([0.2126, 0.7152, 0.0722])
    return _GroundScene(tone_map(linear), LIGHT, ground, lit & ground, np.full(lit.shape, SHADED_GROUND @ weights))


def test_a_right_mask_leaves_no_error_of_the_shadow() -> None:
    scene = halves()
    right = _shade_figures([scene], [LIGHT], [_predicted_mask(scene, LIGHT)])
    assert right["right"] > 97
    assert right["shadow off by, mean"] < 10


def test_without_a_mask_shade_is_darkened_twice() -> None:
    scene = halves()
    error = _shadow_error(scene, LIGHT, np.ones(scene.lit.shape))
    shade = ~scene.lit[scene.ground]
    assert np.abs(error[~shade]).max() < 0.05
    assert error[shade].max() < -1.0
    none = _shade_figures([scene], [LIGHT], [np.ones(scene.lit.shape)])
    assert none["recall"] == 0.0
    assert none["right"] == pytest.approx(50.0)
    assert none["too dark by, mean"] == pytest.approx(none["shadow off by, mean"], abs=5.0)


def test_what_the_ground_shows_has_a_name() -> None:
    scene = halves()
    assert scene.kind == "both"
    assert replace(scene, lit=scene.ground).kind == "lit"
    assert replace(scene, lit=np.zeros_like(scene.ground)).kind == "shade"


@pytest.mark.slow
@pytest.mark.usefixtures("llvm")
def test_a_rendered_photo_is_darker_in_shade_and_is_reported(lit_network: Path) -> None:
    (scene,) = _render_scenes(1)
    seen = scene.picture.mean(axis=-1)
    assert seen[scene.ground & scene.lit].mean() > seen[scene.ground & ~scene.lit].mean()
    assert scene.light.sun_irradiance is not None
    report = _format_masks(Model.load(lit_network), [scene])
    assert f"Ground of 1 photos: {scene.kind}" in report
    assert "true mask, true light" in report

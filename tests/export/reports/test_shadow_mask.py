"""Masks of shade against the truth of rendered places."""

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from export.data.panoramas import read_index
from export.reports.map_detail import _choose_views, report_map_detail
from export.reports.shadow_mask import (
    _format_masks,
    _GroundScene,
    _predicted_mask,
    _render_scenes,
    _shade_figures,
    _shadow_error,
)
from export.reports.sky_models import _compare, _format_errors, _hosek_wilkie, _Truth
from lighting.color import tone_map
from lighting.geometry import direction, latlong_directions
from lighting.model import Model
from lighting.sky.clear_sky import prague_radiance
from tests.helpers.predictions import SHADED_GROUND, SUNLIT_GROUND, stated_light

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
@pytest.mark.needs("mitsuba", "llvm")
def test_a_rendered_photo_is_darker_in_shade_and_is_reported(lit_network: Path) -> None:
    (scene,) = _render_scenes(1)
    seen = scene.picture.mean(axis=-1)
    assert seen[scene.ground & scene.lit].mean() > seen[scene.ground & ~scene.lit].mean()
    assert scene.light.sun_irradiance is not None
    report = _format_masks(Model.load(lit_network), [scene])
    assert f"Ground of 1 photos: {scene.kind}" in report
    assert "true mask, true light" in report


SUN = direction(30.0, 20.0)


def truth(turbidity: float, elevation: float = 20.0, balance: tuple[float, ...] = (5.0, 5.0, 5.0)) -> _Truth:
    """A sky of the Prague model in another exposure and white balance."""
    sun = direction(30.0, elevation)
    return _Truth(sun, elevation, prague_radiance(latlong_directions(64)[:32], sun, turbidity) * balance)


def test_exposure_and_white_balance_do_not_count() -> None:
    errors = _compare(truth(6.0, balance=(7.0, 5.0, 3.0)), partial(prague_radiance, turbidity=6.0))
    assert (errors.color, errors.faces) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert errors.brightness < 0.01  # luminance weighs colours that are no longer the same


def test_another_turbidity_counts() -> None:
    near, far = (_compare(truth(6.0), partial(prague_radiance, turbidity=t)) for t in (7.0, 10.0))
    assert 0 < near.brightness < far.brightness
    assert 0 < near.faces < far.faces


def test_the_table_has_a_row_for_each_turbidity_and_the_best_of_each_picture() -> None:
    text = _format_errors([truth(4.0), truth(6.0), truth(6.0, elevation=5.0)])
    assert "Suns at 0 to 10°: 1 pictures" in text
    assert "Suns at 10 to 25°: 2 pictures" in text
    assert "Suns at 25 to 90°" not in text
    assert text.count("Prague, best turbidity of each picture | 0.000 | 0.000 | 0.000 |") == 2
    assert text.count("Hosek-Wilkie, turbidity") == 18


def test_hosek_and_wilkie_have_the_same_ground() -> None:
    up = np.array([[0.0, 1.0, 0.0]])
    assert _hosek_wilkie(up, SUN, 3.0).shape == (1, 3)
    assert _hosek_wilkie(up, SUN, 3.0)[0, 2] > _hosek_wilkie(up, SUN, 3.0)[0, 0]


def toy_features(pictures: list[np.ndarray]) -> np.ndarray:
    return np.array([[p.mean(), p.std(), np.abs(np.diff(p, axis=0)).mean()] for p in pictures])


def test_crops_are_of_as_many_places_as_there_are(data: Path) -> None:
    panoramas = read_index(data)
    places = {p.place for p in panoramas}
    first = _choose_views(panoramas, len(places))
    assert {p.place for p in first} == places
    assert _choose_views(panoramas[::-1], 3) != []


@pytest.mark.slow
def test_the_report_has_a_row_for_each_kind_of_map_and_keeps_what_is_estimated(
    data: Path, lit_network: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("export.reports.map_detail._imagenet_features", lambda: toy_features)
    monkeypatch.setattr("export.reports.map_detail.MAP_ROWS", 192)
    model = Model.load(lit_network)
    report = report_map_detail(data, model, 4, "train", tmp_path / "cache")
    for row in ("| true panorama |", "| without detail |"):
        assert report.count(row) == 2
    kept = sorted((tmp_path / "cache").glob("*.npz"))
    assert len(kept) == 4
    before = [file.stat().st_mtime_ns for file in kept]
    assert report_map_detail(data, model, 4, "train", tmp_path / "cache").split("CPU")[0] == report.split("CPU")[0]
    assert [file.stat().st_mtime_ns for file in kept] == before

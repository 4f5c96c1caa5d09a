"""Whether pixels and metadata contradict each other."""

import numpy as np
import pytest

from lighting.fusion.consistency import _elevation_p_value, _heading_p_value, consistency_warnings
from lighting.fusion.single_view import Observations, fuse, likelihood_by_heading
from lighting.sun_grid import grid_directions
from tests.helpers.predictions import GRID, UNIFORM, grid_prediction, lobe_prediction


def test_the_tail_of_an_elevation_is_that_of_the_lobe() -> None:
    predicted = lobe_prediction(0.0, 45.0, 80.0)  # 6.4 deg of standard deviation an axis, and 4 deg of smoothing
    assert _elevation_p_value(predicted, np.array([45.0])) == pytest.approx(1.0, abs=0.1)
    assert _elevation_p_value(predicted, np.array([45.0 + 7.6])) == pytest.approx(0.317, abs=0.06)
    assert _elevation_p_value(predicted, np.array([5.0])) < 1e-3
    assert _elevation_p_value(predicted, np.array([89.0])) < 1e-3


def test_one_fitting_zone_is_enough() -> None:
    predicted = lobe_prediction(0.0, 45.0, 80.0)
    alone = _elevation_p_value(predicted, np.array([45.0]))
    assert _elevation_p_value(predicted, np.array([2.0, 45.0, 88.0])) == pytest.approx(alone)


def test_tails_of_suns_drawn_from_the_prediction_are_uniform() -> None:
    random = np.random.default_rng(0)
    predicted = lobe_prediction(30.0, 50.0, 15.0)
    drawn = random.choice(len(UNIFORM), 400, p=predicted.sun_probability / predicted.sun_probability.sum())
    elevation = np.degrees(np.arcsin(grid_directions(GRID)[drawn, 1]))
    tails = np.array([_elevation_p_value(predicted, np.array([el])) for el in elevation])
    for level in (0.1, 0.3, 0.5, 0.7, 0.9):
        assert np.mean(tails < level) == pytest.approx(level, abs=0.09)


def test_a_heading_where_the_pixels_see_it_is_no_surprise() -> None:
    density = likelihood_by_heading(lobe_prediction(0.0, 40.0, 80.0), np.array([[40.0, 100.0]]))
    assert _heading_p_value(density, 100.0, 10.0) > 0.9
    assert _heading_p_value(density, 280.0, 10.0) < 1e-3
    assert _heading_p_value(density, 280.0 + 360.0, 10.0) == pytest.approx(_heading_p_value(density, 280.0, 10.0))


def test_a_flat_sky_contradicts_nothing() -> None:
    evidence = Observations(((30.0, 120.0),), heading=77.0, vertical_fov=50.0)
    assert fuse(grid_prediction(UNIFORM), evidence).warnings == ()


def test_every_part_of_the_evidence_has_its_own_sentence() -> None:
    predicted = lobe_prediction(0.0, 60.0, 150.0)
    suns = np.array([[5.0, 100.0]])
    warnings = list(
        consistency_warnings(
            predicted, suns, likelihood_by_heading(lobe_prediction(0.0, 5.0, 150.0), suns), (280.0, 10.0), 12.0
        )
    )
    assert [w.split(" ")[0] for w in warnings] == ["The", "The", "The"]
    assert "elevation by time and place, 5°" in warnings[0]
    assert "heading of 280°" in warnings[1]
    assert "12°" in warnings[2]
    assert warnings[2].endswith("°: check the focal length.")


def test_only_a_lens_that_sees_more_than_the_picture_makes_it_a_crop() -> None:
    (warning,) = consistency_warnings(
        lobe_prediction(0.0, 60.0, 150.0), np.empty((0, 2)), np.empty((0, 360)), None, 120.0, "clip"
    )
    assert warning.endswith("°: it may be cropped.")
    assert warning.code == "lens-contradicted"


def test_each_contradiction_has_its_code() -> None:
    predicted = lobe_prediction(0.0, 60.0, 150.0)
    suns = np.array([[5.0, 100.0]])
    found = consistency_warnings(predicted, suns, likelihood_by_heading(predicted, suns), None, None)
    assert [warning.code for warning in found] == ["elevation-contradicted"]
    suns = np.array([[60.0, 100.0]])
    found = consistency_warnings(predicted, suns, likelihood_by_heading(predicted, suns), (280.0, 10.0), None)
    assert [warning.code for warning in found] == ["heading-contradicted"]


def test_a_sun_of_twilight_is_not_said_to_stand_on_the_horizon() -> None:
    predicted = lobe_prediction(0.0, 60.0, 150.0)
    suns = np.array([[0.0, 100.0]])
    (warning,) = consistency_warnings(predicted, suns, likelihood_by_heading(predicted, suns), None, None)
    assert warning == "The photo contradicts the sun's elevation by time and place, at most 0°: check both."


@pytest.mark.parametrize("seen", [0.0, 3.0, 8.0, 15.0])
def test_a_sun_of_twilight_agrees_with_pixels_that_see_it_low(seen: float) -> None:
    assert fuse(lobe_prediction(0.0, seen, 80.0), Observations(((0.0, 100.0),))).warnings == ()


def test_what_smoothing_puts_below_the_horizon_counts_as_above_it() -> None:
    assert _elevation_p_value(lobe_prediction(0.0, 0.0, 80.0), np.array([5.0])) == pytest.approx(0.98, abs=0.02)


def test_several_zones_are_named_as_a_range() -> None:
    predicted = lobe_prediction(0.0, 80.0, 150.0)
    assert "3 to 12°" in fuse(predicted, Observations(((3.0, 80.0), (12.0, 95.0)))).warnings[0]

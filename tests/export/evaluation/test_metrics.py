"""Tests of metrics."""

from dataclasses import replace

import numpy as np
import pytest

from export.evaluation.fit_constants import _clustered_error
from export.evaluation.metrics import (
    _bootstrap,
    _fov_noticed,
    _horizon_ends,
    _horizon_noticed,
    _recall_area,
    _roll_noticed,
    answers_from_sun,
    auc,
    azimuth_error,
    camera_scores,
    difference_interval,
    elevation_error,
    figures_table,
    format_interval,
    markdown_table,
    select_crops,
    sun_error,
    sun_figures,
)
from export.evaluation.report import _best_constant, _place_figures, _place_weights, _visibility_by_place
from lighting.geometry import Pinhole, angle_between, angles, camera_directions, direction
from tests.helpers.panoramas import said, truth, truth_of


def test_the_area_under_the_recall_of_errors() -> None:
    assert _recall_area(np.zeros(3), 5.0) == pytest.approx(100.0)
    assert _recall_area(np.array([2.5, 7.0]), 5.0) == pytest.approx(25.0)


@pytest.mark.parametrize(("elevation", "roll"), [(0.0, 0.0), (12.0, 0.0), (-8.0, 15.0)])
def test_the_horizon_is_where_the_camera_sees_elevation_zero(elevation: float, roll: float) -> None:
    width, height = 400, 300
    rays = camera_directions(Pinhole(width, height, 60.0, 0.0, elevation, roll))
    ends = _horizon_ends(np.array([[elevation, roll, 60.0]]), np.array([width / height]))[0]
    for column, end in ((0, ends[0]), (width - 1, ends[1])):
        row = int(np.argmin(np.abs(rays[:, column, 1])))
        if 0 < row < height - 1:
            assert 0.5 - (row + 0.5) / height == pytest.approx(end, abs=0.01)


def test_a_perfect_camera_scores_full_marks() -> None:
    known = truth([0.0, 10.0], [20.0, 30.0])
    known = replace(known, camera=np.array([[5.0, 0.0, 50.0], [-5.0, 2.0, 60.0]]))
    scores = camera_scores(known, replace(said([0.0, 10.0], [20.0, 30.0]), camera=known.camera))
    assert scores["elevation AUC 1°"] == pytest.approx(100.0)
    assert scores["horizon AUC"] == pytest.approx(100.0)
    assert scores["horizon off %"] == pytest.approx(0.0)


def test_bootstrap_draws_whole_units() -> None:
    """Crops of one panorama are no independent evidence: a hundred copies of each do not narrow the interval."""
    value = np.random.default_rng(1).normal(0, 1, 30)
    units = np.array([f"u{i}" for i in range(30)])
    once = _bootstrap(units, lambda i: float(value[i].mean()))
    many = np.repeat(value, 100)
    repeated = _bootstrap(np.repeat(units, 100), lambda i: float(many[i].mean()))
    assert once[0] < value.mean() < once[1]
    np.testing.assert_allclose(repeated, once, atol=1e-9)
    assert once[1] - once[0] == pytest.approx(2 * 1.96 / np.sqrt(30), rel=0.3)


def test_difference_interval_is_below_zero_for_the_better() -> None:
    rng = np.random.default_rng(2)
    units = np.repeat([f"u{i}" for i in range(40)], 5)
    worse = rng.uniform(10, 60, 200)
    assert difference_interval(worse - 5, worse, units)[1] < 0
    low, high = difference_interval(rng.permutation(worse), worse, units)
    assert low < 0 < high


def test_errors_cross_the_seam_with_their_sign() -> None:
    t, s = truth([170.0, -170.0], [30.0, 30.0]), said([-170.0, 170.0], [20.0, 45.0])
    np.testing.assert_allclose(azimuth_error(t, s), [20.0, -20.0], atol=1e-9)
    np.testing.assert_allclose(elevation_error(t, s), [-10.0, 15.0], atol=1e-9)


def test_sun_figures_of_four_known_errors() -> None:
    t = truth([0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0])
    figures = sun_figures(t, said([4.0, 8.0, 40.0, 180.0], [0.0, 0.0, 0.0, 0.0]))
    assert figures["median"] == pytest.approx(24.0)
    assert figures["< 22.5° %"] == 50.0
    assert figures["< 45° %"] == 75.0
    assert figures["flips %"] == 25.0
    assert figures["in 50 % region"] == 25.0
    assert figures["in 90 % region"] == 50.0
    assert figures["NLL"] == pytest.approx(1.5)


def test_auc_counts_ties_half() -> None:
    score = np.array([0.1, 0.4, 0.4, 0.9])
    assert auc(score, np.array([False, False, True, True])) == pytest.approx(0.875)
    assert np.isnan(auc(score, np.zeros(4, bool)))


def test_select_keeps_the_chosen_crops_of_every_field() -> None:
    t = truth([0.0, 10.0, 20.0], [0.0, 0.0, 0.0])
    chosen = select_crops(t, np.array([False, True, True]))
    assert chosen.panorama.tolist() == ["p0", "p1"]
    np.testing.assert_allclose(sun_error(chosen, said([0.0, 0.0], [0.0, 0.0])), [10.0, 20.0], atol=1e-9)


def test_a_table_has_a_line_for_each_row() -> None:
    assert markdown_table(["", "a"], [["x", "1"], ["y", "2"]]).splitlines() == [
        "|  | a |",
        "| --- | --- |",
        "| x | 1 |",
        "| y | 2 |",
    ]


@pytest.mark.parametrize(
    ("value", "column", "shown"),
    [(12.34, "median", "12.3"), (12.34, "NLL", "12.34"), (8.0, "crops", "8"), (float("nan"), "median", "-")],
)
def test_a_column_decides_the_decimals(value: float, column: str, shown: str) -> None:
    assert figures_table({"outdoor": {column: value}}).splitlines()[-1] == f"| outdoor | {shown} |"


def test_an_interval_shows_both_ends() -> None:
    assert format_interval((-1.26, 3.0)) == "-1.3 to 3.0"
    assert format_interval((-1.26, 3.0), 2) == "-1.26 to 3.00"


def test_places_that_go_together_make_a_share_less_sure() -> None:
    hit = np.array([True, True, False, False])
    apart, in_pairs = np.array(["a", "b", "c", "d"]), np.array(["a", "a", "b", "b"])
    assert _clustered_error(hit, apart) == pytest.approx(0.25)
    assert _clustered_error(hit, in_pairs) == pytest.approx(0.5**1.5)
    assert _clustered_error(hit, np.array(["a"] * 4)) == pytest.approx(0.0)


def test_the_best_constant_beats_other_constants() -> None:
    elevation = np.array([70.0, 75.0, 80.0])
    suns = direction(np.linspace(-180, 180, 72, endpoint=False)[:, None], elevation)
    best = np.median(angle_between(suns, direction(0.0, _best_constant(elevation))))
    assert all(
        best <= np.median(angle_between(suns, direction(30.0, other))) + 1e-9 for other in (0.0, 40.0, 75.0, 90.0)
    )


PLACES = np.array(["a", "b", "b", "b"])


def test_weights_are_the_same_for_each_place_and_sum_to_one() -> None:
    weights = _place_weights(PLACES)
    assert weights.tolist() == pytest.approx([1 / 2, 1 / 6, 1 / 6, 1 / 6])


def test_an_area_by_weights_is_that_of_crops_which_are_there_so_often() -> None:
    score, positive = np.array([0.9, 0.2, 0.4, 0.3]), np.array([True, True, False, False])
    often = np.array([3, 1, 1, 2])
    again = np.repeat(np.arange(4), often)
    assert auc(score, positive, often.astype(float)) == pytest.approx(auc(score[again], positive[again]))


def test_a_place_of_many_panoramas_counts_as_one_of_few() -> None:
    truth = truth_of(4, elevation=30.0)
    truth.place[:] = np.where(truth.panorama == truth.panorama[0], "small", "large")
    small = truth.place == "small"
    azimuth, elevation = angles(truth.sun)
    said = answers_from_sun(
        direction(azimuth + np.where(small, 60.0, 1.0), elevation), visibility=np.where(small, 0.2, 0.9)
    )
    figures = _place_figures(truth, said, {"low": small})
    assert figures["places"] == 2
    assert figures["< 45° %"] == pytest.approx(50.0)
    assert figures["low"] > 45
    assert figures["low, bias"] == pytest.approx(0.0, abs=1e-6)
    truth.visibility[:] = np.where(small, 0.0, 1.0)
    assert _visibility_by_place(truth, said) == 1.0


@pytest.mark.parametrize(("error", "share"), [(0.0, 50), (0.06, 55), (0.125, 60), (0.31, 75), (-0.31, 75), (2.0, 100)])
def test_horizon_is_noticed_as_in_the_study(error: float, share: float) -> None:
    assert _horizon_noticed(np.array([error])) == pytest.approx([share], abs=1)


@pytest.mark.parametrize(
    ("true", "error", "share"),
    [(0, 1.4, 55), (0, -2.8, 60), (0, 7.1, 75), (11, -3.5, 60), (-11, 8.5, 75), (11, 4.5, 55), (-11, -9.5, 60)],
)
def test_roll_is_noticed_sooner_where_it_makes_a_picture_too_level(true: float, error: float, share: float) -> None:
    assert _roll_noticed(np.array([true]), np.array([true + error])) == pytest.approx([share], abs=1.5)


@pytest.mark.parametrize(
    ("true", "error", "share"),
    [(55, -6.2, 55), (55, -31, 75), (55, 60, 50), (75, -10.7, 55), (75, -54, 75), (75, 30, 55), (75, 59, 60)],
)
def test_fov_is_noticed_where_it_is_too_narrow(true: float, error: float, share: float) -> None:
    assert _fov_noticed(np.array([float(true)]), np.array([true + error])) == pytest.approx([share], abs=1)

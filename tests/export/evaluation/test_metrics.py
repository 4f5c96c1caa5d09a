"""Tests of metrics."""

from dataclasses import replace

import numpy as np
import pytest

from export.data.labels import Label
from export.evaluation.metrics import (
    answers_from_sun,
    auc,
    azimuth_error,
    camera_scores,
    clustered_error,
    difference_interval,
    elevation_error,
    figures_table,
    format_interval,
    horizon_ends,
    markdown_table,
    median_interval,
    select_crops,
    sun_error,
    sun_figures,
)
from export.evaluation.report import CONSTANT, baseline_answers, format_report
from lighting.geometry import Pinhole, angle_between, angles, camera_directions, direction
from tests.helpers.panoramas import said, truth, truth_of


def cameras_score(true: list[float], said: list[float], aspect: float = 1.0) -> dict[str, float]:
    """Scores of one camera by another; elevation, roll and vertical field of view in deg."""
    known = replace(truth([0.0], [20.0]), camera=np.array([true]), aspect=np.array([aspect]))
    return camera_scores(known, answers_from_sun(known.sun, camera=np.array([said])))


def test_the_area_under_the_recall_of_errors() -> None:
    known = replace(truth([0.0, 10.0], [20.0, 20.0]), camera=np.array([[0.0, 0.0, 50.0]] * 2))
    answers = answers_from_sun(known.sun, camera=known.camera + np.array([[2.5, 0.0, 0.0], [7.0, 0.0, 0.0]]))
    scores = camera_scores(known, answers)
    assert scores["roll AUC 5°"] == pytest.approx(100.0)
    assert scores["elevation AUC 5°"] == pytest.approx(25.0)


@pytest.mark.parametrize(("elevation", "roll"), [(12.0, 0.0), (-8.0, 0.0), (-8.0, 15.0), (8.0, 15.0), (8.0, -15.0)])
def test_the_horizon_is_where_the_camera_sees_elevation_zero(elevation: float, roll: float) -> None:
    """That of a level camera crosses the middle of the picture; one that looks up sees it below."""
    width, height = 400, 300
    rays = camera_directions(Pinhole(width, height, 60.0, 0.0, elevation, roll))
    rows = np.array([np.argmin(np.abs(rays[:, column, 1])) for column in (0, width - 1)])
    assert ((rows > 0) & (rows < height - 1)).all()
    ends = 0.5 - (rows + 0.5) / height
    camera, aspect = [elevation, roll, 60.0], width / height
    np.testing.assert_allclose(horizon_ends(np.array([camera]), np.array([aspect])), [ends], atol=0.01)
    scores = cameras_score([0.0, 0.0, 60.0], camera, aspect)
    assert scores["horizon off %"] == pytest.approx(100 * np.abs(ends).max(), abs=1.0)


def test_a_perfect_camera_scores_full_marks() -> None:
    known = truth([0.0, 10.0], [20.0, 30.0])
    known = replace(known, camera=np.array([[5.0, 0.0, 50.0], [-5.0, 2.0, 60.0]]))
    scores = camera_scores(known, replace(said([0.0, 10.0], [20.0, 30.0]), camera=known.camera))
    assert scores["elevation AUC 1°"] == pytest.approx(100.0)
    assert scores["horizon AUC"] == pytest.approx(100.0)
    assert scores["horizon off %"] == pytest.approx(0.0)


def test_bootstrap_draws_whole_units() -> None:
    """Crops of one panorama are no independent evidence: copies of each do not narrow the interval."""
    value = np.random.default_rng(1).normal(0, 1, 101)
    units = np.array([f"u{i}" for i in range(101)])
    once, repeated = median_interval(value, units), median_interval(np.repeat(value, 9), np.repeat(units, 9))
    assert once[0] < np.median(value) < once[1]
    np.testing.assert_allclose(repeated, once, atol=1e-9)
    assert once[1] - once[0] == pytest.approx(2 * 1.96 * np.sqrt(np.pi / 2 / 101), rel=0.3)


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
    assert clustered_error(hit, apart) == pytest.approx(0.25)
    assert clustered_error(hit, in_pairs) == pytest.approx(0.5**1.5)
    assert clustered_error(hit, np.array(["a"] * 4)) == pytest.approx(0.0)


def test_the_best_constant_beats_other_constants() -> None:
    elevation = np.array([70.0, 75.0, 80.0])
    suns = direction(np.linspace(-180, 180, 72, endpoint=False)[:, None], elevation)
    training = [Label("p", sun_azimuth=0.0, sun_elevation=float(e)) for e in elevation]
    constant = baseline_answers(truth([0.0], [0.0]), training)[CONSTANT].sun[0]
    best = np.median(angle_between(suns, constant))
    assert all(
        best <= np.median(angle_between(suns, direction(30.0, other))) + 1e-9 for other in (0.0, 40.0, 75.0, 90.0)
    )


def test_an_area_by_weights_is_that_of_crops_which_are_there_so_often() -> None:
    score, positive = np.array([0.9, 0.2, 0.4, 0.3]), np.array([True, True, False, False])
    often = np.array([3, 1, 1, 2])
    again = np.repeat(np.arange(4), often)
    assert auc(score, positive, often.astype(float)) == pytest.approx(auc(score[again], positive[again]))


def test_a_place_of_many_panoramas_counts_as_one_of_few() -> None:
    truth = truth_of(4, elevation=30.0)
    truth.place[:] = np.where(truth.panorama == truth.panorama[0], "small", "large")
    small = truth.place == "small"
    azimuth = angles(truth.sun)[0]
    truth.sun[small] = direction(azimuth[small], np.full(small.sum(), 10.0))
    said = answers_from_sun(
        direction(azimuth + np.where(small, 60.0, 1.0), np.where(small, 10.0, 30.0)),
        visibility=np.where(small, 0.2, 0.9),
        camera=truth.camera,
    )
    truth.visibility[:] = np.where(small, 0.0, 1.0)
    _, table = format_report("paper", truth, {"ours": said}, {"ours": said}).split("Each place counted alike")
    header, _, row = (line.split(" | ") for line in table.splitlines()[2:5])
    figures = dict(zip(header, row, strict=True))
    assert figures["places"] == "2"
    assert figures["< 45° %"] == "50.0"
    assert float(figures["sun 0 to 20°"]) > 45
    assert figures["sun 0 to 20°, bias"] in ("0.0", "-0.0")
    assert figures["visibility AUC |"] == "1.00 |"


@pytest.mark.parametrize(("error", "share"), [(0.0, 50), (0.06, 55), (0.125, 60), (0.31, 75), (-0.31, 75), (2.0, 100)])
def test_horizon_is_noticed_as_in_the_study(error: float, share: float) -> None:
    focal = 0.5 / np.tan(np.radians(30.0))
    scores = cameras_score([0.0, 0.0, 60.0], [float(np.degrees(np.arctan(error / focal))), 0.0, 60.0])
    assert scores["horizon noticed %"] == pytest.approx(share, abs=1)


@pytest.mark.parametrize(
    ("true", "error", "share"),
    [(0, 1.4, 55), (0, -2.8, 60), (0, 7.1, 75), (11, -3.5, 60), (-11, 8.5, 75), (11, 4.5, 55), (-11, -9.5, 60)],
)
def test_roll_is_noticed_sooner_where_it_makes_a_picture_too_level(true: float, error: float, share: float) -> None:
    scores = cameras_score([0.0, float(true), 60.0], [0.0, true + error, 60.0])
    assert scores["roll noticed %"] == pytest.approx(share, abs=1.5)


@pytest.mark.parametrize(
    ("true", "error", "share"),
    [(55, -6.2, 55), (55, -31, 75), (55, 60, 50), (75, -10.7, 55), (75, -54, 75), (75, 30, 55), (75, 59, 60)],
)
def test_fov_is_noticed_where_it_is_too_narrow(true: float, error: float, share: float) -> None:
    """Of square pictures, whose horizontal field of view is the vertical one."""
    scores = cameras_score([0.0, 0.0, float(true)], [0.0, 0.0, true + error])
    assert scores["fov noticed %"] == pytest.approx(share, abs=1)

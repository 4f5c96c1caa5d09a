"""Tests of baselines."""

import numpy as np
import pytest

from export.evaluation.baselines import _best_constant, _place_weights, place_figures, visibility_by_place
from export.evaluation.metrics import answers_from_sun, auc
from lighting.geometry import angle_between, angles, direction
from tests.helpers.panoramas import truth_of


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
    figures = place_figures(truth, said, {"low": small})
    assert figures["places"] == 2
    assert figures["< 45° %"] == pytest.approx(50.0)
    assert figures["low"] > 45
    assert figures["low, bias"] == pytest.approx(0.0, abs=1e-6)
    truth.visibility[:] = np.where(small, 0.0, 1.0)
    assert visibility_by_place(truth, said) == 1.0

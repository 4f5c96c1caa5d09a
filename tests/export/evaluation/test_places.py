"""Each place counts alike."""

import numpy as np
import pytest

from export.evaluation.metrics import auc
from export.evaluation.places import place_figures, place_weights, visibility_by_place
from export.evaluation.records import answers
from lighting.geometry import angles, direction
from tests.export.evaluation.examples import truth_of

PLACES = np.array(["a", "b", "b", "b"])


def test_weights_are_the_same_for_each_place_and_sum_to_one() -> None:
    weights = place_weights(PLACES)
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
    said = answers(direction(azimuth + np.where(small, 60.0, 1.0), elevation), visibility=np.where(small, 0.2, 0.9))
    figures = place_figures(truth, said, {"low": small})
    assert figures["places"] == 2
    assert figures["< 45° %"] == pytest.approx(50.0)
    assert figures["low"] > 45
    assert figures["low, bias"] == pytest.approx(0.0, abs=1e-6)
    truth.visibility[:] = np.where(small, 0.0, 1.0)
    assert visibility_by_place(truth, said) == 1.0

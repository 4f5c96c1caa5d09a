"""Answers that look at no pixel, which a network has to beat; figures in which each place counts alike."""

import math
from collections.abc import Sequence

import numpy as np

from export.data.labels import Label
from export.evaluation.metrics import (
    Answers,
    Bools,
    Names,
    Truth,
    answers_from_sun,
    auc,
    elevation_error,
    median,
    sun_error,
)
from lighting.geometry import Floats, angle_between, direction
from lighting.sun_grid import weighted_median

CONSTANT = "constant direction"
MIDDLE_CAMERA = (0.0, 0.0, 51.5)  # deg, elevation, roll and vertical field of view in the middle of the paper's ranges


def baseline_answers(truth: Truth, training: Sequence[Label]) -> dict[str, Answers]:
    """Each baseline's answers; the constants are the best for the training panoramas.

    Args:
        truth: of N crops, of which the number alone counts.
        training: labels of the panoramas of `train`.
    """
    count = len(truth.scored)
    elevation = np.array([label.sun_elevation for label in training if math.isfinite(label.sun_elevation)])
    fitted = [label for label in training if label.fit_ok]
    uniform = np.full(count, math.log(2 * math.pi))
    constants = {
        "camera": np.tile(MIDDLE_CAMERA, (count, 1)),
        "visibility": np.zeros(count),
        "turbidity": np.full(count, median(np.array([label.turbidity for label in fitted]))),
        "exposure": np.full(count, median(np.array([label.exposure for label in fitted]))),
    }
    azimuth = np.random.default_rng(0).uniform(-180, 180, count)
    constant = np.tile(direction(0.0, _best_constant(elevation)), (count, 1))
    return {
        CONSTANT: answers_from_sun(constant, nll=uniform, **constants),
        "zenith": answers_from_sun(np.tile([0.0, 1.0, 0.0], (count, 1)), nll=uniform),
        "random azimuth": answers_from_sun(direction(azimuth, np.full(count, median(elevation))), nll=uniform),
    }


def _best_constant(elevation: Floats) -> float:
    """Elevation [deg] of the direction with the least median error to suns at these elevations and any azimuth."""
    azimuth = np.linspace(-180, 180, 72, endpoint=False)
    suns = direction(azimuth[None, :], elevation[:, None])
    candidates = np.arange(0.0, 91.0)
    errors = [np.median(angle_between(suns, direction(0.0, candidate))) for candidate in candidates]
    return float(candidates[int(np.argmin(errors))])


def place_figures(truth: Truth, answers: Answers, heights: dict[str, Bools]) -> dict[str, float]:
    """Sun figures over scored crops by place, and those of each group by its places: deg and %.

    Args:
        truth: of N crops that all have a sun.
        answers: of the same crops.
        heights: (N,) which crops belong to each group of true elevations.
    """
    error, bias, weight = sun_error(truth, answers), elevation_error(truth, answers), _place_weights(truth.place)
    figures = {
        "places": float(len(np.unique(truth.place))),
        "median": weighted_median(error, weight),
        "< 22.5° %": 100 * float(np.sum(weight * (error < 22.5))),
        "< 45° %": 100 * float(np.sum(weight * (error < 45))),
    }
    for name, chosen in heights.items():
        group_weight = _place_weights(truth.place[chosen])
        figures[name] = weighted_median(error[chosen], group_weight)
        figures[f"{name}, bias"] = weighted_median(bias[chosen], group_weight)
    return figures


def visibility_by_place(truth: Truth, answers: Answers) -> float:
    """Area under the ROC curve of direct sunlight, yes against no, over all crops by place.

    Args:
        truth: of N crops.
        answers: of the same crops.
    """
    known = np.isin(truth.visibility, (0.0, 1.0))
    return auc(answers.visibility[known], truth.visibility[known] == 1.0, _place_weights(truth.place[known]))


def _place_weights(places: Names) -> Floats:
    """Weights (N,) of crops that sum to 1, and to the same over each place."""
    _, index, count = np.unique(places, return_inverse=True, return_counts=True)
    return np.asarray(1.0 / (count[index] * max(len(count), 1)))

"""Figures in which each place counts alike, however many panoramas it has: what a photo of a new place may expect."""

import numpy as np

from export.evaluation.metrics import auc, elevation_error, sun_error
from export.evaluation.records import Answers, Bools, Names, Truth
from lighting.geometry import Floats
from lighting.medians import weighted_median


def place_figures(truth: Truth, said: Answers, heights: dict[str, Bools]) -> dict[str, float]:
    """Sun figures over scored crops by place, and those of each group of true elevations (N,) by its own places."""
    error, bias, weight = sun_error(truth, said), elevation_error(truth, said), place_weights(truth.place)
    figures = {
        "places": float(len(np.unique(truth.place))),
        "median": weighted_median(error, weight),
        "< 22.5° %": 100 * float(np.sum(weight * (error < 22.5))),
        "< 45° %": 100 * float(np.sum(weight * (error < 45))),
    }
    for name, chosen in heights.items():
        own = place_weights(truth.place[chosen])
        figures[name] = weighted_median(error[chosen], own)
        figures[f"{name}, bias"] = weighted_median(bias[chosen], own)
    return figures


def visibility_by_place(truth: Truth, said: Answers) -> float:
    """Area under the ROC curve of direct sunlight, yes against no, over all crops by place."""
    known = np.isin(truth.visibility, (0.0, 1.0))
    return auc(said.visibility[known], truth.visibility[known] == 1.0, place_weights(truth.place[known]))


def place_weights(places: Names) -> Floats:
    """Weights (N,) of crops that sum to 1, and to the same over each place."""
    _, index, count = np.unique(places, return_inverse=True, return_counts=True)
    return np.asarray(1.0 / (count[index] * max(len(count), 1)))

"""Answers that look at no pixel: what a network has to beat."""

import math
from collections.abc import Sequence

import numpy as np

from export.data import Label
from export.evaluation.metrics import median
from export.evaluation.records import Answers, Truth, answers
from lighting.geometry import Floats, angle_between, direction

CONSTANT = "constant direction"
MIDDLE_CAMERA = (0.0, 0.0, 51.5)  # deg, elevation, roll and vertical field of view in the middle of the paper's ranges


def without_network(truth: Truth, training: Sequence[Label]) -> dict[str, Answers]:
    """Each baseline's answers; the constants are the best for the training panoramas."""
    count = len(truth.scored)
    elevation = sun_elevations(training)
    fits = [label for label in training if label.fit_ok]
    uniform = np.full(count, math.log(2 * math.pi))
    constants = {
        "camera": np.tile(MIDDLE_CAMERA, (count, 1)),
        "visibility": np.zeros(count),
        "turbidity": np.full(count, median(np.array([label.turbidity for label in fits]))),
        "exposure": np.full(count, median(np.array([label.exposure for label in fits]))),
    }
    azimuth = np.random.default_rng(0).uniform(-180, 180, count)
    constant = np.tile(direction(0.0, best_constant(elevation)), (count, 1))
    return {
        CONSTANT: answers(constant, nll=uniform, **constants),
        "zenith": answers(np.tile([0.0, 1.0, 0.0], (count, 1)), nll=uniform),
        "random azimuth": answers(direction(azimuth, np.full(count, median(elevation))), nll=uniform),
    }


def sun_elevations(labels: Sequence[Label]) -> Floats:
    """Sun elevations [deg] of the panoramas that have a sun."""
    return np.array([label.sun_elevation for label in labels if math.isfinite(label.sun_elevation)])


def best_constant(elevation: Floats) -> float:
    """Elevation [deg] of the direction with the least median error to suns at these elevations and any azimuth."""
    azimuth = np.linspace(-180, 180, 72, endpoint=False)
    suns = direction(azimuth[None, :], elevation[:, None])
    candidates = np.arange(0.0, 91.0)
    errors = [np.median(angle_between(suns, direction(0.0, candidate))) for candidate in candidates]
    return float(candidates[int(np.argmin(errors))])

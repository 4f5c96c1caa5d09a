"""Accuracy figures of answers against the truth, as functions of arrays; angles in deg."""

import numpy as np

from export.evaluation.records import Answers, Bools, Truth
from lighting.geometry import Floats, angle_between, angles, wrap_azimuth

FLIP = 135.0  # deg of azimuth error from which the sun is on the wrong side, front for back


def sun_error(truth: Truth, said: Answers) -> Floats:
    """Angle (N,) between the true and the estimated sun."""
    return angle_between(truth.sun, said.sun)


def azimuth_error(truth: Truth, said: Answers) -> Floats:
    """Signed difference (N,) of azimuth, in (-180, 180]."""
    return wrap_azimuth(angles(said.sun)[0] - angles(truth.sun)[0])


def elevation_error(truth: Truth, said: Answers) -> Floats:
    """Signed difference (N,) of elevation, positive where the estimate is too high."""
    return np.asarray(angles(said.sun)[1] - angles(truth.sun)[1])


def share(condition: Bools) -> float:
    """Percentage of crops for which the condition holds."""
    return float(100 * np.mean(condition)) if len(condition) else float("nan")


def median(value: Floats) -> float:
    """Median of the finite values, NaN if there are none."""
    finite = value[np.isfinite(value)]
    return float(np.median(finite)) if len(finite) else float("nan")


def sun_figures(truth: Truth, said: Answers) -> dict[str, float]:
    """Figures of the sun's direction over crops that all have a sun."""
    error, azimuth, elevation = sun_error(truth, said), azimuth_error(truth, said), elevation_error(truth, said)
    low, high = np.percentile(error, [25, 75]) if len(error) else (float("nan"),) * 2
    return {
        "crops": float(len(error)),
        "median": median(error),
        "quartile 1": float(low),
        "quartile 3": float(high),
        "< 22.5° %": share(error < 22.5),
        "< 45° %": share(error < 45),
        "azimuth": median(np.abs(azimuth)),
        "elevation": median(np.abs(elevation)),
        "elevation bias": median(elevation),
        "flips %": share(np.abs(azimuth) > FLIP),
        "NLL": float(np.mean(said.nll)) if len(error) else float("nan"),
        "in 50 % region": share(error <= said.radius_50) if np.isfinite(said.radius_50).all() else float("nan"),
        "in 90 % region": share(error <= said.radius_90) if np.isfinite(said.radius_90).all() else float("nan"),
    }


def camera_figures(truth: Truth, said: Answers) -> dict[str, float]:
    """Figures of the camera and of the sky over all crops, sun or not."""
    elevation, roll, fov = np.abs(said.camera - truth.camera).T
    sky = np.isfinite(truth.turbidity)
    known = np.isin(truth.visibility, (0.0, 1.0))
    return {
        "crops": float(len(elevation)),
        "elevation": median(elevation),
        "elevation < 5° %": share(elevation < 5),
        "roll": median(roll),
        "fov": median(fov),
        "fov < 10° %": share(fov < 10),
        "visibility AUC": auc(said.visibility[known], truth.visibility[known] == 1.0),
        "turbidity": median(np.abs(said.turbidity - truth.turbidity)[sky]),
        "exposure, stops": median(np.abs(np.log2(said.exposure[sky] / truth.exposure[sky]))),
    }


def auc(score: Floats, positive: Bools, weight: Floats | None = None) -> float:
    """Area under the ROC curve: the chance that a positive scores above a negative, ties counting half.

    Positives and negatives are drawn by the weights (N,) if there are any.
    """
    if not positive.any() or positive.all() or not np.isfinite(score).all():
        return float("nan")
    above = np.sign(score[positive][:, None] - score[~positive][None, :])
    each = None if weight is None else np.outer(weight[positive], weight[~positive])
    return float(np.average(above + 1, weights=each) / 2)

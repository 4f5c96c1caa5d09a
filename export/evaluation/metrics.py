"""Accuracy figures of predictions against the truth, as functions of arrays; angles in deg."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import angle_between, angles, wrap_azimuth

Floats = NDArray[np.floating[Any]]
Bools = NDArray[np.bool_]
Record = TypeVar("Record", "Truth", "Answers")

FLIP = 135.0  # deg of azimuth error from which the sun was put on the wrong side, front for back


@dataclass(frozen=True)
class Truth:
    """What is known about N crops; NaN where it is not."""

    panorama: NDArray[np.str_]  # (N,) name
    place: NDArray[np.str_]
    scored: Bools  # (N,) the sun's direction is known well enough to score
    sun: Floats  # (N, 3)
    camera: Floats  # (N, 3) elevation, roll, vertical field of view
    visibility: Floats  # (N,) 1 direct sun, 0.5 partly, 0 none
    turbidity: Floats  # (N,)
    exposure: Floats  # (N,)
    in_view: NDArray[np.str_]  # (N,) "sun in view", "sky in view" or "no sky"


@dataclass(frozen=True)
class Answers:
    """What one method says about N crops; NaN where it says nothing."""

    sun: Floats  # (N, 3)
    radius_50: Floats  # (N,)
    radius_90: Floats
    nll: Floats  # (N,) negative log density [nat, of 1/sr] at the true sun
    camera: Floats  # (N, 3)
    visibility: Floats
    turbidity: Floats
    exposure: Floats


def select(record: Record, chosen: Bools) -> Record:
    """The record of the chosen crops alone."""
    return type(record)(**{f.name: getattr(record, f.name)[chosen] for f in fields(record)})


def answers(sun: Floats, **given: Floats) -> Answers:
    """Answers of a method that says no more than `given` beside the sun (N, 3)."""
    unknown = np.full(len(sun), np.nan)
    values = {f.name: unknown for f in fields(Answers)} | {"camera": np.full((len(sun), 3), np.nan), "sun": sun}
    return Answers(**(values | given))


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
    """Figures of the sun's direction over crops that all have one."""
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


def auc(score: Floats, positive: Bools) -> float:
    """Area under the ROC curve: the chance that a positive scores above a negative, ties counting half."""
    if not positive.any() or positive.all() or not np.isfinite(score).all():
        return float("nan")
    above = score[positive][:, None] - score[~positive][None, :]
    return float(np.mean(np.sign(above) + 1) / 2)


def bootstrap(
    units: NDArray[np.str_], figure: Callable[[NDArray[np.intp]], float], repeats: int = 2000
) -> tuple[float, float]:
    """95 % interval of `figure(indices)` when whole units (N,), panoramas or places, are drawn with replacement."""
    rng = np.random.default_rng(0)
    members = [np.flatnonzero(units == unit) for unit in np.unique(units)]
    draws = rng.integers(len(members), size=(repeats, len(members)))
    values = [figure(np.concatenate([members[i] for i in draw])) for draw in draws]
    low, high = np.percentile(values, [2.5, 97.5])
    return float(low), float(high)


def median_interval(error: Floats, units: NDArray[np.str_]) -> tuple[float, float]:
    """95 % interval of the median error."""
    return bootstrap(units, lambda i: float(np.median(error[i])))


def difference_interval(ours: Floats, theirs: Floats, units: NDArray[np.str_]) -> tuple[float, float]:
    """95 % interval of our median error less theirs on the same crops; below zero, we are better."""
    return bootstrap(units, lambda i: float(np.median(ours[i]) - np.median(theirs[i])))


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)

"""Errors, AUC, intervals, tables, Truth and Answers.

AUC of errors is as in GeoCalib (Veicht et al., ECCV 2024). The horizon's error and its AUC are as in HLW (Workman et
al., BMVC 2016). That error is the largest distance between the true and the estimated horizon inside the picture, over
its height.

References:
    [1] Hold-Geoffroy et al., A perceptual measure for deep single image camera calibration, CVPR 2018.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats, angle_between, angles, direction, wrap_azimuth
from lighting.prediction import SunEstimate

# What is true of a set of crops, and what a method says about them, as arrays; angles in deg.

Bools = NDArray[np.bool_]
Names = NDArray[np.str_]
Record = TypeVar("Record")  # a dataclass of arrays


@dataclass(frozen=True)
class Truth:
    """The truth about N crops; NaN where it is unknown."""

    panorama: Names  # (N,) name
    place: Names  # (N,) where it was taken; panoramas of one place are not independent
    scored: Bools  # (N,) the sun's direction is known well enough to score
    sun: Floats  # (N, 3)
    camera: Floats  # (N, 3) elevation, roll, vertical field of view
    aspect: Floats  # (N,) width over height
    visibility: Floats  # (N,) 1 direct sun, 0.5 partly, 0 none
    turbidity: Floats  # (N,)
    exposure: Floats  # (N,)
    in_view: Names  # (N,) "sun in view", "sky in view" or "no sky"


@dataclass(frozen=True)
class Answers:
    """The answers of one method for N crops; NaN where it has none."""

    sun: Floats  # (N, 3)
    radius_50: Floats  # (N,)
    radius_90: Floats  # (N,)
    nll: Floats  # (N,) negative log density [nat, of 1/sr] at the true sun
    camera: Floats  # (N, 3) as in Truth
    visibility: Floats  # (N,) probability of direct sun
    turbidity: Floats  # (N,)
    exposure: Floats  # (N,)


def select_crops(record: Record, chosen: Bools | NDArray[np.intp]) -> Record:
    """The same record, of the chosen crops alone.

    Args:
        record: a dataclass of arrays of N crops, such as Truth and Answers.
        chosen: (N,), or the indices of some.
    """
    return type(record)(**{name: values[chosen] for name, values in vars(record).items()})


def answers_from_sun(sun: Floats, **fields_of_answers: Floats) -> Answers:
    """Answers of a method that states the sun, some other fields, and nothing else.

    Args:
        sun: (N, 3) unit vectors.
        fields_of_answers: (N, ...) values of further fields of Answers.
    """
    unknown = np.full(len(sun), np.nan)
    values = {f.name: unknown for f in fields(Answers)} | {"camera": np.full((len(sun), 3), np.nan), "sun": sun}
    return Answers(**(values | fields_of_answers))


def answers_from_estimates(suns: Sequence[SunEstimate], **fields_of_answers: Floats) -> Answers:
    """Answers of a method that states the sun with its radii, some other fields, and nothing else.

    Args:
        suns: N.
        fields_of_answers: (N, ...) values of further fields of Answers.
    """
    sun = direction([s.azimuth for s in suns], [s.elevation for s in suns])
    half, most = np.array([s.radius_50 for s in suns]), np.array([s.radius_90 for s in suns])
    return answers_from_sun(sun, radius_50=half, radius_90=most, **fields_of_answers)


# Accuracy figures of answers against the truth, as functions of arrays; angles in deg.

FLIP = 135.0  # deg of azimuth error from which the sun is on the wrong side, front for back


def sun_error(truth: Truth, answers: Answers) -> Floats:
    """Angle (N,) [deg] between the true and the estimated sun.

    Args:
        truth: of N crops.
        answers: of the same crops.
    """
    return angle_between(truth.sun, answers.sun)


def azimuth_error(truth: Truth, answers: Answers) -> Floats:
    """Signed difference (N,) of azimuth [deg], in (-180, 180].

    Args:
        truth: of N crops.
        answers: of the same crops.
    """
    return wrap_azimuth(angles(answers.sun)[0] - angles(truth.sun)[0])


def elevation_error(truth: Truth, answers: Answers) -> Floats:
    """Signed difference (N,) of elevation [deg], positive where the estimate is too high.

    Args:
        truth: of N crops.
        answers: of the same crops.
    """
    return np.asarray(angles(answers.sun)[1] - angles(truth.sun)[1])


def percentage(condition: Bools) -> float:
    """Percentage of crops for which a condition holds; NaN of none.

    Args:
        condition: (N,).
    """
    return float(100 * np.mean(condition)) if len(condition) else float("nan")


def median(value: Floats) -> float:
    """Median of the finite values, NaN if there are none.

    Args:
        value: (N,).
    """
    finite = value[np.isfinite(value)]
    return float(np.median(finite)) if len(finite) else float("nan")


def sun_figures(truth: Truth, answers: Answers) -> dict[str, float]:
    """Figures of the sun's direction: deg, %, and nat.

    Args:
        truth: of N crops that all have a sun.
        answers: of the same crops.
    """
    error, azimuth, elevation = (of(truth, answers) for of in (sun_error, azimuth_error, elevation_error))
    low, high = np.percentile(error, [25, 75]) if len(error) else (float("nan"),) * 2
    radii = {"in 50 % region": answers.radius_50, "in 90 % region": answers.radius_90}
    return {
        "crops": float(len(error)),
        "median": median(error),
        "quartile 1": float(low),
        "quartile 3": float(high),
        "< 22.5° %": percentage(error < 22.5),
        "< 45° %": percentage(error < 45),
        "azimuth": median(np.abs(azimuth)),
        "elevation": median(np.abs(elevation)),
        "elevation bias": median(elevation),
        "flips %": percentage(np.abs(azimuth) > FLIP),
        "NLL": float(np.mean(answers.nll)) if len(error) else float("nan"),
        **{n: percentage(error <= r) if np.isfinite(r).all() else math.nan for n, r in radii.items()},
    }


def camera_figures(truth: Truth, answers: Answers) -> dict[str, float]:
    """Figures of the camera and of the sky over all crops, sun or not: deg, % and stops.

    Args:
        truth: of N crops.
        answers: of the same crops.
    """
    elevation, roll, fov = np.abs(answers.camera - truth.camera).T
    sky = np.isfinite(truth.turbidity)
    known = np.isin(truth.visibility, (0.0, 1.0))
    return {
        "crops": float(len(elevation)),
        "elevation": median(elevation),
        "elevation < 5° %": percentage(elevation < 5),
        "roll": median(roll),
        "fov": median(fov),
        "fov < 10° %": percentage(fov < 10),
        "visibility AUC": auc(answers.visibility[known], truth.visibility[known] == 1.0),
        "turbidity": median(np.abs(answers.turbidity - truth.turbidity)[sky]),
        "exposure, stops": median(np.abs(np.log2(answers.exposure[sky] / truth.exposure[sky]))),
    }


def auc(score: Floats, positive: Bools, weight: Floats | None = None) -> float:
    """Area under the ROC curve: the chance that a positive scores above a negative, ties counting half.

    Args:
        score: (N,).
        positive: (N,).
        weight: (N,) by which positives and negatives are drawn; None for all alike.
    """
    if not positive.any() or positive.all() or not np.isfinite(score).all():
        return float("nan")
    above = np.sign(score[positive][:, None] - score[~positive][None, :])
    each = None if weight is None else np.outer(weight[positive], weight[~positive])
    return float(np.average(above + 1, weights=each) / 2)


# The camera scored as calibration papers score it: the area under the recall of errors up to a few degrees.

_ANGLES = {"elevation": 0, "roll": 1, "fov": 2}  # columns of a camera
_UP_TO = (1.0, 5.0, 10.0)  # deg
_HORIZON_UP_TO = 0.25  # of the picture's height


def camera_scores(truth: Truth, answers: Answers) -> dict[str, float]:
    """Scores [%] of the camera, the horizon's median error [% of the picture's height], and who notices the errors.

    "Noticed" is the mean share of people who prefer the true value, by a study [1]; 50 is chance.

    Args:
        truth: of N crops.
        answers: of the same crops.
    """
    errors = np.abs(answers.camera - truth.camera)
    areas = [(name, errors[:, column], limit) for name, column in _ANGLES.items() for limit in _UP_TO]
    scores = {f"{name} AUC {limit:g}°": _recall_area(values, limit) for name, values, limit in areas}
    ends, true_ends = (horizon_ends(of.camera, truth.aspect) for of in (answers, truth))
    horizon = np.abs(ends - true_ends).max(axis=1)
    cameras = truth.camera, answers.camera
    return {
        **scores,
        "horizon AUC": _recall_area(horizon, _HORIZON_UP_TO),
        "horizon off %": 100 * median(horizon),
        "horizon noticed %": float(np.mean(_share(_HORIZON_SLOPE * 100 * horizon))),
        "roll noticed %": float(np.mean(_roll_noticed(truth.camera[:, 1], answers.camera[:, 1]))),
        "fov noticed %": float(np.mean(_fov_noticed(*(_horizontal_fov(c, truth.aspect) for c in cameras)))),
    }


def _recall_area(errors: Floats, limit: float) -> float:
    """Area [%] under the share of errors (N,) below a threshold, over thresholds from 0 to `limit`."""
    return float(100 * np.mean(np.clip(1 - errors / limit, 0, 1)))


def _horizontal_fov(camera: Floats, aspect: Floats) -> Floats:
    """Horizontal fields of view (N,) [deg] of cameras (N, 3) whose pictures have the aspect (N,)."""
    return np.asarray(np.degrees(2 * np.arctan(aspect * np.tan(np.radians(camera[:, 2]) / 2))))


def horizon_ends(camera: Floats, aspect: Floats) -> Floats:
    """Heights (N, 2) of the horizon at the picture's left and right edge, in picture heights above its center.

    Args:
        camera: (N, 3) elevation, roll and vertical field of view, deg.
        aspect: (N,) width over height.
    """
    elevation, roll, fov = np.radians(camera).T
    focal = 0.5 / np.tan(fov / 2)
    sides = np.stack([-aspect / 2, aspect / 2], axis=1)
    return np.asarray((np.sin(roll)[:, None] * sides - (focal * np.tan(elevation))[:, None]) / np.cos(roll)[:, None])


# How many people notice a wrong camera in a composite, after a study in which people saw two pictures of an object in a
# photo, one with the true camera and one with another [1]. The share that prefers the true one is 50 % where nobody
# notices and 100 % where all do. Lines are fitted here to the study's shares: each error adds to 50 % in proportion, by
# a slope that depends on the true value.

_HORIZON_SLOPE = 0.8  # % of people for each % of the picture's height, wherever the horizon lies
_LEVEL_ROLL_SLOPE = 3.5  # % of people for each deg, of a camera that is level
_ROLLED = 11.0  # deg, of a rolled camera, whose slopes are:
_TOO_LEVEL_SLOPE, _TOO_ROLLED_SLOPE = 2.8, 1.1  # % of people for each deg
_FOVS = (55.0, 75.0)  # deg, of the horizontal fields of view whose slopes are:
_TOO_NARROW_SLOPES, _TOO_WIDE_SLOPES = (0.81, 0.465), (0.0, 0.17)  # % of people for each deg


def _roll_noticed(true: Floats, estimate: Floats) -> Floats:
    """Share (N,) [%] of people who prefer the true roll, 50 to 100."""
    is_too_level = np.abs(estimate) < np.abs(true)
    rolled = np.where(is_too_level, _TOO_LEVEL_SLOPE, _TOO_ROLLED_SLOPE)
    way = np.clip(np.abs(true) / _ROLLED, 0.0, 1.0)
    slope = _LEVEL_ROLL_SLOPE + way * (rolled - _LEVEL_ROLL_SLOPE)
    return _share(slope * np.abs(estimate - true))


def _fov_noticed(true: Floats, estimate: Floats) -> Floats:
    """Share (N,) [%] of people who prefer the true field of view, 50 to 100."""
    narrow, wide = (np.interp(true, _FOVS, slopes) for slopes in (_TOO_NARROW_SLOPES, _TOO_WIDE_SLOPES))
    return _share(np.where(estimate < true, narrow, wide) * np.abs(estimate - true))


def _share(beyond_chance: Floats) -> Floats:
    """Share (N,) [%] of people who prefer what is true, 50 to 100."""
    return np.asarray(np.clip(50.0 + beyond_chance, 50.0, 100.0))


# Tables in Markdown.

_WITH_TWO = ("temperature", "NLL", "NLL, before", "NLL, after", "visibility AUC")
DECIMALS = dict.fromkeys(("crops", "places", "fitted to"), 0) | dict.fromkeys(_WITH_TWO, 2)  # 1 in all other columns


def markdown_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table.

    Args:
        header: the columns' names.
        rows: cells, as many as columns.
    """
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def figures_table(rows: dict[str, dict[str, float]], digits: int | None = None) -> str:
    """A Markdown table with one row per method or group, one column per figure; "-" where there is none.

    Args:
        rows: figures by column; the first row names the columns.
        digits: decimals of all columns; None for those of DECIMALS.
    """
    columns = list(next(iter(rows.values())))
    places = {column: DECIMALS.get(column, 1) if digits is None else digits for column in columns}
    cells = [
        [name, *(f"{row[c]:.{digits}f}" if math.isfinite(row[c]) else "-" for c, digits in places.items())]
        for name, row in rows.items()
    ]
    return markdown_table(["", *columns], cells)


def format_interval(ends: tuple[float, float], decimals: int = 1) -> str:
    """An interval as the tables show it.

    Args:
        ends: lower and upper.
        decimals: of both.
    """
    return f"{ends[0]:.{decimals}f} to {ends[1]:.{decimals}f}"


# Confidence intervals by bootstrap over whole panoramas or places, whose crops are not independent.

_REPEATS = 2000


def _bootstrap(units: Names, figure: Callable[[NDArray[np.intp]], float]) -> tuple[float, float]:
    """95 % interval of `figure(indices)` when whole units (N,), panoramas or places, are drawn with replacement."""
    rng = np.random.default_rng(0)
    members = [np.flatnonzero(units == unit) for unit in np.unique(units)]
    draws = rng.integers(len(members), size=(_REPEATS, len(members)))
    values = [figure(np.concatenate([members[i] for i in draw])) for draw in draws]
    low, high = np.percentile(values, [2.5, 97.5])
    return float(low), float(high)


def median_interval(error: Floats, units: Names) -> tuple[float, float]:
    """95 % interval of the median error.

    Args:
        error: (N,).
        units: (N,) panoramas or places, which are drawn as a whole.
    """
    return _bootstrap(units, lambda i: float(np.median(error[i])))


def difference_interval(ours: Floats, theirs: Floats, units: Names) -> tuple[float, float]:
    """95 % interval of our median error minus theirs on the same crops; below zero, ours is better.

    Args:
        ours: (N,) errors.
        theirs: (N,) errors.
        units: (N,) panoramas or places, which are drawn as a whole.
    """
    return _bootstrap(units, lambda i: float(np.median(ours[i]) - np.median(theirs[i])))


def clustered_error(values: Floats | Bools, units: Names) -> float:
    """The standard error of a mean.

    Args:
        values: (N,).
        units: (N,) panoramas or places; values of one are not independent.
    """
    _, index = np.unique(units, return_inverse=True)
    return float(np.sqrt(np.sum(np.bincount(index, values - values.mean()) ** 2)) / len(values))

"""Confidence intervals by bootstrap over whole panoramas or places, whose crops are not independent."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from export.evaluation.records import Bools, Names
from lighting.geometry import Floats

REPEATS = 2000


def bootstrap(units: Names, figure: Callable[[NDArray[np.intp]], float]) -> tuple[float, float]:
    """95 % interval of `figure(indices)` when whole units (N,), panoramas or places, are drawn with replacement."""
    rng = np.random.default_rng(0)
    members = [np.flatnonzero(units == unit) for unit in np.unique(units)]
    draws = rng.integers(len(members), size=(REPEATS, len(members)))
    values = [figure(np.concatenate([members[i] for i in draw])) for draw in draws]
    low, high = np.percentile(values, [2.5, 97.5])
    return float(low), float(high)


def median_interval(error: Floats, units: Names) -> tuple[float, float]:
    """95 % interval of the median error."""
    return bootstrap(units, lambda i: float(np.median(error[i])))


def difference_interval(ours: Floats, theirs: Floats, units: Names) -> tuple[float, float]:
    """95 % interval of our median error minus theirs on the same crops; below zero, ours is better."""
    return bootstrap(units, lambda i: float(np.median(ours[i]) - np.median(theirs[i])))


def clustered_error(values: Floats | Bools, places: Names) -> float:
    """The standard error of the mean of values (N,), of which those of one place are not independent."""
    _, index = np.unique(places, return_inverse=True)
    return float(np.sqrt(np.sum(np.bincount(index, values - values.mean()) ** 2)) / len(values))

"""The median of values that count differently."""

import numpy as np

from lighting.geometry import Floats


def weighted_median(value: Floats, weight: Floats) -> float:
    """The least of the values (N,) up to which half of the weight (N,) lies; NaN if there are none."""
    if not len(value):
        return float("nan")
    order = np.argsort(value)
    held = np.cumsum(weight[order]) / weight.sum()
    return float(value[order][np.searchsorted(held, 0.5)])

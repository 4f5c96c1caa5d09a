"""Intervals by bootstrap over whole panoramas."""

import numpy as np
import pytest

from export.evaluation.intervals import bootstrap, difference_interval


def test_bootstrap_draws_whole_units() -> None:
    """Crops of one panorama are no independent evidence: a hundred copies of each do not narrow the interval."""
    value = np.random.default_rng(1).normal(0, 1, 30)
    units = np.array([f"u{i}" for i in range(30)])
    once = bootstrap(units, lambda i: float(value[i].mean()))
    many = np.repeat(value, 100)
    repeated = bootstrap(np.repeat(units, 100), lambda i: float(many[i].mean()))
    assert once[0] < value.mean() < once[1]
    np.testing.assert_allclose(repeated, once, atol=1e-9)
    assert once[1] - once[0] == pytest.approx(2 * 1.96 / np.sqrt(30), rel=0.3)


def test_difference_interval_is_below_zero_for_the_better() -> None:
    rng = np.random.default_rng(2)
    units = np.repeat([f"u{i}" for i in range(40)], 5)
    worse = rng.uniform(10, 60, 200)
    assert difference_interval(worse - 5, worse, units)[1] < 0
    low, high = difference_interval(rng.permutation(worse), worse, units)
    assert low < 0 < high

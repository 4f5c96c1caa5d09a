"""Medians of values that count differently."""

import numpy as np

from lighting.medians import weighted_median


def test_a_weighted_median_is_where_half_of_the_weight_lies() -> None:
    weight = np.array([3.0, 1.0, 1.0, 1.0])
    assert weighted_median(np.array([9.0, 1.0, 2.0, 3.0]), weight) == 3.0
    assert weighted_median(np.array([1.0, 9.0, 8.0, 7.0]), weight) == 1.0
    assert np.isnan(weighted_median(np.empty(0), np.empty(0)))

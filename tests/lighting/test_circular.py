"""Von Mises curves, circular means and modes, the weighted median."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lighting.geometry import wrap_azimuth
from lighting.sun_grid import (
    HEADINGS,
    blur_headings,
    circular_correlation,
    circular_mode,
    heading_from_probability,
    von_mises,
    weighted_median,
)

angles_ = st.floats(0.0, 360.0)


def bell(centre: float, spread: float) -> np.ndarray:
    curve = von_mises(HEADINGS - centre, spread)
    return np.asarray(curve / curve.sum())


def test_a_narrow_von_mises_is_a_normal_curve() -> None:
    offset = np.array([0.0, 2.0, 5.0])
    assert von_mises(offset, 5.0) == pytest.approx(np.exp(-0.5 * (offset / 5.0) ** 2), rel=2e-3)


@given(angles_, st.floats(4.0, 30.0))
def test_a_heading_is_the_middle_of_its_bell(centre: float, spread: float) -> None:
    found = heading_from_probability(bell(centre, spread))
    assert abs(float(wrap_azimuth(found.best - centre))) < 0.5
    assert 0.0 <= found.best < 360.0


def test_radii_of_a_heading_are_the_quantiles_of_its_bell() -> None:
    found = heading_from_probability(bell(123.0, 10.0))
    assert found.radius_50 == pytest.approx(6.745, abs=0.6)
    assert found.radius_90 == pytest.approx(16.45, abs=0.6)


def test_the_stronger_mode_wins_and_the_other_does_not_pull() -> None:
    assert circular_mode(HEADINGS, 0.6 * bell(350.0, 6.0) + 0.4 * bell(170.0, 6.0)) == pytest.approx(-10.0, abs=0.1)


def test_two_blurs_are_one_of_their_hypotenuse() -> None:
    assert blur_headings(bell(50.0, 6.0), 8.0) == pytest.approx(bell(50.0, 10.0), abs=2e-4)


def test_correlation_finds_the_turn_between_two() -> None:
    product = circular_correlation(bell(70.0, 5.0), bell(40.0, 5.0))
    assert product.argmax() == 30
    assert product.sum() == pytest.approx(1.0)


def test_a_weighted_median_is_where_half_of_the_weight_lies() -> None:
    weight = np.array([3.0, 1.0, 1.0, 1.0])
    assert weighted_median(np.array([9.0, 1.0, 2.0, 3.0]), weight) == 3.0
    assert weighted_median(np.array([1.0, 9.0, 8.0, 7.0]), weight) == 1.0
    assert np.isnan(weighted_median(np.empty(0), np.empty(0)))

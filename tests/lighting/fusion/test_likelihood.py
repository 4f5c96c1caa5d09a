"""Distributions rotated, blurred and pooled."""

import numpy as np
import pytest

from lighting.fusion.likelihood import (
    SUN_CORRELATION,
    Correlation,
    _overlap,
    effective_weights,
    elevation_density,
    pool_log_likelihoods,
    pooling_exponent,
    rotate_density,
)
from lighting.fusion.multi_view import _ELEVATION_CORRELATION
from lighting.geometry import Floats, direction
from tests.helpers.predictions import GRID, UNIFORM, grid_prediction, lobe_prediction


def test_a_turned_camera_sees_the_sun_turned_the_other_way() -> None:
    turned = rotate_density(lobe_prediction(50.0, 40.0).sun_probability, 30.0, GRID)
    there = lobe_prediction(20.0, 40.0).sun_probability
    assert np.corrcoef(turned, there)[0, 1] > 0.98


def test_the_elevations_density_is_flat_for_a_flat_sky_and_peaks_at_the_sun() -> None:
    elevation = np.arange(0.0, 91.0, 5.0)
    assert elevation_density(grid_prediction(UNIFORM), elevation) == pytest.approx(1 / (2 * np.pi), rel=1e-5)
    assert elevation[elevation_density(lobe_prediction(10.0, 35.0, 100.0), elevation).argmax()] == 35.0


FOV = np.array([50.0, 50.0, 50.0])


def ahead(*headings: float) -> Floats:
    return direction(np.array(headings), 0.0)


def test_views_that_share_nothing_count_as_the_best_linear_mean_says() -> None:
    """For equal correlations c the weights of the best linear unbiased mean are 1 / (1 + (n - 1) c)."""
    found = effective_weights(ahead(0.0, 120.0, 240.0), FOV, Correlation(0.2, 0.0))
    matrix = np.full((3, 3), 0.2) + 0.8 * np.eye(3)
    assert found == pytest.approx(np.linalg.solve(matrix, np.ones(3)))


def test_one_view_twice_counts_once() -> None:
    found = effective_weights(ahead(0.0, 0.0, 180.0), FOV, Correlation(0.0, 0.0))
    assert found == pytest.approx([0.5, 0.5, 1.0])


def test_the_errors_of_views_correlate_by_the_square_of_what_they_share() -> None:
    """Two views with half in common correlate by a quarter, on top of what views without overlap do."""
    found = effective_weights(ahead(0.0, 31.25), FOV[:2], Correlation(0.2, 0.0))
    assert found == pytest.approx([1 / (1 + 0.2 + 0.8 / 4)] * 2)


def test_the_same_view_under_another_sun_counts_more() -> None:
    same = effective_weights(ahead(0.0, 0.0, 0.0), FOV, SUN_CORRELATION)
    other = effective_weights(ahead(0.0, 0.0, 0.0), FOV, SUN_CORRELATION, np.full((3, 3), 0.2))
    assert (other > same).all()


def test_a_view_that_is_hardly_there_takes_little_from_the_others() -> None:
    found = effective_weights(ahead(0.0, 0.0, 180.0), FOV, Correlation(0.0, 0.0), present=np.array([1.0, 0.1, 1.0]))
    assert found == pytest.approx([1 / 1.1, 0.1 / 2.0, 1.0])


def test_one_view_says_what_it_says_however_often_all_are_misled() -> None:
    density = np.array([1.0, 2.0, 5.0])
    for twice in (1, 2):
        found = pool_log_likelihoods(
            np.log(np.tile(density, (twice, 1))), np.full(twice, 1.0 / twice), Correlation(0.0, 0.3)
        )
        assert found == pytest.approx(density / 8.0)


def test_where_all_may_be_misled_no_number_of_views_makes_the_sun_certain() -> None:
    """Fifty views that count in full leave every cell the share that one view gives it, times the share of cases."""
    density = np.array([1.0, 3.0])
    log = np.log(np.tile(density, (50, 1)))
    assert pool_log_likelihoods(log, np.ones(50), Correlation(0.0, 0.0))[0] < 1e-20
    assert pool_log_likelihoods(log, np.ones(50), Correlation(0.0, 0.1))[0] == pytest.approx(0.1 * 0.25)


def test_cells_count_by_their_area() -> None:
    log = np.log(np.array([[1.0, 1.0], [4.0, 1.0]]))
    found = pool_log_likelihoods(log, np.array([0.5, 0.5]), Correlation(0.0, 0.0), area=np.array([1.0, 3.0]))
    assert found == pytest.approx([0.4, 0.6])


def test_overlap_falls_from_one_to_nothing() -> None:
    found = _overlap(ahead(0.0, 31.25, 62.5), FOV)[0]
    assert found == pytest.approx([1.0, 0.5, 0.0], abs=1e-9)


def test_correlated_photos_count_as_fewer() -> None:
    assert pooling_exponent(1, _ELEVATION_CORRELATION) == 1.0
    assert pooling_exponent(4, 0.0) == 1.0
    assert pooling_exponent(4, 1.0) == 0.25
    assert 8 * pooling_exponent(8, _ELEVATION_CORRELATION) < 1 / _ELEVATION_CORRELATION

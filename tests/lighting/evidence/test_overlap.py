"""How much views count."""

import numpy as np
import pytest

from lighting.evidence.overlap import SUN, Correlation, counts, multiplied, overlap, power
from lighting.evidence.together import ELEVATION_CORRELATION
from lighting.geometry import Floats, direction

FOV = np.array([50.0, 50.0, 50.0])


def ahead(*headings: float) -> Floats:
    return direction(np.array(headings), 0.0)


def test_views_that_share_nothing_count_as_the_best_linear_mean_says() -> None:
    """For equal correlations c the weights of the best linear unbiased mean are 1 / (1 + (n - 1) c)."""
    found = counts(ahead(0.0, 120.0, 240.0), FOV, Correlation(0.2, 0.0))
    matrix = np.full((3, 3), 0.2) + 0.8 * np.eye(3)
    assert found == pytest.approx(np.linalg.solve(matrix, np.ones(3)))


def test_one_view_twice_counts_once() -> None:
    found = counts(ahead(0.0, 0.0, 180.0), FOV, Correlation(0.0, 0.0))
    assert found == pytest.approx([0.5, 0.5, 1.0])


def test_the_errors_of_views_correlate_by_the_square_of_what_they_share() -> None:
    """Two views with half in common correlate by a quarter, on top of what views without overlap do."""
    found = counts(ahead(0.0, 31.25), FOV[:2], Correlation(0.2, 0.0))
    assert found == pytest.approx([1 / (1 + 0.2 + 0.8 / 4)] * 2)


def test_the_same_view_under_another_sun_counts_more() -> None:
    same = counts(ahead(0.0, 0.0, 0.0), FOV, SUN)
    other = counts(ahead(0.0, 0.0, 0.0), FOV, SUN, np.full((3, 3), 0.2))
    assert (other > same).all()


def test_a_view_that_is_hardly_there_takes_little_from_the_others() -> None:
    found = counts(ahead(0.0, 0.0, 180.0), FOV, Correlation(0.0, 0.0), present=np.array([1.0, 0.1, 1.0]))
    assert found == pytest.approx([1 / 1.1, 0.1 / 2.0, 1.0])


def test_one_view_says_what_it_says_however_often_all_are_misled() -> None:
    density = np.array([1.0, 2.0, 5.0])
    for twice in (1, 2):
        found = multiplied(np.log(np.tile(density, (twice, 1))), np.full(twice, 1.0 / twice), Correlation(0.0, 0.3))
        assert found == pytest.approx(density / 8.0)


def test_where_all_may_be_misled_no_number_of_views_makes_the_sun_certain() -> None:
    """Fifty views that count in full leave every cell the share that one view gives it, times the share of cases."""
    density = np.array([1.0, 3.0])
    log = np.log(np.tile(density, (50, 1)))
    assert multiplied(log, np.ones(50), Correlation(0.0, 0.0))[0] < 1e-20
    assert multiplied(log, np.ones(50), Correlation(0.0, 0.1))[0] == pytest.approx(0.1 * 0.25)


def test_cells_count_by_their_area() -> None:
    log = np.log(np.array([[1.0, 1.0], [4.0, 1.0]]))
    found = multiplied(log, np.array([0.5, 0.5]), Correlation(0.0, 0.0), area=np.array([1.0, 3.0]))
    assert found == pytest.approx([0.4, 0.6])


def test_overlap_falls_from_one_to_nothing() -> None:
    found = overlap(ahead(0.0, 31.25, 62.5), FOV)[0]
    assert found == pytest.approx([1.0, 0.5, 0.0], abs=1e-9)


def test_correlated_photos_count_as_fewer() -> None:
    assert power(1, ELEVATION_CORRELATION) == 1.0
    assert power(4, 0.0) == 1.0
    assert power(4, 1.0) == 0.25
    assert 8 * power(8, ELEVATION_CORRELATION) < 1 / ELEVATION_CORRELATION

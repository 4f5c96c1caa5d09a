"""RANSAC and robust least squares, beside wrong matches and gross errors."""

import numpy as np
import pytest

from lighting.registration.robust_fit import least_squares, ransac_rotation
from lighting.registration.rotations import focal_from_fov, rotation_vector
from tests.helpers.cameras import SIZE, matches, relative_rotation

X = np.linspace(-1, 1, 200)
TRUE = np.array([0.4, -1.3])


def test_noise_of_known_size_gives_the_covariance_of_linear_regression() -> None:
    noise = np.random.default_rng(0).normal(0, 0.05, len(X))
    fit = least_squares(lambda p: p[0] + p[1] * X - (TRUE[0] + TRUE[1] * X + noise), np.zeros(2), 0.5)
    design = np.stack([np.ones_like(X), X], axis=1)
    expected = 0.05**2 * np.linalg.inv(design.T @ design)
    assert fit.parameters == pytest.approx(TRUE, abs=0.02)
    assert np.sqrt(np.diag(fit.covariance)) == pytest.approx(np.sqrt(np.diag(expected)), rel=0.15)


def test_a_fifth_of_gross_errors_moves_it_little() -> None:
    values = TRUE[0] + TRUE[1] * X
    values[::5] += 10.0
    fit = least_squares(lambda p: p[0] + p[1] * X - values, np.array([0.0, 0.0]), 0.1)
    assert fit.parameters == pytest.approx(TRUE, abs=0.02)


def test_a_prior_holds_what_the_data_leave_open() -> None:
    """Its inverse variance of 4 is in units of residuals of variance 1, so that the spread is a half."""
    values = TRUE[0] + np.random.default_rng(0).normal(0, 0.05, 50)
    fit = least_squares(lambda p: p[0] + 0.0 * p[1] - values, np.array([0.0, 2.0]), 0.1, np.array([0.0, 4.0]))
    assert fit.parameters == pytest.approx([TRUE[0], 2.0], abs=0.02)
    assert fit.covariance[1, 1] == pytest.approx(0.25, rel=0.01)


FIRST, SECOND = (0.0, 5.0, 2.0), (-28.0, 1.0, -1.0)


@pytest.mark.parametrize("wrong", [0.0, 0.5])
def test_the_rotation_is_found_among_wrong_matches(wrong: float) -> None:
    focal = focal_from_fov(50.0, *SIZE)
    result = ransac_rotation(matches(FIRST, SECOND, 50.0, near=300.0, wrong=wrong), (focal, focal), [0.8, 1.0, 1.25])
    assert result.zoom == 1.0
    assert np.degrees(np.linalg.norm(rotation_vector(result.rotation @ relative_rotation(FIRST, SECOND).T))) < 1.0


def test_the_same_matches_give_the_same_answer() -> None:
    matched = matches(FIRST, SECOND, 50.0, near=300.0, wrong=0.5)
    first, second = (ransac_rotation(matched, (1.2, 1.2), [0.9, 1.0, 1.1]) for _ in range(2))
    assert (first.rotation == second.rotation).all()


def test_a_strong_prior_keeps_a_parameter_where_it_is_expected() -> None:
    prior, expected = np.array([1e12, 0.0]), np.array([0.0, 0.0])
    fit = least_squares(lambda p: p[0] + p[1] * X - (TRUE[0] + TRUE[1] * X), np.zeros(2), 1.0, prior, expected)
    assert fit.parameters == pytest.approx([0.0, TRUE[1]], abs=0.02)
    assert fit.covariance[0, 0] < 1e-9


def test_residuals_at_the_answer_are_returned() -> None:
    fit = least_squares(lambda p: p[0] + p[1] * X - (TRUE[0] + TRUE[1] * X), np.zeros(2), 1.0)
    assert np.abs(fit.residuals).max() < 1e-6

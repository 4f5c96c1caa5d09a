"""The shares of people who notice, against figures of the study."""

import numpy as np
import pytest

from export.evaluation.perception import fov_noticed, horizon_noticed, roll_noticed


@pytest.mark.parametrize(("error", "share"), [(0.0, 50), (0.06, 55), (0.125, 60), (0.31, 75), (-0.31, 75), (2.0, 100)])
def test_horizon_is_noticed_as_in_the_study(error: float, share: float) -> None:
    assert horizon_noticed(np.array([error])) == pytest.approx([share], abs=1)


@pytest.mark.parametrize(
    ("true", "error", "share"),
    [(0, 1.4, 55), (0, -2.8, 60), (0, 7.1, 75), (11, -3.5, 60), (-11, 8.5, 75), (11, 4.5, 55), (-11, -9.5, 60)],
)
def test_roll_is_noticed_sooner_where_it_makes_a_picture_too_level(true: float, error: float, share: float) -> None:
    assert roll_noticed(np.array([true]), np.array([true + error])) == pytest.approx([share], abs=1.5)


@pytest.mark.parametrize(
    ("true", "error", "share"),
    [(55, -6.2, 55), (55, -31, 75), (55, 60, 50), (75, -10.7, 55), (75, -54, 75), (75, 30, 55), (75, 59, 60)],
)
def test_fov_is_noticed_where_it_is_too_narrow(true: float, error: float, share: float) -> None:
    assert fov_noticed(np.array([float(true)]), np.array([true + error])) == pytest.approx([share], abs=1)

"""Figures of errors that are known."""

import numpy as np
import pytest

from export.evaluation.metrics import auc, azimuth_error, elevation_error, sun_figures
from tests.export.evaluation.examples import said, truth


def test_errors_cross_the_seam_with_their_sign() -> None:
    t, s = truth([170.0, -170.0], [30.0, 30.0]), said([-170.0, 170.0], [20.0, 45.0])
    np.testing.assert_allclose(azimuth_error(t, s), [20.0, -20.0], atol=1e-9)
    np.testing.assert_allclose(elevation_error(t, s), [-10.0, 15.0], atol=1e-9)


def test_sun_figures_of_four_known_errors() -> None:
    t = truth([0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0])
    figures = sun_figures(t, said([4.0, 8.0, 40.0, 180.0], [0.0, 0.0, 0.0, 0.0]))
    assert figures["median"] == pytest.approx(24.0)
    assert figures["< 22.5° %"] == 50.0
    assert figures["< 45° %"] == 75.0
    assert figures["flips %"] == 25.0
    assert figures["in 50 % region"] == 25.0
    assert figures["in 90 % region"] == 50.0
    assert figures["NLL"] == pytest.approx(1.5)


def test_auc_counts_ties_half() -> None:
    score = np.array([0.1, 0.4, 0.4, 0.9])
    assert auc(score, np.array([False, False, True, True])) == pytest.approx(0.875)
    assert np.isnan(auc(score, np.zeros(4, bool)))

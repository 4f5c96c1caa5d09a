"""Correlation of errors."""

import numpy as np
import pytest

from export.evaluation.correlation import CORRELATIONS, correlation_report
from tests.export.evaluation.examples import AZIMUTH, EACH, erring, truth_of


@pytest.mark.slow
@pytest.mark.parametrize(("shared", "expected"), [(False, CORRELATIONS[0]), (True, 1.0)])
def test_the_correlation_of_errors_is_found(shared: bool, expected: float) -> None:
    truth = truth_of(8)
    report = correlation_report(truth, erring(truth, shared), np.tile(AZIMUTH, 8), EACH)
    learnt = [float(cell) for cell in report.splitlines()[-1].split("|")[3:6]]
    assert learnt == pytest.approx([expected] * 3, abs=0.3)

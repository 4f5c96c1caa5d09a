"""Tests of multi view."""

import numpy as np
import pytest

from export.evaluation.metadata import simulate_metadata
from export.evaluation.multi_view import CORRELATIONS, _correlation_report, _group_crops, groups_report
from tests.helpers.panoramas import AZIMUTH, EACH, erring, truth_of


@pytest.mark.slow
@pytest.mark.parametrize(("shared", "expected"), [(False, CORRELATIONS[0]), (True, 1.0)])
def test_the_correlation_of_errors_is_found(shared: bool, expected: float) -> None:
    truth = truth_of(8)
    report = _correlation_report(truth, erring(truth, shared), np.tile(AZIMUTH, 8), EACH)
    correlations = [float(cell) for cell in report.splitlines()[-1].split("|")[3:6]]
    assert correlations == pytest.approx([expected] * 3, abs=0.3)


@pytest.mark.parametrize("size", [1, 2, 4, 8])
def test_every_scored_crop_is_dealt_once_with_its_own_panorama(size: int) -> None:
    truth = truth_of(3)
    truth.scored[:EACH] = False
    groups = _group_crops(truth, EACH, size)
    assert sorted(np.concatenate(groups)) == list(range(EACH, 3 * EACH))
    assert all(len(g) == size and len({*truth.panorama[g]}) == 1 for g in groups)


@pytest.mark.slow
def test_more_views_find_the_sun_better() -> None:
    truth = truth_of(2)
    azimuth = np.tile(AZIMUTH, 2)
    report = groups_report("paper", truth, erring(truth, shared=False), simulate_metadata(truth, EACH), azimuth, EACH)
    rows = {cells[1].strip(): cells[2:] for line in report.splitlines() if len(cells := line.split("|")) > 5}
    error = {name: float(cells[1]) for name, cells in rows.items() if "headings" in name}
    assert error["8, headings known"] < error["2, headings known"]
    assert error["8, headings known, time+place"] < error["8, headings known"]
    assert float(rows["8, headings known, time+place"][2]) == 0.0

"""Views of one panorama taken together, and how far their errors correlate."""

import numpy as np
import pytest

from export.evaluation.correlation import CORRELATIONS, correlation_report
from export.evaluation.groups import groups_of, groups_report
from export.evaluation.metrics import Truth
from export.evaluation.simulated_metadata import take_metadata
from lighting.geometry import angles
from lighting.records import Prediction
from tests.export.evaluation.test_simulated_metadata import EACH, truth_of
from tests.lighting.evidence.test_fusion import lobe

AZIMUTH = np.arange(0, 360, 360 / EACH)  # of a panorama's cameras
SPREAD = 10.46  # deg an axis, of a lobe of concentration 30


def erring(truth: Truth, shared: bool) -> list[Prediction]:
    """Calibrated networks, whose errors are independent or common to a panorama."""
    if shared:
        panorama = np.arange(len(truth.sun)) // EACH
        noise = SPREAD * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])[panorama % 4]
    else:
        noise = np.random.default_rng(1).normal(0, SPREAD, (len(truth.sun), 2))
    azimuth, elevation = angles(truth.sun)
    stretch = np.cos(np.radians(elevation))
    return [
        lobe(a + da / c, e + de, 30.0) for a, e, c, (da, de) in zip(azimuth, elevation, stretch, noise, strict=True)
    ]


@pytest.mark.parametrize("size", [1, 2, 4, 8])
def test_every_scored_crop_is_dealt_once_with_its_own_panorama(size: int) -> None:
    truth = truth_of(3)
    truth.scored[:EACH] = False
    groups = groups_of(truth, EACH, size)
    assert sorted(np.concatenate([g.members for g in groups])) == list(range(EACH, 3 * EACH))
    assert all(len(g.members) == size and len({*truth.panorama[g.members]}) == 1 for g in groups)


@pytest.mark.slow
def test_more_views_find_the_sun_better() -> None:
    truth = truth_of(2)
    azimuth = np.tile(AZIMUTH, 2)
    report = groups_report("paper", truth, erring(truth, shared=False), take_metadata(truth, EACH), azimuth, EACH)
    rows = {cells[1].strip(): cells[2:] for line in report.splitlines() if len(cells := line.split("|")) > 5}
    error = {name: float(cells[1]) for name, cells in rows.items() if "headings" in name}
    assert error["8, headings known"] < error["2, headings known"]
    assert error["8, headings known, time+place"] < error["8, headings known"]
    assert float(rows["8, headings known, time+place"][2]) == 0.0


@pytest.mark.slow
@pytest.mark.parametrize(("shared", "expected"), [(False, CORRELATIONS[0]), (True, 1.0)])
def test_the_correlation_of_errors_is_found(shared: bool, expected: float) -> None:
    truth = truth_of(8)
    report = correlation_report(truth, erring(truth, shared), np.tile(AZIMUTH, 8), EACH)
    learnt = [float(cell) for cell in report.splitlines()[-1].split("|")[3:6]]
    assert learnt == pytest.approx([expected] * 3, abs=0.3)

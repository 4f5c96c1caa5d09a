"""Several crops of one panorama taken together."""

import numpy as np
import pytest

from export.evaluation.groups import groups_of, groups_report
from export.evaluation.simulated_metadata import take_metadata
from tests.export.evaluation.examples import AZIMUTH, EACH, erring, truth_of


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

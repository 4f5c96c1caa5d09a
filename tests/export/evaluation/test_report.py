"""The tables of the report."""

import numpy as np

from export.evaluation.records import answers
from export.evaluation.report import bins, in_view_report, intervals_table, report
from lighting.geometry import angles, direction
from tests.export.evaluation.examples import truth_of


def turned(by: float) -> np.ndarray:
    azimuth, elevation = angles(truth_of(4).sun)
    return direction(azimuth + by, elevation)


def test_each_crop_is_in_one_bin_of_elevation_and_one_of_view() -> None:
    truth = truth_of(4, elevation=45.0)
    found = bins(truth)
    assert list(found) == ["sun 45 to 90°", "sky in view"]  # empty bins are left out; a bin begins at its lower end
    assert all(chosen.all() for chosen in found.values())


def test_intervals_compare_ours_with_each_other_method() -> None:
    truth = truth_of(4)
    said = {"ours": answers(turned(10.0)), "worse": answers(turned(40.0))}
    ours, worse = intervals_table(truth, said, "ours").splitlines()[2:]
    assert ours.split(" | ")[3] == ""
    low, high = (float(end) for end in worse.split(" | ")[3].split(" to "))
    assert low <= high < 0  # ours has the smaller error


def test_a_protocol_counts_its_crops_and_names_every_method() -> None:
    truth = truth_of(4)
    camera = {"camera": truth.camera, "exposure": truth.exposure}
    said = {"ours": answers(turned(10.0), **camera), "other": answers(turned(40.0))}
    alone = {"ours": said["ours"]}
    text = report("paper", truth, said, alone, "ours")
    assert "## Protocol `paper`: 32 crops, 32 with a sun to score (4 panoramas of 2 places)" in text
    assert sum(line.startswith("| other |") for line in text.splitlines()) == 3  # it says nothing of the camera
    assert sum(line.startswith("| ours |") for line in text.splitlines()) > 4
    assert "by the networks alone, without the straight lines" in text
    assert "32 crops of 4 panoramas" in in_view_report(truth, said, "| what metadata add |")

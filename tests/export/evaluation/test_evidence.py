"""The table of every subset of the evidence, and the share of warnings."""

import numpy as np
import pytest

from export.evaluation.evidence import SUBSETS, evidence_report, in_view_evidence, warning_shares
from export.evaluation.records import Truth
from export.evaluation.simulated_metadata import take_metadata
from lighting.geometry import angles, direction
from lighting.records import Prediction
from tests.export.evaluation.examples import EACH, truth_of
from tests.lighting.evidence.test_fusion import lobe


def seeing(truth: Truth, off: float = 0.0, concentration: float = 60.0) -> list[Prediction]:
    """Networks that put each sun `off` [deg] too high."""
    azimuth, elevation = angles(truth.sun)
    return [lobe(float(a), float(e) + off, concentration) for a, e in zip(azimuth, elevation, strict=True)]


def twice(said: list[Prediction]) -> list[tuple[Prediction, Prediction]]:
    """Networks that say the same of a camera whose lens is known."""
    return list(zip(said, said, strict=True))


def test_all_subsets_of_the_evidence_are_there() -> None:
    plain = {s for s in SUBSETS if "local time+place" not in s}
    assert len(plain) == len(SUBSETS) - 2 == 8
    assert max(plain, key=len) == ("time+place", "heading", "focal length")


def test_time_and_place_correct_an_elevation_that_is_too_high() -> None:
    truth = truth_of(2)
    report = evidence_report("paper", truth, twice(seeing(truth, off=12.0)), take_metadata(truth, EACH))
    rows = {cells[1].strip(): cells[2:] for line in report.splitlines() if len(cells := line.split("|")) > 5}
    columns = [name.strip() for name in rows[""]]
    elevation, heading = columns.index("elevation"), columns.index("heading")
    assert float(rows["pixels"][elevation]) == pytest.approx(12.0, abs=1.0)
    assert float(rows["pixels + time+place"][elevation]) == 0.0
    assert rows["pixels + heading"] == rows["pixels"]
    assert rows["pixels"][heading].strip() == "-"
    assert float(rows["pixels + time+place"][heading]) < 2.0
    assert "95 % interval" in report


def test_sharp_pixels_find_out_false_records_and_pass_true_ones() -> None:
    truth = truth_of(4)
    high = np.arange(len(truth.sun)) % (2 * EACH) < EACH
    truth.sun[high] = truth_of(4, 75.0).sun[high]
    shares = warning_shares(truth, seeing(truth, concentration=300.0), take_metadata(truth, EACH))
    assert [row["true"] for row in shares.values()] == [0.0, 0.0, 0.0, 0.0]
    assert [row["false"] for row in shares.values()] == pytest.approx([100.0, 100.0, 100.0, 100.0], abs=10.0)


def test_a_seen_sun_moves_with_the_lens_only_where_the_picture_is_white() -> None:
    """The focal length is told; the network's own is 50 deg, the true one another."""
    truth = truth_of(2, 15.0)
    truth.sun[:] = direction(20.0, 15.0)
    truth.camera[:] = (2.0, 0.0, 65.0)
    said = twice([lobe(20.0, 15.0, 300.0)] * len(truth.sun))
    rows = {}
    for name, level in (("grey", 120), ("white", 255)):
        pictures = [np.full((300, 400, 3), level, np.uint8)] * len(said)
        table = in_view_evidence(truth, said, pictures)
        rows[name] = [float(line.split("|")[2]) for line in table.splitlines() if "focal length" in line]
    assert rows["grey"][0] < 1.0 < 3.0 < rows["white"][0]


def test_gravity_tells_the_camera_of_crops_that_show_the_sun() -> None:
    truth = truth_of(2, 15.0)
    truth.camera[:] = (9.0, 0.0, 50.0)  # the networks say 2 deg
    white = [np.full((300, 400, 3), 255, np.uint8)] * len(truth.sun)
    table = in_view_evidence(truth, twice([lobe(20.0, 15.0, 300.0)] * len(truth.sun)), white)
    tilt = {cells[1].strip(): float(cells[3]) for line in table.splitlines()[2:] if (cells := line.split("|"))}
    assert tilt["pixels"] > 4.0
    assert tilt["pixels + gravity"] < 2.0

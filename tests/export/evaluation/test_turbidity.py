"""The network's turbidity against a constant, on skies whose turbidity is known."""

from dataclasses import replace

import numpy as np
import pytest

from export.evaluation.records import answers
from export.evaluation.turbidity import turbidity_report
from tests.export.evaluation.examples import EACH, truth_of


@pytest.mark.slow
def test_errors_and_intervals_by_kind_of_panorama() -> None:
    truth = replace(truth_of(6), turbidity=np.repeat([2.0, 4.0, 2.0, 4.0, 2.0, np.nan], EACH))
    ours = answers(truth.sun, turbidity=truth.turbidity + 0.25)
    constant = answers(truth.sun, turbidity=np.full(len(truth.sun), 3.5))
    kind = np.repeat(["hdr", "hdr", "ldr", "ldr", "ldr", "ldr"], EACH)
    text = turbidity_report("paper", truth, ours, constant, kind)
    rows = {
        cells[1].strip(): [c.strip() for c in cells[2:-1]]
        for line in text.splitlines()
        if "|" in line and (cells := line.split("|"))
    }
    assert rows["HDR"] == ["16", "2", "1", "0.25", "1.00", "-1.25 to -0.25", "-0.75 to -0.75"]
    assert rows["LDR, clean sky"][:5] == ["24", "3", "2", "0.25", "1.50"]
    assert rows["both"][:5] == ["40", "5", "3", "0.25", "1.50"]


@pytest.mark.slow
def test_kinds_without_a_known_sky_have_no_row() -> None:
    truth = truth_of(1)
    said = answers(truth.sun, turbidity=truth.turbidity)
    text = turbidity_report("paper", truth, said, said, np.full(EACH, "ldr"))
    assert "| LDR, clean sky | 8 |" in text
    assert "HDR |" not in text

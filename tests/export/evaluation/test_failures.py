"""The worst crops and their causes."""

import csv
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from export.evaluation.failures import CAUSES, MOST_EACH, WORST, failures_report, worst, write_failures
from tests.export.evaluation.examples import EACH, FAILURE, off_by, truth_of


@pytest.mark.parametrize(
    ("change", "cause"),
    [
        ({}, "confident and wrong"),
        ({"azimuth_error": 100.0, "in_view": "no sky", "direct": "no", "radius_50": 60.0}, "no sky"),
        ({"direct": "partly", "radius_50": 60.0}, "sun not shining"),
        ({"direct": "no", "azimuth_error": 170.0}, "sun not shining"),
        ({"direct": "", "azimuth_error": -170.0}, "front-back flip"),
        ({"radius_50": 60.0, "azimuth_error": 170.0}, "wide distribution"),
        ({"sun": (-80.0, 40.0), "azimuth_error": 130.0}, "confident and wrong"),
        ({"sun": (-60.0, 40.0), "said": (65.0, 45.0), "azimuth_error": 125.0}, "left-right mirror"),
        ({"azimuth_error": -5.0, "elevation_error": 50.0}, "elevation alone"),
    ],
)
def test_the_first_rule_that_holds_names_the_cause(change: dict[str, object], cause: str) -> None:
    said = {"said": (50.0, 10.0)} | change
    assert replace(FAILURE, **said).cause == cause  # type: ignore[arg-type]


def test_the_worst_come_first_few_of_each_panorama_and_none_unscored() -> None:
    truth = truth_of(30)
    truth.scored[:EACH] = False
    error = np.linspace(170, 1, len(truth.sun))
    found = worst(truth, off_by(truth, error))
    assert len(found) == WORST
    assert found[0].index == EACH
    assert [f.index % EACH for f in found[:4]] == [0, 1, 2, 0]
    assert max(Counter(f.panorama for f in found).values()) == MOST_EACH
    assert [f.error for f in found] == sorted((f.error for f in found), reverse=True)
    assert found[0].azimuth_error == pytest.approx(error[EACH])
    assert found[0].elevation_error == pytest.approx(0, abs=1e-9)
    assert found[0].direct == "yes"


def test_a_sun_that_is_not_known_to_shine_says_nothing() -> None:
    truth = replace(truth_of(1), visibility=np.array([np.nan, 0.5, 0, 1, 1, 1, 1, 1]))
    found = worst(truth, off_by(truth, np.linspace(170, 100, EACH)))
    assert [f.direct for f in found] == ["", "partly", "no"]


def test_the_report_counts_every_cause_and_the_flips() -> None:
    found = [
        replace(FAILURE, error=151.0, azimuth_error=170.0),
        replace(FAILURE, direct="no", azimuth_error=-160.0),
        replace(FAILURE, direct="no", panorama="p1"),
    ]
    text = failures_report(found)
    rows = {
        cells[1].strip(): [c.strip() for c in cells[3:-1]]
        for line in text.splitlines()
        if len(cells := line.split("|")) > 4
    }
    assert {name: rows[name] for name in CAUSES if rows[name] != ["0", "0"]} == {
        "sun not shining": ["2", "2"],
        "front-back flip": ["1", "1"],
    }
    words = " ".join(text.split())
    assert "The 3 worst crops" in words
    assert "(2 panoramas): sun errors of 60 to 151°" in words
    assert "In 2 of them, whatever the cause, the sun is on the wrong side" in words


def test_the_file_has_a_line_a_failure(tmp_path: Path) -> None:
    write_failures(tmp_path / "f.csv", [replace(FAILURE, index=2)], np.array([0.0, 0.0, -33.25]))
    with (tmp_path / "f.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert row == {
        "panorama": "p0",
        "azimuth": "-33.2",
        "error": "60.0",
        "azimuth_error": "80.0",
        "elevation_error": "0.0",
        "in_view": "sky in view",
        "direct": "yes",
        "cause": "confident and wrong",
    }

"""Tests of failures."""

import csv
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from export.crops.crops import Camera, Source
from export.data.labels import Label
from export.data.panoramas import Panorama
from export.evaluation.baselines import CONSTANT
from export.evaluation.failures import (
    ACROSS,
    CAUSES,
    ESTIMATE_COLOR,
    MAX_EACH,
    MAX_FAILURES,
    RELIABILITY_FILE,
    THUMBNAIL,
    TRUE_COLOR,
    ScoredCrops,
    _contact_sheet,
    _failures_report,
    _turbidity_report,
    _worst_crops,
    _write_failures,
    diagnostic_sections,
)
from export.evaluation.metrics import answers_from_sun
from export.evaluation.predictions import decode_answers
from tests.helpers.panoramas import EACH, FAILURE, erring, off_by, truth_of


def test_the_sheet_shows_each_picture_with_both_suns() -> None:
    grey = np.full((30, 40, 3), 128, np.uint8)
    failures = [replace(FAILURE, sun=(90.0, 0.0), estimate=(-90.0, 0.0))] * (ACROSS + 1)
    whole = _contact_sheet(failures, [grey] * len(failures))
    assert whole.width == ACROSS * (THUMBNAIL[0] + 4)
    assert whole.height == 2 * _contact_sheet(failures[:1], [grey]).height
    first = np.asarray(whole)[: THUMBNAIL[1], : THUMBNAIL[0]]
    assert (first[5, 5] == 128).all()
    middle = {c: np.argwhere((first == c).all(axis=-1)).mean(axis=0) for c in (TRUE_COLOR, ESTIMATE_COLOR)}
    assert middle[TRUE_COLOR][1] > middle[ESTIMATE_COLOR][1] + 40
    assert middle[TRUE_COLOR][0] == pytest.approx(middle[ESTIMATE_COLOR][0], abs=1)


LABEL = Label("p", 0.0, 40.0, 2.0, "given", 0.0, 40.0, 3.0, 0.5, 0.1, True, "yes")


def scored_crops() -> ScoredCrops:
    truth = truth_of(4)
    predictions = erring(truth, shared=False)
    answers = decode_answers(predictions, truth.sun)
    grey = np.full((64, 128, 3), 100, np.uint8)
    sources = [Source(Panorama(n, Path(n), "ldr", n, "val"), (grey,), LABEL) for n in ("p0", "p1", "p2", "p3")]
    views = [(source, Camera(45.0 * i, 0.0, 0.0, 50.0, 4 / 3)) for source in sources for i in range(EACH)]
    return ScoredCrops(
        views, truth, predictions, predictions, {"outdoor": answers, CONSTANT: answers}, {"outdoor": answers}
    )


def test_both_protocols_get_reliability_and_temperature_and_paper_the_rest(tmp_path: Path) -> None:
    one = scored_crops()
    assert one.ours == "outdoor"
    sections = diagnostic_sections({"paper": one, "phone": one}, tmp_path, failures=False)
    titles = [section.splitlines()[0].removeprefix("## ").split(",")[0] for section in sections]
    assert titles[0] == titles[1] == "Reliability of the sun's distribution"
    assert titles[2:] == ["Temperature", "Temperature", "Turbidity", "Where it fails"]
    assert [path.name for path in tmp_path.iterdir()] == [RELIABILITY_FILE]


def test_the_worst_crops_are_written_only_when_asked_for(tmp_path: Path) -> None:
    diagnostic_sections({"paper": scored_crops()}, tmp_path, failures=True)
    with Image.open(tmp_path / "failures.png") as sheet:
        assert sheet.width == ACROSS * (THUMBNAIL[0] + 4)
    assert {path.name for path in tmp_path.iterdir()} == {RELIABILITY_FILE, "failures.csv", "failures.png"}


def test_without_a_sun_to_score_there_is_nothing_to_say(tmp_path: Path) -> None:
    assert diagnostic_sections({}, tmp_path, failures=True) == []
    assert list(tmp_path.iterdir()) == []


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
        ({"sun": (-60.0, 40.0), "estimate": (65.0, 45.0), "azimuth_error": 125.0}, "left-right mirror"),
        ({"azimuth_error": -5.0, "elevation_error": 50.0}, "elevation alone"),
    ],
)
def test_the_first_rule_that_holds_names_the_cause(change: dict[str, object], cause: str) -> None:
    answers = {"estimate": (50.0, 10.0)} | change
    assert replace(FAILURE, **answers).cause == cause  # type: ignore[arg-type]


def test_the_worst_come_first_few_of_each_panorama_and_none_unscored() -> None:
    truth = truth_of(30)
    truth.scored[:EACH] = False
    error = np.linspace(170, 1, len(truth.sun))
    failures = _worst_crops(truth, off_by(truth, error))
    assert len(failures) == MAX_FAILURES
    assert failures[0].index == EACH
    assert [f.index % EACH for f in failures[:4]] == [0, 1, 2, 0]
    assert max(Counter(f.panorama for f in failures).values()) == MAX_EACH
    assert [f.error for f in failures] == sorted((f.error for f in failures), reverse=True)
    assert failures[0].azimuth_error == pytest.approx(error[EACH])
    assert failures[0].elevation_error == pytest.approx(0, abs=1e-9)
    assert failures[0].direct == "yes"


def test_a_sun_that_is_not_known_to_shine_says_nothing() -> None:
    truth = replace(truth_of(1), visibility=np.array([np.nan, 0.5, 0, 1, 1, 1, 1, 1]))
    failures = _worst_crops(truth, off_by(truth, np.linspace(170, 100, EACH)))
    assert [f.direct for f in failures] == ["", "partly", "no"]


def test_the_report_counts_every_cause_and_the_flips() -> None:
    failures = [
        replace(FAILURE, error=151.0, azimuth_error=170.0),
        replace(FAILURE, direct="no", azimuth_error=-160.0),
        replace(FAILURE, direct="no", panorama="p1"),
    ]
    text = _failures_report(failures)
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
    _write_failures(tmp_path / "f.csv", [replace(FAILURE, index=2)], np.array([0.0, 0.0, -33.25]))
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


@pytest.mark.slow
def test_errors_and_intervals_by_kind_of_panorama() -> None:
    truth = replace(truth_of(6), turbidity=np.repeat([2.0, 4.0, 2.0, 4.0, 2.0, np.nan], EACH))
    ours = answers_from_sun(truth.sun, turbidity=truth.turbidity + 0.25)
    constant = answers_from_sun(truth.sun, turbidity=np.full(len(truth.sun), 3.5))
    kind = np.repeat(["hdr", "hdr", "ldr", "ldr", "ldr", "ldr"], EACH)
    text = _turbidity_report("paper", truth, ours, constant, kind)
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
    answers = answers_from_sun(truth.sun, turbidity=truth.turbidity)
    text = _turbidity_report("paper", truth, answers, answers, np.full(EACH, "ldr"))
    assert "| LDR, clean sky | 8 |" in text
    assert "HDR |" not in text

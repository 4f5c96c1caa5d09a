"""The sections about reliability, turbidity and the worst crops."""

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
from export.evaluation.evaluate import RELIABILITY_FILE, diagnostic_sections
from export.evaluation.failures import (
    CAUSES,
    MAX_EACH,
    MAX_FAILURES,
    draw_contact_sheet,
    failures_report,
    find_worst_crops,
    write_failures,
)
from export.evaluation.metrics import Truth, answers_from_sun, select_crops
from export.evaluation.predictions import ScoredCrops, decode_answers
from export.evaluation.reliability import (
    CONE,
    DENSEST,
    draw_reliability,
    reliability_curves,
    reliability_report,
    temperature_report,
)
from export.evaluation.report import CONSTANT, turbidity_report
from lighting.decoding import sun_from_prediction
from lighting.geometry import angle_between, direction
from lighting.prediction import Prediction
from lighting.sun_grid import grid_directions, temper
from tests.helpers.panoramas import EACH, FAILURE, drawn, erring, off_by, rings, truth_of
from tests.helpers.predictions import UNIFORM, grid_prediction, lobe_prediction


def test_the_sheet_shows_each_picture_with_both_suns(tmp_path: Path) -> None:
    grey = np.full((30, 40, 3), 128, np.uint8)
    failures = [replace(FAILURE, sun=(90.0, 40.0), estimate=(-90.0, 40.0))] * 6
    draw_contact_sheet(failures, [grey] * len(failures), tmp_path / "sheet.png")
    with Image.open(tmp_path / "sheet.png") as sheet:
        whole = np.asarray(sheet.convert("RGB"))
    assert whole.shape[1] == 2.5 * whole.shape[0]  # two rows of five
    assert (whole == 128).all(axis=-1).mean() > 0.3
    true, estimate = (np.argwhere((whole == color).all(axis=-1)) for color in ((255, 215, 0), (31, 119, 180)))
    assert len(true) == pytest.approx(len(estimate), rel=0.2)
    assert true[:, 1].max() > estimate[:, 1].max() + 10  # the true sun lies to the right
    assert true[:, 0].mean() == pytest.approx(estimate[:, 0].mean(), abs=1)


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
        assert sheet.format == "PNG"
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
    failures = find_worst_crops(truth, off_by(truth, error))
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
    failures = find_worst_crops(truth, off_by(truth, np.linspace(170, 100, EACH)))
    assert [f.direct for f in failures] == ["", "partly", "no"]


def test_the_report_counts_every_cause_and_the_flips() -> None:
    failures = [
        replace(FAILURE, error=151.0, azimuth_error=170.0),
        replace(FAILURE, direct="no", azimuth_error=-160.0),
        replace(FAILURE, direct="no", panorama="p1"),
    ]
    text = failures_report(failures)
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


@pytest.mark.slow
def test_errors_and_intervals_by_kind_of_panorama() -> None:
    truth = replace(truth_of(6), turbidity=np.repeat([2.0, 4.0, 2.0, 4.0, 2.0, np.nan], EACH))
    ours = answers_from_sun(truth.sun, turbidity=truth.turbidity + 0.25)
    constant = answers_from_sun(truth.sun, turbidity=np.full(len(truth.sun), 3.5))
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
    answers = answers_from_sun(truth.sun, turbidity=truth.turbidity)
    text = turbidity_report("paper", truth, answers, answers, np.full(EACH, "ldr"))
    assert "| LDR, clean sky | 8 |" in text
    assert "HDR |" not in text


def truth_at(sun: np.ndarray) -> Truth:
    """Scored crops with these suns (N, 3)."""
    truth = select_crops(truth_of(-(-len(sun) // EACH)), np.arange(len(sun)))
    return replace(truth, sun=sun)


def densest(sun: np.ndarray, predictions: list[Prediction]) -> np.ndarray:
    """Probability (N,) of the region of highest density that reaches each sun."""
    return reliability_curves(truth_at(sun), predictions)[DENSEST]


def shares(sun: np.ndarray, predictions: list[Prediction]) -> np.ndarray:
    """Share [%] of the suns inside the regions of 25, 50 and 75 %, by the table."""
    (row,) = (
        line
        for line in reliability_report("paper", {DENSEST: densest(sun, predictions)}).splitlines()
        if DENSEST in line[:6]
    )
    return np.array([float(cell) for cell in row.split("|")[4:7]])


def test_the_densest_cells_come_first_whatever_their_size() -> None:
    found = densest(grid_directions("rings:2x2"), [rings(0.4, 0.1, 0.2, 0.3)] * 4)
    np.testing.assert_allclose(found, [0.5 + 0.2, 0.9 + 0.05, 0.3 + 0.1, 0.15], atol=1e-6)


def test_a_uniform_sky_says_the_same_of_every_sun() -> None:
    found = densest(direction([0.0, 90.0, -50.0], [5.0, 40.0, 80.0]), [grid_prediction(UNIFORM)] * 3)
    np.testing.assert_allclose(found, 0.5, atol=1e-6)


def test_honest_distributions_lie_on_the_diagonal() -> None:
    predictions, sun = drawn(400, 40.0)
    np.testing.assert_allclose(shares(sun, predictions), (25, 50, 75), atol=6)


@pytest.mark.parametrize(("claimed", "sign"), [(160.0, -1), (10.0, 1)])
def test_those_too_sure_lie_below_it_and_timid_ones_above(claimed: float, sign: int) -> None:
    _, sun = drawn(400, 40.0)
    predictions, _ = drawn(400, claimed)
    assert (sign * (shares(sun, predictions) - (25, 50, 75)) > 10).all()


def test_cones_are_those_of_the_reported_radii() -> None:
    predictions, sun = drawn(60, 8.0)
    answers = [sun_from_prediction(p) for p in predictions]
    error = angle_between(sun, direction([a.azimuth for a in answers], [a.elevation for a in answers]))
    levels = reliability_curves(truth_at(sun), predictions)[CONE]
    np.testing.assert_array_equal(levels <= 0.5, error <= [a.radius_50 for a in answers])
    np.testing.assert_array_equal(levels <= 0.9, error <= [a.radius_90 for a in answers])


def test_crops_that_are_not_scored_count_nowhere() -> None:
    truth = truth_of(2)
    truth.scored[:EACH] = False
    truth.in_view[EACH:] = ["no sky"] * 2 + ["sky in view"] * 6
    found = reliability_curves(truth, [lobe_prediction(0.0, 40.0)] * (2 * EACH))
    assert {name: len(levels) for name, levels in found.items()} == {
        DENSEST: 8,
        "sun 20 to 45°": 8,
        "sky in view": 6,
        "no sky": 2,
        CONE: 8,
    }


@pytest.mark.slow
def test_the_table_sets_found_beside_expected(tmp_path: Path) -> None:
    levels = (np.arange(100) + 0.5) / 100
    text = reliability_report("paper", {DENSEST: levels, CONE: levels / 2})
    rows = {cells[1].strip(): cells[2:-1] for line in text.splitlines() if len(cells := line.split("|")) > 5}
    assert [float(cell) for cell in rows[DENSEST]] == [100, 10, 25, 50, 75, 90, 95, 0]
    assert [float(cell) for cell in rows[CONE]] == [100, 20, 50, 100, 100, 100, 100, 50]
    draw_reliability({"paper": {DENSEST: levels}, "phone": {DENSEST: levels, "no sky": levels}}, tmp_path / "r.png")
    with Image.open(tmp_path / "r.png") as picture:
        assert picture.width > 500
        assert len(picture.convert("RGB").getcolors(1 << 20) or []) > 20


def tempered(prediction: Prediction, temperature: float) -> Prediction:
    """The prediction with its sun's logits divided by a temperature."""
    return replace(prediction, sun_probability=temper(prediction.sun_probability, temperature))


def fitted_temperature(predictions: list[Prediction], sun: np.ndarray) -> float:
    """What the table says of all places."""
    lines = temperature_report("paper", truth_at(sun), predictions).splitlines()
    (row,) = (line for line in lines if line.startswith("| all |"))
    return float(row.split("|")[3])


@pytest.mark.parametrize("temperature", [0.6, 1.0, 1.7])
def test_the_temperature_that_was_taken_away_is_found_again(temperature: float) -> None:
    predictions, sun = drawn(300, 30.0)
    assert fitted_temperature([tempered(p, 1 / temperature) for p in predictions], sun) == pytest.approx(
        temperature, rel=0.1
    )


def test_an_impossible_sun_costs_much_but_not_everything() -> None:
    predictions = [grid_prediction(np.r_[1.0, np.zeros(1023)])]
    assert np.isfinite(fitted_temperature(predictions, np.array([[0.0, -1.0, 0.0]])))


@pytest.mark.slow
def test_each_half_is_fit_temperature_on_its_own_places_and_measured_on_the_others() -> None:
    truth = truth_of(8)
    sharp = [tempered(p, 0.5) for p in erring(truth, shared=False)]
    text = temperature_report("paper", truth, sharp)
    header, _, *lines = [line for line in text.splitlines() if line.startswith("|")]
    columns = [cell.strip() for cell in header.split("|")[1:-1]]
    rows = [dict(zip(columns, (c.strip() for c in line.split("|")[1:-1]), strict=True)) for line in lines]
    assert [row[""] for row in rows] == ["half A", "half B", "all"]
    assert [int(row["fitted to"]) for row in rows] == [4 * EACH, 4 * EACH, 8 * EACH]
    assert [int(row["crops"]) for row in rows] == [4 * EACH, 4 * EACH, 8 * EACH]
    for row in rows:
        assert float(row["temperature"]) == pytest.approx(2.0, rel=0.35)
        assert float(row["NLL, after"]) < float(row["NLL, before"])
        assert float(row["in 50 %, after"]) > float(row["in 50 %, before"])


def test_one_place_alone_has_no_other_half() -> None:
    truth = truth_of(2)
    text = temperature_report("paper", truth, [lobe_prediction(0.0, 40.0)] * len(truth.sun))
    assert "half A" not in text
    assert "| all | 16 |" in text

"""Tests of reliability."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from export.evaluation.reliability import (
    CONE,
    DENSEST,
    _cone_level,
    _density_levels,
    _fit_temperature,
    _inside,
    _tempered,
    draw_reliability,
    reliability_curves,
    reliability_report,
    temperature_report,
)
from lighting.decoding import sun_from_prediction
from lighting.geometry import angle_between, direction
from lighting.sun_grid import grid_directions
from tests.helpers.panoramas import EACH, drawn, erring, rings, truth_of
from tests.helpers.predictions import UNIFORM, grid_prediction, lobe_prediction


def test_the_densest_cells_come_first_whatever_their_size() -> None:
    found = _density_levels([rings(0.4, 0.1, 0.2, 0.3)] * 4, grid_directions("rings:2x2"))
    np.testing.assert_allclose(found, [0.5 + 0.2, 0.9 + 0.05, 0.3 + 0.1, 0.15], atol=1e-6)


def test_a_uniform_sky_says_the_same_of_every_sun() -> None:
    found = _density_levels([grid_prediction(UNIFORM)] * 3, direction([0.0, 90.0, -50.0], [5.0, 40.0, 80.0]))
    np.testing.assert_allclose(found, 0.5, atol=1e-6)


def test_honest_distributions_lie_on_the_diagonal() -> None:
    predictions, sun = drawn(400, 40.0)
    np.testing.assert_allclose(_inside(_density_levels(predictions, sun), (25, 50, 75)), (25, 50, 75), atol=6)


@pytest.mark.parametrize(("claimed", "sign"), [(160.0, -1), (10.0, 1)])
def test_those_too_sure_lie_below_it_and_timid_ones_above(claimed: float, sign: int) -> None:
    _, sun = drawn(400, 40.0)
    predictions, _ = drawn(400, claimed)
    assert (sign * (_inside(_density_levels(predictions, sun), (25, 50, 75)) - (25, 50, 75)) > 10).all()


def test_cones_are_those_of_the_reported_radii() -> None:
    predictions, sun = drawn(60, 8.0)
    answers = [sun_from_prediction(p) for p in predictions]
    error = angle_between(sun, direction([a.azimuth for a in answers], [a.elevation for a in answers]))
    levels = np.array([_cone_level(p, s) for p, s in zip(predictions, sun, strict=True)])
    np.testing.assert_array_equal(levels <= 0.5, error <= [a.radius_50 for a in answers])
    np.testing.assert_array_equal(levels <= 0.9, error <= [a.radius_90 for a in answers])


def test_shares_are_counted() -> None:
    np.testing.assert_allclose(_inside(np.array([0.05, 0.1, 0.5, 0.96]), (5, 10, 50, 95, 100)), [25, 50, 75, 75, 100])


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


def test_tempering_is_a_power_that_sums_to_one() -> None:
    predictions = grid_prediction(np.array([0.64, 0.16, 0.16, 0.04]))
    np.testing.assert_allclose(
        _tempered(predictions, 2.0).sun_probability, [0.8 / 1.8, 0.4 / 1.8, 0.4 / 1.8, 0.2 / 1.8], 1e-6
    )
    np.testing.assert_allclose(_tempered(predictions, 1.0).sun_probability, predictions.sun_probability, 1e-6)


@pytest.mark.parametrize("temperature", [0.6, 1.0, 1.7])
def test_the_temperature_that_was_taken_away_is_found_again(temperature: float) -> None:
    predictions, sun = drawn(300, 30.0)
    assert _fit_temperature([_tempered(p, 1 / temperature) for p in predictions], sun) == pytest.approx(
        temperature, rel=0.1
    )


def test_an_impossible_sun_costs_much_but_not_everything() -> None:
    predictions = [grid_prediction(np.r_[1.0, np.zeros(1023)])]
    assert np.isfinite(_fit_temperature(predictions, np.array([[0.0, -1.0, 0.0]])))


@pytest.mark.slow
def test_each_half_is_fit_temperature_on_its_own_places_and_measured_on_the_others() -> None:
    truth = truth_of(8)
    sharp = [_tempered(p, 0.5) for p in erring(truth, shared=False)]
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

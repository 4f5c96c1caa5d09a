"""Regions that hold a given probability, and how many true suns lie in them."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from export.evaluation.reliability import (
    CONE,
    DENSEST,
    cone_levels,
    curves,
    density_levels,
    draw,
    inside,
    reliability_report,
)
from lighting.decoding import sun_of
from lighting.geometry import angle_between, direction
from lighting.sun_grid import grid_directions
from tests.export.evaluation.examples import EACH, drawn, rings, truth_of
from tests.lighting.evidence.test_fusion import UNIFORM, lobe, prediction


def test_the_densest_cells_come_first_whatever_their_size() -> None:
    found = density_levels([rings(0.4, 0.1, 0.2, 0.3)] * 4, grid_directions("rings:2x2"))
    np.testing.assert_allclose(found, [0.5 + 0.2, 0.9 + 0.05, 0.3 + 0.1, 0.15], atol=1e-6)


def test_a_uniform_sky_says_the_same_of_every_sun() -> None:
    found = density_levels([prediction(UNIFORM)] * 3, direction([0.0, 90.0, -50.0], [5.0, 40.0, 80.0]))
    np.testing.assert_allclose(found, 0.5, atol=1e-6)


def test_honest_distributions_lie_on_the_diagonal() -> None:
    said, sun = drawn(400, 40.0)
    np.testing.assert_allclose(inside(density_levels(said, sun), (25, 50, 75)), (25, 50, 75), atol=6)


@pytest.mark.parametrize(("claimed", "sign"), [(160.0, -1), (10.0, 1)])
def test_those_too_sure_lie_below_it_and_timid_ones_above(claimed: float, sign: int) -> None:
    _, sun = drawn(400, 40.0)
    said, _ = drawn(400, claimed)
    assert (sign * (inside(density_levels(said, sun), (25, 50, 75)) - (25, 50, 75)) > 10).all()


def test_cones_are_those_of_the_reported_radii() -> None:
    said, sun = drawn(60, 8.0)
    answers = [sun_of(p) for p in said]
    error = angle_between(sun, direction([a.azimuth for a in answers], [a.elevation for a in answers]))
    levels = cone_levels(said, sun)
    np.testing.assert_array_equal(levels <= 0.5, error <= [a.radius_50 for a in answers])
    np.testing.assert_array_equal(levels <= 0.9, error <= [a.radius_90 for a in answers])


def test_shares_are_counted() -> None:
    np.testing.assert_allclose(inside(np.array([0.05, 0.1, 0.5, 0.96]), (5, 10, 50, 95, 100)), [25, 50, 75, 75, 100])


def test_crops_that_are_not_scored_count_nowhere() -> None:
    truth = truth_of(2)
    truth.scored[:EACH] = False
    truth.in_view[EACH:] = ["no sky"] * 2 + ["sky in view"] * 6
    found = curves(truth, [lobe(0.0, 40.0)] * (2 * EACH))
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
    draw({"paper": {DENSEST: levels}, "phone": {DENSEST: levels, "no sky": levels}}, tmp_path / "r.png")
    with Image.open(tmp_path / "r.png") as picture:
        assert picture.width > 500
        assert len(picture.convert("RGB").getcolors(1 << 20) or []) > 20

"""Temperatures found again in distributions that were sharpened or flattened on purpose."""

import numpy as np
import pytest

from export.evaluation.temperature import fitted, temperature_report, tempered
from tests.export.evaluation.examples import EACH, drawn, erring, truth_of
from tests.lighting.evidence.test_fusion import lobe, prediction


def test_tempering_is_a_power_that_sums_to_one() -> None:
    said = prediction(np.array([0.64, 0.16, 0.16, 0.04]))
    np.testing.assert_allclose(tempered(said, 2.0).sun_probability, [0.8 / 1.8, 0.4 / 1.8, 0.4 / 1.8, 0.2 / 1.8], 1e-6)
    np.testing.assert_allclose(tempered(said, 1.0).sun_probability, said.sun_probability, 1e-6)


@pytest.mark.parametrize("temperature", [0.6, 1.0, 1.7])
def test_the_temperature_that_was_taken_away_is_found_again(temperature: float) -> None:
    said, sun = drawn(300, 30.0)
    assert fitted([tempered(p, 1 / temperature) for p in said], sun) == pytest.approx(temperature, rel=0.1)


def test_an_impossible_sun_costs_much_but_not_everything() -> None:
    said = [prediction(np.r_[1.0, np.zeros(1023)])]
    assert np.isfinite(fitted(said, np.array([[0.0, -1.0, 0.0]])))


@pytest.mark.slow
def test_each_half_is_fitted_on_its_own_places_and_measured_on_the_others() -> None:
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
    text = temperature_report("paper", truth, [lobe(0.0, 40.0)] * len(truth.sun))
    assert "half A" not in text
    assert "| all | 16 |" in text

"""How far a sun's colour goes to a clear sun's."""

from pathlib import Path

import numpy as np
import pytest

from export.evaluation import sun_colour as module
from export.evaluation.sun_colour import Sun, errors, sun_colour_report
from lighting.model import Model

CYAN, WHITE, SKY = np.array([2.2, 3.0, 3.3]), np.full(3, 3.0), np.full(3, 0.5)


def sun(place: str, true: np.ndarray, elevation: float = 60.0, *, unclipped: bool = False) -> Sun:
    """A sun that is said to be cyan."""
    return Sun(place, true, CYAN, true * np.sin(np.radians(elevation)) + SKY, SKY, elevation, unclipped)


def test_a_white_sun_that_is_said_to_be_cyan_errs_the_less_the_nearer_it_comes_to_white() -> None:
    found = [errors([sun("a", WHITE)], power) for power in (0.0, 0.5, 1.0)]
    assert found[0][0] > found[1][0] > found[2][0] == pytest.approx(0.0, abs=1e-4)
    assert found[0][1] > found[1][1] > found[2][1] == pytest.approx(0.0, abs=1e-4)


def test_places_count_alike() -> None:
    right, wrong = sun("a", CYAN), sun("b", WHITE)
    assert errors([right, right, right, wrong], 0.0) == pytest.approx(errors([wrong], 0.0) / 2)


def test_the_report_has_a_row_for_each_power(monkeypatch: pytest.MonkeyPatch, lit_network: Path) -> None:
    monkeypatch.setattr(module, "judged", lambda *given: given[-1])
    monkeypatch.setattr(module, "suns_of", lambda _, part: [sun("a", CYAN if part == "train" else WHITE)])
    report = sun_colour_report(Model.load(lit_network), Path("data"), Path("labels.csv"))
    assert report.startswith("Error of colour in 1 crops of `train`, 1 crops of `val`")
    assert "| 0 | 0.0\N{DEGREE SIGN} / 0.0\N{DEGREE SIGN} | " in report
    assert report.count("\n| 0") == len(module.POWERS)


def test_suns_known_to_be_unclipped_stand_once_more(monkeypatch: pytest.MonkeyPatch, lit_network: Path) -> None:
    monkeypatch.setattr(module, "judged", lambda *given: given[-1])
    monkeypatch.setattr(module, "suns_of", lambda *_: [sun("a", WHITE), sun("b", CYAN, unclipped=True)])
    report = sun_colour_report(Model.load(lit_network), Path("data"), Path("labels.csv"))
    assert "2 crops of `train`, 1 crops of `train, unclipped`, 2 crops of `val`" in report
    assert report.splitlines()[4].split("|")[3].strip() == "0.0\N{DEGREE SIGN} / 0.0\N{DEGREE SIGN}"

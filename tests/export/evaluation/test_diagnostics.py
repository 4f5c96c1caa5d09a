"""The sections after the figures."""

from pathlib import Path

import numpy as np

from export.crops import Camera, Source
from export.data import Label, Panorama
from export.evaluation.baselines import CONSTANT
from export.evaluation.diagnostics import PICTURE, Judged, diagnostic_sections
from export.evaluation.views import interpret
from tests.export.evaluation.examples import EACH, erring, truth_of

LABEL = Label("p", 0.0, 40.0, 2.0, "given", 0.0, 40.0, 3.0, 0.5, 0.1, True, "yes")


def judged() -> Judged:
    truth = truth_of(4)
    predictions = erring(truth, shared=False)
    said = interpret(predictions, truth.sun)
    grey = np.full((64, 128, 3), 100, np.uint8)
    sources = [Source(Panorama(n, Path(n), "ldr", n, "val"), (grey,), LABEL) for n in ("p0", "p1", "p2", "p3")]
    views = [(source, Camera(45.0 * i, 0.0, 0.0, 50.0, 4 / 3)) for source in sources for i in range(EACH)]
    return Judged(views, truth, predictions, predictions, {"outdoor": said, CONSTANT: said}, {"outdoor": said})


def test_both_protocols_get_reliability_and_temperature_and_paper_the_rest(tmp_path: Path) -> None:
    one = judged()
    assert one.ours == "outdoor"
    sections = diagnostic_sections({"paper": one, "phone": one}, tmp_path, failures=False)
    titles = [section.splitlines()[0].removeprefix("## ").split(",")[0] for section in sections]
    assert titles[0] == titles[1] == "Reliability of the sun's distribution"
    assert titles[2:] == ["Temperature", "Temperature", "Turbidity", "Where it fails"]
    assert [path.name for path in tmp_path.iterdir()] == [PICTURE]


def test_the_worst_crops_are_written_only_when_asked_for(tmp_path: Path) -> None:
    diagnostic_sections({"paper": judged()}, tmp_path, failures=True)
    assert {path.name for path in tmp_path.iterdir()} == {PICTURE, "failures.csv", "failures.png"}


def test_without_a_sun_to_score_there_is_nothing_to_say(tmp_path: Path) -> None:
    assert diagnostic_sections({}, tmp_path, failures=True) == []
    assert list(tmp_path.iterdir()) == []

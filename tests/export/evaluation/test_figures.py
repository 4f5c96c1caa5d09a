"""The figures that the service returns are those of the report."""

import json
from pathlib import Path

import numpy as np

from export.evaluation.figures import stated_figures, write_figures
from export.evaluation.metrics import camera_figures, sun_figures
from export.evaluation.records import answers
from lighting.geometry import direction
from tests.conftest import TINY
from tests.export.evaluation.examples import truth_of


def test_figures_are_rounded_as_the_tables_show_them(tmp_path: Path) -> None:
    truth = truth_of(2)
    count = len(truth.sun)
    ones = np.ones(count)
    said = answers(
        direction(np.linspace(-170, 170, count), np.full(count, 33.3)),
        radius_50=40 * ones,
        radius_90=90 * ones,
        nll=ones,
        camera=truth.camera + 1.23,
        visibility=ones,
        turbidity=4.56 * ones,
        exposure=0.3 * ones,
    )
    stated = stated_figures(truth, said)
    sun, camera = sun_figures(truth, said), camera_figures(truth, said)
    assert stated["crops"] == count
    assert stated["sun_median"] == round(sun["median"], 1)
    assert stated["sun_elevation_median"] == 6.7
    assert stated["camera_elevation_median"] == round(camera["elevation"], 1) == 1.2
    assert stated["turbidity_median"] == 1.6
    written = json.loads(write_figures(TINY, {"paper": stated}, tmp_path).read_text(encoding="utf-8"))
    assert (tmp_path / "tiny-0.0.1.json").exists()
    assert (written["name"], written["version"], written["accuracy"]) == ("tiny", "0.0.1", {"paper": stated})


def test_a_protocol_without_suns_is_not_stated(tmp_path: Path) -> None:
    truth = truth_of(1, scored=False)
    stated = stated_figures(truth, answers(truth.sun, camera=truth.camera))
    assert stated["sun_median"] is None
    assert json.loads(write_figures(TINY, {"paper": stated}, tmp_path).read_text())["accuracy"] == {}

"""The report's sections after the figures: what the network's doubt is worth, its turbidity, and where it fails."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from export.crops.crops import Camera, Source, take
from export.evaluation.contact_sheet import write_sheet
from export.evaluation.failures import failures_report, worst, write_failures
from export.evaluation.metrics import Answers, Truth
from export.evaluation.reliability import curves, draw, reliability_report
from export.evaluation.temperature import temperature_report
from export.evaluation.turbidity import turbidity_report
from lighting.colour import tone_map
from lighting.records import Prediction

PICTURE = "reliability.png"


@dataclass(frozen=True)
class Judged:
    """What one network said of one protocol's crops."""

    crops: Sequence[tuple[Source, Camera]]
    truth: Truth
    predictions: Sequence[Prediction]
    said: Answers
    constant: Answers  # of the best constants


def honesty_sections(judged: dict[str, Judged], out: Path, *, failures: bool) -> list[str]:
    """The sections; writes reliability.png into `out` and, with `failures`, failures.csv and failures.png.

    `judged` has the protocols with a sun to score.
    """
    levels = {protocol: curves(j.truth, j.predictions) for protocol, j in judged.items()}
    sections = [reliability_report(protocol, found) for protocol, found in levels.items()]
    sections += [temperature_report(protocol, j.truth, j.predictions) for protocol, j in judged.items()]
    if levels:
        draw(levels, out / PICTURE)
    if "paper" in judged:
        sections += _of_paper(judged["paper"], out, failures=failures)
    return sections


def _of_paper(judged: Judged, out: Path, *, failures: bool) -> list[str]:
    kind = np.array([source.panorama.kind for source, _ in judged.crops])
    found = worst(judged.truth, judged.said)
    if failures:
        write_failures(out / "failures.csv", found, np.array([camera.azimuth for _, camera in judged.crops]))
        spec = judged.predictions[0].spec
        shown = [take(*judged.crops[f.index], spec) for f in found]
        write_sheet(out / "failures.png", found, [tone_map(crop.linear) for crop in shown])
    return [
        turbidity_report("paper", judged.truth, judged.said, judged.constant, kind),
        failures_report(found),
    ]

"""The report's sections after the figures: reliability of the probabilities, turbidity, failures."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from export.crops import take
from export.evaluation.baselines import CONSTANT
from export.evaluation.contact_sheet import write_sheet
from export.evaluation.failures import failures_report, worst, write_failures
from export.evaluation.records import Answers, Truth
from export.evaluation.reliability import curves, draw, reliability_report
from export.evaluation.temperature import temperature_report
from export.evaluation.turbidity import turbidity_report
from export.evaluation.views import View
from lighting.colour import tone_map
from lighting.records import Prediction

PICTURE = "reliability.png"


@dataclass(frozen=True)
class Judged:
    """The answers for the crops of one protocol."""

    views: Sequence[View]
    truth: Truth
    predictions: Sequence[Prediction]  # of our network
    with_lens: Sequence[Prediction]  # the same, of photos that state their lens
    said: dict[str, Answers]  # of each method, our network first
    alone: dict[str, Answers]  # of each network without what else the pictures show

    @property
    def ours(self) -> str:
        """The name of our network."""
        return next(iter(self.said))


def diagnostic_sections(judged: dict[str, Judged], out: Path, *, failures: bool) -> list[str]:
    """The sections about the protocols that have a sun to score.

    Writes reliability.png into `out`, and with `failures` also failures.csv and failures.png.
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
    kind = np.array([source.panorama.kind for source, _ in judged.views])
    found = worst(judged.truth, judged.said[judged.ours])
    if failures:
        write_failures(out / "failures.csv", found, np.array([camera.azimuth for _, camera in judged.views]))
        spec = judged.predictions[0].spec
        shown = [take(*judged.views[f.index], spec) for f in found]
        write_sheet(out / "failures.png", found, [tone_map(crop.linear) for crop in shown])
    return [
        turbidity_report("paper", judged.truth, judged.said[judged.ours], judged.said[CONSTANT], kind),
        failures_report(found),
    ]

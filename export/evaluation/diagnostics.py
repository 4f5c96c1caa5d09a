"""The report's sections after the figures: reliability of the probabilities, turbidity, the worst crops by cause."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from export.crops.crops import crop_panorama
from export.evaluation.failures import draw_contact_sheet, failures_report, find_worst_crops, write_failures
from export.evaluation.metrics import Answers, Truth
from export.evaluation.predictions import View
from export.evaluation.reliability import draw_reliability, reliability_curves, reliability_report, temperature_report
from export.evaluation.report import CONSTANT, turbidity_report
from lighting.color import tone_map
from lighting.prediction import Prediction

RELIABILITY_FILE = "reliability.png"


@dataclass(frozen=True)
class ScoredCrops:
    """The answers for the crops of one protocol."""

    views: Sequence[View]
    truth: Truth
    predictions: Sequence[Prediction]  # of our network
    with_lens: Sequence[Prediction]  # the same, of photos that state their lens
    answers: dict[str, Answers]  # of each method, our network first
    network_answers: dict[str, Answers]  # of each network without what else the pictures show

    @property
    def ours(self) -> str:
        """The name of our network."""
        return next(iter(self.answers))


def diagnostic_sections(scored: dict[str, ScoredCrops], out: Path, *, failures: bool) -> list[str]:
    """The sections about the protocols that have a sun to score; writes reliability.png.

    Args:
        scored: by protocol.
        out: folder for the pictures.
        failures: write failures.csv and failures.png as well.
    """
    levels = {protocol: reliability_curves(crops.truth, crops.predictions) for protocol, crops in scored.items()}
    sections = [reliability_report(protocol, curves) for protocol, curves in levels.items()]
    sections += [temperature_report(protocol, crops.truth, crops.predictions) for protocol, crops in scored.items()]
    if levels:
        draw_reliability(levels, out / RELIABILITY_FILE)
    if "paper" in scored:
        sections += _paper_sections(scored["paper"], out, failures=failures)
    return sections


def _paper_sections(scored: ScoredCrops, out: Path, *, failures: bool) -> list[str]:
    kind = np.array([source.panorama.kind for source, _ in scored.views])
    ours = scored.answers[scored.ours]
    worst = find_worst_crops(scored.truth, ours)
    if failures:
        write_failures(out / "failures.csv", worst, np.array([camera.azimuth for _, camera in scored.views]))
        spec = scored.predictions[0].spec
        pictures = [tone_map(crop_panorama(*scored.views[failure.index], spec).linear) for failure in worst]
        draw_contact_sheet(worst, pictures, out / "failures.png")
    return [turbidity_report("paper", scored.truth, ours, scored.answers[CONSTANT], kind), failures_report(worst)]

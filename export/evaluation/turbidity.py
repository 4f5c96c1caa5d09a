"""Whether the estimated turbidity beats the best constant."""

from textwrap import fill

import numpy as np

from export.evaluation.intervals import difference_interval
from export.evaluation.records import Answers, Names, Truth, select
from export.evaluation.tables import interval, table

MEANING = fill(
    "Median absolute error against the skies fitted to the panoramas, of the network and of a constant, the median of "
    "the training skies; 95 % intervals of the network's error minus the constant's. LDR skies count only if their fit "
    "is trusted.",
    120,
)


def turbidity_report(protocol: str, truth: Truth, ours: Answers, constant: Answers, kind: Names) -> str:
    """The table of one protocol; `kind` (N,) is "hdr" or "ldr", the panorama's."""
    known = np.isfinite(truth.turbidity)
    rows = {"HDR": known & (kind == "hdr"), "LDR, clean sky": known & (kind == "ldr"), "both": known}
    lines = [
        _line(name, select(truth, chosen), select(ours, chosen), select(constant, chosen))
        for name, chosen in rows.items()
        if chosen.any()
    ]
    header = ["", "crops", "panoramas", "places", "network", "constant", "minus it, panoramas", "minus it, places"]
    return f"## Turbidity, protocol `{protocol}`\n\n{MEANING}\n\n{table(header, lines)}"


def _line(name: str, truth: Truth, ours: Answers, constant: Answers) -> list[str]:
    error, other = (np.abs(said.turbidity - truth.turbidity) for said in (ours, constant))
    counts = (len(error), len(np.unique(truth.panorama)), len(np.unique(truth.place)))
    less = [interval(difference_interval(error, other, units), 2) for units in (truth.panorama, truth.place)]
    return [name, *map(str, counts), f"{np.median(error):.2f}", f"{np.median(other):.2f}", *less]

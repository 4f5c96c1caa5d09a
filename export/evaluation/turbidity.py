"""Whether the estimated turbidity beats the best answer that looks at no pixel."""

from textwrap import fill

import numpy as np
from numpy.typing import NDArray

from export.evaluation.metrics import Answers, Truth, difference_interval, select, table
from export.evaluation.report import interval

MEANING = fill(
    "Median absolute error against the skies fitted to the panoramas: the network's, and that of the median of the "
    "training skies; 95 % intervals of the network's less the constant's. LDR skies are the clean ones, whose fit is "
    "trusted.",
    120,
)


def turbidity_report(protocol: str, truth: Truth, ours: Answers, constant: Answers, kind: NDArray[np.str_]) -> str:
    """The table of one protocol; `kind` (N,) is "hdr" or "ldr", the panorama's."""
    known = np.isfinite(truth.turbidity)
    rows = {"HDR": known & (kind == "hdr"), "LDR, clean sky": known & (kind == "ldr"), "both": known}
    lines = [
        _line(name, select(truth, chosen), select(ours, chosen), select(constant, chosen))
        for name, chosen in rows.items()
        if chosen.any()
    ]
    header = ["", "crops", "panoramas", "places", "network", "constant", "less it, panoramas", "less it, places"]
    return f"## Turbidity, protocol `{protocol}`\n\n{MEANING}\n\n{table(header, lines)}"


def _line(name: str, truth: Truth, ours: Answers, constant: Answers) -> list[str]:
    error, other = (np.abs(said.turbidity - truth.turbidity) for said in (ours, constant))
    counts = (len(error), len(np.unique(truth.panorama)), len(np.unique(truth.place)))
    less = [interval(difference_interval(error, other, units), 2) for units in (truth.panorama, truth.place)]
    return [name, *map(str, counts), f"{np.median(error):.2f}", f"{np.median(other):.2f}", *less]

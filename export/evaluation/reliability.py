"""Calibration of the sun's distribution: how often the true sun lies in the region that holds the probability p.

Two regions are tested: the cells of highest density, and the cone around the answer, whose radii are `radius_50` and
`radius_90`.
"""

from collections.abc import Sequence
from itertools import compress
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from export.evaluation.metrics import share
from export.evaluation.records import Truth, select
from export.evaluation.report import IN_VIEW, bins
from export.evaluation.tables import figures_table
from lighting.decoding import best_guess
from lighting.files import replacing
from lighting.geometry import Floats, angle_between
from lighting.records import Prediction
from lighting.sun_grid import cones, grid_directions, grid_solid_angle

LEVELS = tuple(range(5, 100, 5))  # %, drawn
QUOTED = (10, 25, 50, 75, 90, 95)  # %, in the table
DENSEST, CONE = "all", "all, cone around the answer"
MEANING = fill(
    "Share [%] of true suns inside the region that holds p of the probability: the cells of highest density, and in "
    "the last row the cone around the answer, whose radii are `radius_50` and `radius_90`. A calibrated distribution "
    "has p in the column p. `largest gap` is the largest difference over p = 5 to 95 %, in percentage points.",
    120,
)


def density_levels(said: Sequence[Prediction], sun: Floats) -> Floats:
    """Probability (N,) of the region of highest density that just reaches each true sun (N, 3).

    It holds all cells that are denser than the sun's own, and half of those that are equally dense.
    """
    cells, area = (of(said[0].spec.sun_grid) for of in (grid_directions, grid_solid_angle))
    own = np.argmax(sun @ cells.T, axis=1)
    probability = np.array([p.sun_probability for p in said], dtype=np.float64)
    density = probability / area
    at_sun = density[np.arange(len(own)), own][:, None]
    held = probability * ((density > at_sun) + 0.5 * (density == at_sun))
    return np.asarray(held.sum(axis=1) / probability.sum(axis=1))


def cone_levels(said: Sequence[Prediction], sun: Floats) -> Floats:
    """Probability (N,) of the cone around each answer that just reaches the true sun (N, 3)."""
    return np.array([_cone_level(p, towards) for p, towards in zip(said, sun, strict=True)])


def _cone_level(said: Prediction, sun: Floats) -> float:
    layout = said.spec.sun_grid
    answer = best_guess(said.sun_probability, layout)
    return float(np.interp(angle_between(sun, answer), *cones(said.sun_probability, grid_directions(layout), answer)))


def curves(truth: Truth, said: Sequence[Prediction]) -> dict[str, Floats]:
    """Probabilities (n,) of the regions that reach the true sun: of all scored crops, of each bin, and of the cones."""
    scored = select(truth, truth.scored)
    known = list(compress(said, truth.scored))
    levels = density_levels(known, scored.sun)
    by_group = {name: levels[chosen] for name, chosen in bins(scored).items()}
    return {DENSEST: levels, **by_group, CONE: cone_levels(known, scored.sun)}


def inside(levels: Floats, expected: Sequence[float]) -> Floats:
    """Share [%] of the suns inside the regions of each probability [%]."""
    return np.array([share(levels <= p / 100) for p in expected])


def reliability_report(protocol: str, found: dict[str, Floats]) -> str:
    """The table of one protocol."""
    rows = {
        name: {
            "crops": float(len(levels)),
            **{f"{p} %": float(value) for p, value in zip(QUOTED, inside(levels, QUOTED), strict=True)},
            "largest gap": float(np.abs(inside(levels, LEVELS) - LEVELS).max()),
        }
        for name, levels in found.items()
    }
    return f"## Reliability of the sun's distribution, protocol `{protocol}`\n\n{MEANING}\n\n{figures_table(rows)}"


def draw(protocols: dict[str, dict[str, Floats]], path: Path) -> None:
    """Plot the share inside against p: one column per protocol, by elevation above, by what is in view below."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.6 * len(protocols), 9.2), layout="compressed")
    panels = figure.subplots(2, len(protocols), sharex=True, sharey=True, squeeze=False)
    for column, (protocol, found) in zip(panels.T, protocols.items(), strict=True):
        column[0].set_title(f"protocol {protocol}")
        column[1].set_xlabel("probability of the region [%]")
        for panel, views in zip(column, (False, True), strict=True):
            _panel(panel, {n: v for n, v in found.items() if n in (DENSEST, CONE) or (n in IN_VIEW) == views})
    for panel in panels[:, 0]:
        panel.set_ylabel("true suns inside [%]")
    with replacing(path) as temporary:
        figure.savefig(temporary, format="png", dpi=100, pil_kwargs={"optimize": True})


STYLES: dict[str, dict[str, Any]] = {
    DENSEST: {"color": "black", "linewidth": 2.2},
    CONE: {"color": "black", "linestyle": ":"},
}


def _panel(panel: Any, found: dict[str, Floats]) -> None:
    panel.plot([0, 100], [0, 100], color="0.7", linewidth=1)
    for name, levels in found.items():
        shown = np.concatenate([[0.0], inside(levels, LEVELS), [100.0]])
        panel.plot([0, *LEVELS, 100], shown, label=f"{name} ({len(levels)})", **STYLES.get(name, {}))
    panel.set(xlim=(0, 100), ylim=(0, 100), aspect="equal")
    panel.grid(alpha=0.25)
    panel.legend(frameon=False, fontsize=8)

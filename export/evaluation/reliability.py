"""How often the true sun lies in the region that holds a probability, and the temperature that calibrates it.

Two regions are tested: the cells of highest density, and the cone around the answer, whose radii are `radius_50` and
`radius_90`.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import compress
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from export.evaluation.metrics import (
    Bools,
    Truth,
    answers_from_estimates,
    figures_table,
    percentage,
    select_crops,
    sun_figures,
)
from export.evaluation.multi_view import place_halves
from export.evaluation.predictions import MIN_DENSITY, sun_nll
from export.evaluation.report import IN_VIEW, sun_bins
from lighting.decoding import sun_from_prediction
from lighting.files import atomic_write
from lighting.geometry import Floats, angle_between
from lighting.prediction import Prediction
from lighting.sun_grid import cumulative_by_angle, grid_directions, grid_solid_angle, temper

LEVELS = tuple(range(5, 100, 5))  # %, drawn
_QUOTED = (10, 25, 50, 75, 90, 95)  # %, in the table
DENSEST, CONE = "all", "all, cone around the answer"
_RELIABILITY_MEANING = fill(
    "Share [%] of true suns inside the region that holds p of the probability. The region is the cells of highest "
    "density; in the last row it is the cone around the answer, of `radius_50` or `radius_90`. A calibrated "
    "distribution has p in the column p. `largest gap` is the largest difference over p = 5 to 95 %, in "
    "percentage points.",
    120,
)


def _density_levels(predictions: Sequence[Prediction], sun: Floats) -> Floats:
    """Probability (N,) of the region of highest density that just reaches each true sun (N, 3).

    It holds all cells that are denser than the sun's own, and half of those that are equally dense.
    """
    cells, area = (of(predictions[0].spec.sun_grid) for of in (grid_directions, grid_solid_angle))
    sun_cell = np.argmax(sun @ cells.T, axis=1)
    probability = np.array([p.sun_probability for p in predictions], dtype=np.float64)
    density = probability / area
    at_sun = density[np.arange(len(sun_cell)), sun_cell][:, None]
    denser = probability * ((density > at_sun) + 0.5 * (density == at_sun))
    return np.asarray(denser.sum(axis=1) / probability.sum(axis=1))


def reliability_curves(truth: Truth, predictions: Sequence[Prediction]) -> dict[str, Floats]:
    """Probabilities (n,) of the regions that reach the true sun: of all scored crops, of each bin, and of the cones.

    Args:
        truth: of N crops.
        predictions: N, of the same crops.
    """
    scored = select_crops(truth, truth.scored)
    predictions = list(compress(predictions, truth.scored))
    levels = _density_levels(predictions, scored.sun)
    cones = []  # probability of the cone around each answer that just reaches the true sun
    for p, sun in zip(predictions, scored.sun, strict=True):
        reach = cumulative_by_angle(p.sun_probability, grid_directions(p.spec.sun_grid), p.sun_direction)
        cones.append(float(np.interp(angle_between(sun, p.sun_direction), *reach)))
    by_group = {name: levels[chosen] for name, chosen in sun_bins(scored).items()}
    return {DENSEST: levels, **by_group, CONE: np.array(cones)}


def _inside(levels: Floats, expected: Sequence[float]) -> Floats:
    """Share [%] of the suns inside the regions of each probability [%]."""
    return np.array([percentage(levels <= p / 100) for p in expected])


def reliability_report(protocol: str, curves: dict[str, Floats]) -> str:
    """The table of one protocol.

    Args:
        protocol: its name.
        curves: of `reliability_curves`.
    """
    rows = {
        name: {
            "crops": float(len(levels)),
            **{f"{p} %": float(value) for p, value in zip(_QUOTED, _inside(levels, _QUOTED), strict=True)},
            "largest gap": float(np.abs(_inside(levels, LEVELS) - LEVELS).max()),
        }
        for name, levels in curves.items()
    }
    title = f"## Reliability of the sun's distribution, protocol `{protocol}`"
    return f"{title}\n\n{_RELIABILITY_MEANING}\n\n{figures_table(rows)}"


def draw_reliability(protocols: dict[str, dict[str, Floats]], path: Path) -> None:
    """Plot the share inside against p: one column per protocol, by elevation above, by what is in view below.

    Args:
        protocols: the curves of each.
        path: PNG file to write.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.6 * len(protocols), 9.2), layout="compressed")
    panels = figure.subplots(2, len(protocols), sharex=True, sharey=True, squeeze=False)
    for column, (protocol, curves) in zip(panels.T, protocols.items(), strict=True):
        column[0].set_title(f"protocol {protocol}")
        column[1].set_xlabel("probability of the region [%]")
        for panel, views in zip(column, (False, True), strict=True):
            _draw_panel(panel, {n: v for n, v in curves.items() if n in (DENSEST, CONE) or (n in IN_VIEW) == views})
    for panel in panels[:, 0]:
        panel.set_ylabel("true suns inside [%]")
    with atomic_write(path) as temporary:
        figure.savefig(temporary, format="png", dpi=100, pil_kwargs={"optimize": True})


STYLES: dict[str, dict[str, Any]] = {
    DENSEST: {"color": "black", "linewidth": 2.2},
    CONE: {"color": "black", "linestyle": ":"},
}


def _draw_panel(panel: Any, curves: dict[str, Floats]) -> None:
    panel.plot([0, 100], [0, 100], color="0.7", linewidth=1)
    for name, levels in curves.items():
        inside = np.concatenate([[0.0], _inside(levels, LEVELS), [100.0]])
        panel.plot([0, *LEVELS, 100], inside, label=f"{name} ({len(levels)})", **STYLES.get(name, {}))
    panel.set(xlim=(0, 100), ylim=(0, 100), aspect="equal")
    panel.grid(alpha=0.25)
    panel.legend(frameon=False, fontsize=8)


_TEMPERATURES = [round(0.5 * 1.02**i, 3) for i in range(90)]  # 0.5 to 3
# Names of columns, and of the figures in them.
_COLUMNS = {"NLL": "NLL", "in 50 %": "in 50 % region", "in 90 %": "in 90 % region", "median": "median"}
_TEMPERATURE_MEANING = fill(
    "Temperature T of the sun's probabilities, p^(1/T), in addition to the network's own. It is fitted by NLL on one "
    "half of the places and tested on the other (`all`: fitted and tested on all). Regions are cones around the "
    "answer. The network ships with the right temperature if T is near 1 in both halves and changes little.",
    120,
)


def temperature_report(protocol: str, truth: Truth, predictions: Sequence[Prediction]) -> str:
    """The table of one protocol.

    Args:
        protocol: its name.
        truth: of N crops.
        predictions: N, of the same crops.
    """
    halves = place_halves(truth)
    half = np.array([halves.get(str(place), -1) for place in truth.place])
    rows = {}
    for name, fit, measured in (("half A", 0, 1), ("half B", 1, 0), ("all", None, None)):
        learning, tested = (truth.scored if h is None else truth.scored & (half == h) for h in (fit, measured))
        if learning.any() and tested.any():
            rows[name] = _temperature_row(truth, predictions, learning, tested)
    return f"## Temperature, protocol `{protocol}`\n\n{_TEMPERATURE_MEANING}\n\n{figures_table(rows)}"


def _temperature_row(
    truth: Truth, predictions: Sequence[Prediction], learning: Bools, tested: Bools
) -> dict[str, float]:
    fitted = _fit_temperature(list(compress(predictions, learning)), truth.sun[learning])
    test_predictions, test_truth = list(compress(predictions, tested)), select_crops(truth, tested)
    row = {"fitted to": float(np.count_nonzero(learning)), "temperature": fitted, "crops": float(len(test_predictions))}
    figures = {}
    for when, t in (("before", 1.0), ("after", fitted)):
        tempered = [replace(p, sun_probability=temper(p.sun_probability, t)) for p in test_predictions]
        suns, nll = [sun_from_prediction(p) for p in tempered], sun_nll(tempered, test_truth.sun)
        figures[when] = sun_figures(test_truth, answers_from_estimates(suns, nll=nll))
    return row | {f"{name}, {when}": of[c] for name, c in _COLUMNS.items() for when, of in figures.items()}


def _fit_temperature(predictions: Sequence[Prediction], sun: Floats) -> float:
    """The one of _TEMPERATURES under which the true suns (N, 3) are most likely."""
    cells, area = (of(predictions[0].spec.sun_grid) for of in (grid_directions, grid_solid_angle))
    sun_cell = np.argmax(sun @ cells.T, axis=1)
    log = np.log(np.maximum([p.sun_probability for p in predictions], MIN_DENSITY * area))

    def mean_nll(temperature: float) -> float:
        logits = log / temperature
        return float(np.mean(np.logaddexp.reduce(logits, axis=1) - logits[np.arange(len(sun_cell)), sun_cell]))

    return min(_TEMPERATURES, key=mean_nll)

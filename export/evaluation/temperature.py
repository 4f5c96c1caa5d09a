"""Whether the sun's softmax has the right temperature: another one is fitted on some places and tested on others."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import compress
from textwrap import fill

import numpy as np
from numpy.typing import NDArray

from export.evaluation.correlation import halves_of
from export.evaluation.metrics import sun_figures
from export.evaluation.records import Bools, Truth, answers, select
from export.evaluation.tables import figures_table
from export.evaluation.views import LEAST_DENSITY
from lighting.decoding import sun_of
from lighting.geometry import Floats, direction
from lighting.records import Prediction
from lighting.sun_grid import density, grid_directions, grid_solid_angle

TEMPERATURES = [round(0.5 * 1.02**i, 3) for i in range(90)]  # 0.5 to 3
COLUMNS = {"NLL": "NLL", "in 50 %": "in 50 % region", "in 90 %": "in 90 % region", "median": "median"}
MEANING = fill(
    "Temperature T of the sun's probabilities, p^(1/T), in addition to the network's own: fitted by NLL on one half of "
    "the places and tested on the other (`all`: fitted and tested on all). Regions are cones around the answer. The "
    "network ships with the right temperature if T is near 1 in both halves and changes little.",
    120,
)


def temperature_report(protocol: str, truth: Truth, said: Sequence[Prediction]) -> str:
    """The table of one protocol."""
    halves = halves_of(truth)
    half = np.array([halves.get(str(place), -1) for place in truth.place])
    rows = {}
    for name, fit, measured in (("half A", 0, 1), ("half B", 1, 0), ("all", None, None)):
        learning, tested = (truth.scored if h is None else truth.scored & (half == h) for h in (fit, measured))
        if learning.any() and tested.any():
            rows[name] = _row(truth, said, learning, tested)
    return f"## Temperature, protocol `{protocol}`\n\n{MEANING}\n\n{figures_table(rows)}"


def _row(truth: Truth, said: Sequence[Prediction], learning: Bools, tested: Bools) -> dict[str, float]:
    divisor = fitted(list(compress(said, learning)), truth.sun[learning])
    shown, known = list(compress(said, tested)), select(truth, tested)
    before, after = (figures(known, [tempered(p, t) for p in shown]) for t in (1.0, divisor))
    both = {f"{name}, {when}": of[name] for name in COLUMNS for when, of in (("before", before), ("after", after))}
    return {"fitted to": float(np.count_nonzero(learning)), "temperature": divisor, "crops": float(len(shown)), **both}


def fitted(said: Sequence[Prediction], sun: Floats) -> float:
    """The one of TEMPERATURES under which the true suns (N, 3) are most likely."""
    cells, area = (of(said[0].spec.sun_grid) for of in (grid_directions, grid_solid_angle))
    own = np.argmax(sun @ cells.T, axis=1)
    log = np.log(np.maximum([p.sun_probability for p in said], LEAST_DENSITY * area))
    costs = {t: _cost(log / t, own) for t in TEMPERATURES}
    return min(costs, key=costs.__getitem__)


def _cost(log: Floats, own: NDArray[np.intp]) -> float:
    """Mean negative log probability of the cells `own` (N,), from unnormalised logarithms (N, G)."""
    highest = log.max(axis=1, keepdims=True)
    total = np.log(np.exp(log - highest).sum(axis=1)) + highest[:, 0]
    return float(np.mean(total - log[np.arange(len(own)), own]))


def tempered(said: Prediction, temperature: float) -> Prediction:
    """The prediction with its sun's logits divided by another temperature."""
    power = said.sun_probability.astype(np.float64) ** (1 / temperature)
    return replace(said, sun_probability=(power / power.sum()).astype(np.float32))


def figures(truth: Truth, said: Sequence[Prediction]) -> dict[str, float]:
    """COLUMNS over crops that all have a sun."""
    suns = [sun_of(p) for p in said]
    probability = np.array([p.sun_probability for p in said])
    values = answers(
        direction([s.azimuth for s in suns], [s.elevation for s in suns]),
        radius_50=np.array([s.radius_50 for s in suns]),
        radius_90=np.array([s.radius_90 for s in suns]),
        nll=-np.log(np.maximum(density(probability, truth.sun, said[0].spec.sun_grid), LEAST_DENSITY)),
    )
    measured = sun_figures(truth, values)
    return {name: measured[column] for name, column in COLUMNS.items()}

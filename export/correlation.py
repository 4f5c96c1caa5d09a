"""How far the errors of crops of one panorama correlate, which discounts them in lighting/together.py.

Learnt on one half of the places and measured on the other, both ways round; the constants that ship are those of all.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from export.metrics import Truth
from export.report import figures_table
from lighting.geometry import angle_between, angles
from lighting.parameters import Prediction
from lighting.sun_grid import grid_directions, most_likely, radius
from lighting.together import elevation_density, power, seen_from

SIZES = (2, 4, 8)  # views; one panorama has 8 crops
CORRELATIONS = np.round(np.arange(0.1, 1.55, 0.1), 2)  # tried

Floats = NDArray[np.floating[Any]]


@dataclass(frozen=True)
class Logs:
    """Logarithms of what the crops of one panorama say, in its own frame."""

    sun: Floats  # (crops, N) over the cells
    elevation: Floats  # (crops, N) of the cells' elevation alone
    cell: int  # where the true sun is
    truth: Floats  # (3,)
    half: int  # 0 or 1, of the places


def correlation_report(truth: Truth, said: Sequence[Prediction], azimuth: Floats, crops_each: int) -> str:
    """The correlations learnt on each half of the places, and the coverage on the other half."""
    layout = said[0].spec.sun_grid
    logs = [
        _logs(truth, said, azimuth, range(first, first + crops_each), layout)
        for first in range(0, len(said), crops_each)
        if truth.scored[first]
    ]
    rows: dict[str, dict[str, float]] = {}
    for name, fit in (("half A", (0,)), ("half B", (1,)), ("all", (0, 1))):
        measured = [g for g in logs if g.half not in fit] or logs
        sun, elevation = (learn([g for g in logs if g.half in fit], what) for what in ("sun", "elevation"))
        rows[name] = {"panoramas": float(sum(g.half in fit for g in logs)), "sun": sun, "elevation": elevation}
        for size in SIZES:
            inside = [
                _inside(g.sun[part].sum(axis=0) * power(size, sun), g, layout) for g, part in _parts(measured, size)
            ]
            rows[name][f"{size}: in 50 %"], rows[name][f"{size}: in 90 %"] = 100 * np.mean(inside, axis=0)
    title = "Correlations learnt on one half of the places, and coverage measured on the other (`all`: on the same)"
    return f"{title}\n\n{figures_table(rows)}"


def _logs(truth: Truth, said: Sequence[Prediction], azimuth: Floats, members: range, layout: str) -> Logs:
    first, cells = members[0], grid_directions(layout)
    elevation = angles(cells)[1]
    sun = [seen_from(said[i].sun_probability, azimuth[first] - azimuth[i], layout) for i in members]
    heights = [elevation_density(said[i], elevation) for i in members]
    place = hashlib.sha256(truth.place[first].encode()).digest()[0] % 2
    cell = int(np.argmax(cells @ truth.sun[first]))
    return Logs(_log(np.array(sun)), _log(np.array(heights)), cell, truth.sun[first], place)


def _log(density: Floats) -> Floats:
    return np.asarray(np.log(np.maximum(density, 1e-12)))


def _parts(logs: Sequence[Logs], size: int) -> list[tuple[Logs, NDArray[np.intp]]]:
    """Each panorama's crops in groups."""
    rng = np.random.default_rng(size)
    return [(g, part) for g in logs for part in rng.permutation(len(g.sun)).reshape(-1, size)]


def learn(logs: Sequence[Logs], what: str) -> float:
    """The correlation with the least negative log density at the true suns, over all sizes."""
    loss = [
        np.mean([np.mean([_loss(getattr(g, what)[part], g.cell, c) for g, part in _parts(logs, n)]) for n in SIZES])
        for c in CORRELATIONS
    ]
    return float(CORRELATIONS[int(np.argmin(loss))])


def _loss(logs: Floats, cell: int, correlation: float) -> float:
    product = logs.sum(axis=0) * power(len(logs), correlation)
    highest = product.max()
    return float(np.log(np.exp(product - highest).sum()) + highest - product[cell])


def _inside(log: Floats, panorama: Logs, layout: str) -> tuple[bool, bool]:
    probability = np.exp(log - log.max())
    centre = most_likely(probability, layout)
    error = float(angle_between(centre, panorama.truth))
    return error <= radius(probability, 0.5, layout, centre), error <= radius(probability, 0.9, layout, centre)

"""How strongly the errors of crops of one panorama correlate, if one number for all of them has to do.

The correlation is learnt on one half of the places and tested on the other, and the reverse. That of elevations which
ships lies between those of the two protocols, learnt on all places; those by overlap are learnt by
export/reports/multi_view.py.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from export.evaluation.records import Truth
from export.evaluation.tables import figures_table
from lighting.circular import HEADINGS
from lighting.decoding import sun_of, sun_on_rings
from lighting.evidence import elevation_density, power, ring_of, seen_from
from lighting.geometry import Floats, angle_between, angles, direction
from lighting.records import Prediction, SunEstimate
from lighting.sun_grid import grid_directions

SIZES = (2, 4, 8)  # views; one panorama has 8 crops
CORRELATIONS = np.round(np.arange(0.1, 1.55, 0.1), 2)  # tried
KINDS = ("sun", "azimuth", "elevation")


@dataclass(frozen=True)
class Densities:
    """The answers for the crops of one panorama, turned into its frame."""

    log: dict[str, Floats]  # by kind: logarithmic densities (crops, N) over the cells or around the ring
    cell: dict[str, int]  # by kind: the index of the true one of the N
    truth: Floats  # (3,) the true sun
    half: int  # 0 or 1: the half that the place belongs to
    said: Prediction


def correlation_report(truth: Truth, said: Sequence[Prediction], azimuth: Floats, crops_each: int) -> str:
    """A table of the correlations learnt on each half of the places, with the coverage on the other half."""
    halves = halves_of(truth)
    views = [
        _views(truth, said, azimuth, range(first, first + crops_each), halves[truth.place[first]])
        for first in range(0, len(said), crops_each)
        if truth.scored[first]
    ]
    rows = {}
    for name, fit in (("half A", (0,)), ("half B", (1,)), ("all", (0, 1))):
        if not (learning := [v for v in views if v.half in fit]):  # one place alone
            continue
        learnt = {kind: learn(learning, kind) for kind in KINDS}
        measured = [v for v in views if v.half not in fit] or views
        rows[name] = {"panoramas": float(len(learning)), **learnt, **_coverage(measured, learnt)}
    title = (
        "Correlations learnt on one half of the places; share [%] inside the 90 % region on the other (`all`: on all)"
    )
    return f"{title}\n\n{figures_table(rows)}"


def halves_of(truth: Truth) -> dict[str, int]:
    """The half, 0 or 1, of each place; both halves have about as many crops."""
    places, counts = np.unique(truth.place[truth.scored], return_counts=True)
    return {str(place): i % 2 for i, place in enumerate(places[np.argsort(-counts, kind="stable")])}


def _views(truth: Truth, said: Sequence[Prediction], azimuth: Floats, members: range, half: int) -> Densities:
    """The answers for the crops `members` of one panorama; `azimuth` (N,) is where each crop's camera points in it."""
    first, layout = members[0], said[0].spec.sun_grid
    sun, cells = truth.sun[first], grid_directions(layout)
    sun_azimuth, sun_elevation = map(float, angles(sun))
    turned = [(said[i], float(azimuth[first] - azimuth[i])) for i in members]
    log = {
        "sun": [seen_from(p.sun_probability, turn, layout) for p, turn in turned],
        "azimuth": [ring_of(p, sun_elevation, turn) for p, turn in turned],
        "elevation": [elevation_density(p, angles(cells)[1]) for p, _ in turned],
    }
    cell = int(np.argmax(cells @ sun))
    at = {"sun": cell, "azimuth": round(sun_azimuth) % 360, "elevation": cell}
    return Densities({kind: _log(np.array(values)) for kind, values in log.items()}, at, sun, half, said[first])


def _log(density: Floats) -> Floats:
    return np.asarray(np.log(np.maximum(density, 1e-12)))


def _parts(views: Sequence[Densities], size: int) -> list[tuple[Densities, NDArray[np.intp]]]:
    """Each panorama's crops in groups."""
    rng = np.random.default_rng(size)
    return [(v, part) for v in views for part in rng.permutation(len(v.log["sun"])).reshape(-1, size)]


def learn(views: Sequence[Densities], kind: str) -> float:
    """The correlation with the least negative log density at the true suns, over all sizes."""
    loss = [
        np.mean([np.mean([_loss(v.log[kind][part], v.cell[kind], c) for v, part in _parts(views, n)]) for n in SIZES])
        for c in CORRELATIONS
    ]
    return float(CORRELATIONS[int(np.argmin(loss))])


def _loss(logs: Floats, cell: int, correlation: float) -> float:
    product = logs.sum(axis=0) * power(len(logs), correlation)
    highest = product.max()
    return float(np.log(np.exp(product - highest).sum()) + highest - product[cell])


def _coverage(views: Sequence[Densities], learnt: dict[str, float]) -> dict[str, float]:
    return {
        f"{kind}, {size} views": float(100 * np.mean([_inside(v, kind, part, learnt[kind]) for v, part in parts]))
        for kind in ("sun", "azimuth")
        for size, parts in ((size, _parts(views, size)) for size in SIZES)
    }


def _inside(views: Densities, kind: str, part: NDArray[np.intp], correlation: float) -> bool:
    """Whether the true sun is in the 90 % region of crops taken together."""
    product = views.log[kind][part].sum(axis=0) * power(len(part), correlation)
    probability = np.exp(product - product.max())
    sun = _decode(views, kind, probability / probability.sum())
    return float(angle_between(direction(sun.azimuth, sun.elevation), views.truth)) <= sun.radius_90


def _decode(views: Densities, kind: str, probability: Floats) -> SunEstimate:
    if kind == "azimuth":
        return sun_on_rings(direction(HEADINGS, float(angles(views.truth)[1])), probability)
    return sun_of(replace(views.said, sun_probability=probability))

"""Gain of several crops.

The correlation is learnt on one half of the places and tested on the other, and the reverse. That of elevations which
ships lies between those of the two protocols, learnt on all places; those by overlap were learnt by
`python -m export turns overlap` of commit 6df25d7.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from textwrap import fill

import numpy as np
from numpy.typing import NDArray

from export.crops.crops import crop_rng
from export.evaluation.metadata import COMPASS_ERROR, COMPASS_MEDIAN, SimulatedMetadata, keep_evidence
from export.evaluation.metrics import Truth, figures_table, median, percentage
from lighting.circular import HEADINGS, Heading
from lighting.decoding import sun_from_prediction, sun_from_rings
from lighting.fusion.likelihood import density_on_ring, elevation_density, pooling_exponent, rotate_density
from lighting.fusion.metadata_prior import observations_from_metadata
from lighting.fusion.multi_view import fuse_views
from lighting.fusion.single_view import Observations, Posterior
from lighting.fusion.user_input import NO_USER_INPUT
from lighting.geometry import Floats, angle_between, angles, direction, wrap_azimuth
from lighting.records import EvidenceKind, Prediction, SunEstimate
from lighting.sun_grid import grid_directions

# How strongly the errors of crops of one panorama correlate, if one number for all of them has to do.

SIZES = (2, 4, 8)  # views; one panorama has 8 crops
CORRELATIONS = np.round(np.arange(0.1, 1.55, 0.1), 2)  # tried
KINDS = ("sun", "azimuth", "elevation")


@dataclass(frozen=True)
class _Densities:
    """The answers for the crops of one panorama, turned into its frame."""

    log: dict[str, Floats]  # by kind: logarithmic densities (crops, N) over the cells or around the ring
    cell: dict[str, int]  # by kind: the index of the true one of the N
    truth: Floats  # (3,) the true sun
    half: int  # 0 or 1: the half that the place belongs to
    said: Prediction


def _correlation_report(truth: Truth, said: Sequence[Prediction], azimuth: Floats, crops_each: int) -> str:
    """A table of the correlations learnt on each half of the places, with the coverage on the other half."""
    halves = place_halves(truth)
    views = [
        _views(truth, said, azimuth, range(first, first + crops_each), halves[truth.place[first]])
        for first in range(0, len(said), crops_each)
        if truth.scored[first]
    ]
    rows = {}
    for name, fit in (("half A", (0,)), ("half B", (1,)), ("all", (0, 1))):
        if not (learning := [v for v in views if v.half in fit]):  # one place alone
            continue
        learnt = {kind: _learn(learning, kind) for kind in KINDS}
        measured = [v for v in views if v.half not in fit] or views
        rows[name] = {"panoramas": float(len(learning)), **learnt, **_coverage(measured, learnt)}
    title = (
        "Correlations learnt on one half of the places; share [%] inside the 90 % region on the other (`all`: on all)"
    )
    return f"{title}\n\n{figures_table(rows)}"


def place_halves(truth: Truth) -> dict[str, int]:
    """The half, 0 or 1, of each place; both halves have about as many crops."""
    places, counts = np.unique(truth.place[truth.scored], return_counts=True)
    return {str(place): i % 2 for i, place in enumerate(places[np.argsort(-counts, kind="stable")])}


def _views(truth: Truth, said: Sequence[Prediction], azimuth: Floats, members: range, half: int) -> _Densities:
    """The answers for the crops `members` of one panorama; `azimuth` (N,) is where each crop's camera points in it."""
    first, layout = members[0], said[0].spec.sun_grid
    sun, cells = truth.sun[first], grid_directions(layout)
    sun_azimuth, sun_elevation = map(float, angles(sun))
    turned = [(said[i], float(azimuth[first] - azimuth[i])) for i in members]
    log = {
        "sun": [rotate_density(p.sun_probability, turn, layout) for p, turn in turned],
        "azimuth": [density_on_ring(p, sun_elevation, turn) for p, turn in turned],
        "elevation": [elevation_density(p, angles(cells)[1]) for p, _ in turned],
    }
    cell = int(np.argmax(cells @ sun))
    at = {"sun": cell, "azimuth": round(sun_azimuth) % 360, "elevation": cell}
    return _Densities({kind: _log(np.array(values)) for kind, values in log.items()}, at, sun, half, said[first])


def _log(density: Floats) -> Floats:
    return np.asarray(np.log(np.maximum(density, 1e-12)))


def _parts(views: Sequence[_Densities], size: int) -> list[tuple[_Densities, NDArray[np.intp]]]:
    """Each panorama's crops in groups."""
    rng = np.random.default_rng(size)
    return [(v, part) for v in views for part in rng.permutation(len(v.log["sun"])).reshape(-1, size)]


def _learn(views: Sequence[_Densities], kind: str) -> float:
    """The correlation with the least negative log density at the true suns, over all sizes."""
    loss = [
        np.mean([np.mean([_loss(v.log[kind][part], v.cell[kind], c) for v, part in _parts(views, n)]) for n in SIZES])
        for c in CORRELATIONS
    ]
    return float(CORRELATIONS[int(np.argmin(loss))])


def _loss(logs: Floats, cell: int, correlation: float) -> float:
    product = logs.sum(axis=0) * pooling_exponent(len(logs), correlation)
    highest = product.max()
    return float(np.log(np.exp(product - highest).sum()) + highest - product[cell])


def _coverage(views: Sequence[_Densities], learnt: dict[str, float]) -> dict[str, float]:
    return {
        f"{kind}, {size} views": float(100 * np.mean([_inside(v, kind, part, learnt[kind]) for v, part in parts]))
        for kind in ("sun", "azimuth")
        for size, parts in ((size, _parts(views, size)) for size in SIZES)
    }


def _inside(views: _Densities, kind: str, part: NDArray[np.intp], correlation: float) -> bool:
    """Whether the true sun is in the 90 % region of crops taken together."""
    product = views.log[kind][part].sum(axis=0) * pooling_exponent(len(part), correlation)
    probability = np.exp(product - product.max())
    sun = _decode(views, kind, probability / probability.sum())
    return float(angle_between(direction(sun.azimuth, sun.elevation), views.truth)) <= sun.radius_90


def _decode(views: _Densities, kind: str, probability: Floats) -> SunEstimate:
    if kind == "azimuth":
        return sun_from_rings(direction(HEADINGS, float(angles(views.truth)[1])), probability)
    return sun_from_prediction(replace(views.said, sun_probability=probability))


# Accuracy and coverage of several crops of one panorama taken together.

COMPASS_JITTER = 10.0  # deg, standard deviation between two headings of one phone; the rest of its error is shared
SIMULATION = fill(
    "Groups of views of one panorama. Known headings are exact. Compass headings share one error with a median of "
    f"{COMPASS_MEDIAN:g}°, and each has its own of {COMPASS_JITTER:g}° standard deviation. The views share elevation, "
    "turbidity and exposure; unknown headings are inferred relative to the first view.",
    120,
)


@dataclass(frozen=True)
class _Group:
    """Crops of one panorama."""

    members: NDArray[np.intp]  # (n,) indices of crops
    place: str


def _groups_of(truth: Truth, crops_each: int, size: int) -> list[_Group]:
    """The scored crops of each panorama, dealt into groups of `size`."""
    found = []
    for first in range(0, len(truth.scored), crops_each):
        if truth.scored[first]:
            order = crop_rng(truth.panorama[first], size, "group").permutation(crops_each) + first
            found += [_Group(part, truth.place[first]) for part in order.reshape(-1, size)]
    return found


def groups_report(
    protocol: str,
    truth: Truth,
    said: Sequence[Prediction],
    taken: Sequence[SimulatedMetadata],
    azimuth: Floats,
    crops_each: int,
) -> str:
    """The tables of one protocol; `azimuth` (N,) is where each crop's camera points in its panorama."""
    dealt = {size: _groups_of(truth, crops_each, size) for size in SIZES}
    rows = {}
    for name, evidence in MODES.items():
        for size, groups in dealt.items():
            fused = [_answer(g, said, taken, azimuth, evidence, known_headings=name in KNOWN) for g in groups]
            rows[f"{size}, {name}"] = _figures(truth, groups, fused, azimuth)
    return "\n\n".join(
        [
            f"## Several photos together, protocol `{protocol}`: crops of {len(dealt[crops_each])} panoramas [deg]",
            SIMULATION,
            figures_table(rows),
            _correlation_report(truth, said, azimuth, crops_each),
        ]
    )


def _nothing(_: SimulatedMetadata, __: np.random.Generator, ___: float) -> Observations:
    return Observations()


def _compass(taken: SimulatedMetadata, rng: np.random.Generator, shared: float) -> Observations:
    return Observations(heading=(taken.heading + shared + rng.normal(0, COMPASS_JITTER)) % 360.0)


def _time(taken: SimulatedMetadata, _: np.random.Generator, __: float) -> Observations:
    return observations_from_metadata(
        keep_evidence(taken.metadata, (EvidenceKind.TIME_AND_PLACE,)), NO_USER_INPUT
    ).observations


def _time_and_compass(taken: SimulatedMetadata, rng: np.random.Generator, shared: float) -> Observations:
    return replace(_time(taken, rng, shared), heading=_compass(taken, rng, shared).heading)


MODES: dict[str, Callable[[SimulatedMetadata, np.random.Generator, float], Observations]] = {
    "headings known": _nothing,
    "compass headings": _compass,
    "headings unknown": _nothing,
    "headings known, time+place": _time,
    "compass headings, time+place": _time_and_compass,
}
KNOWN = ("headings known", "headings known, time+place")


def _answer(
    group: _Group,
    said: Sequence[Prediction],
    taken: Sequence[SimulatedMetadata],
    azimuth: Floats,
    evidence: Callable[[SimulatedMetadata, np.random.Generator, float], Observations],
    *,
    known_headings: bool,
) -> tuple[Posterior, ...]:
    rng = np.random.default_rng(int(group.members[0]))
    shared = rng.normal(0, COMPASS_ERROR)
    given = [evidence(taken[i], rng, shared) for i in group.members]
    headings = [float(azimuth[i]) for i in group.members] if known_headings else None
    return fuse_views([said[i] for i in group.members], given, headings)


def _figures(
    truth: Truth, groups: Sequence[_Group], fused: Sequence[tuple[Posterior, ...]], azimuth: Floats
) -> dict[str, float]:
    """Median errors over all crops of all groups, and the share of truths inside the regions."""
    members = np.concatenate([g.members for g in groups])
    flat = [f for answers in fused for f in answers]
    sun = direction([f.sun.azimuth for f in flat], [f.sun.elevation for f in flat])
    error = angle_between(truth.sun[members], sun)
    turned = [_turn_errors(azimuth[g.members], answers) for g, answers in zip(groups, fused, strict=True)]
    return {
        "crops": float(len(flat)),
        "sun": median(error),
        "elevation": median(np.abs(angles(sun)[1] - angles(truth.sun[members])[1])),
        "in 50 % region": percentage(error <= [f.sun.radius_50 for f in flat]),
        "in 90 % region": percentage(error <= [f.sun.radius_90 for f in flat]),
        "turbidity": median(np.abs([f.prediction.turbidity for f in flat] - truth.turbidity[members])),
        "relative heading": median(np.concatenate(turned)),
    }


def _turn_errors(azimuth: Floats, answers: Sequence[Posterior]) -> Floats:
    """Errors [deg] of the inferred headings, which are relative to the first photo's."""
    found: list[tuple[float, Heading]] = [
        (float(turn), f.relative_heading)
        for turn, f in zip(azimuth[1:] - azimuth[0], answers[1:], strict=True)
        if f.relative_heading is not None
    ]
    return np.array([abs(float(wrap_azimuth(heading.best - turn))) for turn, heading in found])

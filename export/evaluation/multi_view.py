"""What several crops of one panorama gain together, and how their errors correlate.

The correlation is learnt on one half of the places and tested on the other, and the reverse. That of elevations which
ships lies between those of the two protocols, learnt on all places; those by overlap were learnt by
`python -m export turns overlap` of commit 6df25d7.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from textwrap import fill

import numpy as np
from numpy.typing import NDArray

from export.crops.crops import crop_rng
from export.evaluation import metrics
from export.evaluation.metadata import COMPASS_MEDIAN, PHONE_STD, SimulatedMetadata, keep_evidence
from lighting.decoding import sun_from_prediction, sun_from_rings
from lighting.fusion.metadata_prior import observations_from_metadata
from lighting.fusion.multi_view import fuse_views
from lighting.fusion.pooling import elevation_density, pooling_exponent, rotate_density
from lighting.fusion.single_view import Observations, Posterior
from lighting.fusion.user_input import NO_USER_INPUT
from lighting.geometry import Floats, angle_between, angles, direction, wrap_azimuth
from lighting.prediction import Prediction
from lighting.records import EvidenceKind
from lighting.sun_grid import HEADINGS, grid_directions, smooth_density

SIZES = (2, 4, 8)  # views; one panorama has 8 crops
CORRELATIONS = np.round(np.arange(0.1, 1.55, 0.1), 2)  # tried
_KINDS = ("sun", "azimuth", "elevation")


@dataclass(frozen=True)
class _Densities:
    """The answers for the crops of one panorama, turned into its frame."""

    log: dict[str, Floats]  # by kind: logarithmic densities (crops, N) over the cells or around the ring
    cell: dict[str, int]  # by kind: the index of the true one of the N
    sun: Floats  # (3,) the true sun
    half: int  # 0 or 1: the half that the place belongs to
    prediction: Prediction  # of the first crop


def _correlation_report(
    truth: metrics.Truth, predictions: Sequence[Prediction], azimuth: Floats, crops_each: int
) -> str:
    """A table of the correlations learnt on each half of the places, with the coverage on the other half."""
    halves = place_halves(truth)
    views = [
        _views(truth, predictions, azimuth, range(first, first + crops_each), halves[truth.place[first]])
        for first in range(0, len(predictions), crops_each)
        if truth.scored[first]
    ]
    rows = {}
    for name, halves_fitted in (("half A", (0,)), ("half B", (1,)), ("all", (0, 1))):
        if not (training := [v for v in views if v.half in halves_fitted]):  # one place alone
            continue
        correlations = {kind: _fit_correlation(training, kind) for kind in _KINDS}
        tested = [v for v in views if v.half not in halves_fitted] or views
        rows[name] = {"panoramas": float(len(training)), **correlations, **_coverage(tested, correlations)}
    share = "share [%] inside the 90 % region on the other (`all`: on all)"
    return f"Correlations learnt on one half of the places; {share}\n\n{metrics.figures_table(rows)}"


def place_halves(truth: metrics.Truth) -> dict[str, int]:
    """The half, 0 or 1, of each place; both halves have about as many crops.

    Args:
        truth: of N crops.
    """
    places, counts = np.unique(truth.place[truth.scored], return_counts=True)
    return {str(place): i % 2 for i, place in enumerate(places[np.argsort(-counts, kind="stable")])}


def _views(
    truth: metrics.Truth, predictions: Sequence[Prediction], azimuth: Floats, members: range, half: int
) -> _Densities:
    """The answers for the crops `members` of one panorama; `azimuth` (N,) is where each crop's camera points in it."""
    first, layout = members[0], predictions[0].spec.sun_grid
    sun, cells = truth.sun[first], grid_directions(layout)
    sun_azimuth, sun_elevation = map(float, angles(sun))
    rotated = [(predictions[i], float(azimuth[first] - azimuth[i])) for i in members]
    rings = [(p.sun_probability, direction(HEADINGS + angle, sun_elevation)) for p, angle in rotated]  # by azimuth
    densities = {
        "sun": [rotate_density(p.sun_probability, angle, layout) for p, angle in rotated],
        "azimuth": [smooth_density(*ring, layout) for ring in rings],
        "elevation": [elevation_density(p, angles(cells)[1]) for p, _ in rotated],
    }
    cell = int(np.argmax(cells @ sun))
    true_cell = {"sun": cell, "azimuth": round(sun_azimuth) % 360, "elevation": cell}
    logs = {kind: np.log(np.maximum(values, 1e-12)) for kind, values in densities.items()}
    return _Densities(logs, true_cell, sun, half, predictions[first])


def _deal_crops(views: Sequence[_Densities], size: int) -> list[tuple[_Densities, NDArray[np.intp]]]:
    """Each panorama's crops in groups."""
    rng = np.random.default_rng(size)
    return [(v, part) for v in views for part in rng.permutation(len(v.log["sun"])).reshape(-1, size)]


def _fit_correlation(views: Sequence[_Densities], kind: str) -> float:
    """The correlation with the least negative log density at the true suns, over all sizes."""
    dealt = [[(v.log[kind][part], v.cell[kind]) for v, part in _deal_crops(views, n)] for n in SIZES]

    def loss(logs: Floats, cell: int, correlation: float) -> float:
        product = logs.sum(axis=0) * pooling_exponent(len(logs), correlation)
        return float(np.logaddexp.reduce(product) - product[cell])

    losses = [np.mean([np.mean([loss(*one, c) for one in groups]) for groups in dealt]) for c in CORRELATIONS]
    return float(CORRELATIONS[int(np.argmin(losses))])


def _coverage(views: Sequence[_Densities], correlations: dict[str, float]) -> dict[str, float]:
    return {
        f"{kind}, {size} views": float(100 * np.mean([_inside(v, kind, part, correlations[kind]) for v, part in parts]))
        for kind in ("sun", "azimuth")
        for size, parts in ((size, _deal_crops(views, size)) for size in SIZES)
    }


def _inside(views: _Densities, kind: str, part: NDArray[np.intp], correlation: float) -> bool:
    """Whether the true sun is in the 90 % region of crops taken together."""
    product = views.log[kind][part].sum(axis=0) * pooling_exponent(len(part), correlation)
    probability = np.exp(product - product.max())
    probability /= probability.sum()
    if kind == "azimuth":
        sun = sun_from_rings(direction(HEADINGS, float(angles(views.sun)[1])), probability)
    else:
        sun = sun_from_prediction(replace(views.prediction, sun_probability=probability))
    return float(angle_between(direction(sun.azimuth, sun.elevation), views.sun)) <= sun.radius_90


# Accuracy and coverage of several crops of one panorama taken together.

_COMPASS_JITTER = 10.0  # deg, standard deviation between two headings of one phone; the rest of its error is shared
_SIMULATION = fill(
    "Groups of views of one panorama. Known headings are exact. Compass headings share one error with a median of "
    f"{COMPASS_MEDIAN:g}°, and each has its own of {_COMPASS_JITTER:g}° standard deviation. The views share elevation, "
    "turbidity and exposure; unknown headings are inferred relative to the first view.",
    120,
)


def _group_crops(truth: metrics.Truth, crops_each: int, size: int) -> list[NDArray[np.intp]]:
    """Indices (size,) of the scored crops of each panorama, dealt into groups."""
    groups: list[NDArray[np.intp]] = []
    for first in range(0, len(truth.scored), crops_each):
        if truth.scored[first]:
            order = crop_rng(truth.panorama[first], size, "group").permutation(crops_each) + first
            groups += list(order.reshape(-1, size))
    return groups


def groups_report(
    protocol: str,
    truth: metrics.Truth,
    predictions: Sequence[Prediction],
    simulated: Sequence[SimulatedMetadata],
    azimuth: Floats,
    crops_each: int,
) -> str:
    """The tables of one protocol.

    Args:
        protocol: its name.
        truth: of N crops, panorama by panorama.
        predictions: N, of the same crops.
        simulated: N, metadata of the same crops.
        azimuth: (N,) deg where each crop's camera points in its panorama.
        crops_each: of a panorama.
    """
    dealt = {size: _group_crops(truth, crops_each, size) for size in SIZES}
    rows = {}
    for mode, (size, groups) in product(_MODES, dealt.items()):
        fused = [_fuse_group(group, predictions, simulated, mode, azimuth) for group in groups]
        rows[f"{size}, {mode}"] = _figures(truth, groups, fused, azimuth)
    sections = [
        f"## Several photos together, protocol `{protocol}`: crops of {len(dealt[crops_each])} panoramas [deg]",
        _SIMULATION,
        metrics.figures_table(rows),
        _correlation_report(truth, predictions, azimuth, crops_each),
    ]
    return "\n\n".join(sections)


_MODES = (  # what is known of the views
    "headings known",
    "compass headings",
    "headings unknown",
    "headings known, time+place",
    "compass headings, time+place",
)


def _fuse_group(
    group: NDArray[np.intp],
    predictions: Sequence[Prediction],
    simulated: Sequence[SimulatedMetadata],
    mode: str,
    azimuth: Floats,
) -> tuple[Posterior, ...]:
    """The light of crops taken together, by what a mode of _MODES knows of them; azimuth (N,)."""
    rng = np.random.default_rng(int(group[0]))
    shared = rng.normal(0, PHONE_STD)  # error of all headings
    observed = []
    for one in (simulated[i] for i in group):
        known = Observations()
        if "time+place" in mode:
            metadata = keep_evidence(one.metadata, (EvidenceKind.TIME_AND_PLACE,))
            known = observations_from_metadata(metadata, NO_USER_INPUT).observations
        if "compass" in mode:
            known = replace(known, heading=(one.heading + shared + rng.normal(0, _COMPASS_JITTER)) % 360.0)
        observed.append(known)
    headings = azimuth[group].tolist() if "headings known" in mode else None
    return fuse_views([predictions[i] for i in group], observed, headings)


def _figures(
    truth: metrics.Truth, groups: Sequence[NDArray[np.intp]], fused: Sequence[tuple[Posterior, ...]], azimuth: Floats
) -> dict[str, float]:
    """Median errors over all crops of all groups, and the share of truths inside the regions."""
    members = np.concatenate(groups)
    posteriors = [posterior for group in fused for posterior in group]
    answers, grouped = metrics.answers_from_estimates([p.sun for p in posteriors]), metrics.select_crops(truth, members)
    headings = [_heading_errors(azimuth[group], fused_group) for group, fused_group in zip(groups, fused, strict=True)]
    figures = metrics.sun_figures(grouped, answers)
    return {
        "crops": float(len(posteriors)),
        "sun": figures["median"],
        **{name: figures[name] for name in ("elevation", "in 50 % region", "in 90 % region")},
        "turbidity": metrics.median(np.abs([p.prediction.turbidity for p in posteriors] - grouped.turbidity)),
        "relative heading": metrics.median(np.concatenate(headings)),
    }


def _heading_errors(azimuth: Floats, posteriors: Sequence[Posterior]) -> Floats:
    """Errors [deg] of the inferred headings, which are relative to the first photo's."""
    true = (azimuth[1:] - azimuth[0]).tolist()
    headings = [(t, p.relative_heading) for t, p in zip(true, posteriors[1:], strict=True)]
    return np.array([abs(float(wrap_azimuth(heading.best - t))) for t, heading in headings if heading is not None])

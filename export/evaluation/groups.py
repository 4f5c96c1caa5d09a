"""Accuracy and coverage of several crops of one panorama taken together."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from textwrap import fill

import numpy as np
from numpy.typing import NDArray

from export.crops import generator
from export.evaluation.correlation import SIZES, correlation_report
from export.evaluation.metrics import median, share
from export.evaluation.records import Truth
from export.evaluation.simulated_metadata import COMPASS_ERROR, COMPASS_MEDIAN, Taken, only
from export.evaluation.tables import figures_table
from lighting.circular import Heading
from lighting.evidence import NOTHING_GIVEN, Evidence, Fused, fuse_together, known
from lighting.geometry import Floats, angle_between, angles, direction, wrap_azimuth
from lighting.records import EvidenceKind, Prediction

COMPASS_JITTER = 10.0  # deg, standard deviation between two headings of one phone; the rest of its error is shared
SIMULATION = fill(
    "Groups of views of one panorama. Known headings are exact. Compass headings share one error with a median of "
    f"{COMPASS_MEDIAN:g}°, and each has its own of {COMPASS_JITTER:g}° standard deviation. The views share elevation, "
    "turbidity and exposure; unknown headings are inferred relative to the first view.",
    120,
)


@dataclass(frozen=True)
class Group:
    """Crops of one panorama."""

    members: NDArray[np.intp]  # (n,) indices of crops
    place: str


def groups_of(truth: Truth, crops_each: int, size: int) -> list[Group]:
    """The scored crops of each panorama, dealt into groups of `size`."""
    found = []
    for first in range(0, len(truth.scored), crops_each):
        if truth.scored[first]:
            order = generator(truth.panorama[first], size, "group").permutation(crops_each) + first
            found += [Group(part, truth.place[first]) for part in order.reshape(-1, size)]
    return found


def groups_report(
    protocol: str, truth: Truth, said: Sequence[Prediction], taken: Sequence[Taken], azimuth: Floats, crops_each: int
) -> str:
    """The tables of one protocol; `azimuth` (N,) is where each crop's camera points in its panorama."""
    dealt = {size: groups_of(truth, crops_each, size) for size in SIZES}
    rows = {}
    for name, evidence in MODES.items():
        for size, groups in dealt.items():
            fused = [_answer(g, said, taken, azimuth, evidence, known_headings=name in KNOWN) for g in groups]
            rows[f"{size}, {name}"] = figures(truth, groups, fused, azimuth)
    return "\n\n".join(
        [
            f"## Several photos together, protocol `{protocol}`: crops of {len(dealt[crops_each])} panoramas [deg]",
            SIMULATION,
            figures_table(rows),
            correlation_report(truth, said, azimuth, crops_each),
        ]
    )


def _nothing(_: Taken, __: np.random.Generator, ___: float) -> Evidence:
    return Evidence()


def _compass(taken: Taken, rng: np.random.Generator, shared: float) -> Evidence:
    return Evidence(heading=(taken.heading + shared + rng.normal(0, COMPASS_JITTER)) % 360.0)


def _time(taken: Taken, _: np.random.Generator, __: float) -> Evidence:
    return known(only(taken.facts, (EvidenceKind.TIME_AND_PLACE,)), NOTHING_GIVEN).evidence


def _time_and_compass(taken: Taken, rng: np.random.Generator, shared: float) -> Evidence:
    return replace(_time(taken, rng, shared), heading=_compass(taken, rng, shared).heading)


MODES: dict[str, Callable[[Taken, np.random.Generator, float], Evidence]] = {
    "headings known": _nothing,
    "compass headings": _compass,
    "headings unknown": _nothing,
    "headings known, time+place": _time,
    "compass headings, time+place": _time_and_compass,
}
KNOWN = ("headings known", "headings known, time+place")


def _answer(
    group: Group,
    said: Sequence[Prediction],
    taken: Sequence[Taken],
    azimuth: Floats,
    evidence: Callable[[Taken, np.random.Generator, float], Evidence],
    *,
    known_headings: bool,
) -> tuple[Fused, ...]:
    rng = np.random.default_rng(int(group.members[0]))
    shared = rng.normal(0, COMPASS_ERROR)
    given = [evidence(taken[i], rng, shared) for i in group.members]
    headings = [float(azimuth[i]) for i in group.members] if known_headings else None
    return fuse_together([said[i] for i in group.members], given, headings)


def figures(
    truth: Truth, groups: Sequence[Group], fused: Sequence[tuple[Fused, ...]], azimuth: Floats
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
        "in 50 % region": share(error <= [f.sun.radius_50 for f in flat]),
        "in 90 % region": share(error <= [f.sun.radius_90 for f in flat]),
        "turbidity": median(np.abs([f.prediction.turbidity for f in flat] - truth.turbidity[members])),
        "relative heading": median(np.concatenate(turned)),
    }


def _turn_errors(azimuth: Floats, answers: Sequence[Fused]) -> Floats:
    """Errors [deg] of the inferred headings, which are relative to the first photo's."""
    found: list[tuple[float, Heading]] = [
        (float(turn), f.relative_heading)
        for turn, f in zip(azimuth[1:] - azimuth[0], answers[1:], strict=True)
        if f.relative_heading is not None
    ]
    return np.array([abs(float(wrap_azimuth(heading.best - turn))) for turn, heading in found])

"""Rotation averaging: the orientations of many cameras from the turns of some pairs (Hartley et al. 2013).

Gauss-Newton on the rotation vectors, each turn weighted by its covariance. Sums of distances are minimised first, which
a turn that contradicts the others cannot hold; then Cauchy's weight takes from such a turn most of what it says.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from lighting.geometry import Floats
from lighting.turns.rays import nearest_rotation, rotation_about, rotation_vector
from lighting.turns.rotation import Turn

Pairs = Mapping[tuple[int, int], Turn]  # by the numbers of both photos, the lower first

OUTLYING = 5.0  # standard deviations from which a turn counts for half
LEAST_SIGMA = 0.02  # deg, under which no turn is believed: lenses are not perfect pinholes
STEPS = 20  # under one weight, at most

Weight = Callable[[float], float]


@dataclass(frozen=True, eq=False)
class Oriented:
    """Cameras that are connected by turns."""

    members: tuple[int, ...]  # numbers of the photos, ascending
    rotations: Floats  # (n, 3, 3) directions in the first member's frame to each member's
    covariance: Floats  # (n, 3, 3) [deg^2] of the small rotation in each member's frame; zero for the first


def components(count: int, pairs: Pairs) -> list[tuple[int, ...]]:
    """The photos 0 to `count` - 1 in groups that turns connect, each ascending, by their first photo."""
    group = list(range(count))
    for a, b in pairs:
        low, high = sorted((group[a], group[b]))
        group = [low if g == high else g for g in group]
    return [tuple(i for i in range(count) if group[i] == g) for g in sorted(set(group))]


def average(members: tuple[int, ...], pairs: Pairs) -> Oriented:
    """The orientations of connected photos."""
    inside = {pair: turn for pair, turn in pairs.items() if pair[0] in members}
    place = {number: k for k, number in enumerate(members)}
    rotations = _along_the_surest(members, inside)
    for weight in (_by_distance, _by_cauchy) if len(members) > 1 else ():
        rotations = _settled(inside, place, rotations, weight)
    return Oriented(members, nearest_rotation(rotations), _covariances(inside, place, rotations))


def _settled(pairs: Pairs, place: Mapping[int, int], rotations: Floats, weight: Weight) -> Floats:
    """The orientations after as many steps as change anything."""
    for _ in range(STEPS):
        normal, pull = _normal_equations(pairs, place, rotations, weight)
        step = np.linalg.solve(normal, pull).reshape(-1, 3)
        rotations = np.concatenate([rotations[:1], rotation_about(step) @ rotations[1:]])
        if np.abs(step).max() < 1e-9:
            break
    return rotations


def _along_the_surest(members: tuple[int, ...], pairs: Pairs) -> Floats:
    """Orientations (n, 3, 3) by the surest turns that connect all (Prim's spanning tree)."""
    known = {members[0]: np.eye(3)}
    order = sorted(pairs, key=lambda pair: pairs[pair].sigma)
    while len(known) < len(members):
        a, b = next(pair for pair in order if (pair[0] in known) != (pair[1] in known))
        turn = pairs[a, b].rotation
        known |= {b: turn @ known[a]} if a in known else {a: turn.T @ known[b]}
    return np.array([known[number] for number in members])


def _normal_equations(
    pairs: Pairs, place: Mapping[int, int], rotations: Floats, weigh: Weight
) -> tuple[Floats, Floats]:
    """Matrix (3(n-1), 3(n-1)) and right side of the corrections [rad] of all orientations but the first."""
    size = 3 * len(rotations)
    normal, pull = np.zeros((size, size)), np.zeros(size)
    for (a, b), turn in pairs.items():
        i, j = place[a], place[b]
        expected = rotations[j] @ rotations[i].T
        off = rotation_vector(turn.rotation @ expected.T)
        slope = np.zeros((3, size))
        slope[:, 3 * j : 3 * j + 3], slope[:, 3 * i : 3 * i + 3] = np.eye(3), -expected
        weight = _inverse(turn) * weigh(float(off @ _inverse(turn) @ off))
        normal += slope.T @ weight @ slope
        pull += slope.T @ weight @ off
    return normal[3:, 3:], pull[3:]


def _inverse(turn: Turn) -> Floats:
    """Inverse covariance (3, 3) [1/rad^2]."""
    return np.asarray(np.linalg.inv(np.radians(np.radians(turn.covariance + LEAST_SIGMA**2 * np.eye(3)))))


def _by_distance(square: float) -> float:
    """The weight of a turn this many squared standard deviations off, for the least sum of distances."""
    return 1.0 / max(float(np.sqrt(square)), 0.1)


def _by_cauchy(square: float) -> float:
    return 1.0 / (1.0 + square / OUTLYING**2)


def _covariances(pairs: Pairs, place: Mapping[int, int], rotations: Floats) -> Floats:
    if len(rotations) == 1:
        return np.zeros((1, 3, 3))
    inverse = np.linalg.inv(_normal_equations(pairs, place, rotations, _by_cauchy)[0])
    own = [inverse[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] for k in range(len(rotations) - 1)]
    return np.concatenate([np.zeros((1, 3, 3)), np.degrees(np.degrees(np.array(own)))])

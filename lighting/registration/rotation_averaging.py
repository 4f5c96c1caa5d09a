"""Orientations of cameras by their relative rotations, averaged on the group of rotations, outliers weighted down.

Orientations follow from the relative rotations of some pairs [1]: Gauss-Newton on the rotation vectors, each pair
weighted by its covariance. Sums of distances are minimized first, which a pair that contradicts the others cannot pull;
then Cauchy's weight takes from such a pair most of what it says.

References:
    [1] Hartley, Trumpf, Dai and Li, "Rotation averaging", IJCV 2013.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from lighting.geometry import Floats
from lighting.registration.rotations import nearest_rotation, rotation_about, rotation_vector
from lighting.registration.two_view import RelativeRotation

PairRotations = Mapping[tuple[int, int], RelativeRotation]  # by the numbers of both photos, the lower first
_CAUCHY_SCALE = 5.0  # standard deviations from which a pair counts for half
_MIN_STD = 0.02  # deg, under which no rotation is believed: lenses are not perfect pinholes
_MAX_STEPS = 20  # under one weight, at most
_WeightFn = Callable[[float], float]


@dataclass(frozen=True, eq=False)
class OrientedGroup:
    """Cameras that relative rotations connect."""

    members: tuple[int, ...]
    """Numbers of the photos, ascending."""
    rotations: Floats
    """(n, 3, 3) directions in the first member's frame to each member's."""
    covariance: Floats
    """(n, 3, 3) [deg^2] of the small rotation in each member's frame; zero for the first."""


def connected_components(count: int, pairs: PairRotations) -> list[tuple[int, ...]]:
    """The photos in groups that pairs connect, each ascending, by their first photo.

    Args:
        count: of the photos.
        pairs: the relative rotations.
    """
    group = list(range(count))
    for a, b in pairs:
        low, high = sorted((group[a], group[b]))
        group = [low if g == high else g for g in group]
    return [tuple(i for i in range(count) if group[i] == g) for g in sorted(set(group))]


def average_rotations(members: tuple[int, ...], pairs: PairRotations) -> OrientedGroup:
    """The orientations of connected photos.

    Args:
        members: numbers of the photos, ascending.
        pairs: the relative rotations, of these photos or of more.
    """
    inside = {pair: relative for pair, relative in pairs.items() if pair[0] in members}
    index = {number: k for k, number in enumerate(members)}
    rotations = _spanning_tree(members, inside)
    for weight in (_l1_weight, _cauchy_weight) if len(members) > 1 else ():
        for _ in range(_MAX_STEPS):
            normal, pull = _normal_equations(inside, index, rotations, weight)
            step = np.linalg.solve(normal, pull).reshape(-1, 3)
            rotations = np.concatenate([rotations[:1], rotation_about(step) @ rotations[1:]])
            if np.abs(step).max() < 1e-9:
                break
    return OrientedGroup(members, nearest_rotation(rotations), _covariances(inside, index, rotations))


def _spanning_tree(members: tuple[int, ...], pairs: PairRotations) -> Floats:
    """Orientations (n, 3, 3) by the surest pairs that connect all (Prim's spanning tree)."""
    oriented = {members[0]: np.eye(3)}
    order = sorted(pairs, key=lambda pair: pairs[pair].std)
    while len(oriented) < len(members):
        a, b = next(pair for pair in order if (pair[0] in oriented) != (pair[1] in oriented))
        relative = pairs[a, b].rotation
        oriented |= {b: relative @ oriented[a]} if a in oriented else {a: relative.T @ oriented[b]}
    return np.array([oriented[number] for number in members])


def _normal_equations(
    pairs: PairRotations, index: Mapping[int, int], rotations: Floats, weigh: _WeightFn
) -> tuple[Floats, Floats]:
    """Matrix (3(n-1), 3(n-1)) and right side of the corrections [rad] of all orientations but the first."""
    size = 3 * len(rotations)
    normal, pull = np.zeros((size, size)), np.zeros(size)
    for (a, b), relative in pairs.items():
        i, j = index[a], index[b]
        expected = rotations[j] @ rotations[i].T
        error = rotation_vector(relative.rotation @ expected.T)
        slope = np.zeros((3, size))
        slope[:, 3 * j : 3 * j + 3], slope[:, 3 * i : 3 * i + 3] = np.eye(3), -expected
        weight = _information(relative) * weigh(float(error @ _information(relative) @ error))
        normal += slope.T @ weight @ slope
        pull += slope.T @ weight @ error
    return normal[3:, 3:], pull[3:]


def _information(relative: RelativeRotation) -> Floats:
    """Inverse covariance (3, 3) [1/rad^2]."""
    return np.asarray(np.linalg.inv(np.radians(np.radians(relative.covariance + _MIN_STD**2 * np.eye(3)))))


def _l1_weight(square: float) -> float:
    """The weight of a rotation this many squared standard deviations off, for the least sum of distances."""
    return 1.0 / max(float(np.sqrt(square)), 0.1)


def _cauchy_weight(square: float) -> float:
    return 1.0 / (1.0 + square / _CAUCHY_SCALE**2)


def _covariances(pairs: PairRotations, index: Mapping[int, int], rotations: Floats) -> Floats:
    if len(rotations) == 1:
        return np.zeros((1, 3, 3))
    inverse = np.linalg.inv(_normal_equations(pairs, index, rotations, _cauchy_weight)[0])
    blocks = [inverse[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] for k in range(len(rotations) - 1)]
    return np.concatenate([np.zeros((1, 3, 3)), np.degrees(np.degrees(np.array(blocks)))])

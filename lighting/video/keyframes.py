"""Keyframes in one frame: a graph of turns between them, and the orientations that fit all of them best.

Errors of a chain of turns add up; where the camera comes back to what it saw, features of keyframes are matched and
the loop is closed. Orientations then are those with the least sum of squared differences to all turns (rotation
averaging; Chatterji and Govindu 2013 describe the steps taken here), turns far off counting little.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats, angle_between
from lighting.turns import Turn, match, rotation_about, rotation_of, rotation_vector
from lighting.video.follow import Key

JOINS = 2  # keyframes to either side of a gap that are compared
NEIGHBOURS = 5  # keyframes; those nearer in time need no loop
NEAR_ENOUGH = 0.5  # of the vertical field of view, up to which two keyframes are compared
MOST_LOOPS = 60  # compared in a shot
MOST_KEYS = 1200  # beyond which the chain is left as it is: the graph would take too much memory
_STEPS = 12  # of the averaging, at most
_WRONG = 0.5  # deg, beyond which a turn counts for ever less


@dataclass(frozen=True, eq=False)
class Link:
    """A turn between two keyframes."""

    a: int
    b: int
    rotation: Floats  # (3, 3) directions in a's camera to b's
    weight: float = 1.0


def turn_between(a: Key, b: Key, vertical_fov: float | None, fov_sigma: float = 0.0) -> Turn | None:
    """The turn from a to b by their features, None where they have too little in common.

    The lens is given [deg], exactly or with a standard deviation of both pictures' lenses, or unknown.
    """
    if a.picture.shape != b.picture.shape:
        return None
    size = (a.picture.shape[1], a.picture.shape[0])
    return rotation_of(match(a.features, b.features), size, size, (vertical_fov, vertical_fov), fov_sigma)


def chained(count: int, links: Sequence[Link]) -> tuple[Floats, NDArray[np.intp]]:
    """Orientations (K, 3, 3) along the links, and which part (K,) each keyframe belongs to.

    Each part's first keyframe has the identity.
    """
    orientation, part = np.tile(np.eye(3), (count, 1, 1)), np.full(count, -1)
    near: list[list[tuple[int, Floats]]] = [[] for _ in range(count)]
    for link in links:
        near[link.a].append((link.b, link.rotation))
        near[link.b].append((link.a, link.rotation.T))
    for start in range(count):
        waiting = [start] if part[start] < 0 else []
        if waiting:
            part[start] = start
        while waiting:
            here = waiting.pop(0)
            for there, rotation in near[here]:
                if part[there] < 0:
                    part[there], orientation[there] = start, rotation @ orientation[here]
                    waiting.append(there)
    return orientation, part


def averaged(orientation: Floats, links: Sequence[Link], fixed: NDArray[np.bool_]) -> Floats:
    """Orientations (K, 3, 3) that fit the links best, from ones nearby; those `fixed` (K,) stay."""
    count = len(orientation)
    if len(links) < count or count > MOST_KEYS:
        return orientation
    a, b = (np.array([getattr(link, end) for link in links]) for end in ("a", "b"))
    turns, given = np.stack([link.rotation for link in links]), np.array([link.weight for link in links])
    for _ in range(_STEPS):
        off = np.swapaxes(orientation[b], 1, 2) @ turns @ orientation[a]
        residual = np.stack([rotation_vector(r) for r in off])
        weight = given / (1.0 + np.sum(residual**2, axis=1) / np.radians(_WRONG) ** 2)
        step = _corrections(a, b, residual, weight, fixed)
        orientation = orientation @ rotation_about(step)
        if np.abs(step).max() < 1e-7:
            break
    return orientation


def _corrections(
    a: NDArray[np.intp], b: NDArray[np.intp], residual: Floats, weight: Floats, fixed: NDArray[np.bool_]
) -> Floats:
    """Small rotation vectors (K, 3) in the first camera's frame, by which orientations are to be turned."""
    count = len(fixed)
    laplacian, right = np.zeros((count, count)), np.zeros((count, 3))
    np.add.at(laplacian, (a, a), weight)
    np.add.at(laplacian, (b, b), weight)
    np.add.at(laplacian, (a, b), -weight)
    np.add.at(laplacian, (b, a), -weight)
    np.add.at(right, b, weight[:, None] * residual)
    np.add.at(right, a, -weight[:, None] * residual)
    laplacian[fixed] = 0.0
    laplacian[fixed, fixed] = 1.0
    right[fixed] = 0.0
    return np.linalg.solve(laplacian + 1e-9 * np.eye(count), right)


def loops(keys: Sequence[Key], orientation: Floats, part: NDArray[np.intp], vertical_fov: float) -> list[Link]:
    """Turns by features between keyframes that look nearly the same way and are not neighbours."""
    pairs = _near_pairs(orientation, part, NEAR_ENOUGH * vertical_fov)
    step = max(1, math.ceil(len(pairs) / MOST_LOOPS))
    found = [(i, j, turn_between(keys[i], keys[j], vertical_fov)) for i, j in pairs[::step]]
    return [Link(i, j, turn.rotation, 0.5) for i, j, turn in found if turn is not None]


def _near_pairs(orientation: Floats, part: NDArray[np.intp], within: float) -> list[tuple[int, int]]:
    """Pairs of keyframes that look the same way to an angle [deg], each with the nearest of those long before it."""
    pairs = []
    for j in range(NEIGHBOURS, len(orientation)):
        older = np.flatnonzero(part[: j - NEIGHBOURS + 1] == part[j])
        if not len(older):
            continue
        apart = angle_between(orientation[older, 2], orientation[j, 2])
        if apart.min() < within:
            pairs.append((int(older[int(np.argmin(apart))]), j))
    return pairs

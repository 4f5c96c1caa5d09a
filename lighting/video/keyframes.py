"""Keyframes in one frame: a graph of turns between them, and the orientations that fit all of them best.

Errors of a chain of turns add up; where the camera comes back to what it saw, features of keyframes are matched and
the loop is closed. Orientations then are those with the least sum of squared differences to all turns (rotation
averaging; Chatterji and Govindu 2013 describe the steps taken here), turns far off counting little.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats
from lighting.turns.match import match
from lighting.turns.rays import rotation_about, rotation_vector
from lighting.turns.rotation import Turn, rotation_of
from lighting.video.follow import Key

LOOPS_EACH = 2  # older keyframes that a keyframe is compared with
NEAR_ENOUGH = 0.6  # of the diagonal field of view, up to which two keyframes are compared
MOST_KEYS = 1200  # beyond which the chain is left as it is: the graph would take too much memory
_STEPS = 12
_WRONG = 0.5  # deg, beyond which a turn counts for ever less


@dataclass(frozen=True, eq=False)
class Link:
    """A turn between two keyframes."""

    a: int
    b: int
    rotation: Floats  # (3, 3) directions in a's camera to b's
    weight: float = 1.0


def turn_between(a: Key, b: Key, vertical_fov: float | None) -> Turn | None:
    """The turn from a to b by their features, None where they have too little in common.

    The lens is given [deg], or unknown.
    """
    size = (a.features.width, a.features.height)
    if size != (b.features.width, b.features.height):
        return None
    return rotation_of(match(a.features, b.features), size, size, (vertical_fov, vertical_fov))


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
    ahead = -orientation[:, 2]
    first = keys[0].features
    diagonal = np.degrees(2 * np.arctan(np.tan(np.radians(vertical_fov / 2)) * np.hypot(1, first.width / first.height)))
    found = []
    for j in range(len(keys)):
        older = np.flatnonzero((part[:j] == part[j]) & (np.arange(j) < j - 2))
        apart = np.degrees(np.arccos(np.clip(ahead[older] @ ahead[j], -1.0, 1.0)))
        for i in older[np.argsort(apart, kind="stable")][:LOOPS_EACH]:
            if np.degrees(np.arccos(np.clip(ahead[i] @ ahead[j], -1.0, 1.0))) < NEAR_ENOUGH * diagonal:
                turn = turn_between(keys[i], keys[j], vertical_fov)
                found += [] if turn is None else [Link(int(i), j, turn.rotation, 0.5)]
    return found

"""RANSAC (Fischler and Bolles 1981) for a rotation and a focal length that many matches obey."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats
from lighting.turns.match import Matches
from lighting.turns.rays import rays

TOLERANCE = 3.0  # pixels within which a match obeys
SAMPLES = 300  # pairs of matches tried for each focal length
SCORED = 250  # matches, the surest, that each trial is scored on


@dataclass(frozen=True, eq=False)
class Found:
    """The best trial."""

    rotation: Floats  # (3, 3) directions in the first camera's frame to the second's
    zoom: float  # both focal lengths times this


def search(matches: Matches, focal: tuple[float, float], zooms: Sequence[float]) -> Found:
    """The rotation and the zoom that most of the surest matches obey; `matches` are two or more."""
    rng = np.random.default_rng(0)  # the same answer every time
    best, found = -np.inf, Found(np.eye(3), 1.0)
    for zoom in zooms:
        a, b = rays(matches.a[:SCORED], zoom * focal[0]), rays(matches.b[:SCORED], zoom * focal[1])
        trials = _through_pairs(a, b, _pairs(len(a), rng))
        scores = _scores(trials, a, b, TOLERANCE * matches.pixel / (zoom * max(focal)))
        if scores.max() > best:
            best, found = float(scores.max()), Found(trials[int(np.argmax(scores))], zoom)
    return found


def _pairs(count: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Indices (SAMPLES, 2) of two different matches each."""
    first = rng.integers(0, count, SAMPLES)
    return np.stack([first, (first + rng.integers(1, count, SAMPLES)) % count], axis=1)


def _through_pairs(a: Floats, b: Floats, pairs: NDArray[np.intp]) -> Floats:
    """Rotations (T, 3, 3) that take two rays each as nearly as can be from `a` to `b`."""
    return np.asarray(_frame(b[pairs]) @ np.swapaxes(_frame(a[pairs]), -1, -2))


def _frame(two: Floats) -> Floats:
    """Right-handed axes as columns (T, 3, 3), decided by two rays (T, 2, 3) alike."""
    along = two[:, 0] + two[:, 1]
    across = np.cross(two[:, 0], two[:, 1])
    x = along / np.linalg.norm(along, axis=1, keepdims=True)
    y = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    return np.stack([x, y, np.cross(x, y)], axis=-1)


def _scores(trials: Floats, a: Floats, b: Floats, tolerance: float) -> Floats:
    """For each rotation (T, 3, 3), how well rays (M, 3) are taken to theirs: each counts up to 1 (Torr's MSAC)."""
    turned = np.einsum("tij,mj->tmi", trials, a)
    apart = np.sum(np.square(turned - b), axis=2) / (tolerance * tolerance)
    return np.asarray(np.sum(np.maximum(1.0 - apart, 0.0), axis=1))

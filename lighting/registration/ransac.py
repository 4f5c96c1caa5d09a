"""RANSAC and robust least squares."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats
from lighting.registration.features import Matches
from lighting.registration.rotations import rays_through

STEP = 1e-6  # of each parameter, for the derivatives
STEPS = 25  # at most

Residuals = Callable[[Floats], Floats]


@dataclass(frozen=True, eq=False)
class LeastSquaresResult:
    """Where the residuals are least, and how sure that is."""

    parameters: Floats  # (P,)
    covariance: Floats  # (P, P) of them, from the scatter of the residuals
    residuals: Floats  # (N,) there


def least_squares(
    residuals: Residuals, start: Floats, scale: float, prior: Floats | None = None, expected: Floats | None = None
) -> LeastSquaresResult:
    """The parameters (P,) at which residuals (N,), beyond `scale` ever less weighted, are least.

    `prior` (P,) are inverse variances of the parameters around `expected`, which is `start` unless given, in the units
    of residuals of variance 1.
    """
    at, damping = np.asarray(start, dtype=np.float64), 1e-3
    known = np.zeros(len(at)) if prior is None else prior * scale * scale
    center = at.copy() if expected is None else expected
    value = residuals(at)
    for _ in range(STEPS):
        slope, weight = _slope(residuals, at, value), _weights(value, scale)
        normal = (slope * weight[:, None]).T @ slope + np.diag(known)
        gradient = slope.T @ (weight * value) + known * (at - center)
        step = -np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), gradient)
        there = residuals(at + step)
        if _cost(there, scale) + known @ (at + step - center) ** 2 < _cost(value, scale) + known @ (at - center) ** 2:
            at, value, damping = at + step, there, 0.2 * damping
        else:
            damping *= 10.0
        if np.abs(step).max() < 1e-8 or damping > 1e8:
            break
    return LeastSquaresResult(at, _covariance(_slope(residuals, at, value), value, scale, known), value)


def _slope(residuals: Residuals, at: Floats, value: Floats) -> Floats:
    """Derivatives (N, P)."""
    return np.stack([(residuals(at + step) - value) / STEP for step in STEP * np.eye(len(at))], axis=1)


def _weights(value: Floats, scale: float) -> Floats:
    return np.asarray(1.0 / (1.0 + np.square(value / scale)))


def _cost(value: Floats, scale: float) -> float:
    return float(scale * scale * np.sum(np.log1p(np.square(value / scale))))


def _covariance(slope: Floats, value: Floats, scale: float, known: Floats) -> Floats:
    """Covariance (P, P) of the parameters: the weighted scatter of the residuals times the inverse normal matrix."""
    weight = _weights(value, scale)
    scatter = float(weight @ np.square(value) / max(weight.sum() - len(known), 1.0))
    normal = (slope * weight[:, None]).T @ slope / max(scatter, 1e-18) + np.diag(known) / (scale * scale)
    return np.asarray(np.linalg.pinv(normal, hermitian=True))


# RANSAC (Fischler and Bolles 1981) for a rotation and a focal length that many matches obey.

TOLERANCE = 3.0  # pixels within which a match obeys
SAMPLES = 300  # pairs of matches tried for each focal length
SCORED = 250  # matches, the surest, that each trial is scored on


@dataclass(frozen=True, eq=False)
class _RansacResult:
    """The best trial."""

    rotation: Floats  # (3, 3) directions in the first camera's frame to the second's
    zoom: float  # both focal lengths times this


def ransac_rotation(matches: Matches, focal: tuple[float, float], zooms: Sequence[float]) -> _RansacResult:
    """The rotation and the zoom that most of the surest matches obey; `matches` are two or more."""
    rng = np.random.default_rng(0)  # the same answer every time
    best, found = -np.inf, _RansacResult(np.eye(3), 1.0)
    for zoom in zooms:
        a, b = rays_through(matches.a[:SCORED], zoom * focal[0]), rays_through(matches.b[:SCORED], zoom * focal[1])
        trials = _through_pairs(a, b, _pairs(len(a), rng))
        scores = _scores(trials, a, b, TOLERANCE * matches.pixel / (zoom * max(focal)))
        if scores.max() > best:
            best, found = float(scores.max()), _RansacResult(trials[int(np.argmax(scores))], zoom)
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

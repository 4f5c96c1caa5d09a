"""Fits that wrong matches do not spoil: RANSAC [1] finds a rotation, robust least squares refine any parameters.

References:
    [1] Fischler and Bolles, "Random sample consensus", CACM 1981.
    [2] Torr and Zisserman, "MLESAC", CVIU 2000.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lighting.geometry import Floats
from lighting.registration.features import Matches
from lighting.registration.rotations import rays_through

INLIER_TOLERANCE = 3.0  # pixels within which a match obeys
_SAMPLES = 300  # pairs of matches tried for each focal length
_SCORED = 250  # matches, the surest, that each trial is scored on
_STEP = 1e-6  # of each parameter, for the derivatives
_MAX_STEPS = 25

Residuals = Callable[[Floats], Floats]


@dataclass(frozen=True, eq=False)
class LeastSquaresResult:
    """Where the residuals are least, and how sure that is."""

    parameters: Floats
    """Parameters, (P,)."""
    covariance: Floats
    """(P, P) of them, from the scatter of the residuals."""
    residuals: Floats
    """(N,) at the parameters."""


def least_squares(
    residuals: Residuals, start: Floats, scale: float, prior: Floats | None = None, expected: Floats | None = None
) -> LeastSquaresResult:
    """The parameters (P,) at which residuals are least, those beyond `scale` ever less weighted.

    Args:
        residuals: function of parameters (P,) to residuals (N,).
        start: (P,) parameters to begin with.
        scale: of the residuals, from which they count less.
        prior: (P,) inverse variances of the parameters, for residuals of variance 1; None for no prior.
        expected: (P,) parameters around which the prior lies; None for `start`.
    """
    at, damping = np.asarray(start, dtype=np.float64), 1e-3
    prior_weight = np.zeros(len(at)) if prior is None else prior * scale * scale
    center = at.copy() if expected is None else expected
    value = residuals(at)
    slope = _slope(residuals, at, value)
    for _ in range(_MAX_STEPS):
        weight = _weights(value, scale)
        normal = (slope * weight[:, None]).T @ slope + np.diag(prior_weight)
        gradient = slope.T @ (weight * value) + prior_weight * (at - center)
        step = -np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), gradient)
        candidate = residuals(at + step)
        if (
            _cost(candidate, scale) + prior_weight @ (at + step - center) ** 2
            < _cost(value, scale) + prior_weight @ (at - center) ** 2
        ):
            at, value, damping = at + step, candidate, 0.2 * damping
            slope = _slope(residuals, at, value)
        else:
            damping *= 10.0
        if np.abs(step).max() < 1e-8 or damping > 1e8:
            break
    return LeastSquaresResult(at, _covariance(slope, value, scale, prior_weight), value)


def _slope(residuals: Residuals, at: Floats, value: Floats) -> Floats:
    """Derivatives (N, P)."""
    return np.stack([(residuals(at + step) - value) / _STEP for step in _STEP * np.eye(len(at))], axis=1)


def _weights(value: Floats, scale: float) -> Floats:
    return np.asarray(1.0 / (1.0 + np.square(value / scale)))


def _cost(value: Floats, scale: float) -> float:
    return float(scale * scale * np.sum(np.log1p(np.square(value / scale))))


def _covariance(slope: Floats, value: Floats, scale: float, prior_weight: Floats) -> Floats:
    """Covariance (P, P) of the parameters: the weighted scatter of the residuals times the inverse normal matrix."""
    weight = _weights(value, scale)
    scatter = float(weight @ np.square(value) / max(weight.sum() - len(prior_weight), 1.0))
    normal = (slope * weight[:, None]).T @ slope / max(scatter, 1e-18) + np.diag(prior_weight) / (scale * scale)
    return np.asarray(np.linalg.pinv(normal, hermitian=True))


class _RansacResult(NamedTuple):
    """The best trial."""

    rotation: Floats  # (3, 3) directions in the first camera's frame to the second's
    zoom: float  # both focal lengths times this


def ransac_rotation(matches: Matches, focal: tuple[float, float], zooms: Sequence[float]) -> _RansacResult:
    """The rotation and the zoom that most of the surest matches obey.

    Args:
        matches: two or more.
        focal: both focal lengths in half diagonals.
        zooms: factors on both focal lengths to try.
    """
    rng = np.random.default_rng(0)  # the same answer every time
    best, result = -np.inf, _RansacResult(np.eye(3), 1.0)
    for zoom in zooms:
        a, b = rays_through(matches.a[:_SCORED], zoom * focal[0]), rays_through(matches.b[:_SCORED], zoom * focal[1])
        first = rng.integers(0, len(a), _SAMPLES)
        pairs = np.stack([first, (first + rng.integers(1, len(a), _SAMPLES)) % len(a)], axis=1)  # two different rays
        # A trial takes them as nearly as can be from `a` to `b`.
        trials = _frame(b[pairs]) @ np.swapaxes(_frame(a[pairs]), -1, -2)
        scores = _scores(trials, a, b, INLIER_TOLERANCE * matches.pixel / (zoom * max(focal)))
        if scores.max() > best:
            best, result = float(scores.max()), _RansacResult(trials[int(np.argmax(scores))], zoom)
    return result


def _frame(two: Floats) -> Floats:
    """Right-handed axes as columns (T, 3, 3), decided by two rays (T, 2, 3) alike."""
    along = two[:, 0] + two[:, 1]
    across = np.cross(two[:, 0], two[:, 1])
    x = along / np.linalg.norm(along, axis=1, keepdims=True)
    y = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    return np.stack([x, y, np.cross(x, y)], axis=-1)


def _scores(trials: Floats, a: Floats, b: Floats, tolerance: float) -> Floats:
    """For each rotation (T, 3, 3), how well rays (M, 3) are taken to theirs: each counts up to 1 (MSAC [2])."""
    products = (b[:, :, None] * a[:, None, :]).reshape(len(a), 9)
    scores = trials.reshape(-1, 9) @ products.T  # b . R a, by which |R a - b|^2 is 2 - 2 b . R a of unit vectors
    scores -= 1.0
    scores *= 2.0 / (tolerance * tolerance)
    scores += 1.0
    return np.asarray(np.maximum(scores, 0.0, out=scores).sum(axis=1))

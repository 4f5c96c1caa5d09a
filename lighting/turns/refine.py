"""Least squares (Gauss-Newton with damping) under Cauchy weights, so that the few wrong matches count for little."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lighting.geometry import Floats

STEP = 1e-6  # of each parameter, for the derivatives
STEPS = 25  # at most

Residuals = Callable[[Floats], Floats]


@dataclass(frozen=True, eq=False)
class Fit:
    """Where the residuals are least, and how sure that is."""

    parameters: Floats  # (P,)
    covariance: Floats  # (P, P) of them, from the scatter of the residuals
    residuals: Floats  # (N,) there


def minimise(
    residuals: Residuals, start: Floats, scale: float, prior: Floats | None = None, expected: Floats | None = None
) -> Fit:
    """The parameters (P,) at which residuals (N,), beyond `scale` ever less weighted, are least.

    `prior` (P,) are inverse variances of the parameters around `expected`, which is `start` unless given, in the units
    of residuals of variance 1.
    """
    at, damping = np.asarray(start, dtype=np.float64), 1e-3
    known = np.zeros(len(at)) if prior is None else prior * scale * scale
    centre = at.copy() if expected is None else expected
    value = residuals(at)
    for _ in range(STEPS):
        slope, weight = _slope(residuals, at, value), _weights(value, scale)
        normal = (slope * weight[:, None]).T @ slope + np.diag(known)
        gradient = slope.T @ (weight * value) + known * (at - centre)
        step = -np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), gradient)
        there = residuals(at + step)
        if _cost(there, scale) + known @ (at + step - centre) ** 2 < _cost(value, scale) + known @ (at - centre) ** 2:
            at, value, damping = at + step, there, 0.2 * damping
        else:
            damping *= 10.0
        if np.abs(step).max() < 1e-8 or damping > 1e8:
            break
    return Fit(at, _covariance(_slope(residuals, at, value), value, scale, known), value)


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

"""How much a set of light vectors multiplies the noise of pixels in the normals that photometric stereo finds.

With brightnesses b = M x of a patch, x = albedo x normal, and noise of standard deviation sigma in each, least squares
gives x with covariance sigma^2 (M^T M)^-1. The noise gain of axis k is lambda_k = sqrt of the k-th diagonal of
(M^T M)^-1: its 95 % interval is +- 1.96 sigma lambda_k / albedo of the normal's component (Hold-Geoffroy et al., What
Is a Good Day for Outdoor Photometric Stereo?, ICCP 2015). The diagonal depends on the axes chosen; 1 / sigma_min, with
the least singular value of M, does not and is at least as large. Both fall as 1 / sqrt(photos) and grow as
1 / exposure: compare only what shares both. What no light resolves has an infinite gain.
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.floating[Any]]

SURE = 1.96  # standard deviations to either side that hold 95 % of a normal distribution
WORST_ERROR = 90.0  # deg, an error so large says nothing of the normal
_SINGULAR = 1e-12  # least determinant of M^T M, of matrices scaled to unit mean diagonal


def gram(matrix: ArrayLike) -> Floats:
    """M^T M (..., 3, 3) of illumination matrices (..., T, 3)."""
    m = np.asarray(matrix, dtype=np.float64)
    return np.asarray(np.swapaxes(m, -1, -2) @ m)


def inverse(grams: ArrayLike) -> Floats:
    """Inverses (..., 3, 3) of symmetric positive matrices (..., 3, 3); infinite on the diagonal where singular."""
    g = np.asarray(grams, dtype=np.float64)
    scale = np.maximum(np.trace(g, axis1=-2, axis2=-1) / 3, np.finfo(np.float64).tiny)
    a, b, c, d, e, f = ((g[..., i, j] / scale) for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)))
    adjugate = [d * f - e * e, c * e - b * f, b * e - c * d, a * f - c * c, b * c - a * e, a * d - b * b]
    determinant = a * adjugate[0] + b * adjugate[1] + c * adjugate[2]
    solvable = determinant > _SINGULAR
    divisor = np.where(solvable, determinant * scale, 1.0)
    xx, xy, xz, yy, yz, zz = (
        np.where(solvable, term / divisor, hopeless)
        for term, hopeless in zip(adjugate, (np.inf, 0.0, 0.0, np.inf, 0.0, np.inf), strict=True)
    )
    return np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=-1).reshape(g.shape)


def covariance(matrix: ArrayLike, noise: float = 1.0) -> Floats:
    """Covariance (..., 3, 3) of albedo x normal from illumination matrices (..., T, 3) and pixel noise sigma."""
    return np.asarray(noise**2 * inverse(gram(matrix)))


def noise_gain(matrix: ArrayLike) -> Floats:
    """Noise gain lambda_k (..., 3) of each axis of illumination matrices (..., T, 3)."""
    return gain_of(inverse(gram(matrix)))


def largest_gain(matrix: ArrayLike) -> Floats:
    """lambda_max (...), the largest noise gain of the three axes."""
    return np.asarray(noise_gain(matrix).max(axis=-1))


def rotation_free_gain(matrix: ArrayLike) -> Floats:
    """1 / sigma_min (...) of illumination matrices (..., T, 3): the gain along the worst direction, not axis."""
    m = np.asarray(matrix, dtype=np.float64)
    if m.shape[-2] < 3:
        return np.full(m.shape[:-2], np.inf)
    least = np.linalg.svd(m, compute_uv=False)[..., -1]
    with np.errstate(divide="ignore"):
        return np.asarray(1 / least)


def gain_of(inverses: Floats) -> Floats:
    """Noise gain (..., 3) of each axis from (M^T M)^-1 (..., 3, 3)."""
    return np.asarray(np.sqrt(np.diagonal(inverses, axis1=-2, axis2=-1)))


def interval_95(gain: ArrayLike, noise: float, albedo: float = 1.0) -> Floats:
    """Half width (...) of the 95 % interval of a normal's component, from its noise gain (...)."""
    return np.asarray(SURE * noise * np.asarray(gain, dtype=np.float64) / albedo)


def angular_spread(inverses: Floats, normals: ArrayLike) -> Floats:
    """Root mean square turn [rad] (...) of unit normals (..., 3) per unit of noise / albedo, from (M^T M)^-1 (..., 3, 3).

    To first order in the noise, where only what moves x across the normal turns it.
    """
    n = np.asarray(normals, dtype=np.float64)
    along = np.einsum("...i,...ij,...j->...", n, np.where(np.isfinite(inverses), inverses, 0.0), n)
    return np.asarray(np.sqrt(np.maximum(np.trace(inverses, axis1=-2, axis2=-1) - along, 0.0)))


def angular_error(spread: ArrayLike, noise: float, albedo: float = 1.0) -> Floats:
    """Expected error [deg] (...) of normals from their `angular_spread` (...): at most WORST_ERROR."""
    return np.asarray(np.minimum(np.degrees(noise / albedo * np.asarray(spread, dtype=np.float64)), WORST_ERROR))


def window_inverses(matrix: ArrayLike, moments: NDArray[np.intp]) -> Floats:
    """(M^T M)^-1 (..., W, 3, 3) of windows, of illumination matrices (..., T, 3) over a day.

    `moments` (W, shots) are the indices of each window's photos; each holds the same number, so that gains compare.
    """
    m = np.asarray(matrix, dtype=np.float64)
    squares = m[..., :, None] * m[..., None, :]
    total = np.zeros((*m.shape[:-2], len(moments), 3, 3))
    for index in moments.T:
        total += squares[..., index, :, :]
    return inverse(total)


def gain_over_windows(matrix: ArrayLike, moments: NDArray[np.intp]) -> Floats:
    """lambda_max (..., W) of windows with photos at `moments` (W, shots), see `window_inverses`."""
    return np.asarray(gain_of(window_inverses(matrix, moments)).max(axis=-1))


def sphere_normals(count: int) -> Floats:
    """Unit vectors (count, 3) spread evenly over the sphere along a spiral of golden angles."""
    up = 1 - (2 * np.arange(count) + 1) / count
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    level = np.sqrt(1 - up**2)
    return np.stack([level * np.sin(turn), up, -level * np.cos(turn)], axis=-1)

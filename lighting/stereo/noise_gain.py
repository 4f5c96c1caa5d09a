"""How light resolves a normal: the noise gain of its components, and the expected error of its angle.

A patch has brightnesses b = M x, with x = albedo x normal, and noise of standard deviation sigma in each. Least squares
gives x with covariance sigma^2 (M^T M)^-1. The noise gain of axis k is lambda_k = sqrt of the k-th diagonal of
(M^T M)^-1. The 95 % interval of the normal's component is +- 1.96 sigma lambda_k / albedo (Hold-Geoffroy et al., What
Is a Good Day for Outdoor Photometric Stereo?, ICCP 2015). The diagonal depends on the axes chosen; 1 / sigma_min, with
the least singular value of M, does not and is at least as large. Both fall as 1 / sqrt(photos) and grow as 1 /
exposure: compare only what shares both. What no light resolves has an infinite gain.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.geometry import Floats

_Z_95 = 1.96  # standard deviations to either side that hold 95 % of a normal distribution
_MAX_ERROR = 90.0  # deg, the largest that is stated
_UPPER_TRIANGLE = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))  # rows and columns of the upper triangle
_MIN_DETERMINANT = 1e-12  # least determinant of M^T M, of matrices scaled to unit mean diagonal


def _inverse(upper: Floats) -> Floats:
    """Inverses (..., 3, 3) of symmetric positive matrices by their upper triangles (..., 6).

    They are infinite on the diagonal where singular. By cofactors a million take a second.
    """
    scale = np.maximum((upper[..., 0] + upper[..., 3] + upper[..., 5]) / 3, np.finfo(np.float64).tiny)
    a, b, c, d, e, f = np.moveaxis(upper / scale[..., None], -1, 0)
    adjugate = [d * f - e * e, c * e - b * f, b * e - c * d, a * f - c * c, b * c - a * e, a * d - b * b]
    determinant = a * adjugate[0] + b * adjugate[1] + c * adjugate[2]
    solvable = determinant > _MIN_DETERMINANT
    factor = 1 / np.where(solvable, determinant * scale, 1.0)
    result = np.empty((*upper.shape[:-1], 3, 3))
    for (row, column), cofactor in zip(_UPPER_TRIANGLE, adjugate, strict=True):
        value = np.where(solvable, cofactor * factor, np.inf if row == column else 0.0)
        result[..., row, column] = result[..., column, row] = value
    return result


def rotation_free_gain(matrix: ArrayLike) -> Floats:
    """Return the gain along the worst direction, whatever the axes: 1 / sigma_min (...).

    Args:
        matrix: (..., T, 3) illumination matrices.
    """
    m = np.asarray(matrix, dtype=np.float64)
    if m.shape[-2] < 3:
        return np.full(m.shape[:-2], np.inf)
    least = np.linalg.svd(m, compute_uv=False)[..., -1]
    with np.errstate(divide="ignore"):
        return np.asarray(1 / least)


def gain_from_inverse(inverses: Floats) -> Floats:
    """Return the noise gain (..., 3) of each axis.

    Args:
        inverses: (..., 3, 3), (M^T M)^-1.
    """
    return np.asarray(np.sqrt(np.diagonal(inverses, axis1=-2, axis2=-1)))


def interval_95(gain: ArrayLike, noise: float, albedo: float = 1.0) -> Floats:
    """Return half the width (...) of the 95 % interval of a normal's component.

    Args:
        gain: (...) noise gains.
        noise: standard deviation of a pixel.
        albedo: of the surface, over 0.
    """
    return np.asarray(_Z_95 * noise * np.asarray(gain, dtype=np.float64) / albedo)


def angular_std(inverses: Floats, normals: ArrayLike) -> Floats:
    """Return the root mean square rotation [rad] (...) of normals per noise / albedo.

    To first order in the noise, where only what moves x across the normal rotates it.

    Args:
        inverses: (..., 3, 3), (M^T M)^-1.
        normals: (..., 3) unit vectors.
    """
    n = np.asarray(normals, dtype=np.float64)
    tangent = np.eye(3) - n[..., :, None] * n[..., None, :]
    square = np.einsum("...ij,...ij->...", np.where(np.isfinite(inverses), inverses, 0.0), tangent)
    solvable = np.isfinite(inverses[..., 0, 0])
    return np.asarray(np.where(solvable, np.sqrt(np.maximum(square, 0.0)), np.inf))


def angular_error(std: ArrayLike, noise: float, albedo: float = 1.0) -> Floats:
    """Return the expected error [deg] (...) of normals, at most 90.

    Args:
        std: (...), as `angular_std` returns it.
        noise: standard deviation of a pixel.
        albedo: of the surface, over 0.
    """
    return np.asarray(np.minimum(np.degrees(noise / albedo * np.asarray(std, dtype=np.float64)), _MAX_ERROR))


def window_gram_inverses(matrix: ArrayLike, moments: NDArray[np.intp]) -> Floats:
    """Return (M^T M)^-1 (N, ..., 3, 3) of windows of a day.

    Args:
        matrix: (N, T, 3) illumination matrices of the day.
        moments: (..., shots) indices of each window's photos, as many in each, so that gains compare.
    """
    m = np.asarray(matrix, dtype=np.float64)
    products = np.stack([m[..., row] * m[..., column] for row, column in _UPPER_TRIANGLE], axis=-1)
    total = np.zeros((len(m), *moments.shape[:-1], 6))
    for index in np.moveaxis(moments, -1, 0):
        total += np.take(products, index, axis=1)
    return _inverse(total)

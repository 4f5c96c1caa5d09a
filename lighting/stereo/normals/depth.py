"""Depth from normals: the surface whose slopes agree best with them, by weighted least squares.

Between two neighbouring pixels the depth changes by the mean of their slopes. Each such pair is one equation, weighted
by how much both face the camera, since slopes at grazing normals are large and uncertain. The sparse system is solved
directly (scipy). With a focal length the slopes are those of the logarithm of depth (Durou et al., Normal
Integration: A Survey, JMIV 2018), without one the camera is orthographic.
"""

import numpy as np
from numpy.typing import NDArray

from lighting.errors import require_extra
from lighting.geometry import Floats

Image = NDArray[np.float32]

_STEEPEST = 0.05  # the least n_z that slopes are taken from
_ANCHOR = 1e-9  # weight that holds each piece of the surface near 0


def integrate(normal: Image, mask: NDArray[np.bool_], focal: float | None = None) -> Floats:
    """Heights (H, W) towards the camera, whose mean is 0, in pixels; NaN outside the mask.

    `normal` (H, W, 3) is in the camera frame. With a focal length [pixels] the result is the distance from the camera
    in place of the height, of mean logarithm 0. Pieces of the mask that do not touch each have that mean.
    Raises ParameterError where scipy is missing.
    """
    slopes = _slopes(normal, focal)
    value = np.full(mask.shape, np.nan)
    value[mask] = _solve(slopes, mask, np.maximum(normal[..., 2], _STEEPEST))
    return value if focal is None else np.exp(value)


def _slopes(normal: Image, focal: float | None) -> tuple[Floats, Floats]:
    """Changes (H, W) of the height, or of the logarithm of the distance, to the next pixel right and down."""
    x, y, z = np.moveaxis(normal.astype(np.float64), -1, 0)
    if focal is None:
        z = np.maximum(z, _STEEPEST)
        return -x / z, y / z
    height, width = z.shape
    right = np.arange(width) - (width - 1) / 2
    up = (height - 1) / 2 - np.arange(height)
    towards = np.maximum(focal * z - right[None, :] * x - up[:, None] * y, _STEEPEST * focal)
    return x / towards, -y / towards


def _solve(slopes: tuple[Floats, Floats], mask: NDArray[np.bool_], facing: Floats) -> Floats:
    """Values (P,) of the mask's pixels that fit the slopes best."""
    sparse = require_extra("scipy.sparse", "Depth needs scipy", "stereo")
    from scipy.sparse.linalg import splu

    index = np.cumsum(mask).reshape(mask.shape) - 1
    count = int(mask.sum())
    first, second, change, weight = _pairs(slopes, mask, facing, index)
    rows = np.arange(len(first))
    entries = np.concatenate([-np.ones(len(first)), np.ones(len(first))])
    places = (np.concatenate([rows, rows]), np.concatenate([first, second]))
    steps = sparse.coo_matrix((entries, places), shape=(len(first), count)).tocsr()
    weighted = steps.multiply(weight[:, None]).tocsr()
    square = (weighted.T @ steps + _ANCHOR * sparse.identity(count)).tocsc()
    factors = splu(square, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}, diag_pivot_thresh=0.0)
    value = factors.solve(weighted.T @ change)
    return np.asarray(value - value.mean())


def _pairs(
    slopes: tuple[Floats, Floats], mask: NDArray[np.bool_], facing: Floats, index: NDArray[np.intp]
) -> tuple[NDArray[np.intp], NDArray[np.intp], Floats, Floats]:
    """Neighbours in the mask: the pixel's number, that of the one right of or below it, the change and its weight."""
    found = []
    for slope, here, there in (
        (slopes[0], np.s_[:, :-1], np.s_[:, 1:]),
        (slopes[1], np.s_[:-1], np.s_[1:]),
    ):
        both = mask[here] & mask[there]
        change = (slope[here] + slope[there])[both] / 2
        weight = np.minimum(facing[here], facing[there])[both] ** 2
        found.append((index[here][both], index[there][both], change, weight))
    first, second, change, weight = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return first, second, change, weight


def depth_error(found: Floats, truth: Floats, mask: NDArray[np.bool_]) -> float:
    """Mean absolute difference of two heights (H, W) in a mask, after the offset that makes it least."""
    difference = (found - truth)[mask]
    return float(np.mean(np.abs(difference - np.median(difference))))

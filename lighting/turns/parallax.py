"""The turn of a camera that also moved, by the essential matrix (Longuet-Higgins 1981).

Five matches decide an essential matrix where the focal length is known (Nister 2004, as OpenCV computes it); its
rotation, direction of motion and the focal length are then refined together on the Sampson distances of all matches.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats
from lighting.turns.match import Matches, opencv
from lighting.turns.rays import cross_matrix, rotation_about
from lighting.turns.refine import Fit, minimise

TOLERANCE = 1.5  # pixels from the epipolar line within which a match obeys
PARALLAX, LEAST_MORE = 1.25, 12  # times as many, and so many more, must obey it where the camera moved
LEAST_MOVED = 24  # matches that agree on a motion, which has more freedom than a rotation

_SURE = 0.999  # probability with which OpenCV's sampling is to meet a sample without a wrong match
_FLIP = np.diag([1.0, -1.0, -1.0])  # between OpenCV's axes (y down, z ahead) and ours


@dataclass(frozen=True, eq=False)
class Motion:
    """A turn, a direction of motion and a zoom, and how sure they are."""

    rotation: Floats  # (3, 3) directions in the first camera's frame to the second's
    towards: Floats  # (3,) unit vector from the second camera to the first, in the second's frame
    zoom: float
    covariance: Floats  # (4, 4) of the rotation's vector [rad] and the zoom's logarithm
    inliers: NDArray[np.bool_]  # (M,)


def epipolar_inliers(matches: Matches) -> NDArray[np.bool_]:
    """Which matches (M,) obey the best fundamental matrix, whatever the lens."""
    cv2 = opencv()
    unit = 1.0 / matches.pixel  # OpenCV's thresholds suit pixels
    try:
        _, mask = cv2.findFundamentalMat(matches.a * unit, matches.b * unit, cv2.USAC_MAGSAC, TOLERANCE, _SURE, 5000)
    except cv2.error:  # its way of saying that no model fits
        mask = None
    return np.zeros(len(matches), dtype=bool) if mask is None else np.asarray(mask).ravel().astype(bool)


def obeying_more(matches: Matches, agreed: int) -> Matches | None:
    """The matches that obey one epipolar geometry, where those are clearly more than the `agreed` on a rotation."""
    obeying = epipolar_inliers(matches)
    if not clearly_more(int(np.count_nonzero(obeying)), agreed):
        return None
    return Matches(matches.a[obeying], matches.b[obeying], matches.pixel)


def clearly_more(obeying: int, agreed: int) -> bool:
    """Whether so many matches that obey an epipolar geometry tell of a motion where so many agree on something less."""
    return obeying >= max(PARALLAX * agreed, agreed + LEAST_MORE, LEAST_MOVED)


def motion(
    matches: Matches, focal: tuple[float, float], zooms: Sequence[float], log_zoom_prior: float
) -> Motion | None:
    """The best motion over the zooms tried; None where no essential matrix fits.

    `log_zoom_prior` is the inverse variance of the zoom's logarithm around 0.
    """
    tried = [m for zoom in zooms if (m := _at(matches, focal, zoom, log_zoom_prior)) is not None]
    return max(tried, key=lambda m: np.count_nonzero(m.inliers), default=None)


def _at(matches: Matches, focal: tuple[float, float], zoom: float, prior: float) -> Motion | None:
    started = _essential(matches, focal, zoom)
    return None if started is None else _refined(matches, focal, zoom, prior, *started)


def _essential(matches: Matches, focal: tuple[float, float], zoom: float) -> tuple[Floats, Floats] | None:
    """Rotation (3, 3) and direction of motion (3,) by RANSAC over five matches."""
    cv2 = opencv()
    a, b = (p * [1.0, -1.0] / (zoom * f) for p, f in zip((matches.a, matches.b), focal, strict=True))
    tolerance = TOLERANCE * matches.pixel / (zoom * max(focal))
    try:
        matrix, mask = cv2.findEssentialMat(a, b, np.eye(3), cv2.USAC_MAGSAC, _SURE, tolerance)
        if matrix is None or np.shape(matrix) != (3, 3):
            return None
        _, rotation, towards, _ = cv2.recoverPose(matrix, a, b, np.eye(3), mask=mask.copy())
    except cv2.error:
        return None
    return np.asarray(_FLIP @ rotation @ _FLIP), np.asarray(_FLIP @ towards.ravel())


def _refined(
    matches: Matches, focal: tuple[float, float], zoom: float, prior: float, rotation: Floats, towards: Floats
) -> Motion:
    side = np.linalg.svd(towards[None])[2][1:]  # two unit vectors across the motion

    def parts(at: Floats) -> tuple[Floats, Floats, float]:
        moved = towards + at[4:] @ side
        return rotation_about(at[:3]) @ rotation, moved / np.linalg.norm(moved), zoom * float(np.exp(at[3]))

    def residuals(at: Floats) -> Floats:
        return sampson(matches, focal, *parts(at))

    scale = TOLERANCE * matches.pixel
    inverse = np.array([0.0, 0.0, 0.0, prior, 0.0, 0.0])
    fit: Fit = minimise(residuals, np.zeros(6), scale, inverse, np.array([0.0, 0.0, 0.0, -np.log(zoom), 0.0, 0.0]))
    return Motion(*parts(fit.parameters), fit.covariance[:4, :4], np.abs(fit.residuals) < 2.0 * scale)


def sampson(matches: Matches, focal: tuple[float, float], rotation: Floats, towards: Floats, zoom: float) -> Floats:
    """Distances (M,) [half diagonals] of matches from their epipolar lines, to first order (Sampson 1982)."""
    one = np.ones((len(matches), 1))
    a, b = np.hstack([matches.a, one]), np.hstack([matches.b, one])
    from_a, from_b = (np.diag([1.0, 1.0, -zoom * f]) for f in focal)
    matrix = from_b @ cross_matrix(towards) @ rotation @ from_a
    across_b, across_a = a @ matrix.T, b @ matrix
    steep = np.sum(across_b[:, :2] ** 2, axis=1) + np.sum(across_a[:, :2] ** 2, axis=1)
    return np.asarray(np.sum(across_b * b, axis=1) / np.sqrt(np.maximum(steep, 1e-18)))

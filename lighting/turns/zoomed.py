"""The turn of a camera that was zoomed between two photos: a rotation and a focal length for each of them.

Two photos from one point obey the homography K2 R K1^-1 wherever things are, which decides both focal lengths. Its
epipolar geometry is that of a walk ahead as well, so a zoom must be ruled out before a walk is believed.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats
from lighting.turns.match import Matches
from lighting.turns.rays import offsets, rotation_about
from lighting.turns.refine import minimise
from lighting.turns.search import TOLERANCE, search

ONE_LENS = 0.06  # logarithm of the ratio of two focal lengths up to which they may be those of one lens

_FAR = 50.0  # logarithm of a factor on a focal length, beyond any lens
_FIRST = np.vstack([np.eye(3, 5), [0.0, 0.0, 0.0, 1.0, -1.0]])  # the first logarithm is the mean less half the ratio's


@dataclass(frozen=True, eq=False)
class Zoomed:
    """A turn and two focal lengths, and how sure they are."""

    rotation: Floats  # (3, 3) directions in the first camera's frame to the second's
    focal: tuple[float, float]  # of both photos [half diagonals]
    covariance: Floats  # (4, 4) of the rotation's vector [rad] and the first focal length's logarithm
    inliers: NDArray[np.bool_]  # (M,) matches that obey it in the photo that shows them coarser


def zoomed(matches: Matches, focal: tuple[float, float], zooms: Sequence[float], mean_prior: float) -> Zoomed | None:
    """The best turn with two focal lengths, for matches of which nearly all are right; None where one would do.

    `focal` are guesses [half diagonals], of which only the ratio to the mean of both photos is kept: `zooms` are the
    factors on it to try, `mean_prior` is the inverse variance of its logarithm.
    """
    half = 0.5 * (_log_growth(matches) - float(np.log(focal[1] / focal[0])))
    apart = (focal[0] * float(np.exp(-half)), focal[1] * float(np.exp(half)))
    tried = [_refined(matches, apart, zoom, mean_prior) for zoom in zooms]  # a wrong start creeps along a valley
    found = min(tried, key=lambda t: _cost(matches, t))
    ratio = found.focal[1] / found.focal[0] * focal[0] / focal[1]
    return found if abs(np.log(ratio)) > ONE_LENS else None


def _refined(matches: Matches, focal: tuple[float, float], zoom: float, mean_prior: float) -> Zoomed:
    """The nearest optimum to both focal lengths times a zoom."""
    started = search(matches, focal, [zoom]).rotation

    def parts(at: Floats) -> tuple[Floats, tuple[float, float]]:
        first, second = np.exp(np.clip([at[3] - at[4], at[3] + at[4]], -_FAR, _FAR))  # a step may go too far
        return rotation_about(at[:3]) @ started, (float(zoom * focal[0] * first), float(zoom * focal[1] * second))

    def residuals(at: Floats) -> Floats:
        return offsets(matches.a, matches.b, *parts(at)).ravel()

    prior, expected = np.array([0.0, 0.0, 0.0, mean_prior, 0.0]), np.array([0.0, 0.0, 0.0, -np.log(zoom), 0.0])
    scale = TOLERANCE * matches.pixel
    fit = minimise(residuals, np.zeros(5), scale / 2.0, prior, expected)
    off = np.linalg.norm(fit.residuals.reshape(2, -1, 2), axis=-1)
    return Zoomed(*parts(fit.parameters), _FIRST @ fit.covariance @ _FIRST.T, np.min(off, axis=0) < scale)


def _cost(matches: Matches, found: Zoomed) -> float:
    """How far matches are from obeying, those far off counting for ever less (Cauchy)."""
    off = offsets(matches.a, matches.b, found.rotation, found.focal) / (TOLERANCE * matches.pixel / 2.0)
    return float(np.sum(np.log1p(np.square(off))))


def _log_growth(matches: Matches) -> float:
    """The logarithm by which distances between points are larger in the second photo, as a rule."""
    other = np.roll(np.arange(len(matches)), 1 + len(matches) // 3)
    first, second = (np.linalg.norm(points - points[other], axis=1) for points in (matches.a, matches.b))
    return float(np.median(np.log(np.maximum(second, matches.pixel) / np.maximum(first, matches.pixel))))

"""The relative rotation of two cameras, by points that match between their photos (features.py).

OpenCV is in the extra `all`; without it every function here that needs it raises MissingExtraError.

Far things obey the homography at infinity K R K^-1: a rotation and a focal length are sought that most matches obey
and refined. Where the lens was zoomed, each photo gets a focal length of its own; where the camera moved between
near things the essential matrix takes over.

Five matches decide an essential matrix where the focal length is known [2]. Its rotation, direction of motion and the
focal length are then refined together on the Sampson distances of all matches [3].

Two photos from one point obey the homography K2 R K1^-1 wherever things are, which decides both focal lengths. Its
epipolar geometry is that of a walk ahead as well, so a zoom must be ruled out before a walk is believed.

References:
    [1] Longuet-Higgins, "A computer algorithm for reconstructing a scene from two projections", Nature 1981.
    [2] Nister, "An efficient solution to the five-point relative pose problem", PAMI 2004; OpenCV computes it.
    [3] Sampson, "Fitting conic sections to very scattered data", CGIP 1982.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats
from lighting.registration.features import Matches, import_opencv
from lighting.registration.robust_fit import INLIER_TOLERANCE, LeastSquaresResult, least_squares, ransac_rotation
from lighting.registration.rotations import (
    cross_matrix,
    focal_from_fov,
    fov_from_focal,
    project_points,
    rays_through,
    rotation_about,
)

_DIAGONAL_FOVS = np.geomspace(25.0, 115.0, 14)  # deg, tried where the lens is unknown
_MIN_INLIERS = 12  # matches that agree
_MIN_INLIER_SHARE = 0.15  # of the matches in the common part of both photos
_MAX_STD = 2.0  # deg, of an answer
_MIN_GUESS_STD = 0.1  # of a focal length's logarithm from which on it is a guess, which does not see a zoom
_MIN_STATIC_SHARE = 0.5  # of the matches that obey a motion must obey a rotation too, where the motion stays unknown
_MIN_ZOOMED_SHARE = 0.95  # of the matches that obey an epipolar geometry must obey a zoom for it to be one
_STATIC_VARIANCE = 2.0 * 1.3**2  # over what the scatter of the matches says, each of which counts in both photos
_MOVING_VARIANCE = 3.0**2  # the same where the camera moved; a match counts once

_EPIPOLAR_TOLERANCE = 1.5  # pixels from the epipolar line within which a match obeys
_MIN_PARALLAX_RATIO = 1.25  # times as many matches must obey it where the camera moved
_MIN_PARALLAX_GAIN = 12  # and so many more
_MIN_MOVING_INLIERS = 24  # matches that agree on a motion, which has more freedom than a rotation
_CONFIDENCE = 0.999  # with which OpenCV's sampling is to meet a sample without a wrong match
_FLIP = np.diag([1.0, -1.0, -1.0])  # between OpenCV's axes (y down, z ahead) and ours

_MAX_LOG_ZOOM = 50.0  # logarithm of a factor on a focal length, beyond any lens
_FIRST = np.vstack([np.eye(3, 5), [0.0, 0.0, 0.0, 1.0, -1.0]])  # the first logarithm is the mean less half the ratio's


@dataclass(frozen=True, eq=False)
class RelativeRotation:
    """The rotation from the first camera to the second."""

    rotation: Floats
    """(3, 3) a direction in the first camera's frame (x right, y up, -z ahead) to the second's."""
    covariance: Floats
    """(3, 3) [deg^2] of the small rotation vector in the second's frame that corrects `rotation`."""
    vertical_fov: tuple[float, float]
    """Deg, of the first and of the second photo."""
    fov_std: float
    """Deg, one standard deviation of those; 0 where they are exact."""
    inliers: int
    """Matches that agree."""
    matches: int
    """How many there are, whether they agree or not."""
    translates: bool = False
    """Whether the camera moved as well, among near things."""
    zoomed: bool = False
    """Whether the photos have a focal length each, other than was assumed of them."""

    @property
    def std(self) -> float:
        """Deg, one standard deviation of the rotation about its least certain axis."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance)[-1]))


def estimate_rotation(
    matches: Matches,
    size_a: tuple[int, int],
    size_b: tuple[int, int],
    fovs: tuple[float | None, float | None] = (None, None),
    fov_std: float = 0.0,
) -> RelativeRotation | None:
    """The relative rotation of two cameras; None where their photos have too little in common to tell.

    Args:
        matches: points that both photos show.
        size_a: width and height of the first photo, in pixels.
        size_b: the same of the second.
        fovs: vertical fields of view in deg; one alone counts for both, none means one unknown lens.
        fov_std: standard deviation of `fovs` in deg; 0 takes them as exact.
    """
    if len(matches) < _MIN_INLIERS:
        return None
    sizes = (size_a, size_b)
    focals = [(focal_from_fov(fov, *size), fov) for fov, size in zip(fovs, sizes, strict=True) if fov is not None]
    if not focals:
        return _choose_model(matches, _Lens(sizes, (1.0, 1.0), np.inf))
    log_std = np.radians(fov_std) / np.sin(np.radians(focals[0][1]))  # d log f = d fov / sin fov
    return _choose_model(matches, _Lens(sizes, (focals[0][0], focals[-1][0]), float(log_std)))


@dataclass(frozen=True, eq=False)
class _PairFit:
    """A rotation and the focal lengths, and how sure they are."""

    rotation: Floats  # (3, 3) directions in the first camera's frame to the second's
    focal: tuple[float, float]  # of both photos [half diagonals]
    covariance: Floats  # (4, 4) of the rotation's vector [rad] and the first focal length's logarithm
    inliers: NDArray[np.bool_]  # (M,) matches that obey it
    translation: Floats | None = None  # (3,) unit vector from the second camera to the first, in the second's frame


@dataclass(frozen=True)
class _Lens:
    """Both focal lengths before matching; as a rule both are off by one factor, the zoom."""

    sizes: tuple[tuple[int, int], tuple[int, int]]  # (width, height) of both photos
    focal: tuple[float, float]  # of both photos [half diagonals]
    log_std: float  # one standard deviation of the zoom's logarithm; 0 exact, infinite unknown

    def zooms(self) -> list[float]:
        """The zooms to try."""
        if np.isinf(self.log_std):
            return [float(z) for z in 1.0 / np.tan(np.radians(_DIAGONAL_FOVS) / 2.0)]
        return [1.0] if self.log_std < 0.01 else [float(np.exp(k * self.log_std)) for k in (-2, -1, 0, 1, 2)]

    def zoomed(self, zoom: float) -> tuple[float, float]:
        """Both focal lengths times a zoom."""
        return zoom * self.focal[0], zoom * self.focal[1]

    def prior(self) -> float:
        """Inverse variance of the zoom's logarithm."""
        return 0.0 if np.isinf(self.log_std) else 1.0 / max(self.log_std, 1e-9) ** 2


def _choose_model(matches: Matches, lens: _Lens) -> RelativeRotation | None:
    """By a rotation alone; where an epipolar geometry fits clearly more matches, by a zoom or a motion."""
    static = _fit_rotation(matches, lens)
    obeying = prefers_translation(matches, 0 if static is None else static.inliers)
    if obeying is None:
        return static
    trusted = static if static is not None and static.inliers >= _MIN_STATIC_SHARE * len(obeying) else None
    zoomed = None
    if lens.log_std >= _MIN_GUESS_STD:  # no focal length is known: perhaps each photo has its own
        wide = replace(lens, log_std=2.0 * lens.log_std)  # several lenses make a poorer guess of one
        zoomed = _estimate_zoom(obeying, lens.focal, wide.zooms(), wide.prior())
    if zoomed is None or _clearly_more(len(obeying), int(np.sum(zoomed.inliers))):
        return _fit_motion(obeying, len(matches), lens) or trusted
    if np.mean(zoomed.inliers) < _MIN_ZOOMED_SHARE:
        return trusted
    return _describe(lens, zoomed, _STATIC_VARIANCE, len(matches), zoomed=True) or trusted


def _fit_rotation(matches: Matches, lens: _Lens) -> RelativeRotation | None:
    """The rotation of a camera that stayed where it was, or looks at far things only."""
    rotation, zoom = ransac_rotation(matches, lens.focal, lens.zooms())
    scale = INLIER_TOLERANCE * matches.pixel
    for _ in range(2):
        near = _distances(matches, rotation, lens.zoomed(zoom)) < 2.0 * scale
        if np.count_nonzero(near) < _MIN_INLIERS:
            return None
        fit = _refine_rotation(matches, near, rotation, zoom, lens)
        rotation, zoom = rotation_about(fit.parameters[:3]) @ rotation, zoom * float(np.exp(fit.parameters[3]))
    first, second = lens.zoomed(zoom)
    inliers = _distances(matches, rotation, (first, second)) < scale
    moved = np.abs(project_points(rays_through(matches.a, first) @ rotation.T, second))
    common = int(np.count_nonzero(np.all(moved <= np.array(lens.sizes[1]) / np.hypot(*lens.sizes[1]), axis=1)))
    if np.count_nonzero(inliers) < max(_MIN_INLIERS, _MIN_INLIER_SHARE * common):
        return None
    pair = _PairFit(rotation, (first, second), fit.covariance, inliers)
    return _describe(lens, pair, _STATIC_VARIANCE, len(matches))


def _fit_motion(obeying: Matches, matches: int, lens: _Lens) -> RelativeRotation | None:
    """The rotation of a camera that walked, by those of so many matches that obey an epipolar geometry."""
    result = essential_motion(obeying, lens.focal, lens.zooms(), lens.prior())
    if result is None or np.count_nonzero(result.inliers) < _MIN_MOVING_INLIERS:
        return None
    return _describe(lens, result, _MOVING_VARIANCE, matches, translates=True)


def _describe(lens: _Lens, fit: _PairFit, variance: float, matches: int, **kind: bool) -> RelativeRotation | None:
    """The rotation of a fit to some of so many matches, its covariance times `variance`; None where it is not sure."""
    first, second = (fov_from_focal(f, *size) for f, size in zip(fit.focal, lens.sizes, strict=True))
    covariance = variance * fit.covariance
    fov_std = float(np.sqrt(covariance[3, 3]) * np.degrees(np.sin(np.radians(first))))
    in_degrees = np.degrees(np.degrees(covariance[:3, :3]))
    count = int(np.count_nonzero(fit.inliers))
    relative = RelativeRotation(fit.rotation, in_degrees, (first, second), fov_std, count, matches, **kind)
    return relative if relative.std <= _MAX_STD else None


def _distances(matches: Matches, rotation: Floats, focal: tuple[float, float]) -> Floats:
    """How far (M,) [half diagonals] each match is from obeying the rotation, in the worse of both photos."""
    return np.asarray(np.max(np.linalg.norm(_transfer_errors(matches.a, matches.b, rotation, focal), axis=-1), axis=0))


def _refine_rotation(
    matches: Matches, near: NDArray[np.bool_], rotation: Floats, zoom: float, lens: _Lens
) -> LeastSquaresResult:
    a, b = matches.a[near], matches.b[near]

    def residuals(at: Floats) -> Floats:
        scaled = lens.zoomed(zoom * float(np.exp(at[3])))
        return _transfer_errors(a, b, rotation_about(at[:3]) @ rotation, scaled).ravel()

    scale = INLIER_TOLERANCE * matches.pixel / 2.0
    prior = np.array([0.0, 0.0, 0.0, lens.prior()])
    expected = np.array([0.0, 0.0, 0.0, -np.log(zoom)])
    return least_squares(residuals, np.zeros(4), scale, prior, expected)


# A camera that also moved: the essential matrix [2, 3].


def _epipolar_inliers(matches: Matches) -> NDArray[np.bool_]:
    """Which matches (M,) obey the best fundamental matrix, whatever the lens."""
    cv2 = import_opencv()
    unit = 1.0 / matches.pixel  # OpenCV's thresholds suit pixels
    try:
        a, b = matches.a * unit, matches.b * unit
        _, mask = cv2.findFundamentalMat(a, b, cv2.USAC_MAGSAC, _EPIPOLAR_TOLERANCE, _CONFIDENCE, 5000)
    except cv2.error:  # its way of saying that no model fits
        mask = None
    return np.zeros(len(matches), dtype=bool) if mask is None else np.asarray(mask).ravel().astype(bool)


def prefers_translation(matches: Matches, agreed: int) -> Matches | None:
    """The matches that obey one epipolar geometry, where those are clearly more than obey a rotation.

    Args:
        matches: points that both photos show.
        agreed: how many obey a rotation.
    """
    obeying = _epipolar_inliers(matches)
    if not _clearly_more(int(np.count_nonzero(obeying)), agreed):
        return None
    return Matches(matches.a[obeying], matches.b[obeying], matches.pixel)


def _clearly_more(obeying: int, agreed: int) -> bool:
    """Whether so many matches that obey an epipolar geometry tell of a motion."""
    return obeying >= max(_MIN_PARALLAX_RATIO * agreed, agreed + _MIN_PARALLAX_GAIN, _MIN_MOVING_INLIERS)


def essential_motion(
    matches: Matches, focal: tuple[float, float], zooms: Sequence[float], log_zoom_prior: float
) -> _PairFit | None:
    """The best motion over the zooms tried; None where no essential matrix fits.

    Args:
        matches: points that both photos show.
        focal: both focal lengths in half diagonals.
        zooms: factors on both focal lengths to try.
        log_zoom_prior: inverse variance of the zoom's logarithm around 0.
    """
    started = [(zoom, motion) for zoom in zooms if (motion := _essential(matches, focal, zoom)) is not None]
    candidates = [_refine_motion(matches, focal, zoom, log_zoom_prior, *motion) for zoom, motion in started]
    return max(candidates, key=lambda m: np.count_nonzero(m.inliers), default=None)


def _essential(matches: Matches, focal: tuple[float, float], zoom: float) -> tuple[Floats, Floats] | None:
    """Rotation (3, 3) and direction of motion (3,) by RANSAC over five matches."""
    cv2 = import_opencv()
    a, b = (p * [1.0, -1.0] / (zoom * f) for p, f in zip((matches.a, matches.b), focal, strict=True))
    tolerance = _EPIPOLAR_TOLERANCE * matches.pixel / (zoom * max(focal))
    try:
        matrix, mask = cv2.findEssentialMat(a, b, np.eye(3), cv2.USAC_MAGSAC, _CONFIDENCE, tolerance)
        if matrix is None or np.shape(matrix) != (3, 3):
            return None
        _, rotation, translation, _ = cv2.recoverPose(matrix, a, b, np.eye(3), mask=mask.copy())
    except cv2.error:
        return None
    return np.asarray(_FLIP @ rotation @ _FLIP), np.asarray(_FLIP @ translation.ravel())


def _refine_motion(
    matches: Matches, focal: tuple[float, float], zoom: float, prior: float, rotation: Floats, translation: Floats
) -> _PairFit:
    side = np.linalg.svd(translation[None])[2][1:]  # two unit vectors across the motion

    def parts(at: Floats) -> tuple[Floats, Floats, float]:
        moved = translation + at[4:] @ side
        return rotation_about(at[:3]) @ rotation, moved / np.linalg.norm(moved), zoom * float(np.exp(at[3]))

    def residuals(at: Floats) -> Floats:
        return _sampson(matches, focal, *parts(at))

    scale = _EPIPOLAR_TOLERANCE * matches.pixel
    inverse = np.array([0.0, 0.0, 0.0, prior, 0.0, 0.0])
    expected = np.array([0.0, 0.0, 0.0, -np.log(zoom), 0.0, 0.0])
    fit = least_squares(residuals, np.zeros(6), scale, inverse, expected)
    inliers = np.abs(fit.residuals) < 2.0 * scale
    turned, moved, best = parts(fit.parameters)
    return _PairFit(turned, (best * focal[0], best * focal[1]), fit.covariance[:4, :4], inliers, moved)


def _sampson(
    matches: Matches, focal: tuple[float, float], rotation: Floats, translation: Floats, zoom: float
) -> Floats:
    """Distances (M,) [half diagonals] of matches from their epipolar lines, to first order [3]."""
    one = np.ones((len(matches), 1))
    a, b = np.hstack([matches.a, one]), np.hstack([matches.b, one])
    from_a, from_b = (np.diag([1.0, 1.0, -zoom * f]) for f in focal)
    matrix = from_b @ cross_matrix(translation) @ rotation @ from_a
    across_b, across_a = a @ matrix.T, b @ matrix
    steep = np.sum(across_b[:, :2] ** 2, axis=1) + np.sum(across_a[:, :2] ** 2, axis=1)
    return np.asarray(np.sum(across_b * b, axis=1) / np.sqrt(np.maximum(steep, 1e-18)))


# A camera that was zoomed between two photos: a rotation and a focal length for each of them.


def _estimate_zoom(matches: Matches, focal: tuple[float, float], zooms: Sequence[float], mean_prior: float) -> _PairFit:
    """The best rotation with two focal lengths, for matches of which nearly all are right.

    A match obeys it where it does in the photo that shows it coarser.

    `focal` are guesses [half diagonals]; only the ratio of each to the mean of both photos is kept. `zooms` are the
    factors on it to try. `mean_prior` is the inverse variance of its logarithm.
    """
    half = 0.5 * (_log_growth(matches) - float(np.log(focal[1] / focal[0])))
    scaled = (focal[0] * float(np.exp(-half)), focal[1] * float(np.exp(half)))
    # Several, for a wrong start creeps along a valley.
    return min((_refine_zoom(matches, scaled, z, mean_prior) for z in zooms), key=lambda t: _zoom_cost(matches, t))


def _refine_zoom(matches: Matches, focal: tuple[float, float], zoom: float, mean_prior: float) -> _PairFit:
    """The nearest optimum to both focal lengths times a zoom."""
    started = ransac_rotation(matches, focal, [zoom]).rotation

    def parts(at: Floats) -> tuple[Floats, tuple[float, float]]:
        # A step may go too far.
        first, second = np.exp(np.clip([at[3] - at[4], at[3] + at[4]], -_MAX_LOG_ZOOM, _MAX_LOG_ZOOM))
        return rotation_about(at[:3]) @ started, (float(zoom * focal[0] * first), float(zoom * focal[1] * second))

    def residuals(at: Floats) -> Floats:
        return _transfer_errors(matches.a, matches.b, *parts(at)).ravel()

    prior, expected = np.array([0.0, 0.0, 0.0, mean_prior, 0.0]), np.array([0.0, 0.0, 0.0, -np.log(zoom), 0.0])
    scale = INLIER_TOLERANCE * matches.pixel
    fit = least_squares(residuals, np.zeros(5), scale / 2.0, prior, expected)
    errors = np.linalg.norm(fit.residuals.reshape(2, -1, 2), axis=-1)
    return _PairFit(*parts(fit.parameters), _FIRST @ fit.covariance @ _FIRST.T, np.min(errors, axis=0) < scale)


def _zoom_cost(matches: Matches, result: _PairFit) -> float:
    """How far matches are from obeying, those far off counting for ever less (Cauchy)."""
    errors = _transfer_errors(matches.a, matches.b, result.rotation, result.focal) / (
        INLIER_TOLERANCE * matches.pixel / 2.0
    )
    return float(np.sum(np.log1p(np.square(errors))))


def _log_growth(matches: Matches) -> float:
    """The logarithm by which distances between points are larger in the second photo, as a rule."""
    other = np.roll(np.arange(len(matches)), 1 + len(matches) // 3)
    first, second = (np.linalg.norm(points - points[other], axis=1) for points in (matches.a, matches.b))
    return float(np.median(np.log(np.maximum(second, matches.pixel) / np.maximum(first, matches.pixel))))


def _transfer_errors(a: Floats, b: Floats, rotation: Floats, focal: tuple[float, float]) -> Floats:
    """How far (2, M, 2) points are from where a rotation puts their matches: in the second photo, then in the first.

    Args:
        a: (M, 2) half diagonals, in the first photo.
        b: (M, 2) in the second.
        rotation: (3, 3) directions in the first camera's frame to the second's.
        focal: both focal lengths in half diagonals.

    Returns:
        half diagonals.
    """
    forward = project_points(rays_through(a, focal[0]) @ rotation.T, focal[1]) - b
    backward = project_points(rays_through(b, focal[1]) @ rotation, focal[0]) - a
    return np.stack([forward, backward])

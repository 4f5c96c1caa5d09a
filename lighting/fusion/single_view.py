"""Posterior of one photo: gravity, compass, ephemeris, visible sun.

Time and place give the sun's elevation and compass azimuth, and only the camera's heading is open. The network's
distribution is read along the ring of that elevation, once for each whole degree of heading, and multiplied with the
compass's prior. Where the time zone is unknown, each candidate sun has a ring.

The network's distribution is in directions, by the camera that the network estimates. Where the picture shows the sun,
the evidence is a pixel: another field of view, elevation or roll moves its direction, and the ephemeris tells how the
camera is tilted. A sun outside the picture is inferred from shadows and shading, and stays where it is.

Two measurements of one quantity are weighted by their variances (Kalman's gain), unless they are too far apart for
chance.

A contradiction is a p-value of what the metadata says under the network's own distribution. The network is not
perfectly calibrated. So the thresholds are those that one true record in a hundred passes on unseen panoramas.
`python -m export evaluate --with-metadata` prints how often each fires on true and on false records.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

import lighting.geometry as geometry
from lighting.calibration import MAX_LENS_RATIO, lens_ratio
from lighting.color import luminance
from lighting.decoding import sun_from_prediction, sun_from_rings
from lighting.errors import ErrorCode, ParameterError
from lighting.fields import RANGES, format_azimuth, format_tilt
from lighting.fusion.drawn_camera import DrawnCamera, fit_camera
from lighting.fusion.shadows import OwnShadow, ShadowMark, fuse_shadows, implied_azimuth
from lighting.geometry import Floats, Pinhole, angles, camera_axes, direction, wrap_azimuth
from lighting.records import CodedWarning, EvidenceKind, Prediction, SunDistribution, SunEstimate, WarningCode
from lighting.sun_grid import (
    HEADINGS,
    Heading,
    bayes_direction,
    blur_headings,
    credible_radii,
    grid_directions,
    heading_from_probability,
    smooth_density,
    soft_label,
    splat_to_grid,
    von_mises,
)

COMPASS_STD = 25.0  # deg: phones' compasses err by 17 deg in the median
COMPASS_OUTLIER_RATE = 0.1  # share of compass headings that say nothing: the uniform part of the prior

_CAMERA_ELEVATION_STD = 3.5  # deg, of the network: 91 (paper) and 79 % (phone) of `val` lie within 5 deg
_DRAWN_STD = 0.5  # deg, of the camera's elevation by a horizon that a person drew
_CAMERA_ROLL_STD = 2.0  # deg, of the network: 68 % of the crops of `val` lie within 1.0 (paper) and 2.3 deg (phone)
MAX_TILT_DISAGREEMENT = 20.0  # deg; 1 % of the crops of `val` differ more from gravity (0.2 % of paper, 2 % of phone)
_MAX_LEARNED_ELEVATION = 35.0  # deg up and down: the network learned from no steeper cameras and predicts none

_MIN_CHOSEN_SHARE = 0.5  # of the probability, from which on the answer is that of one candidate alone

_SUN_PIXEL_STD = 2.0  # deg, of the visible sun's pixel: the network predicts its cell, 16 of 224 pixels
_MIN_VISIBLE_SHARE = 0.6  # of the probability near the answer from which the picture counts as showing the sun
_NEAR_ANGLE = 12.0  # deg from the answer
_REPROJECTED_ANGLE = 25.0  # deg from the answer within which the probability moves with the pixels
_MAX_ASPECT_RATIO = 16 / 9  # of a picture; the prediction does not tell the photo's own
_SAME_CAMERA = 0.02  # share by which two focal lengths, and rad by which two axes, may differ and count as one
_GLARE_ANGLE = 3.0  # deg from its pixel within which a visible sun makes the picture white
_WHITE_LEVEL = 245  # of 255, coded luminance
_MIN_WHITE_SHARE = 0.03  # of the pixels within the glare; 97 % of the crops that show the sun have more
_MAX_SUN_DIFFERENCE = (15.0, 12.0)  # deg of azimuth and elevation up to which ephemeris and picture show one sun

_MAX_SHADOW_DIFFERENCE = 90.0  # deg of azimuth from the pixels' sun; 8 of 8 marks that differed more were wrong

MIN_ELEVATION_P_VALUE = 0.004  # by the pixels, under which the elevation of time and place is contradicted
MIN_HEADING_P_VALUE = 0.008  # the same of a compass heading
_CELL_SCALE = 2.2  # deg, of the logistic curve that smooths a cell's elevation: 4 deg of standard deviation


@dataclass(frozen=True)
class Gravity:
    """How the camera was tilted, by the photo's metadata."""

    elevation: float
    """Deg, positive looks up."""
    roll: float | None
    """Deg, positive rotates the camera clockwise; None where it is unknown."""
    std: float
    """Deg, one standard deviation of both."""


@dataclass(frozen=True)
class Observations:
    """What is known about one photo besides its pixels."""

    candidates: tuple[tuple[float, float], ...] = ()
    """(sun elevation, sun compass azimuth) [deg]."""
    heading: float | None = None
    """Deg clockwise from true north, where the camera points."""
    heading_std: float = COMPASS_STD
    """Deg, one standard deviation of that."""
    vertical_fov: float | None = None
    """Deg, of the upright photo."""
    gravity: Gravity | None = None
    """The camera's tilt."""
    exposure_value: float | None = None
    """EV at ISO 100, of the camera's settings."""
    subject: str = "photo"
    """What warnings call the pixels' source: a "clip" and a "stream" are taken, too."""
    weights: tuple[float, ...] = ()
    """Probability of each candidate before the pixels; () where all are alike."""
    shadows: tuple[ShadowMark, ...] = ()
    """What the user marked, in pixels of a picture of `picture_size`."""
    camera: DrawnCamera | None = None
    """What the user states of the camera, in the same pixels. None: nothing."""
    picture_size: tuple[int, int] = (0, 0)
    """Columns and rows of the upright photo without its border; (0, 0) where nothing is drawn in it."""


@dataclass(frozen=True, eq=False)
class Posterior:
    """The fused distribution and parameters of one photo; `build_estimate` makes an EstimatedLight of it."""

    prediction: Prediction
    """With the fused camera, turbidity and exposure."""
    sun: SunEstimate
    """Where the sun is."""
    directions: Floats
    """(M, 3) unit vectors towards the sun, relative to the camera."""
    probability: Floats
    """(M,) of each, sums to 1."""
    used: tuple[EvidenceKind, ...]
    """The evidence that counted."""
    warnings: tuple[str, ...] = ()
    """Sentences about what contradicts the pixels."""
    camera_heading: Heading | None = None
    """From true north; None without time and place."""
    relative_heading: Heading | None = None
    """From the first of several photos; None where there is a heading."""
    candidate: tuple[float, float] | None = None
    """Elevation and azimuth [deg] of the likeliest one of time and place."""
    candidate_probability: float = 0.0
    """0 to 1, of that one; 0 without time and place."""
    predicted_sun_elevation: float | None = None
    """Deg, by the pixels whose light it has; None: those of `prediction`."""

    def on_cells(self) -> SunDistribution:
        """The same distribution over the network's own cells."""
        grid = self.prediction.spec.sun_grid
        return SunDistribution(grid, splat_to_grid(self.probability, self.directions, grid).astype(np.float32))


@dataclass(frozen=True, eq=False, repr=False)
class _GravityFused:
    """A photo's prediction with its camera tilted as pixels and gravity have it."""

    prediction: Prediction
    observations: Observations  # without a gravity that contradicts the pixels
    warnings: tuple[str, ...] = ()  # the sentence about such a gravity


def fuse_single_view(
    prediction: Prediction, observations: Observations, pixels: NDArray[np.uint8] | None = None
) -> Posterior:
    """Fuse one photo's prediction with its observations, the sun that it shows included.

    Args:
        prediction: of the network.
        observations: from metadata and user.
        pixels: (h, w, 3) sRGB. A photo that is not white at the predicted sun counts as not showing it. None: as white.

    Raises:
        ParameterError: every candidate sun is below the horizon.
    """
    leveled, sun = fuse_gravity(prediction, observations), visible_sun(prediction, pixels)
    if sun is None:
        return fuse_with_gravity(leveled)
    probability = reproject_sun(prediction, _with_lens(leveled.prediction, leveled.observations), sun)
    reprojected = replace(leveled.prediction, sun_probability=probability)
    posterior = fuse_with_gravity(replace(leveled, prediction=reprojected))
    drawn = leveled.observations.camera is not None
    tilt_std = _DRAWN_STD if drawn else camera_elevation_std(leveled.observations.gravity)
    return _tilt_to_ephemeris(posterior, reprojected, tilt_std)


def fuse(prediction: Prediction, observations: Observations) -> Posterior:
    """Fuse a prediction with its observations, wherever the picture shows the sun.

    Args:
        prediction: of the network.
        observations: from metadata and user.

    Raises:
        ParameterError: every candidate sun is below the horizon.
    """
    return fuse_with_gravity(fuse_gravity(prediction, observations))


def fuse_with_gravity(leveled: _GravityFused) -> Posterior:
    """Fuse a prediction whose camera is already tilted as gravity has it.

    Args:
        leveled: as `fuse_gravity` returns it.

    Raises:
        ParameterError: every candidate sun is below the horizon.
    """
    leveled = _fuse_shadows(leveled)
    prediction, observations = leveled.prediction, leveled.observations
    candidates = candidates_above_horizon(observations)
    likelihood = likelihood_by_heading(prediction, candidates)
    compass = None if observations.heading is None else (observations.heading, observations.heading_std)
    lens, subject = observations.vertical_fov, observations.subject
    contradictions = tuple(_consistency_warnings(prediction, candidates, likelihood, compass, lens, subject))
    if len(candidates):
        weight = likelihood * compass_prior(observations) * candidate_weights(observations)[:, None]
        posterior = posterior_on_rings(prediction, observations, weight)
    else:
        posterior = posterior_on_grid(prediction, observations)
    return replace(posterior, warnings=(*contradictions, *leveled.warnings))


# The camera's tilt by the network and by gravity.


def fuse_gravity(prediction: Prediction, observations: Observations) -> _GravityFused:
    """Tilt the prediction's camera by pixels and gravity; its sun stays where it is.

    Args:
        prediction: of the network.
        observations: from metadata and user.
    """
    if observations.camera is not None:
        return _fuse_drawn_camera(prediction, observations, observations.camera)
    if observations.gravity is None:
        return _GravityFused(prediction, observations)
    if (warning := _contradiction(prediction, observations.gravity, observations.subject)) is not None:
        return _GravityFused(prediction, replace(observations, gravity=None), (warning,))
    elevation, roll = _fused_tilt(prediction, observations.gravity)
    return _GravityFused(replace(prediction, camera_elevation=elevation, camera_roll=roll), observations)


def _fuse_drawn_camera(prediction: Prediction, observations: Observations, drawn: DrawnCamera) -> _GravityFused:
    """The same with the camera that the user drew, in place of what the file says of its tilt."""
    camera, lens = observed_camera(prediction, observations), observations.vertical_fov
    fitted = fit_camera(camera, drawn, lens_known=lens is not None)
    changed = replace(
        prediction, camera_elevation=fitted.elevation, camera_roll=fitted.roll, vertical_fov=fitted.vertical_fov
    )
    kept = None if drawn.known is not None else lens
    return _GravityFused(changed, replace(observations, gravity=None, vertical_fov=kept))


def observed_camera(prediction: Prediction, observations: Observations) -> Pinhole:
    """Return the camera of a photo in which a person drew.

    Args:
        prediction: with its elevation and roll, and with its field of view unless the lens is known.
        observations: with `picture_size`.
    """
    fov = _with_lens(prediction, observations).vertical_fov
    return Pinhole(*observations.picture_size, fov, 0.0, prediction.camera_elevation, prediction.camera_roll)


def camera_elevation_std(gravity: Gravity | None) -> float:
    """One standard deviation [deg] of the camera's elevation by network and gravity.

    Args:
        gravity: from the metadata; None leaves the network alone.
    """
    weight = 1.0 if gravity is None else _network_weight(gravity.std, _CAMERA_ELEVATION_STD)
    return _CAMERA_ELEVATION_STD * math.sqrt(weight)


def _contradiction(prediction: Prediction, gravity: Gravity, subject: str = "photo") -> CodedWarning | None:
    """A sentence about a `subject` whose pixels and gravity are farther apart than chance explains."""
    elevation, roll = _tilt_difference(prediction, gravity)
    if math.hypot(elevation, roll * math.cos(math.radians(gravity.elevation))) <= MAX_TILT_DISAGREEMENT:
        return None
    if gravity.roll is None or abs(elevation) >= abs(roll):
        stated, shown = f"elevation, {format_tilt(gravity.elevation)},", format_tilt(prediction.camera_elevation)
    else:
        stated, shown = f"roll, {gravity.roll + 0.0:.0f}°,", f"{prediction.camera_roll + 0.0:.0f}°"
    sentence = f"The file's camera {stated} was not used: the {subject} shows {shown}."
    return CodedWarning(sentence, WarningCode.GRAVITY_CONTRADICTED)


def _fused_tilt(prediction: Prediction, gravity: Gravity) -> tuple[float, float]:
    """The camera's elevation and roll [deg] by both; the roll is 0 where it looks straight up or down within 5 deg."""
    elevation_difference, roll_difference = _tilt_difference(prediction, gravity)
    elevation = gravity.elevation + elevation_difference * _network_weight(gravity.std, _CAMERA_ELEVATION_STD)
    if abs(elevation) > geometry.MIN_STEEP_ELEVATION:
        return elevation, 0.0
    if gravity.roll is None:
        return elevation, prediction.camera_roll
    roll = gravity.roll + roll_difference * _network_weight(gravity.std, _CAMERA_ROLL_STD)
    return elevation, float(wrap_azimuth(roll))


def _tilt_difference(prediction: Prediction, gravity: Gravity) -> tuple[float, float]:
    """By how much [deg] the network has more elevation and roll; its limit stands for steeper cameras."""
    elevation = min(max(gravity.elevation, -_MAX_LEARNED_ELEVATION), _MAX_LEARNED_ELEVATION)
    roll = 0.0 if gravity.roll is None else float(wrap_azimuth(prediction.camera_roll - gravity.roll))
    return prediction.camera_elevation - elevation, roll


def _network_weight(metadata_std: float, network_std: float) -> float:
    """The weight (0 to 1) of the network's value beside that of the metadata."""
    return metadata_std**2 / (metadata_std**2 + network_std**2)


# The sun by shadows that the user marked.


def _fuse_shadows(leveled: _GravityFused) -> _GravityFused:
    """The same with the sun's probability by the user's marks, and a warning of each that the pixels contradict."""
    prediction, observations = leveled.prediction, leveled.observations
    if not observations.shadows:
        return leveled
    camera = observed_camera(prediction, observations)
    cells = grid_directions(prediction.spec.sun_grid)
    probability = fuse_shadows(prediction.sun_probability, observations.shadows, camera, cells)
    pixels = float(angles(prediction.sun_direction)[0])
    warnings = [
        CodedWarning(
            f"A shadow has the sun {format_azimuth(azimuth)}, the {observations.subject} {format_azimuth(pixels)}: "
            + ("is it the camera's own?" if isinstance(mark, OwnShadow) else "is its other end the foot?"),
            WarningCode.SHADOW_CONTRADICTED,
        )
        for mark in observations.shadows
        if (azimuth := implied_azimuth(mark, camera)) is not None
        and abs(float(wrap_azimuth(azimuth - pixels))) > _MAX_SHADOW_DIFFERENCE
    ]
    fused = replace(prediction, sun_probability=probability)
    return replace(leveled, prediction=fused, warnings=(*leveled.warnings, *warnings))


# The sun by time, place and compass.


def candidates_above_horizon(observations: Observations) -> Floats:
    """Select the candidate suns (K, 2) above the horizon.

    Args:
        observations: whose candidates count; there may be none.

    Raises:
        ParameterError: there are candidates, and all are below the horizon.
    """
    candidates = np.array(observations.candidates, dtype=np.float64).reshape(-1, 2)
    up = candidates[candidates[:, 0] >= 0.0]
    if len(candidates) and not len(up):
        sentence = f"At this time and place the sun is {-candidates[:, 0].max():.1f}° below the horizon."
        raise ParameterError(sentence, "time", ErrorCode.NIGHT)
    return up


def candidate_weights(observations: Observations) -> Floats:
    """Probabilities (K,) of the candidate suns above the horizon before the pixels, up to a factor.

    Args:
        observations: whose candidates count.
    """
    is_up = [elevation >= 0.0 for elevation, _ in observations.candidates]
    weights = observations.weights or (1.0,) * len(is_up)
    return np.array([weight for weight, up in zip(weights, is_up, strict=True) if up], dtype=np.float64)


def daylight_candidates(candidates: Sequence[tuple[tuple[float, float], ...]]) -> list[int]:
    """Numbers of the candidates that are above the horizon in every photo.

    Args:
        candidates: of each photo, (elevation, azimuth) [deg]; as many in all.
    """
    return [k for k in range(min(map(len, candidates), default=0)) if all(suns[k][0] >= 0.0 for suns in candidates)]


def likelihood_by_heading(prediction: Prediction, candidates: Floats) -> Floats:
    """Density [1/sr] (K, 360) of the pixels at each candidate's sun, for each of HEADINGS.

    Args:
        prediction: of the network.
        candidates: (K, 2) elevation and compass azimuth [deg].
    """
    if not len(candidates):
        return np.empty((0, len(HEADINGS)))
    return smooth_density(prediction.sun_probability, _ring_directions(candidates), prediction.spec.sun_grid)


def compass_prior(observations: Observations) -> Floats:
    """Prior probability (360,) of HEADINGS: a von Mises curve about the compass heading plus a uniform part.

    Args:
        observations: whose heading counts; uniform without one.
    """
    if observations.heading is None:
        return np.full(360, 1 / 360)
    bell = von_mises(HEADINGS - observations.heading, observations.heading_std)
    return np.asarray((1 - COMPASS_OUTLIER_RATE) * bell / bell.sum() + COMPASS_OUTLIER_RATE / 360)


def posterior_on_grid(prediction: Prediction, observations: Observations) -> Posterior:
    """Posterior of a sun whose elevation is open.

    Args:
        prediction: with the fused camera, and the fused probabilities of the network's cells.
        observations: from metadata and user.
    """
    camera, used = _with_lens(prediction, observations), _used_evidence(prediction, observations)
    sun, cells = sun_from_prediction(prediction), grid_directions(prediction.spec.sun_grid)
    return Posterior(camera, sun, cells, prediction.sun_probability, used, predicted_sun_elevation=sun.elevation)


def posterior_on_rings(prediction: Prediction, observations: Observations, weight: Floats) -> Posterior:
    """Posterior of a sun on the rings of its candidate elevations.

    Args:
        prediction: with the fused camera.
        observations: with at least one candidate above the horizon.
        weight: (K, 360) of each candidate above the horizon and each of HEADINGS, up to a factor.
    """
    p = weight / weight.sum()
    candidates = candidates_above_horizon(observations)
    rings = _ring_directions(candidates)
    directions = rings.reshape(-1, 3)
    sun, heading = sun_from_rings(directions, p.ravel()), heading_from_probability(p.sum(axis=0))
    used = _used_evidence(prediction, observations)
    best, share = _likeliest_candidate(candidates, p.sum(axis=1))
    if len(candidates) > 1 and share >= _MIN_CHOSEN_SHARE:  # the answer is of one instant, its radii count all
        chosen = np.where((candidates == best).all(axis=1)[:, None], p, 0.0)
        alone = sun_from_rings(directions, chosen.ravel() / chosen.sum())
        radii = credible_radii(p.ravel(), directions, direction(alone.azimuth, alone.elevation))
        sun = SunEstimate(alone.azimuth, alone.elevation, *radii)
        heading = replace(heading, best=heading_from_probability(chosen.sum(axis=0) / chosen.sum()).best)
    camera = _with_lens(prediction, observations)
    posterior = Posterior(camera, sun, directions, p.ravel(), used, camera_heading=heading)
    return replace(posterior, candidate=best, candidate_probability=share)


def _likeliest_candidate(candidates: Floats, probability: Floats) -> tuple[tuple[float, float], float]:
    """The sun (elevation, azimuth) with the most probability (K,), that of equal ones added, and that probability."""
    suns, number = np.unique(candidates, axis=0, return_inverse=True)
    mass = np.bincount(number.ravel(), probability)
    elevation, azimuth = suns[np.argmax(mass)]
    return (float(elevation), float(azimuth)), float(mass.max())


def _ring_directions(candidates: Floats) -> Floats:
    """Unit vectors (K, 360, 3) towards each candidate's sun (K, 2) in the frames of cameras at each of HEADINGS."""
    return direction(candidates[:, 1:] - HEADINGS, candidates[:, :1])


def _with_lens(prediction: Prediction, observations: Observations) -> Prediction:
    return replace(prediction, vertical_fov=observations.vertical_fov or prediction.vertical_fov)


def _used_evidence(prediction: Prediction, observations: Observations) -> tuple[EvidenceKind, ...]:
    """The evidence that the answer uses.

    Without time and place, a heading says nothing about the sun; without `suitable`, an exposure says nothing at all.
    """
    is_used = {
        EvidenceKind.PIXELS: True,
        EvidenceKind.TIME_AND_PLACE: bool(observations.candidates),
        EvidenceKind.HEADING: bool(observations.candidates) and observations.heading is not None,
        EvidenceKind.FOCAL_LENGTH: observations.vertical_fov is not None,
        EvidenceKind.GRAVITY: observations.gravity is not None,
        EvidenceKind.SHADOW: bool(observations.shadows),
        EvidenceKind.DRAWN_CAMERA: observations.camera is not None,
        EvidenceKind.CAMERA_EXPOSURE: prediction.light is not None and observations.exposure_value is not None,
    }
    return tuple(kind for kind, used in is_used.items() if used)


# A sun that the picture shows: it stays on its pixel when more is known of the camera.


def visible_sun(prediction: Prediction, pixels: NDArray[np.uint8] | None = None) -> Floats | None:
    """Unit vector (3,) towards the sun by the pixels alone if the picture shows it, else None.

    Args:
        prediction: of the network.
        pixels: (h, w, 3) sRGB. A photo that is not white there does not show the sun. None: as white.
    """
    if prediction.sun_visibility < 0.5:
        return None
    sun = prediction.sun_direction
    right, up, forward = camera_axes(0.0, prediction.camera_elevation, prediction.camera_roll) @ sun
    edge = forward * math.tan(math.radians(prediction.vertical_fov) / 2)
    if abs(up) > edge or abs(right) > _MAX_ASPECT_RATIO * edge:
        return None
    near = grid_directions(prediction.spec.sun_grid) @ sun >= math.cos(math.radians(_NEAR_ANGLE))
    if float(prediction.sun_probability @ near) < _MIN_VISIBLE_SHARE:
        return None
    return sun if pixels is None or _has_glare(pixels, prediction, sun) else None


def _has_glare(pixels: NDArray[np.uint8], prediction: Prediction, sun: Floats) -> bool:
    """Whether the picture is white about the pixel of the sun (3,) by the network's own camera."""
    height, width = pixels.shape[:2]
    camera = Pinhole(width, height, prediction.vertical_fov, 0.0, prediction.camera_elevation, prediction.camera_roll)
    x, y = geometry.camera_pixel(sun, camera)
    reach = camera.focal_length * math.tan(math.radians(_GLARE_ANGLE))
    rows, columns = (slice(max(0, int(at - reach)), max(0, int(at + reach) + 1)) for at in (y, x))
    window = pixels[rows, columns]
    return window.size > 0 and float(np.mean(luminance(window) >= _WHITE_LEVEL)) >= _MIN_WHITE_SHARE


def reproject_sun(prediction: Prediction, camera: Prediction, sun: Floats) -> NDArray[np.float32]:
    """Move the probability near a visible sun to where its pixels look by another camera.

    Args:
        prediction: of the network, in directions by its own camera.
        camera: the same with the elevation, roll and field of view that are better known.
        sun: (3,) unit vector towards the visible sun by the network's camera.

    Returns:
        Probabilities (N,) of the network's cells.
    """
    ratio = math.tan(math.radians(camera.vertical_fov) / 2) / math.tan(math.radians(prediction.vertical_fov) / 2)
    axes_before, axes_after = (camera_axes(0.0, p.camera_elevation, p.camera_roll) for p in (prediction, camera))
    if abs(math.log(ratio)) < _SAME_CAMERA and float(np.abs(axes_before - axes_after).max()) < _SAME_CAMERA:
        return prediction.sun_probability
    cells = grid_directions(prediction.spec.sun_grid)
    right, up, forward = (cells @ axes_before.T).T
    near = (cells @ sun >= math.cos(math.radians(_REPROJECTED_ANGLE))) & (forward > 0)
    rays = np.stack([ratio * right, ratio * up, forward], axis=-1)[near] @ axes_after
    rays[:, 1] = np.maximum(rays[:, 1], 0.0)  # no sun is below the horizon
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    p = np.asarray(prediction.sun_probability, dtype=np.float64)
    moved = np.where(near, 0.0, p) + splat_to_grid(p[near], rays, prediction.spec.sun_grid)
    return np.asarray(moved, dtype=np.float32)


def _tilt_to_ephemeris(posterior: Posterior, prediction: Prediction, tilt_std: float) -> Posterior:
    """The posterior with the camera tilted so that the visible sun has the elevation of time and place.

    The tilt, known to `tilt_std` [deg], and the pixel's are weighted by their variances (Kalman's gain). The sun is
    compared with the mean of a lobe at the known sun: the horizon cuts half of a low one off, so it seems higher.
    """
    if posterior.camera_heading is None:
        return posterior
    grid = prediction.spec.sun_grid
    visible = prediction.sun_direction
    ephemeris = direction(posterior.sun.azimuth, posterior.sun.elevation)
    lobe = soft_label(ephemeris, _lobe_std(prediction, visible) ** -2, grid)
    (azimuth, elevation), (true_azimuth, true_elevation) = (angles(s) for s in (visible, bayes_direction(lobe, grid)))
    lateral, vertical = float(wrap_azimuth(true_azimuth - azimuth)), float(true_elevation - elevation)
    if abs(lateral) > _MAX_SUN_DIFFERENCE[0] or abs(vertical) > _MAX_SUN_DIFFERENCE[1]:
        return posterior
    slope = float(np.cos(np.radians(azimuth)))  # deg of the sun's elevation for each deg of tilt
    gain = slope * tilt_std**2 / (slope**2 * tilt_std**2 + _SUN_PIXEL_STD**2)
    tilt = float(np.clip(posterior.prediction.camera_elevation + gain * vertical, *RANGES["camera_elevation"]))
    return replace(posterior, prediction=replace(posterior.prediction, camera_elevation=tilt))


def _lobe_std(prediction: Prediction, sun: Floats) -> float:
    """How wide [rad] the probability of the visible sun (3,) is to its sides, where no horizon cuts it off."""
    probability, cells = prediction.sun_probability, grid_directions(prediction.spec.sun_grid)
    near = cells @ sun >= math.cos(math.radians(_NEAR_ANGLE))
    lateral = cells[near] @ direction(float(angles(sun)[0]) + 90.0, 0.0)
    return max(math.sqrt(float(np.average(lateral**2, weights=probability[near]))), math.radians(_SUN_PIXEL_STD))


# Whether pixels and metadata contradict each other more than chance explains.


def _consistency_warnings(
    prediction: Prediction,
    candidates: Floats,
    likelihood: Floats,
    compass: tuple[float, float] | None,
    vertical_fov: float | None,
    subject: str = "photo",
) -> Iterator[CodedWarning]:
    """One sentence for each observation that the pixels almost exclude.

    Args:
        prediction: of the network.
        candidates: (K, 2) elevation and compass azimuth [deg] of suns above the horizon; K may be 0.
        likelihood: (K, 360) density of the pixels at each candidate, for each of HEADINGS.
        compass: a heading and its standard deviation [deg]; None without a compass.
        vertical_fov: deg, by what is known of the lens; None where nothing is.
        subject: what the sentences call the pixels' source.
    """
    if len(candidates) and _elevation_p_value(prediction, candidates[:, 0]) < MIN_ELEVATION_P_VALUE:
        yield CodedWarning(
            f"The {subject} contradicts the sun's elevation by time and place, {_format_range(candidates[:, 0])}: "
            "check both.",
            WarningCode.ELEVATION_CONTRADICTED,
        )
    if len(candidates) and compass is not None and _heading_p_value(likelihood, *compass) < MIN_HEADING_P_VALUE:
        sentence = f"The {subject} contradicts the heading of {compass[0]:.0f}°: check the compass."
        yield CodedWarning(sentence, WarningCode.HEADING_CONTRADICTED)
    if vertical_fov is not None and lens_ratio(prediction.vertical_fov, vertical_fov) > MAX_LENS_RATIO:
        wider = vertical_fov > prediction.vertical_fov  # which a crop makes it
        cause = "it may be cropped" if wider else "check the focal length"
        yield CodedWarning(
            f"The lens sees {vertical_fov:.0f}° vertically, the {subject} "
            f"shows {prediction.vertical_fov:.0f}°: {cause}.",
            WarningCode.LENS_CONTRADICTED,
        )


def _elevation_p_value(prediction: Prediction, elevation: Floats) -> float:
    """Two-sided p-value (0 to 1) of the likeliest of elevations (K,) [deg] under the pixels' distribution.

    A sun on the horizon stands for those of twilight: it is as likely as that the sun is there or below.
    """
    cells = angles(grid_directions(prediction.spec.sun_grid))[1]
    below = _logistic(elevation[:, None] - cells) - _logistic(-elevation[:, None] - cells)  # cells end at the horizon
    probability = np.asarray(prediction.sun_probability, dtype=np.float64)
    lower = np.maximum(below @ probability, _logistic(-cells) @ probability)
    return float(np.max(2.0 * np.minimum(lower, 1.0 - lower)))


def _logistic(angle: Floats) -> Floats:
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(angle / _CELL_SCALE, -50.0, 50.0))))


def _heading_p_value(likelihood: Floats, heading: float, heading_std: float) -> float:
    """Probability (0 to 1) of headings at most as likely as this one, by the pixels' density (K, 360) over HEADINGS."""
    total = likelihood.sum(axis=0)
    expected = blur_headings(total / total.sum(), heading_std)
    at_heading = np.interp(heading % 360.0, [*HEADINGS, 360.0], [*expected, expected[0]])
    return float(expected[expected <= at_heading].sum())


def _format_range(elevation: Floats) -> str:
    low, high = elevation.min(), elevation.max()
    if high == 0.0:  # suns of twilight, which are put on the horizon
        return "at most 0°"
    return f"{low:.0f}°" if high - low < 1.0 else f"{low:.0f} to {high:.0f}°"

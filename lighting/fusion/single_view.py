"""Posterior of one photo: gravity, compass, ephemeris, visible sun.

Time and place give the sun's elevation and compass azimuth, and only the camera's heading is open. The network's
distribution is read along the ring of that elevation, once for each whole degree of heading, and multiplied with the
compass's prior. Where the time zone is unknown, each candidate sun has a ring.

Two measurements of one quantity are weighted by their variances (Kalman's gain), unless they are too far apart for
chance.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

import lighting.geometry as geometry
import lighting.sun_grid as sun_grid
from lighting.decoding import sun_from_prediction, sun_from_rings
from lighting.errors import CodedWarning, ErrorCode, ParameterError, WarningCode
from lighting.formatting import format_azimuth, format_tilt
from lighting.fusion.consistency import consistency_warnings
from lighting.fusion.drawn_camera import fit_camera
from lighting.fusion.marks import DrawnCamera, OwnShadow, ShadowMark
from lighting.fusion.shadows import fuse_shadows, implied_azimuth
from lighting.fusion.visible_sun import reproject_sun, tilt_by_sun, visible_sun
from lighting.geometry import Floats, Pinhole, angles, direction, wrap_azimuth
from lighting.prediction import Prediction, SunDistribution, SunEstimate
from lighting.records import EvidenceKind
from lighting.sun_grid import HEADINGS, Heading

COMPASS_STD = 25.0  # deg: phones' compasses err by 17 deg in the median
COMPASS_OUTLIER_RATE = 0.1  # share of compass headings that say nothing: the uniform part of the prior

_CAMERA_ELEVATION_STD = 3.5  # deg, of the network: 91 (paper) and 79 % (phone) of `val` lie within 5 deg
_DRAWN_STD = 0.5  # deg, of the camera's elevation by a horizon that a person drew
_CAMERA_ROLL_STD = 2.0  # deg, of the network: 68 % of the crops of `val` lie within 1.0 (paper) and 2.3 deg (phone)
MAX_TILT_DISAGREEMENT = 20.0  # deg; 1 % of the crops of `val` differ more from gravity (0.2 % of paper, 2 % of phone)
_MAX_LEARNED_ELEVATION = 35.0  # deg up and down: the network learned from no steeper cameras and predicts none

_MIN_CHOSEN_SHARE = 0.5  # of the probability, from which on the answer is that of one candidate alone
_MAX_SHADOW_DIFFERENCE = 90.0  # deg of azimuth from the pixels' sun; 8 of 8 marks that differed more were wrong


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
        return SunDistribution(grid, sun_grid.splat_to_grid(self.probability, self.directions, grid).astype(np.float32))


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
    if posterior.camera_heading is None:  # no ephemeris
        return posterior
    tilt = tilt_by_sun(reprojected, posterior.sun, posterior.prediction.camera_elevation, tilt_std)
    return replace(posterior, prediction=replace(posterior.prediction, camera_elevation=tilt))


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
    candidates, weights = candidates_above_horizon(observations)
    likelihood = likelihood_by_heading(prediction, candidates)
    compass = None if observations.heading is None else (observations.heading, observations.heading_std)
    lens, subject = observations.vertical_fov, observations.subject
    contradictions = tuple(consistency_warnings(prediction, candidates, likelihood, compass, lens, subject))
    if len(candidates):
        weight = likelihood * compass_prior(observations) * weights[:, None]
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
    return _GravityFused(prediction.with_camera(elevation, roll), observations)


def _fuse_drawn_camera(prediction: Prediction, observations: Observations, drawn: DrawnCamera) -> _GravityFused:
    """The same with the camera that the user drew, in place of what the file says of its tilt."""
    camera, lens = _observed_camera(prediction, observations), observations.vertical_fov
    fitted = fit_camera(camera, drawn, lens_known=lens is not None)
    changed = replace(
        prediction, camera_elevation=fitted.elevation, camera_roll=fitted.roll, vertical_fov=fitted.vertical_fov
    )
    kept = None if drawn.known is not None else lens
    return _GravityFused(changed, replace(observations, gravity=None, vertical_fov=kept))


def _observed_camera(prediction: Prediction, observations: Observations) -> Pinhole:
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
    camera = _observed_camera(prediction, observations)
    cells = sun_grid.grid_directions(prediction.spec.sun_grid)
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


def candidates_above_horizon(observations: Observations) -> tuple[Floats, Floats]:
    """Select the candidate suns (K, 2) above the horizon, and their probabilities (K,) before the pixels.

    Probabilities are up to a factor.

    Args:
        observations: whose candidates count; there may be none.

    Raises:
        ParameterError: there are candidates, and all are below the horizon.
    """
    candidates = np.array(observations.candidates, dtype=np.float64).reshape(-1, 2)
    up = candidates[:, 0] >= 0.0
    if len(candidates) and not up.any():
        sentence = f"At this time and place the sun is {-candidates[:, 0].max():.1f}° below the horizon."
        raise ParameterError(sentence, "time", ErrorCode.NIGHT)
    weights = np.array(observations.weights, dtype=np.float64) if observations.weights else np.ones(len(candidates))
    return candidates[up], weights[up]


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
    return sun_grid.smooth_density(prediction.sun_probability, _ring_directions(candidates), prediction.spec.sun_grid)


def compass_prior(observations: Observations) -> Floats:
    """Prior probability (360,) of HEADINGS: a von Mises curve about the compass heading plus a uniform part.

    Args:
        observations: whose heading counts; uniform without one.
    """
    if observations.heading is None:
        return np.full(360, 1 / 360)
    bell = sun_grid.von_mises(HEADINGS - observations.heading, observations.heading_std)
    return np.asarray((1 - COMPASS_OUTLIER_RATE) * bell / bell.sum() + COMPASS_OUTLIER_RATE / 360)


def posterior_on_grid(prediction: Prediction, observations: Observations) -> Posterior:
    """Posterior of a sun whose elevation is open.

    Args:
        prediction: with the fused camera, and the fused probabilities of the network's cells.
        observations: from metadata and user.
    """
    camera, used = _with_lens(prediction, observations), _used_evidence(prediction, observations)
    sun, cells = sun_from_prediction(prediction), sun_grid.grid_directions(prediction.spec.sun_grid)
    return Posterior(camera, sun, cells, prediction.sun_probability, used, predicted_sun_elevation=sun.elevation)


def posterior_on_rings(prediction: Prediction, observations: Observations, weight: Floats) -> Posterior:
    """Posterior of a sun on the rings of its candidate elevations.

    Args:
        prediction: with the fused camera.
        observations: with at least one candidate above the horizon.
        weight: (K, 360) of each candidate above the horizon and each of HEADINGS, up to a factor.
    """
    p = weight / weight.sum()
    candidates, _ = candidates_above_horizon(observations)
    rings = _ring_directions(candidates)
    directions = rings.reshape(-1, 3)
    sun, heading = sun_from_rings(directions, p.ravel()), sun_grid.heading_from_probability(p.sum(axis=0))
    used = _used_evidence(prediction, observations)
    best, share = _likeliest_candidate(candidates, p.sum(axis=1))
    if len(candidates) > 1 and share >= _MIN_CHOSEN_SHARE:  # the answer is of one instant, its radii count all
        chosen = np.where((candidates == best).all(axis=1)[:, None], p, 0.0)
        alone = sun_from_rings(directions, chosen.ravel() / chosen.sum())
        radii = sun_grid.credible_radii(p.ravel(), directions, direction(alone.azimuth, alone.elevation))
        sun = SunEstimate(alone.azimuth, alone.elevation, *radii)
        heading = replace(heading, best=sun_grid.heading_from_probability(chosen.sum(axis=0) / chosen.sum()).best)
    fused = Posterior(_with_lens(prediction, observations), sun, directions, p.ravel(), used, camera_heading=heading)
    return replace(fused, candidate=best, candidate_probability=share)


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

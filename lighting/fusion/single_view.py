"""Posterior of one photo: gravity, compass, ephemeris, visible sun.

With time and place the ephemeris gives the sun's elevation and compass azimuth, and only the camera's heading is open.
The network's distribution is read along the ring of that elevation, once for each whole degree of heading, and
multiplied with the prior of the compass. Where the time zone is unknown, each candidate sun has a ring.

The network's distribution is in directions, by the camera that the network estimates. Where the picture shows the sun,
the evidence is a pixel: another field of view, elevation or roll of the camera moves its direction, and the ephemeris's
elevation says how the camera is tilted. A sun outside the picture is known by shadows and shading, whose directions
are the world's: it stays where it is.

Both are weighted by their errors (Kalman's gain), unless they are too far apart for chance.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lighting.circular import HEADINGS, Heading, heading_from_probability, von_mises
from lighting.color import luminance
from lighting.decoding import bayes_direction, sun_from_prediction, sun_from_rings
from lighting.errors import ErrorCode, ParameterError
from lighting.formatting import tilt_in_words
from lighting.fusion.consistency import consistency_warnings
from lighting.geometry import STEEP, Floats, Pinhole, angles, camera_axes, camera_pixel, direction, wrap_azimuth
from lighting.records import CodedWarning, EvidenceKind, Prediction, SunDistribution, SunEstimate, WarningCode
from lighting.sun_grid import grid_directions, smooth_density, soft_label, splat_to_grid
from lighting.validation import RANGES

# The camera's elevation and roll by the network together with what the photo itself says of gravity.

CAMERA_ELEVATION_STD = (
    3.5  # deg, of the network's camera elevation: 91 (paper) and 79 % (phone) of `val` lie within 5 deg
)
_CAMERA_ROLL_STD = 2.0  # deg, of its camera roll: 68 % of the crops of `val` lie within 1.0 (paper) and 2.3 deg (phone)
MAX_TILT_DISAGREEMENT = 20.0  # deg between the two that 1 % of the crops of `val` pass (0.2 % of paper, 2 % of phone)

_LEARNT = 35.0  # deg of elevation, up and down, that the network learnt from: it says no steeper ones


@dataclass(frozen=True)
class Gravity:
    """How the camera was held, by the photo's metadata."""

    elevation: float  # deg, positive looks up
    roll: float | None  # deg, positive turns the camera clockwise; None where it is not known
    std: float  # deg, one standard deviation


def _contrary(prediction: Prediction, gravity: Gravity, subject: str = "photo") -> CodedWarning | None:
    """A sentence about a `subject` whose pixels and gravity are farther apart than chance explains."""
    above, aside = _apart(prediction, gravity)
    if math.hypot(above, aside * math.cos(math.radians(gravity.elevation))) <= MAX_TILT_DISAGREEMENT:
        return None
    said = _words(gravity.elevation, gravity.roll)
    return CodedWarning(
        f"By its metadata the camera {said}, by the pixels it "
        f"{_words(prediction.camera_elevation, None if gravity.roll is None else prediction.camera_roll)}: "
        f"the {subject} may be cropped, turned or edited. What the metadata say of it was not used.",
        WarningCode.GRAVITY_CONTRADICTED,
    )


def _held(prediction: Prediction, gravity: Gravity) -> tuple[float, float]:
    """The camera's elevation and roll [deg] by both. Where it looks straight up or down within 5 deg, the roll is 0."""
    above, aside = _apart(prediction, gravity)
    elevation = gravity.elevation + above * _share(gravity.std, CAMERA_ELEVATION_STD)
    if abs(elevation) > STEEP:
        return elevation, 0.0
    if gravity.roll is None:
        return elevation, prediction.camera_roll
    return elevation, float(wrap_azimuth(gravity.roll + aside * _share(gravity.std, _CAMERA_ROLL_STD)))


def camera_elevation_std(gravity: Gravity | None) -> float:
    """One standard deviation [deg] of the elevation by both."""
    return (
        CAMERA_ELEVATION_STD
        if gravity is None
        else CAMERA_ELEVATION_STD * math.sqrt(_share(gravity.std, CAMERA_ELEVATION_STD))
    )


def _apart(prediction: Prediction, gravity: Gravity) -> tuple[float, float]:
    """By how much [deg] the network has more elevation and roll; its limit stands for steeper cameras."""
    known = min(max(gravity.elevation, -_LEARNT), _LEARNT)
    aside = 0.0 if gravity.roll is None else float(wrap_azimuth(prediction.camera_roll - gravity.roll))
    return prediction.camera_elevation - known, aside


def _share(stated: float, said: float) -> float:
    """The weight of the network, whose spread is `said`, beside what is stated with another."""
    return stated**2 / (stated**2 + said**2)


def _words(elevation: float, roll: float | None) -> str:
    looks = f"looks {tilt_in_words(elevation)}"
    return looks if roll is None else f"{looks} with a roll of {roll + 0.0:.0f}°"


# Fuse the network's distribution with metadata: one distribution of the sun, and the camera's heading.

COMPASS_STD = 25.0  # deg, standard deviation: phones' compasses err by 17 deg in the median
COMPASS_OUTLIER_RATE = 0.1  # share of compass headings that are useless: the uniform part of the prior


@dataclass(frozen=True)
class Observations:
    """What is known about one photo besides its pixels."""

    candidates: tuple[tuple[float, float], ...] = ()  # equally likely (sun elevation, sun compass azimuth) [deg]
    heading: float | None = None  # deg clockwise from true north, where the camera points
    heading_std: float = COMPASS_STD  # deg, one standard deviation of that
    vertical_fov: float | None = None  # deg, of the upright photo
    gravity: Gravity | None = None  # how the camera was held
    exposure_value: float | None = None  # EV at ISO 100, of the camera's settings
    subject: str = "photo"  # what warnings call the pixels' source: a "clip" and a "stream" are taken, too


@dataclass(frozen=True, eq=False)
class Posterior:
    """The fused distribution and parameters of one photo; `estimate_of` makes an Estimate of it."""

    prediction: Prediction  # with the best known camera, turbidity and exposure
    sun: SunEstimate
    directions: Floats  # (M, 3) unit vectors towards the sun, relative to the camera
    probability: Floats  # (M,) of each, sums to 1
    used: tuple[EvidenceKind, ...]
    warnings: tuple[str, ...] = ()  # sentences about what contradicts the pixels
    camera_heading: Heading | None = None  # from true north, where time and place are known
    relative_heading: Heading | None = None  # from the first of several photos, where no heading was known
    predicted_sun_elevation: float | None = None  # deg, by the pixels whose light it has; None: those of `prediction`

    def on_cells(self) -> SunDistribution:
        """The same distribution over the network's own cells."""
        grid = self.prediction.spec.sun_grid
        return SunDistribution(grid, splat_to_grid(self.probability, self.directions, grid).astype(np.float32))


@dataclass(frozen=True, eq=False)
class GravityFused:
    """What is known of one photo after its camera was put as gravity has it."""

    prediction: Prediction
    observations: Observations  # without a gravity that contradicts the pixels
    warnings: tuple[str, ...] = ()  # the sentence about that


def fuse_gravity(prediction: Prediction, evidence: Observations) -> GravityFused:
    """The prediction with the camera's elevation and roll by pixels and gravity; its sun stays where it is."""
    if evidence.gravity is None:
        return GravityFused(prediction, evidence)
    if (warning := _contrary(prediction, evidence.gravity, evidence.subject)) is not None:
        return GravityFused(prediction, replace(evidence, gravity=None), (warning,))
    elevation, roll = _held(prediction, evidence.gravity)
    return GravityFused(replace(prediction, camera_elevation=elevation, camera_roll=roll), evidence)


def fuse(prediction: Prediction, evidence: Observations) -> Posterior:
    """Fuse a prediction with its evidence; raises ParameterError where every candidate sun is below the horizon."""
    return fuse_with_gravity(fuse_gravity(prediction, evidence))


def fuse_with_gravity(stood: GravityFused) -> Posterior:
    """The same where the camera already stands as gravity has it."""
    prediction, evidence = stood.prediction, stood.observations
    candidates = candidates_above_horizon(evidence)
    density = likelihood_by_heading(prediction, candidates)
    if len(candidates):
        fused = posterior_on_rings(prediction, evidence, density * compass_prior(evidence))
    else:
        fused = posterior_on_grid(prediction, evidence, prediction.sun_probability)
    compass = None if evidence.heading is None else (evidence.heading, evidence.heading_std)
    against = consistency_warnings(prediction, candidates, density, compass, evidence.vertical_fov, evidence.subject)
    return replace(fused, warnings=(*against, *stood.warnings))


def candidates_above_horizon(evidence: Observations) -> Floats:
    """The candidates (K, 2) above the horizon; raises ParameterError if there are candidates and all are below it."""
    candidates = np.array(evidence.candidates, dtype=np.float64).reshape(-1, 2)
    up = candidates[candidates[:, 0] >= 0.0]
    if len(candidates) and not len(up):
        raise ParameterError(
            f"At this time and place the sun is {-candidates[:, 0].max():.1f}° below the horizon.",
            "time",
            ErrorCode.NIGHT,
        )
    return up


def daylight_candidates(candidates: Sequence[tuple[tuple[float, float], ...]]) -> list[int]:
    """The numbers of the candidates that are above the horizon in every photo; all photos have as many."""
    return [k for k in range(min(map(len, candidates), default=0)) if all(own[k][0] >= 0.0 for own in candidates)]


def _ring_directions(candidates: Floats) -> Floats:
    """Unit vectors (K, 360, 3) towards each candidate's sun (K, 2) as cameras at each of HEADINGS see it."""
    return direction(candidates[:, 1:] - HEADINGS, candidates[:, :1])


def likelihood_by_heading(prediction: Prediction, candidates: Floats) -> Floats:
    """Density [1/sr] (K, 360) of the pixels at each candidate's sun (K, 2), for each of HEADINGS."""
    if not len(candidates):
        return np.empty((0, len(HEADINGS)))
    return smooth_density(prediction.sun_probability, _ring_directions(candidates), prediction.spec.sun_grid)


def compass_prior(evidence: Observations) -> Floats:
    """Prior probability (360,) of HEADINGS: a von Mises curve around the compass heading plus a uniform part."""
    if evidence.heading is None:
        return np.full(360, 1 / 360)
    bell = von_mises(HEADINGS - evidence.heading, evidence.heading_std)
    return np.asarray((1 - COMPASS_OUTLIER_RATE) * bell / bell.sum() + COMPASS_OUTLIER_RATE / 360)


def posterior_on_grid(prediction: Prediction, evidence: Observations, probability: Floats) -> Posterior:
    """The answer of probabilities (N,) over the network's own cells."""
    cells = grid_directions(prediction.spec.sun_grid)
    known = replace(prediction, vertical_fov=evidence.vertical_fov or prediction.vertical_fov)
    sun = sun_from_prediction(replace(prediction, sun_probability=probability))
    return Posterior(known, sun, cells, probability, _used(prediction, evidence))


def posterior_on_rings(prediction: Prediction, evidence: Observations, weight: Floats) -> Posterior:
    """The answer of weights (K, 360) for each candidate with the sun up and each of HEADINGS."""
    p = weight / weight.sum()
    known = replace(prediction, vertical_fov=evidence.vertical_fov or prediction.vertical_fov)
    directions = _ring_directions(candidates_above_horizon(evidence)).reshape(-1, 3)
    sun = sun_from_rings(directions, p.ravel())
    return Posterior(
        known,
        sun,
        directions,
        p.ravel(),
        _used(prediction, evidence),
        camera_heading=heading_from_probability(p.sum(axis=0)),
    )


def _used(prediction: Prediction, evidence: Observations) -> tuple[EvidenceKind, ...]:
    """The evidence that the answer uses.

    Without time and place, a heading says nothing about the sun; without `suitable`, an exposure says nothing at all.
    """
    parts = {
        EvidenceKind.PIXELS: True,
        EvidenceKind.TIME_AND_PLACE: bool(evidence.candidates),
        EvidenceKind.HEADING: bool(evidence.candidates) and evidence.heading is not None,
        EvidenceKind.FOCAL_LENGTH: evidence.vertical_fov is not None,
        EvidenceKind.GRAVITY: evidence.gravity is not None,
        EvidenceKind.CAMERA_EXPOSURE: prediction.light is not None and evidence.exposure_value is not None,
    }
    return tuple(kind for kind, there in parts.items() if there)


# A sun that the picture shows stays on its pixel when more is known of the camera.

_SUN_PIXEL_STD = 2.0  # deg, of the seen sun's pixel: the network says its cell, 16 of 224 pixels
_SHOWN = 0.6  # least share of the probability near the answer from which the picture counts as showing the sun
_NEAR = 12.0  # deg around the answer
_MOVED = 25.0  # deg around the answer in which the probability moves with the pixels
_WIDEST = 16 / 9  # aspect ratio of the widest picture; the prediction does not know the photo's own
_SAME = 0.02  # share by which two focal lengths may differ and count as one, and rad by which two axes may
_GLARE = 3.0  # deg around its pixel in which a seen sun makes the picture white
_WHITE = 245  # of 255, coded luminance
_WHITE_SHARE = 0.03  # least share of the pixels there; 97 % of the crops that show the sun have more
_FAR = (15.0, 12.0)  # deg of azimuth and elevation, from which the sun of time and place is not the one seen


def fuse_single_view(
    prediction: Prediction, evidence: Observations, pixels: NDArray[np.uint8] | None = None
) -> Posterior:
    """Fuse one photo's prediction with its evidence; errors as in `fuse`.

    With its `pixels` (h, w, 3), a photo that is not white where the network has the sun counts as not showing it: then
    the network knows the direction by more than a pixel.
    """
    stood, sun = fuse_gravity(prediction, evidence), visible_sun(prediction, pixels)
    if sun is None:
        return fuse_with_gravity(stood)
    lens = stood.observations.vertical_fov or prediction.vertical_fov
    probability = reproject_sun(prediction, replace(stood.prediction, vertical_fov=lens), sun)
    moved = replace(stood.prediction, sun_probability=probability)
    fused = fuse_with_gravity(replace(stood, prediction=moved))
    return _levelled(fused, moved, camera_elevation_std(stood.observations.gravity))


def visible_sun(prediction: Prediction, pixels: NDArray[np.uint8] | None = None) -> Floats | None:
    """Unit vector (3,) towards the sun by the pixels alone if the picture shows it, else None.

    With its `pixels` (h, w, 3), a photo that is not white there does not show it.
    """
    if prediction.sun_visibility < 0.5:
        return None
    probability, cells = prediction.sun_probability, grid_directions(prediction.spec.sun_grid)
    sun = bayes_direction(probability, prediction.spec.sun_grid)
    right, up, forward = camera_axes(0.0, prediction.camera_elevation, prediction.camera_roll) @ sun
    edge = forward * math.tan(math.radians(prediction.vertical_fov) / 2)
    inside = abs(up) <= edge and abs(right) <= _WIDEST * edge
    sure = float(probability @ (cells @ sun >= math.cos(math.radians(_NEAR)))) >= _SHOWN
    if not (inside and sure):
        return None
    return sun if pixels is None or _glares(pixels, prediction, sun) else None


def _glares(pixels: NDArray[np.uint8], prediction: Prediction, sun: Floats) -> bool:
    """Whether the picture is white around the pixel of the sun (3,) by the network's own camera."""
    height, width = pixels.shape[:2]
    camera = Pinhole(width, height, prediction.vertical_fov, 0.0, prediction.camera_elevation, prediction.camera_roll)
    x, y = camera_pixel(sun, camera)
    reach = camera.focal_length * math.tan(math.radians(_GLARE))
    rows, columns = (slice(max(0, int(at - reach)), max(0, int(at + reach) + 1)) for at in (y, x))
    around = pixels[rows, columns]
    return around.size > 0 and float(np.mean(luminance(around) >= _WHITE)) >= _WHITE_SHARE


def reproject_sun(prediction: Prediction, known: Prediction, sun: Floats) -> NDArray[np.float32]:
    """The sun's probability with the seen sun (3,) and what lies around it where their pixels look by `known`'s camera.

    What the network said is in directions by the camera of `prediction`.
    """
    ratio = math.tan(math.radians(known.vertical_fov) / 2) / math.tan(math.radians(prediction.vertical_fov) / 2)
    said, there = (camera_axes(0.0, p.camera_elevation, p.camera_roll) for p in (prediction, known))
    if abs(math.log(ratio)) < _SAME and float(np.abs(said - there).max()) < _SAME:
        return prediction.sun_probability
    cells = grid_directions(prediction.spec.sun_grid)
    right, up, forward = (cells @ said.T).T
    near = (cells @ sun >= math.cos(math.radians(_MOVED))) & (forward > 0)
    rays = np.stack([ratio * right, ratio * up, forward], axis=-1)[near] @ there
    rays[:, 1] = np.maximum(rays[:, 1], 0.0)  # no sun stands below the horizon
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    p = np.asarray(prediction.sun_probability, dtype=np.float64)
    moved = np.where(near, 0.0, p) + splat_to_grid(p[near], rays, prediction.spec.sun_grid)
    return np.asarray(moved, dtype=np.float32)


def _levelled(fused: Posterior, prediction: Prediction, spread: float) -> Posterior:
    """The answer with the camera tilted so that the seen sun stands at the elevation of time and place.

    The tilt, known to `spread` [deg], and the pixel's are weighted by their errors (Kalman's gain). The sun is looked
    for where its probability would be seen to stand: on the horizon half of that is cut off, so it seems higher.
    """
    if fused.camera_heading is None:
        return fused
    grid = prediction.spec.sun_grid
    seen = bayes_direction(prediction.sun_probability, grid)
    known = soft_label(direction(fused.sun.azimuth, fused.sun.elevation), _width(prediction, seen) ** -2, grid)
    (azimuth, elevation), (known_azimuth, known_elevation) = (angles(s) for s in (seen, bayes_direction(known, grid)))
    aside, above = float(wrap_azimuth(known_azimuth - azimuth)), float(known_elevation - elevation)
    if abs(aside) > _FAR[0] or abs(above) > _FAR[1]:
        return fused
    turn = float(np.cos(np.radians(azimuth)))  # deg of the sun's elevation for each deg of tilt
    gain = turn * spread**2 / (turn**2 * spread**2 + _SUN_PIXEL_STD**2)
    tilt = float(np.clip(fused.prediction.camera_elevation + gain * above, *RANGES["camera_elevation"]))
    return replace(fused, prediction=replace(fused.prediction, camera_elevation=tilt))


def _width(prediction: Prediction, sun: Floats) -> float:
    """How wide [rad] the probability of the seen sun (3,) is to its sides, where no horizon cuts it off."""
    probability, cells = prediction.sun_probability, grid_directions(prediction.spec.sun_grid)
    near = cells @ sun >= math.cos(math.radians(_NEAR))
    aside = cells[near] @ direction(float(angles(sun)[0]) + 90.0, 0.0)
    return max(math.sqrt(float(np.average(aside**2, weights=probability[near]))), math.radians(_SUN_PIXEL_STD))

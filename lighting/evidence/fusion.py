"""Fuse the network's distribution with metadata: one distribution of the sun, and the camera's heading.

With time and place the ephemeris gives the sun's elevation and compass azimuth, and only the camera's heading is open.
The network's distribution is read along the ring of that elevation, once for each whole degree of heading, and
multiplied with the prior of the compass. Where the time zone is unknown, each candidate sun has a ring.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lighting.circular import HEADINGS, Heading, heading, von_mises
from lighting.decoding import sun_of, sun_on_rings
from lighting.errors import ErrorCode, ParameterError
from lighting.evidence.contradiction import contradictions
from lighting.evidence.gravity import Gravity, contrary, held
from lighting.geometry import Floats, direction
from lighting.records import EvidenceKind, Prediction, SunDistribution, SunEstimate
from lighting.sun_grid import grid_directions, over_cells, smooth_density

COMPASS_SPREAD = 25.0  # deg, standard deviation: phones' compasses err by 17 deg in the median
GROSS_ERRORS = 0.1  # share of compass headings that are useless: the uniform part of the prior


@dataclass(frozen=True)
class Evidence:
    """What is known about one photo besides its pixels."""

    candidates: tuple[tuple[float, float], ...] = ()  # equally likely (sun elevation, sun compass azimuth) [deg]
    heading: float | None = None  # deg clockwise from true north, where the camera points
    heading_spread: float = COMPASS_SPREAD  # deg, one standard deviation of that
    vertical_fov: float | None = None  # deg, of the upright photo
    gravity: Gravity | None = None  # how the camera was held
    exposure_value: float | None = None  # EV at ISO 100, of the camera's settings
    subject: str = "photo"  # what warnings call the pixels' source: a "clip" and a "stream" are taken, too


@dataclass(frozen=True, eq=False)
class Fused:
    """The fused distribution and parameters of one photo; `estimate_of` makes an Estimate of it."""

    prediction: Prediction  # with the best known camera, turbidity and exposure
    sun: SunEstimate
    directions: Floats  # (M, 3) unit vectors towards the sun, relative to the camera
    probability: Floats  # (M,) of each, sums to 1
    used: tuple[EvidenceKind, ...]
    warnings: tuple[str, ...] = ()  # sentences about what contradicts the pixels
    camera_heading: Heading | None = None  # from true north, where time and place are known
    relative_heading: Heading | None = None  # from the first of several photos, where no heading was known
    said_elevation: float | None = None  # deg, of the sun by the pixels whose light it has; None: those of `prediction`

    def on_cells(self) -> SunDistribution:
        """The same distribution over the network's own cells."""
        grid = self.prediction.spec.sun_grid
        return SunDistribution(grid, over_cells(self.probability, self.directions, grid).astype(np.float32))


@dataclass(frozen=True, eq=False)
class Stood:
    """What is known of one photo after its camera was put as gravity has it."""

    prediction: Prediction
    evidence: Evidence  # without a gravity that contradicts the pixels
    warnings: tuple[str, ...] = ()  # the sentence about that


def stand(prediction: Prediction, evidence: Evidence) -> Stood:
    """The prediction with the camera's elevation and roll by pixels and gravity; its sun stays where it is."""
    if evidence.gravity is None:
        return Stood(prediction, evidence)
    if (warning := contrary(prediction, evidence.gravity, evidence.subject)) is not None:
        return Stood(prediction, replace(evidence, gravity=None), (warning,))
    elevation, roll = held(prediction, evidence.gravity)
    return Stood(replace(prediction, camera_elevation=elevation, camera_roll=roll), evidence)


def fuse(prediction: Prediction, evidence: Evidence) -> Fused:
    """Fuse a prediction with its evidence; raises ParameterError where every candidate sun is below the horizon."""
    return fuse_stood(stand(prediction, evidence))


def fuse_stood(stood: Stood) -> Fused:
    """The same where the camera already stands as gravity has it."""
    prediction, evidence = stood.prediction, stood.evidence
    candidates = above_horizon(evidence)
    density = ring_density(prediction, candidates)
    if len(candidates):
        fused = on_rings(prediction, evidence, density * compass_prior(evidence))
    else:
        fused = on_grid(prediction, evidence, prediction.sun_probability)
    compass = None if evidence.heading is None else (evidence.heading, evidence.heading_spread)
    against = contradictions(prediction, candidates, density, compass, evidence.vertical_fov, evidence.subject)
    return replace(fused, warnings=(*against, *stood.warnings))


def above_horizon(evidence: Evidence) -> Floats:
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


def zones_of_day(candidates: Sequence[tuple[tuple[float, float], ...]]) -> list[int]:
    """The numbers of the candidates that are above the horizon in every photo; all photos have as many."""
    return [k for k in range(min(map(len, candidates), default=0)) if all(own[k][0] >= 0.0 for own in candidates)]


def ring_directions(candidates: Floats) -> Floats:
    """Unit vectors (K, 360, 3) towards each candidate's sun (K, 2) as cameras at each of HEADINGS see it."""
    return direction(candidates[:, 1:] - HEADINGS, candidates[:, :1])


def ring_density(prediction: Prediction, candidates: Floats) -> Floats:
    """Density [1/sr] (K, 360) of the pixels at each candidate's sun (K, 2), for each of HEADINGS."""
    if not len(candidates):
        return np.empty((0, len(HEADINGS)))
    return smooth_density(prediction.sun_probability, ring_directions(candidates), prediction.spec.sun_grid)


def compass_prior(evidence: Evidence) -> Floats:
    """Prior probability (360,) of HEADINGS: a von Mises curve around the compass heading plus a uniform part."""
    if evidence.heading is None:
        return np.full(360, 1 / 360)
    bell = von_mises(HEADINGS - evidence.heading, evidence.heading_spread)
    return np.asarray((1 - GROSS_ERRORS) * bell / bell.sum() + GROSS_ERRORS / 360)


def on_grid(prediction: Prediction, evidence: Evidence, probability: Floats) -> Fused:
    """The answer of probabilities (N,) over the network's own cells."""
    cells = grid_directions(prediction.spec.sun_grid)
    known = replace(prediction, vertical_fov=evidence.vertical_fov or prediction.vertical_fov)
    sun = sun_of(replace(prediction, sun_probability=probability))
    return Fused(known, sun, cells, probability, used(prediction, evidence))


def on_rings(prediction: Prediction, evidence: Evidence, weight: Floats) -> Fused:
    """The answer of weights (K, 360) for each candidate with the sun up and each of HEADINGS."""
    p = weight / weight.sum()
    known = replace(prediction, vertical_fov=evidence.vertical_fov or prediction.vertical_fov)
    directions = ring_directions(above_horizon(evidence)).reshape(-1, 3)
    sun = sun_on_rings(directions, p.ravel())
    return Fused(known, sun, directions, p.ravel(), used(prediction, evidence), camera_heading=heading(p.sum(axis=0)))


def used(prediction: Prediction, evidence: Evidence) -> tuple[EvidenceKind, ...]:
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

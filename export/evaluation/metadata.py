"""What simulated metadata add to the network's answers, and how often false metadata are reported.

Like the crops, the metadata depend on the panorama's name and the crop's index alone.
"""

import math
from collections.abc import Container, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, timedelta
from textwrap import fill

import numpy as np
from numpy.typing import NDArray

from export.crops.crops import crop_rng
from export.evaluation import metrics
from lighting.calibration import MAX_LENS_RATIO
from lighting.errors import WarningCode, warning_code
from lighting.fusion.consistency import MIN_ELEVATION_P_VALUE, MIN_HEADING_P_VALUE
from lighting.fusion.metadata_prior import observations_from_metadata
from lighting.fusion.single_view import MAX_TILT_DISAGREEMENT, Gravity, Observations, Posterior, fuse_single_view
from lighting.fusion.time_zones import is_at_sea, offset_at
from lighting.fusion.user_input import NO_USER_INPUT
from lighting.geometry import Floats, angles, wrap_azimuth, zoomed_fov
from lighting.photo.imu import TILT_STD
from lighting.photo.metadata import HeadingReference, PhotoMetadata
from lighting.prediction import Prediction
from lighting.records import EvidenceKind
from lighting.solar_position import sun_position

_LOCAL_TIME = "local time+place"  # a part of what is known: a time without its zone
LATITUDES = (-55.0, 65.0)  # deg, where people live
FIRST_DAY, DAYS = np.datetime64("2015-01-01T00:00:00"), 3652
STEP = 300  # s, between the moments of a day that are tried first
COMPASS_MEDIAN = 17.0  # deg, median error of a phone's heading
PHONE_STD = 25.2  # deg, standard deviation of the normal distribution with that median, which is 0.6745 of it
OUTLIER_RATE = 0.05  # share of headings that point anywhere


@dataclass(frozen=True)
class SimulatedMetadata:
    """A photo's metadata, and where its camera really pointed."""

    metadata: PhotoMetadata
    heading: float  # deg clockwise from true north
    gross: bool  # whether the compass pointed anywhere


def _simulate_sighting(elevation: float, rng: np.random.Generator) -> tuple[PhotoMetadata, float]:
    """A random place on land, a time at which the sun has an elevation [deg], and its azimuth [deg] from north."""
    while True:
        latitude, longitude = rng.uniform(*LATITUDES), rng.uniform(-180, 180)
        if is_at_sea(latitude, longitude):
            continue
        day = FIRST_DAY + np.timedelta64(int(rng.integers(DAYS)), "D")
        times = day + np.arange(0, 86400, STEP)
        above = sun_position(times, latitude, longitude)[1] > elevation
        passing = times[np.flatnonzero(above[1:] != above[:-1])]  # after which the sun crosses the elevation
        if len(passing):
            seconds = rng.choice(passing) + np.arange(STEP)
            azimuth, height = sun_position(seconds, latitude, longitude)
            best = int(np.argmin(np.abs(height - elevation)))
            time = seconds[best].item().replace(tzinfo=UTC)
            zone = offset_at(latitude, longitude, time)
            local = (time + timedelta(hours=zone)).replace(tzinfo=None)
            place = PhotoMetadata(local_time=local, utc_offset=zone, latitude=latitude, longitude=longitude)
            return place, float(azimuth[best])


def simulate_metadata(truth: metrics.Truth, crops_each: int) -> list[SimulatedMetadata]:
    """The metadata of each crop; crops that are not scored have no sun and get an empty record.

    Args:
        truth: of N crops, panorama by panorama.
        crops_each: of a panorama.
    """
    heights = {str(truth.panorama[i]): float(angles(truth.sun[i])[1]) for i in np.flatnonzero(truth.scored)}
    sightings = {name: _simulate_sighting(height, crop_rng(name, 0, "sighting")) for name, height in heights.items()}
    simulated = [SimulatedMetadata(PhotoMetadata(), math.nan, False)] * len(truth.scored)
    for i in np.flatnonzero(truth.scored).tolist():
        metadata, sun_heading = sightings[truth.panorama[i]]
        rng = crop_rng(truth.panorama[i], i % crops_each, "compass")
        heading = (sun_heading - float(angles(truth.sun[i])[0])) % 360.0
        gross = bool(rng.random() < OUTLIER_RATE)
        stated = (heading + (rng.uniform(-180, 180) if gross else rng.normal(0, PHONE_STD))) % 360.0
        fov = float(truth.camera[i, 2])
        metadata = replace(metadata, heading=stated, heading_reference=HeadingReference.TRUE, vertical_fov=fov)
        simulated[i] = SimulatedMetadata(metadata, heading, gross)
    return simulated


def keep_evidence(metadata: PhotoMetadata, parts: tuple[str, ...]) -> PhotoMetadata:
    """The metadata reduced to some parts.

    Args:
        metadata: of a photo.
        parts: some of _LOCAL_TIME, TIME_AND_PLACE, HEADING and FOCAL_LENGTH.
    """
    kept = metadata
    if EvidenceKind.TIME_AND_PLACE not in parts:
        kept = replace(kept, utc_offset=None)
    if EvidenceKind.TIME_AND_PLACE not in parts and _LOCAL_TIME not in parts:
        kept = replace(kept, local_time=None, latitude=None, longitude=None)
    if EvidenceKind.HEADING not in parts:
        kept = replace(kept, heading=None, heading_reference=None)
    return kept if EvidenceKind.FOCAL_LENGTH in parts else replace(kept, vertical_fov=None)


# What simulated metadata adds to the network's answers: every subset of the evidence, and false records.

PARTS = (EvidenceKind.TIME_AND_PLACE, EvidenceKind.HEADING, EvidenceKind.FOCAL_LENGTH)
SUBSETS: tuple[tuple[str, ...], ...] = (
    (),
    *(tuple(part for bit, part in enumerate(PARTS) if number >> bit & 1) for number in range(1, 8)),
    (_LOCAL_TIME,),
    (_LOCAL_TIME, EvidenceKind.HEADING),
)

_SIMULATION = fill(
    "Simulated places and times: the ephemeris puts the sun as high as it is in the panorama. Simulated compasses: a "
    f"median error of {COMPASS_MEDIAN:g}°, {100 * OUTLIER_RATE:.0f} % of them pointing anywhere. The focal length is "
    "the true one. A heading without time and place says nothing about the sun. A time without its zone is of that of "
    "the place, on land.",
    120,
)
_WARNED = fill(
    "Share of photos [%] with a warning of a contradiction, for true records (compass noise, no gross errors) and for "
    f"false ones. The pixels contradict an elevation of tail probability under "
    f"{MIN_ELEVATION_P_VALUE:.1%}, and a heading of one under {MIN_HEADING_P_VALUE:.1%}. They contradict a focal "
    f"length that differs by a factor over {MAX_LENS_RATIO:g}, and gravity more than {MAX_TILT_DISAGREEMENT:g}° from "
    "where the network has it.",
    120,
)
ByLens = tuple[Prediction, Prediction]  # of a photo that does not state its lens, and of the same one if it does

_WRONG_SUN = 30.0  # deg of elevation by which a false time and place is off
_WRONG_GRAVITY = 30.0  # deg of elevation by which a false camera is off


def evidence_report(
    protocol: str, truth: metrics.Truth, predictions: Sequence[ByLens], simulated: Sequence[SimulatedMetadata]
) -> str:
    """The tables of one protocol, over scored crops.

    Args:
        protocol: its name.
        truth: of N crops.
        predictions: N, of the same crops.
        simulated: N, of the same crops.
    """
    chosen = np.flatnonzero(truth.scored).tolist()
    scored = metrics.select_crops(truth, truth.scored)
    predictions, simulated = [predictions[i] for i in chosen], [simulated[i] for i in chosen]
    photos = list(zip(predictions, [s.metadata for s in simulated], strict=True))
    fused = {
        parts: [fuse_single_view(_choose_lens(p, parts), _observations(m, parts)) for p, m in photos]
        for parts in SUBSETS
    }
    headings = np.array([s.heading for s in simulated])
    names = {parts: " + ".join(("pixels", *parts)).replace(_LOCAL_TIME, "time without zone+place") for parts in SUBSETS}
    rows = {names[parts]: _figures(scored, posteriors, headings) for parts, posteriors in fused.items()}
    sections = [
        f"## Metadata, protocol `{protocol}`: {len(chosen)} crops [deg]",
        _SIMULATION,
        metrics.figures_table(rows),
        _azimuth_sentence(scored, fused[()], fused[(EvidenceKind.TIME_AND_PLACE,)]),
        _WARNED,
        metrics.figures_table(_warning_shares(scored, [without for without, _ in predictions], simulated)),
    ]
    return "\n\n".join(sections)


def _observations(metadata: PhotoMetadata, parts: tuple[str, ...]) -> Observations:
    return observations_from_metadata(keep_evidence(metadata, parts), NO_USER_INPUT).observations


def _choose_lens(prediction: ByLens, parts: Container[str]) -> Prediction:
    """What is predicted of a photo of which these parts are known."""
    without, with_lens = prediction
    return with_lens if EvidenceKind.FOCAL_LENGTH in parts else without


def in_view_evidence(truth: metrics.Truth, predictions: Sequence[ByLens], pictures: Sequence[NDArray[np.uint8]]) -> str:
    """What lens, time and place, and gravity add for crops that show the sun: errors of the sun and of the camera.

    Gravity is simulated with a phone's error of 1 deg.

    Args:
        truth: of N crops.
        predictions: N, of the same crops.
        pictures: N crops' own pixels (h, w, 3), sRGB.
    """
    _, elevation = angles(truth.sun)
    lens = truth.camera[:, 2].tolist()
    sun = [((height, 0.0),) for height in elevation.tolist()]
    evidence = {
        "pixels": [Observations()] * len(predictions),
        "pixels + gravity": _gravity(truth),
        "pixels + focal length": [Observations(vertical_fov=fov) for fov in lens],
        "pixels + time+place": [Observations(candidates) for candidates in sun],
        "pixels + time+place + focal length": [
            Observations(c, vertical_fov=fov) for c, fov in zip(sun, lens, strict=True)
        ],
    }
    rows = {}
    for name, observations in evidence.items():
        chosen = [_choose_lens(prediction, name) for prediction in predictions]
        fused = [fuse_single_view(*photo) for photo in zip(chosen, observations, pictures, strict=True)]
        tilt = np.abs(np.array([f.prediction.camera_elevation for f in fused]) - truth.camera[:, 0])
        error = metrics.sun_error(truth, metrics.answers_from_estimates([f.sun for f in fused]))
        medians = {"sun": metrics.median(error), "camera elevation": metrics.median(tilt)}
        rows[name] = {**medians, "under 5°": metrics.percentage(tilt < 5)}
    return metrics.figures_table(rows)


def _gravity(truth: metrics.Truth, error: float = 0.0) -> list[Observations]:
    """What phones note of gravity, and `error` [deg] that their elevation is wrong besides."""
    noise = np.random.default_rng(0).normal(0.0, TILT_STD, (len(truth.camera), 2))
    tilts = (truth.camera[:, :2] + noise + [error, 0.0]).tolist()
    return [Observations(gravity=Gravity(elevation, roll, TILT_STD)) for elevation, roll in tilts]


def _figures(truth: metrics.Truth, fused: Sequence[Posterior], headings: Floats) -> dict[str, float]:
    """Median errors, and the share of truths inside the regions; true headings (N,) [deg]."""
    answers = metrics.answers_from_estimates([f.sun for f in fused])
    figures = metrics.sun_figures(truth, answers)
    fov = np.array([f.prediction.vertical_fov for f in fused])
    tilt = np.array([f.prediction.camera_elevation for f in fused])
    heading, heading_inside = math.nan, math.nan
    estimates = [(f.camera_heading.best, f.camera_heading.radius_90) for f in fused if f.camera_heading is not None]
    if len(estimates) == len(fused):
        best, radius = np.array(estimates).T
        error = np.abs(wrap_azimuth(best - headings))
        heading, heading_inside = metrics.median(error), metrics.percentage(error <= radius)
    return {
        "sun": figures["median"],
        **{name: figures[name] for name in ("azimuth", "elevation", "in 50 % region", "in 90 % region")},
        "radius 90": metrics.median(answers.radius_90),
        "camera elevation": metrics.median(np.abs(tilt - truth.camera[:, 0])),
        "fov": metrics.median(np.abs(fov - truth.camera[:, 2])),
        "heading": heading,
        "heading in 90 %": heading_inside,
    }


def _azimuth_sentence(truth: metrics.Truth, pixels: Sequence[Posterior], timed: Sequence[Posterior]) -> str:
    answers = (metrics.answers_from_estimates([f.sun for f in fused]) for fused in (timed, pixels))
    later, earlier = (np.abs(metrics.azimuth_error(truth, a)) for a in answers)
    ends = metrics.format_interval(metrics.difference_interval(later, earlier, truth.panorama))
    return f"Median azimuth error with time and place minus that of the pixels alone: 95 % interval {ends}."


# How often the pixels contradict metadata that are true, and metadata that are false.


def _warning_shares(
    truth: metrics.Truth, predictions: Sequence[Prediction], simulated: Sequence[SimulatedMetadata]
) -> dict[str, dict[str, float]]:
    """Percentages of photos with a warning, by what is false."""
    rng = np.random.default_rng(0)
    true, elevation = [s.metadata for s in simulated], angles(truth.sun)[1]
    apart = np.abs(elevation[:, None] - elevation) >= _WRONG_SUN
    other_suns = [true[rng.choice(np.flatnonzero(row))] if row.any() else m for m, row in zip(true, apart, strict=True)]
    rotated = [replace(s.metadata, heading=(s.heading + rng.uniform(90, 270)) % 360.0) for s in simulated]
    cropped = [replace(m, vertical_fov=zoomed_fov(m.vertical_fov or 0.0, 2.0)) for m in true]  # to the middle half
    sound = [(p, s.metadata) for p, s in zip(predictions, simulated, strict=True) if not s.gross]

    def warned(metadata: Sequence[PhotoMetadata], part: EvidenceKind) -> float:
        return _warned(predictions, [_observations(m, (part,)) for m in metadata])

    def heading_warned(photos: Sequence[tuple[Prediction, PhotoMetadata]]) -> float:
        observations = [_observations(m, (EvidenceKind.TIME_AND_PLACE, EvidenceKind.HEADING)) for _, m in photos]
        return _warned([p for p, _ in photos], observations, WarningCode.HEADING_CONTRADICTED)

    headings = sound, list(zip(predictions, rotated, strict=True))
    shares = {  # where the metadata are true, and where they are false
        f"sun off by {_WRONG_SUN:g}° or more": [warned(m, EvidenceKind.TIME_AND_PLACE) for m in (true, other_suns)],
        "heading off by 90 to 270°": [heading_warned(photos) for photos in headings],
        "picture cropped to half": [warned(m, EvidenceKind.FOCAL_LENGTH) for m in (true, cropped)],
        f"camera off by {_WRONG_GRAVITY:g}°": [_warned(predictions, _gravity(truth, e)) for e in (0.0, _WRONG_GRAVITY)],
    }
    return {what: {"true": right, "false": wrong} for what, (right, wrong) in shares.items()}


def _warned(
    predictions: Sequence[Prediction], observations: Sequence[Observations], code: WarningCode | None = None
) -> float:
    """Percentage of photos with a warning, or with one of this code."""
    photos = zip(predictions, observations, strict=True)
    codes = [list(map(warning_code, fuse_single_view(p, o).warnings)) for p, o in photos]
    return metrics.percentage(np.array([bool(c) if code is None else code in c for c in codes]))

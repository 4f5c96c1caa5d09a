"""Metadata -> Observations: sun candidates, heading, lens, gravity, exposure."""

import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from lighting.errors import ErrorCode, ParameterError
from lighting.fields import RANGES
from lighting.fusion.instants import Instant, PhotoInstants, resolve_instants, resolve_together
from lighting.fusion.single_view import COMPASS_STD, Gravity, Observations, daylight_candidates
from lighting.fusion.user_input import UserInput
from lighting.geometry import EYE_HEIGHT, SUN_RADIUS, angle_between, direction
from lighting.photo.metadata import HeadingReference, PhotoMetadata
from lighting.solar_position import ASTRONOMICAL_TWILIGHT, CIVIL_TWILIGHT, NAUTICAL_TWILIGHT, sun_position

if TYPE_CHECKING:
    from pygeomag import GeoMag

Location = tuple[float, float]  # latitude and longitude, deg, positive north and east


def _sun_candidates(instants: Sequence[Instant], location: Location | None) -> tuple[tuple[float, float], ...]:
    """Elevations and compass azimuths [deg] of the sun, one for each instant.

    Args:
        instants: at which the photo may have been taken, one or more.
        location: where; without it there are no candidates.
    """
    if location is None:
        return ()
    azimuth, elevation = sun_position(_utc_times(instants), *location)
    return tuple(zip(elevation.tolist(), azimuth.tolist(), strict=True))


def _utc_times(instants: Sequence[Instant]) -> "np.ndarray[tuple[int], np.dtype[np.datetime64]]":
    return np.array([instant.utc_time.replace(tzinfo=None) for instant in instants], dtype="datetime64[us]")


def _phase(elevation: float, polar: bool) -> str:
    if elevation < ASTRONOMICAL_TWILIGHT:
        return "polar night" if polar else "night"
    kind = "civil" if elevation >= CIVIL_TWILIGHT else "nautical" if elevation >= NAUTICAL_TWILIGHT else "astronomical"
    return f"{kind} twilight of the polar night" if polar else f"{kind} twilight"


def _is_polar_night(instants: Sequence[Instant], location: Location | None) -> bool:
    if location is None or not instants:
        return False
    day = _utc_times(instants)[:1] + np.arange(-12, 13).astype("timedelta64[h]")
    return bool(np.max(sun_position(day, *location)[1]) < -SUN_RADIUS)


USER_HEADING_STD = 10.0  # deg, of a heading that the user states: read from a map rather than from a phone
_DECLINATION_STD = 17.0  # deg, root mean square of the magnetic declination over the latitudes up to 65 deg in 2022

_EARTH_RADIUS_KM = 6371.0
_MAX_DISTANCE_KM = 100.0  # within which the sun has the same direction to a degree
_NIGHT_IN_ALL_ZONES = "One photo is of the night in every zone"

_DECLINATION_EPOCHS = (2010, 2015, 2020, 2025)  # each model holds for five years
_MAX_AERIAL_ELEVATION = -10.0  # deg, of a camera on a gimbal that looks down from above
_MIN_HORIZONTAL_FIELD = 6000.0  # nT, under which the model's authors call compasses unreliable
_DECLINATION_LOCK = threading.Lock()  # a model stores intermediate values in itself, so threads must take turns

_SunCandidates = tuple[tuple[float, float], ...]  # elevation and compass azimuth of each, deg


@dataclass(frozen=True)
class MetadataPrior:
    """The observations of one photo, and what its estimate reports besides."""

    observations: Observations = field(default_factory=Observations)
    """What the metadata and the user say."""
    warnings: tuple[str, ...] = ()
    """Sentences for people."""
    twilight_sun: float | None = None
    """Deg, the sun's negative elevation in civil twilight by time and place."""
    is_night: bool = False
    """Time and place say that it was night, too dark for these skies; they were not used."""
    location: tuple[float, float] | None = field(default=None, repr=False)
    """Latitude and longitude for the answer, deg."""
    instants: PhotoInstants = field(default_factory=PhotoInstants)
    """As many as candidates, if there are any of these."""
    camera_height: float = EYE_HEIGHT
    """Meters above the ground."""
    is_aerial: bool = False
    """A gimbal says that the camera flies, and nothing says how high."""


def observations_from_metadata(
    metadata: PhotoMetadata, user_input: UserInput, subject: str = "photo", *, allow_night: bool = False
) -> MetadataPrior:
    """The observations from a photo's metadata and its user.

    Args:
        metadata: of the photo's file; they never raise.
        user_input: what the user states.
        subject: what warnings call the pixels' source.
        allow_night: whether the user's own time may be at night, as of a later frame of a clip.

    Raises:
        ParameterError: the user's own time or location is at night.
    """
    merged = merge_user_input(metadata, user_input)
    return _observe(merged, resolve_instants(merged, user_input), user_input, subject, allow_night=allow_night)


def _observe(
    merged: PhotoMetadata,
    instants: PhotoInstants,
    user_input: UserInput,
    subject: str = "photo",
    *,
    allow_night: bool = False,
) -> MetadataPrior:
    """The observations of merged metadata; ParameterError where the user's own time or location is at night.

    Candidate suns that are all below the horizon are put on it in civil twilight, and not used at night.
    """
    candidates = _sun_candidates(instants.instants, merged.location) if instants.instants else ()
    highest = max((elevation for elevation, _ in candidates), default=0.0)
    is_night, is_stated = highest < CIVIL_TWILIGHT, user_input.time is not None or user_input.latitude is not None
    if is_night and is_stated and not allow_night:
        phase = _phase(highest, _is_polar_night(instants.instants, merged.location))
        sentence = (
            f"At that time and place the sun is {-highest:.1f}° below the horizon ({phase}; civil twilight ends at "
            "6°): too dark for these skies."
        )
        stated = "latitude" if user_input.time is None else "time"
        raise ParameterError(sentence, stated, ErrorCode.NIGHT)
    warnings = (*instants.warnings, *_unused_input_warnings(merged, user_input, subject))
    if is_dark := highest < -SUN_RADIUS:
        consequence = "time and place were not used."
        if not is_night:
            late = highest < RANGES["sun_elevation"][0]
            consequence = "the answer is too bright." if late else "the answer has no direct sunlight."
        sentence = f"The sun is {-highest:.1f}° below the horizon ({_phase(highest, polar=False)}): {consequence}"
        warnings = (*warnings, sentence)
    raised = () if is_night else tuple((max(el, 0.0) if el >= CIVIL_TWILIGHT else el, az) for el, az in candidates)
    elevation, std, gravity = merged.camera_elevation, merged.gravity_spread, None
    if elevation is not None and std is not None:
        gravity = Gravity(elevation, merged.camera_roll, std)
    weights = tuple(instant.weight for instant in instants.instants) if raised else ()
    compass, exposure_value = _compass(merged, instants, user_input), merged.exposure_value
    observations = Observations(raised, *compass, merged.vertical_fov, gravity, exposure_value, subject, weights)
    by_gimbal = elevation is not None and merged.gravity_source == "gimbal" and elevation < _MAX_AERIAL_ELEVATION
    return MetadataPrior(
        observations,
        warnings,
        twilight_sun=highest if is_dark and not is_night else None,
        is_night=bool(candidates) and is_night,
        location=merged.location if user_input.keep_location else None,
        instants=instants,
        camera_height=EYE_HEIGHT if merged.camera_height is None else merged.camera_height,
        is_aerial=by_gimbal and merged.camera_height is None,
    )


def merge_user_input(metadata: PhotoMetadata, user_input: UserInput) -> PhotoMetadata:
    """The photo's metadata with the place, the heading and the lens that the user states; a place is taken whole.

    Args:
        metadata: of the photo's file.
        user_input: what the user states; `metadata` False drops the file's. Its time is for `resolve_instants`.
    """
    merged = metadata if user_input.metadata else PhotoMetadata()
    if user_input.latitude is not None:
        merged = replace(merged, latitude=user_input.latitude, longitude=user_input.longitude)
    if user_input.heading is not None:
        merged = replace(merged, heading=user_input.heading, heading_reference=HeadingReference.TRUE)
    if user_input.vertical_fov is not None:
        merged = replace(merged, vertical_fov=user_input.vertical_fov)
    if user_input.camera_height is not None:
        merged = replace(merged, camera_height=user_input.camera_height)
    return merged


def share_location(metadata: Sequence[PhotoMetadata]) -> list[PhotoMetadata]:
    """Give photos taken together the location of the first photo that has one.

    Args:
        metadata: of each photo.
    """
    source = next((m for m in metadata if m.latitude is not None), PhotoMetadata())
    return [replace(m, latitude=source.latitude, longitude=source.longitude) for m in metadata]


def observations_single(metadata: PhotoMetadata, user_input: UserInput) -> MetadataPrior:
    """The observations of a photo on its own, where a heading without time and place tells nothing.

    Args:
        metadata: of the photo's file.
        user_input: what the user states.

    Raises:
        ParameterError: the user's own time or location is at night.
    """
    prior = observations_from_metadata(metadata, user_input)
    if user_input.heading is None or prior.observations.candidates or prior.is_night:
        return prior
    warning = "The heading was not used: time and place are not both known."
    return replace(prior, warnings=(*prior.warnings, warning))


def observations_multi(metadata: Sequence[PhotoMetadata], user_input: UserInput) -> list[MetadataPrior]:
    """The observations of photos taken together. If one was taken at night by its metadata, no time is used.

    Args:
        metadata: of each photo's file.
        user_input: what the user states of all.

    Raises:
        ParameterError: it was night in one of them at the user's own time or location, in whatever zone.
    """
    located = share_location(metadata)
    merged = [merge_user_input(m, user_input) for m in located]
    instants = resolve_together(merged, user_input)
    priors = [_observe(m, each, user_input) for m, each in zip(merged, instants, strict=True)]
    if user_input.metadata and user_input.latitude is None:
        priors = [
            replace(p, warnings=(*p.warnings, *_location_warnings(m, used))) if p.observations.candidates else p
            for p, m, used in zip(priors, metadata, located, strict=True)
        ]
    if any(p.is_night for p in priors):
        warning = "Another photo was taken at night: time and place were not used."
        return _without_time(priors, warning)
    candidates = [p.observations.candidates for p in priors if p.observations.candidates]
    if not candidates or daylight_candidates(candidates):
        return priors
    if user_input.latitude is not None:
        raise ParameterError(f"{_NIGHT_IN_ALL_ZONES}: too dark for these skies.", "latitude", ErrorCode.NIGHT)
    return _without_time(priors, f"{_NIGHT_IN_ALL_ZONES}: time and place were not used.")


def _without_time(priors: Sequence[MetadataPrior], warning: str) -> list[MetadataPrior]:
    """The same without time; a warning goes to those that had one."""
    return [
        replace(
            p,
            observations=replace(p.observations, candidates=(), weights=()),
            warnings=(*p.warnings, warning),
            twilight_sun=None,
        )
        if p.observations.candidates
        else p
        for p in priors
    ]


def _location_warnings(metadata: PhotoMetadata, used: PhotoMetadata) -> tuple[str, ...]:
    """A warning where a photo's own location is another than the one that is used for all."""
    locations = (metadata.location, used.location)
    points = [direction(location[1], location[0]) for location in locations if location is not None]
    if len(points) < 2:
        return ()
    distance = _EARTH_RADIUS_KM * math.radians(float(angle_between(*points)))
    if distance < _MAX_DISTANCE_KM:
        return ()
    return (f"Its place lies {distance:.0f} km from the first photo's, which was used for all.",)


def _unused_input_warnings(merged: PhotoMetadata, user_input: UserInput, subject: str) -> tuple[str, ...]:
    """Sentences about what the user stated that could not be used."""
    has_time = any(time is not None for time in (user_input.time, merged.local_time, merged.gps_time))
    if user_input.time is not None and merged.latitude is None:
        return (f"The time was not used, because the {subject} does not say where it was taken.",)
    if user_input.latitude is not None and not has_time:
        return (f"The place was not used, because the {subject} does not say when it was taken.",)
    if user_input.utc_offset is not None and merged.local_time is None and user_input.time is None:
        return (f"The offset from UTC was not used, because the {subject} has no local time.",)
    return ()


# Compass heading and magnetic declination: how far a compass needle points from true north.


def _compass(metadata: PhotoMetadata, instants: PhotoInstants, user_input: UserInput) -> tuple[float | None, float]:
    """The heading from true north, if it is known, and its standard deviation [deg]."""
    if metadata.heading is None:
        return None, COMPASS_STD
    if user_input.heading is not None:
        return metadata.heading % 360.0, USER_HEADING_STD
    if metadata.heading_reference == HeadingReference.TRUE:
        return metadata.heading % 360.0, COMPASS_STD
    instant, declination = instants.likeliest, None
    if instant is not None and metadata.location is not None:
        declination = _magnetic_declination(*metadata.location, instant.utc_time)
    if metadata.heading_reference == HeadingReference.MAGNETIC and declination is not None:
        return (metadata.heading + declination) % 360.0, COMPASS_STD
    std = _DECLINATION_STD if declination is None else declination
    return metadata.heading % 360.0, math.hypot(COMPASS_STD, std)


def _magnetic_declination(latitude: float, longitude: float, time: datetime) -> float | None:
    """Declination [deg, positive east] at sea level by the World Magnetic Model.

    None before 2010, from 2030 on, and near the magnetic poles.
    """
    epoch = time.year - time.year % 5
    if epoch not in _DECLINATION_EPOCHS:
        return None
    year = time.year + (time.timetuple().tm_yday - 1) / 366
    with _DECLINATION_LOCK:
        magnetic = _magnetic_model(epoch).calculate(glat=latitude, glon=longitude, alt=0.0, time=year)
    return float(magnetic.d) if magnetic.h >= _MIN_HORIZONTAL_FIELD else None


@lru_cache(maxsize=len(_DECLINATION_EPOCHS))
def _magnetic_model(epoch: int) -> "GeoMag":
    from pygeomag import GeoMag

    return GeoMag(base_year=epoch)

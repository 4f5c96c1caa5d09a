"""Metadata -> Observations: sun candidates, heading, lens, gravity, daylight.

At ISO 100 sunlight takes EV 15, open shade and a heavy sky 12, a landscape just after sunset 9; streets and shop
windows in bright lamplight take 8, rooms 5 to 7 (ANSI PH2.7, Photographic Exposure Guide). Exposures tell indoors from
outdoors better than pixels do (Boutell and Luo, CVPR 2004).
"""

import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import lru_cache
from typing import TYPE_CHECKING

from lighting.errors import ErrorCode, ParameterError
from lighting.fusion.single_view import COMPASS_STD, Gravity, Observations, daylight_candidates
from lighting.fusion.timezones import (
    drop_unzoned,
    format_below_horizon,
    location_of,
    merge_user_input,
    share_location,
    sun_candidates,
)
from lighting.fusion.user_input import UserInput
from lighting.geometry import SUN_RADIUS, angle_between, direction
from lighting.photo.metadata import HeadingReference, PhotoMetadata
from lighting.solar_position import CIVIL_TWILIGHT

if TYPE_CHECKING:
    from pygeomag import GeoMag

# Magnetic declination: how far a compass needle points from true north, by the World Magnetic Model.

DECLINATION_STD = 17.0  # deg, root mean square over the latitudes up to 65 deg in 2022

_EPOCHS = (2010, 2015, 2020, 2025)  # each model holds for five years
_CALCULATING = threading.Lock()  # a model stores intermediate values in itself, so threads must take turns
_WEAK = 6000.0  # nT of horizontal field, under which the model's authors call compasses unreliable


def _magnetic_declination(latitude: float, longitude: float, time: datetime) -> float | None:
    """Declination [deg, positive east] at sea level; None before 2010, from 2030 on, and near the magnetic poles."""
    epoch = time.year - time.year % 5
    if epoch not in _EPOCHS:
        return None
    year = time.year + (time.timetuple().tm_yday - 1) / 366
    with _CALCULATING:
        field = _model(epoch).calculate(glat=latitude, glon=longitude, alt=0.0, time=year)
    return float(field.d) if field.h >= _WEAK else None


@lru_cache(maxsize=len(_EPOCHS))
def _model(epoch: int) -> "GeoMag":
    from pygeomag import GeoMag

    return GeoMag(base_year=epoch)


# Turn a photo's metadata and its user's statements into evidence about the sun, the heading and the lens.

USER_HEADING_STD = 10.0  # deg, of a heading that the user states: read from a map rather than from a phone

_SunCandidates = tuple[tuple[float, float], ...]  # elevation and compass azimuth of each, deg

_EARTH_RADIUS = 6371.0  # km
_ONE_PLACE = 100.0  # km within which the sun stands within a degree of the same direction
_NIGHT_IN_ALL_ZONES = "Whatever the zone of their clocks, one of the photos taken together was taken at night"
_IN_TWILIGHT = "the answer is the sky of a sun on the horizon, brighter than this one, without direct sunlight."


@dataclass(frozen=True)
class MetadataPrior:
    """The evidence about one photo, and what its Estimate reports besides."""

    observations: Observations = field(default_factory=Observations)
    warnings: tuple[str, ...] = ()
    sun_is_up: bool = True  # False where time and place say that no direct sunlight reaches the photo
    is_night: bool = False  # time and place say that it was night, too dark for these skies; they were not used
    location: tuple[float, float] | None = field(default=None, repr=False)  # latitude and longitude for the answer


def observations_from_metadata(facts: PhotoMetadata, given: UserInput, subject: str = "photo") -> MetadataPrior:
    """The evidence from a photo's metadata and its user; `subject` is what warnings call it.

    Raises ParameterError where the user's own time or place is at night. A photo's own metadata never raise.
    """
    merged = merge_user_input(facts, given)
    candidates = sun_candidates(merged)
    if (highest := _highest(candidates)) < CIVIL_TWILIGHT and (given.time is not None or given.latitude is not None):
        stated = "latitude" if given.time is None else "time"
        raise ParameterError(
            format_below_horizon(merged, highest) + "too dark for these skies.", stated, ErrorCode.NIGHT
        )
    return _known(merged, candidates, given, subject)


def observations_of_frame(facts: PhotoMetadata, given: UserInput, subject: str) -> MetadataPrior:
    """The same for a later frame of a clip, which may pass into the night: the user's own time does not raise."""
    merged = merge_user_input(facts, given)
    return _known(merged, sun_candidates(merged), given, subject)


def _highest(candidates: _SunCandidates) -> float:
    """The highest elevation [deg] of candidate suns; 0 where there are none."""
    return max((elevation for elevation, _ in candidates), default=0.0)


def _known(merged: PhotoMetadata, candidates: _SunCandidates, given: UserInput, subject: str) -> MetadataPrior:
    """The evidence of merged facts whose candidate suns may all be below the horizon."""
    highest, warnings = _highest(candidates), _missing(merged, given, subject)
    if highest < -SUN_RADIUS:
        consequence = _IN_TWILIGHT if highest >= CIVIL_TWILIGHT else "time and place were not used."
        warnings = (*warnings, format_below_horizon(merged, highest) + consequence)
    heading, heading_std = _compass(merged, given)
    evidence = replace(
        _of_camera(merged),
        candidates=_in_twilight_on_the_horizon(candidates) if highest >= CIVIL_TWILIGHT else (),
        exposure_value=merged.exposure_value,
        subject=subject,
        heading=heading,
        heading_std=heading_std,
    )
    sun_is_up = not CIVIL_TWILIGHT <= highest < -SUN_RADIUS
    location = location_of(merged) if given.keep_location else None
    return MetadataPrior(evidence, warnings, sun_is_up, bool(candidates) and highest < CIVIL_TWILIGHT, location)


def camera_observations(facts: PhotoMetadata, given: UserInput) -> Observations:
    """What of the evidence is about the camera alone: its lens, and how it was held."""
    return _of_camera(merge_user_input(facts, given))


def _of_camera(merged: PhotoMetadata) -> Observations:
    elevation, spread = merged.camera_elevation, merged.gravity_spread
    gravity = None if elevation is None or spread is None else Gravity(elevation, merged.camera_roll, spread)
    return Observations(vertical_fov=merged.vertical_fov, gravity=gravity)


def observations_single(facts: PhotoMetadata, given: UserInput) -> MetadataPrior:
    """The evidence of a photo that stands alone, where a heading without time and place tells nothing."""
    found = observations_from_metadata(facts, given)
    if given.heading is None or found.observations.candidates or found.is_night:
        return found
    warning = "The heading was not used, because time and place of the photo are not both known."
    return replace(found, warnings=(*found.warnings, warning))


def observations_multi(facts: Sequence[PhotoMetadata], given: UserInput) -> list[MetadataPrior]:
    """The evidence of photos taken together. If one of them was taken at night by its metadata, no time is used.

    Raises ParameterError where it was night in one of them at the user's own place, whatever zone their times are of.
    """
    there = share_location(facts)
    found = [
        observations_from_metadata(fact, given)
        for fact in (there if given.utc_offset is not None else drop_unzoned(there))
    ]
    if given.use_exif and given.latitude is None:
        found = [
            replace(k, warnings=(*k.warnings, *_elsewhere(own, used))) if k.observations.candidates else k
            for k, own, used in zip(found, facts, there, strict=True)
        ]
    if any(k.is_night for k in found):
        return _timeless(found, "Another photo taken with it says that it was night: time and place were not used.")
    timed = [k.observations.candidates for k in found if k.observations.candidates]
    if not timed or daylight_candidates(timed):
        return found
    if given.latitude is not None:
        raise ParameterError(f"{_NIGHT_IN_ALL_ZONES}: too dark for these skies.", "latitude", ErrorCode.NIGHT)
    return _timeless(found, f"{_NIGHT_IN_ALL_ZONES}: time and place were not used.")


def _elsewhere(facts: PhotoMetadata, used: PhotoMetadata) -> tuple[str, ...]:
    """A warning where a photo's own place is another than the one that is used for all."""
    places = (location_of(facts), location_of(used))
    there = [direction(place[1], place[0]) for place in places if place is not None]
    if len(there) < 2:
        return ()
    distance = _EARTH_RADIUS * math.radians(float(angle_between(*there)))
    if distance < _ONE_PLACE:
        return ()
    return (f"Its own place lies {distance:.0f} km from that of the first photo that has one, which was used for all.",)


def _timeless(found: Sequence[MetadataPrior], warning: str) -> list[MetadataPrior]:
    """The same without time; a warning goes to those that had one."""
    return [
        replace(k, observations=replace(k.observations, candidates=()), warnings=(*k.warnings, warning), sun_is_up=True)
        if k.observations.candidates
        else k
        for k in found
    ]


def _missing(merged: PhotoMetadata, given: UserInput, subject: str) -> tuple[str, ...]:
    """Sentences about what the user said that could not be used."""
    if given.time is not None and merged.latitude is None:
        return (f"The time was not used, because the {subject} does not say where it was taken.",)
    if given.latitude is not None and merged.local_time is None and merged.utc_time is None:
        return (f"The place was not used, because the {subject} does not say when it was taken.",)
    if given.utc_offset is not None and merged.local_time is None:
        return (f"The offset from UTC was not used, because the {subject} has no local time.",)
    return ()


def _in_twilight_on_the_horizon(candidates: _SunCandidates) -> _SunCandidates:
    """The candidates with the suns of civil twilight put on the horizon."""
    return tuple((max(el, 0.0) if el >= CIVIL_TWILIGHT else el, azimuth) for el, azimuth in candidates)


def _compass(facts: PhotoMetadata, given: UserInput) -> tuple[float | None, float]:
    """The heading from true north, if it is known, and its spread [deg]."""
    if facts.heading is None:
        return None, COMPASS_STD
    if given.heading is not None:
        return facts.heading % 360.0, USER_HEADING_STD
    if facts.heading_reference == HeadingReference.TRUE:
        return facts.heading % 360.0, COMPASS_STD
    off = _declination(facts)
    if facts.heading_reference == HeadingReference.MAGNETIC and off is not None:
        return (facts.heading + off) % 360.0, COMPASS_STD
    doubt = DECLINATION_STD if off is None else off
    return facts.heading % 360.0, math.hypot(COMPASS_STD, doubt)


def _declination(facts: PhotoMetadata) -> float | None:
    """The magnetic declination [deg] at the photo's time and place; None where they are not both known."""
    time = facts.utc_time or facts.local_time
    place = location_of(facts)
    return None if time is None or place is None else _magnetic_declination(*place, time)


# Whether a scene was as bright as daylight makes it, by the exposure that the camera noted.

_DARK = 8.0  # EV at ISO 100 that is as often lamplight as daylight: about 30 cd/m2
_STEEPNESS = 2.5  # of the probability in doublings of the odds for each EV: scenes and meters vary by a stop


def daylight_probability(exposure_value: float) -> float:
    """Probability that daylight lit a scene which took an exposure value [EV at ISO 100]."""
    return float(1.0 / (1.0 + 2.0 ** (_STEEPNESS * (_DARK - exposure_value))))


def dark_exposure_warnings(exposure_value: float, subject: str) -> tuple[str, ...]:
    """A sentence for people where daylight is the less likely light of a `subject`."""
    if daylight_probability(exposure_value) >= 0.5:
        return ()
    return (
        f"The {subject} was exposed for a dark scene (EV {exposure_value:.1f} at ISO 100): night, indoors, or a dark "
        "filter on the lens.",
    )

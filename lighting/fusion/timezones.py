"""Local time -> UTC: user, EXIF, GPS, other photos, IANA zone of the place; ONE precedence."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
from numpy.typing import NDArray

from lighting.fusion.user_input import UserInput
from lighting.geometry import SUN_RADIUS
from lighting.photo.metadata import HeadingReference, PhotoMetadata, to_utc
from lighting.solar_position import ASTRONOMICAL_TWILIGHT, CIVIL_TWILIGHT, NAUTICAL_TWILIGHT, sun_position

# Merge a photo's facts with those of its user and of the photos taken with it: time, place and time zone.

# Hours from UTC that clocks follow somewhere, summer times included.
_UTC_OFFSETS = (*range(-12, 15), -9.5, -3.5, -2.5, 3.5, 4.5, 5.5, 5.75, 6.5, 8.75, 9.5, 10.5, 12.75, 13.75)
# Those that clocks followed since there are digital cameras, and no longer, with the place's south, west, north and
# east [deg] (time zone database of 2026). All others since 1995 are among ZONES and within ZONE_LEAD, but for stations
# in the Antarctic and Iqaluit's winter of 1999.
_FORMER_UTC_OFFSETS = {
    -8.5: (-26.0, -131.0, -23.0, -124.0),  # Pitcairn to 1998
    -4.5: (0.0, -74.0, 13.0, -59.0),  # Venezuela 2007 to 2016
    8.5: (37.0, 124.0, 43.0, 131.0),  # North Korea 2015 to 2018
    9.75: (-33.0, 125.0, -31.0, 130.0),  # Eucla in the summers to 2009
    11.5: (-30.0, 167.0, -28.0, 169.0),  # Norfolk Island to 2015
}
_MAX_CLOCK_ERROR_HOURS = 0.1  # h that a camera's clock may be off GPS time and still identify the zone
_ZONE_LEAD_HOURS = (
    -1.25,
    3.5,
)  # h that a zone's clocks may be ahead of the sun's mean time there (Arunachal, western China)


def merge_user_input(facts: PhotoMetadata, given: UserInput) -> PhotoMetadata:
    """The photo's facts, replaced by the user's where given; a time replaces the offset, a place both coordinates."""
    merged = facts if given.use_exif else PhotoMetadata()
    if given.time is not None:
        merged = _taken_at(merged, given.time)
    if given.utc_offset is not None and merged.local_time is not None:
        in_zone = to_utc(merged.local_time, given.utc_offset)
        merged = replace(merged, utc_offset=given.utc_offset, utc_time=in_zone)
    if given.latitude is not None:
        merged = replace(merged, latitude=given.latitude, longitude=given.longitude)
    if given.heading is not None:
        merged = replace(merged, heading=given.heading, heading_reference=HeadingReference.TRUE)
    if given.vertical_fov is not None:
        merged = replace(merged, vertical_fov=given.vertical_fov)
    offset = known_utc_offset(merged)
    return merged if offset is None else _in_zone(merged, offset)


def _taken_at(facts: PhotoMetadata, time: datetime) -> PhotoMetadata:
    if time.tzinfo is None:
        return replace(facts, local_time=time, utc_offset=None, utc_time=None)
    return replace(facts, local_time=time.replace(tzinfo=None), utc_offset=None, utc_time=time.astimezone(UTC))


def share_location(facts: Sequence[PhotoMetadata]) -> list[PhotoMetadata]:
    """The facts of photos taken together; all get the place, and the time zone, of the first photo that has one."""
    place = next((f for f in facts if f.latitude is not None), PhotoMetadata())
    there = [replace(f, latitude=place.latitude, longitude=place.longitude) for f in facts]
    offset = next((hours for f in facts if (hours := known_utc_offset(f)) is not None), None)
    return there if offset is None else [_in_zone(f, offset) for f in there]


def drop_unzoned(facts: list[PhotoMetadata]) -> list[PhotoMetadata]:
    """The facts; where one photo's time is known in UTC, local times of unknown zone are dropped from the others."""
    surer = any(f.utc_time is not None for f in facts)
    return [replace(f, local_time=None) if surer and f.utc_time is None else f for f in facts]


def _stated_offset(metadata: PhotoMetadata) -> float | None:
    """The offset from UTC [h] that the file states."""
    return metadata.utc_offset


def _offset_by_gps(metadata: PhotoMetadata) -> float | None:
    """The difference of clock and GPS time [h], where some zone's clocks have it."""
    if metadata.local_time is None or metadata.utc_time is None:
        return None
    ahead = (metadata.local_time - metadata.utc_time.replace(tzinfo=None)).total_seconds() / 3600
    nearest = round(4 * ahead) / 4
    return (
        nearest
        if nearest in (*_UTC_OFFSETS, *_FORMER_UTC_OFFSETS) and abs(ahead - nearest) < _MAX_CLOCK_ERROR_HOURS
        else None
    )


OffsetRule = Callable[[PhotoMetadata], float | None]
OFFSET_RULES: dict[str, OffsetRule] = {  # how a photo tells its clock's offset from UTC; the first that answers counts
    "stated in the file": _stated_offset,
    "clock against GPS": _offset_by_gps,
}


def known_utc_offset(metadata: PhotoMetadata) -> float | None:
    """How far a photo's clock is ahead of UTC, by the first of OFFSET_RULES that knows it.

    Args:
        metadata: what the photo's file says.

    Returns:
        h, positive east; None where no rule answers.
    """
    return next((hours for rule in OFFSET_RULES.values() if (hours := rule(metadata)) is not None), None)


def _in_zone(facts: PhotoMetadata, utc_offset: float) -> PhotoMetadata:
    if facts.local_time is None or facts.utc_time is not None:
        return facts
    return replace(facts, utc_offset=utc_offset, utc_time=to_utc(facts.local_time, utc_offset))


def location_of(facts: PhotoMetadata) -> tuple[float, float] | None:
    """Latitude and longitude [deg], where they are known."""
    return None if facts.latitude is None or facts.longitude is None else (facts.latitude, facts.longitude)


def candidate_utc_offsets(latitude: float, longitude: float) -> tuple[float, ...]:
    """The offsets from UTC [h] that clocks at a place [deg] may have, or had."""
    low, high = _ZONE_LEAD_HOURS
    here = [zone for zone in _UTC_OFFSETS if (zone - longitude / 15.0 - low) % 24.0 <= high - low]
    former = [zone for zone, box in _FORMER_UTC_OFFSETS.items() if _is_within(latitude, longitude, box)]
    return tuple(sorted((*here, *former)))


def _is_within(latitude: float, longitude: float, box: tuple[float, float, float, float]) -> bool:
    south, west, north, east = box
    return south <= latitude <= north and west <= longitude <= east


# The sun's position by a photo's time and place, and words for a sun below the horizon.


def sun_candidates(facts: PhotoMetadata) -> tuple[tuple[float, float], ...]:
    """Elevations and compass azimuths [deg]: one for a time in UTC, one per possible zone for a local time."""
    if (place := location_of(facts)) is None:
        return ()
    azimuth, elevation = sun_position(_times(facts, place), *place)
    return tuple(zip(elevation.tolist(), azimuth.tolist(), strict=True))


def _times(facts: PhotoMetadata, place: tuple[float, float]) -> NDArray[np.datetime64]:
    """The moments (N,) in UTC at which the photo may have been taken, in the order of the zones."""
    if facts.utc_time is not None:
        return np.array([facts.utc_time.replace(tzinfo=None)], dtype="datetime64[us]")
    if facts.local_time is None:
        return np.array([], dtype="datetime64[us]")
    return np.array(
        [facts.local_time - timedelta(hours=zone) for zone in candidate_utc_offsets(*place)], dtype="datetime64[us]"
    )


def format_below_horizon(facts: PhotoMetadata, highest: float) -> str:
    """The beginning of a sentence about a sun whose highest possible elevation [deg] is negative."""
    return (
        f"At that time and place the sun is {-highest:.1f}° below the horizon ({_phase(highest, facts)}; civil "
        "twilight ends at 6°, nautical at 12°, astronomical at 18°): "
    )


def _phase(elevation: float, facts: PhotoMetadata) -> str:
    polar = _is_polar_night(facts)
    if elevation < ASTRONOMICAL_TWILIGHT:
        return "polar night" if polar else "night"
    kind = "civil" if elevation >= CIVIL_TWILIGHT else "nautical" if elevation >= NAUTICAL_TWILIGHT else "astronomical"
    return f"{kind} twilight of the polar night" if polar else f"{kind} twilight"


def _is_polar_night(facts: PhotoMetadata) -> bool:
    if (place := location_of(facts)) is None:
        return False
    around = _times(facts, place)[:1] + np.arange(-12, 13).astype("timedelta64[h]")
    return bool(np.max(sun_position(around, *place)[1]) < -SUN_RADIUS)

"""Local time -> UTC: user, EXIF, GPS, other photos, IANA zone of the location; ONE precedence."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
from numpy.typing import NDArray

from lighting.fusion.user_input import UserInput
from lighting.geometry import SUN_RADIUS
from lighting.photo.clock import to_utc
from lighting.photo.metadata import HeadingReference, PhotoMetadata
from lighting.solar_position import ASTRONOMICAL_TWILIGHT, CIVIL_TWILIGHT, NAUTICAL_TWILIGHT, sun_position

# Hours from UTC that clocks follow somewhere, summer times included.
_UTC_OFFSETS = (*range(-12, 15), -9.5, -3.5, -2.5, 3.5, 4.5, 5.5, 5.75, 6.5, 8.75, 9.5, 10.5, 12.75, 13.75)
# Those that clocks followed since there are digital cameras, and no longer, with the region's south, west, north and
# east [deg] (time zone database of 2026). All others since 1995 are among _UTC_OFFSETS and within _ZONE_LEAD_HOURS, but
# for stations in the Antarctic and Iqaluit's winter of 1999.
_FORMER_UTC_OFFSETS = {
    -8.5: (-26.0, -131.0, -23.0, -124.0),  # Pitcairn to 1998
    -4.5: (0.0, -74.0, 13.0, -59.0),  # Venezuela 2007 to 2016
    8.5: (37.0, 124.0, 43.0, 131.0),  # North Korea 2015 to 2018
    9.75: (-33.0, 125.0, -31.0, 130.0),  # Eucla in the summers to 2009
    11.5: (-30.0, 167.0, -28.0, 169.0),  # Norfolk Island to 2015
}
_ZONE_LEAD_HOURS = (-1.25, 3.5)  # a zone's clocks, ahead of its sun's mean time (Arunachal, western China)
_MAX_CLOCK_ERROR_HOURS = 0.1  # of a camera against GPS time, up to which the difference identifies the zone


def merge_user_input(metadata: PhotoMetadata, user_input: UserInput) -> PhotoMetadata:
    """The photo's metadata, replaced by what the user states; a time replaces the offset, a location both coordinates.

    Args:
        metadata: of the photo's file.
        user_input: what the user states; `use_exif` False drops the file's.
    """
    merged = metadata if user_input.use_exif else PhotoMetadata()
    if (offset := _known_utc_offset(merged)) is not None:  # of the file's own clock, before the user states another
        merged = _in_zone(merged, offset)
    if user_input.time is not None:
        merged = _with_time(merged, user_input.time)
    if user_input.utc_offset is not None and merged.local_time is not None:
        utc_time = to_utc(merged.local_time, user_input.utc_offset)
        merged = replace(merged, utc_offset=user_input.utc_offset, utc_time=utc_time)
    if user_input.latitude is not None:
        merged = replace(merged, latitude=user_input.latitude, longitude=user_input.longitude)
    if user_input.heading is not None:
        merged = replace(merged, heading=user_input.heading, heading_reference=HeadingReference.TRUE)
    if user_input.vertical_fov is not None:
        merged = replace(merged, vertical_fov=user_input.vertical_fov)
    return merged


def _with_time(metadata: PhotoMetadata, time: datetime) -> PhotoMetadata:
    if time.tzinfo is None:
        return replace(metadata, local_time=time, utc_offset=None, utc_time=None)
    return replace(metadata, local_time=time.replace(tzinfo=None), utc_offset=None, utc_time=time.astimezone(UTC))


def share_location(metadata: Sequence[PhotoMetadata]) -> list[PhotoMetadata]:
    """Give photos taken together the location, and the time zone, of the first photo that has one.

    Args:
        metadata: of each photo.
    """
    source = next((m for m in metadata if m.latitude is not None), PhotoMetadata())
    located = [replace(m, latitude=source.latitude, longitude=source.longitude) for m in metadata]
    offset = next((hours for m in metadata if (hours := _known_utc_offset(m)) is not None), None)
    return located if offset is None else [_in_zone(m, offset) for m in located]


def drop_unzoned(metadata: list[PhotoMetadata]) -> list[PhotoMetadata]:
    """Drop local times of unknown zone where another photo's time is known in UTC.

    Args:
        metadata: of each photo.
    """
    has_utc = any(m.utc_time is not None for m in metadata)
    return [replace(m, local_time=None) if has_utc and m.utc_time is None else m for m in metadata]


# How far a clock is ahead of UTC.


def _stated_offset(metadata: PhotoMetadata) -> float | None:
    """The offset from UTC [h] that the file states."""
    return metadata.utc_offset


def _offset_by_gps(metadata: PhotoMetadata) -> float | None:
    """The difference of clock and GPS time [h], where some zone's clocks have it."""
    if metadata.local_time is None or metadata.utc_time is None:
        return None
    ahead = (metadata.local_time - metadata.utc_time.replace(tzinfo=None)).total_seconds() / 3600
    nearest = round(4 * ahead) / 4
    is_offset = nearest in _UTC_OFFSETS or nearest in _FORMER_UTC_OFFSETS
    return nearest if is_offset and abs(ahead - nearest) < _MAX_CLOCK_ERROR_HOURS else None


_OffsetRule = Callable[[PhotoMetadata], float | None]
OFFSET_RULES: dict[str, _OffsetRule] = {  # how a photo tells its clock's offset from UTC; the first that answers counts
    "stated in the file": _stated_offset,
    "clock against GPS": _offset_by_gps,
}


def _known_utc_offset(metadata: PhotoMetadata) -> float | None:
    """How far a photo's clock is ahead of UTC, by the first of OFFSET_RULES that knows it.

    Args:
        metadata: what the photo's file says.

    Returns:
        h, positive east; None where no rule answers.
    """
    return next((hours for rule in OFFSET_RULES.values() if (hours := rule(metadata)) is not None), None)


def _in_zone(metadata: PhotoMetadata, utc_offset: float) -> PhotoMetadata:
    if metadata.local_time is None or metadata.utc_time is not None:
        return metadata
    return replace(metadata, utc_offset=utc_offset, utc_time=to_utc(metadata.local_time, utc_offset))


def candidate_utc_offsets(latitude: float, longitude: float) -> tuple[float, ...]:
    """The offsets from UTC [h], positive east, that clocks at a location may have, or had.

    Args:
        latitude: deg, positive north.
        longitude: deg, positive east.
    """
    low, high = _ZONE_LEAD_HOURS
    current = [zone for zone in _UTC_OFFSETS if (zone - longitude / 15.0 - low) % 24.0 <= high - low]
    former = [zone for zone, box in _FORMER_UTC_OFFSETS.items() if _is_within(latitude, longitude, box)]
    return tuple(sorted((*current, *former)))


def _is_within(latitude: float, longitude: float, box: tuple[float, float, float, float]) -> bool:
    south, west, north, east = box
    return south <= latitude <= north and west <= longitude <= east


# The sun at a photo's time and location.


def location_of(metadata: PhotoMetadata) -> tuple[float, float] | None:
    """Latitude and longitude [deg], positive north and east; None where they are unknown.

    Args:
        metadata: of the photo.
    """
    return None if metadata.latitude is None or metadata.longitude is None else (metadata.latitude, metadata.longitude)


def sun_candidates(metadata: PhotoMetadata) -> tuple[tuple[float, float], ...]:
    """Elevations and compass azimuths [deg] of the sun, one for a time in UTC, else one for each possible zone.

    Args:
        metadata: of the photo; without time or location there are no candidates.
    """
    if (location := location_of(metadata)) is None:
        return ()
    azimuth, elevation = sun_position(_utc_times(metadata, location), *location)
    return tuple(zip(elevation.tolist(), azimuth.tolist(), strict=True))


def _utc_times(metadata: PhotoMetadata, location: tuple[float, float]) -> NDArray[np.datetime64]:
    """The moments (N,) in UTC at which the photo may have been taken, in the order of the zones."""
    times = []
    if metadata.utc_time is not None:
        times = [metadata.utc_time.replace(tzinfo=None)]
    elif metadata.local_time is not None:
        times = [metadata.local_time - timedelta(hours=zone) for zone in candidate_utc_offsets(*location)]
    return np.array(times, dtype="datetime64[us]")


def format_below_horizon(metadata: PhotoMetadata, elevation: float) -> str:
    """The beginning of a sentence about a sun below the horizon.

    Args:
        metadata: of the photo.
        elevation: deg, the highest possible of the sun, negative.
    """
    return (
        f"At that time and place the sun is {-elevation:.1f}° below the horizon ({_phase(elevation, metadata)}; civil "
        "twilight ends at 6°, nautical at 12°, astronomical at 18°): "
    )


def _phase(elevation: float, metadata: PhotoMetadata) -> str:
    polar = _is_polar_night(metadata)
    if elevation < ASTRONOMICAL_TWILIGHT:
        return "polar night" if polar else "night"
    kind = "civil" if elevation >= CIVIL_TWILIGHT else "nautical" if elevation >= NAUTICAL_TWILIGHT else "astronomical"
    return f"{kind} twilight of the polar night" if polar else f"{kind} twilight"


def _is_polar_night(metadata: PhotoMetadata) -> bool:
    if (location := location_of(metadata)) is None:
        return False
    day = _utc_times(metadata, location)[:1] + np.arange(-12, 13).astype("timedelta64[h]")
    return bool(np.max(sun_position(day, *location)[1]) < -SUN_RADIUS)

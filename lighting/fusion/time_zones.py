"""Offsets from UTC: of the clocks at a place, and of a photo's clock by its file.

The zone tells the hemisphere of a place whose file states none, for photos are taken on land. A place without north or
south, east or west is up to four places. Three of Munich's four lie in the sea, and of those on land few keep the zone
that the clock shows.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from functools import lru_cache
from itertools import product
from operator import attrgetter

from lighting.errors import CodedWarning, WarningCode
from lighting.photo.clock import nearest_utc_offset
from lighting.photo.metadata import PhotoMetadata

ZONE_OF_PLACE = "zone of the place"  # where an offset from UTC comes from, as the record says it
_AT_SEA = "Etc/"  # how the names of the zones begin that ships keep
_SEA_WEIGHTS = {0: 2.0, -1: 1.0, 1: 1.0}  # of the clocks so many hours from the zone of the longitude
_COAST_WEIGHT = 4.0  # of all zones of the coasts around
_COAST_DISTANCES = (1.0, 3.0)  # deg, from which ships bring their clocks
_CLAIMED_TOO = {  # zones that people in disputed places keep besides
    "Europe/Simferopol": ("Europe/Kyiv",),
    "Asia/Urumqi": ("Asia/Shanghai",),
    "Asia/Hebron": ("Asia/Jerusalem",),
    "Asia/Gaza": ("Asia/Jerusalem",),
    "Africa/El_Aaiun": ("Africa/Casablanca", "Africa/Nouakchott"),
    "Asia/Famagusta": ("Asia/Nicosia", "Europe/Istanbul"),
}
_CLAIMED_BOXES = (  # south, west, north and east [deg] of such places, and the zone
    ((46.8, 37.0, 50.1, 40.3), "Europe/Kyiv", "Europe/Moscow"),  # Donetsk and Luhansk
    ((42.4, 40.0, 43.6, 42.2), "Asia/Tbilisi", "Europe/Moscow"),  # Abkhazia
    ((41.9, 43.3, 42.7, 44.6), "Asia/Tbilisi", "Europe/Moscow"),  # South Ossetia
)


@dataclass(frozen=True, eq=False, repr=False)
class _ZoneOffset:
    """An offset from UTC that clocks at a place may have at a local time."""

    hours: float
    """Local minus universal time."""
    name: str
    """Of the zone, the same for all photos of one clock."""
    weight: float
    """Share of the clocks, 0 to 1."""


def clock_offsets(latitude: float, longitude: float, local_time: datetime) -> tuple[_ZoneOffset, ...]:
    """The offsets from UTC that clocks at a place follow at a local time, summer time and history included.

    There is one, but at sea, in disputed places, and in the hours that summer time repeats or leaves out.

    Args:
        latitude: deg, positive north.
        longitude: deg, positive east.
        local_time: naive.
    """
    from zoneinfo import ZoneInfo

    found = []
    for name, weight in _zones_of_place(round(latitude, 4), round(longitude, 4)):
        zone = ZoneInfo(name)
        hours = [_hours(local_time.replace(tzinfo=zone, fold=fold)) for fold in (0, 1)]
        for fold, offset in enumerate(dict.fromkeys(hours)):
            found.append(_ZoneOffset(offset, f"{name} {fold}", weight / len(set(hours))))
    return tuple(found)


def offset_at(latitude: float, longitude: float, utc_time: datetime) -> float:
    """The offset from UTC [h] of the clocks at a place, the likeliest.

    Args:
        latitude: deg, positive north.
        longitude: deg, positive east.
        utc_time: aware.
    """
    from zoneinfo import ZoneInfo

    name = max(_zones_of_place(round(latitude, 4), round(longitude, 4)), key=lambda zone: zone[1])[0]
    return _hours(utc_time.astimezone(ZoneInfo(name)))


def is_at_sea(latitude: float, longitude: float) -> bool:
    """Whether a place is of no country's zone.

    Args:
        latitude: deg, positive north.
        longitude: deg, positive east.
    """
    return all(name.startswith(_AT_SEA) for name in _names_at(latitude, longitude))


def _hours(time: datetime) -> float:
    offset = time.utcoffset()
    assert offset is not None
    return offset / timedelta(hours=1)


@lru_cache(maxsize=64)
def _zones_of_place(latitude: float, longitude: float) -> tuple[tuple[str, float], ...]:
    """Names and weights, which sum to 1, of the IANA zones at a place."""
    names = _names_at(latitude, longitude)
    if is_at_sea(latitude, longitude):
        weights = dict(_sea_zones(latitude, longitude, names))
    else:
        claimed = (zone for name in names for zone in _CLAIMED_TOO.get(name, ()))
        boxed = (
            also
            for (south, west, north, east), name, also in _CLAIMED_BOXES
            if name in names and south <= latitude <= north and west <= longitude <= east
        )
        weights = dict.fromkeys((*names, *claimed, *boxed), 1.0)
    total = sum(weights.values())
    return tuple((name, weight / total) for name, weight in weights.items())


def _sea_zones(latitude: float, longitude: float, names: list[str]) -> Iterator[tuple[str, float]]:
    """The zones of ships: the longitude's, its neighbors, and those of the coasts around."""
    ahead = _nautical_hours(names[0])
    for hours, weight in _SEA_WEIGHTS.items():
        if -12 <= ahead + hours <= 14:
            yield f"Etc/GMT{-(ahead + hours):+d}" if ahead + hours else "Etc/GMT", weight
    coasts = dict.fromkeys(
        name
        for distance, north, east in product(_COAST_DISTANCES, (-1, 0, 1), (-1, 0, 1))
        for name in _names_at(
            min(max(latitude + distance * north, -90.0), 90.0), (longitude + distance * east + 540.0) % 360.0 - 180.0
        )
        if not name.startswith(_AT_SEA)
    )
    yield from ((name, _COAST_WEIGHT / len(coasts)) for name in coasts)


def _nautical_hours(name: str) -> int:
    """Hours ahead of UTC of "Etc/GMT-12", whose sign is that of old Unix."""
    digits = name.removeprefix("Etc/GMT")
    return -int(digits) if digits.lstrip("+-").isdigit() else 0


def _names_at(latitude: float, longitude: float) -> list[str]:
    import tzfpy

    return sorted(tzfpy.get_tzs(longitude, latitude)) or ["Etc/GMT"]


# How far a clock is ahead of UTC, by the file.


def _offset_by_gps(metadata: PhotoMetadata) -> float | None:
    """The difference of clock and GPS time [h], where some zone's clocks have it."""
    if metadata.local_time is None or metadata.gps_time is None:
        return None
    return nearest_utc_offset(metadata.local_time - metadata.gps_time.replace(tzinfo=None))


# How a photo tells its clock's offset from UTC; the first that answers counts. A brand's rule asks `camera_make`.
# Wrong GPS times are no case for a rule: `read_metadata` leaves them out, since more than the offset comes from them.
OFFSET_RULES: dict[str, Callable[[PhotoMetadata], float | None]] = {
    "offset in the file": attrgetter("utc_offset"),
    "GPS": _offset_by_gps,
}


def offset_in_file(metadata: PhotoMetadata) -> tuple[float, str] | None:
    """How far a photo's clock is ahead of UTC [h], and the name of the first of OFFSET_RULES that knows it.

    Args:
        metadata: what the photo's file says.
    """
    answers = ((rule(metadata), name) for name, rule in OFFSET_RULES.items())
    return next(((hours, name) for hours, name in answers if hours is not None), None)


_MAX_OFFSET_ERROR = 0.01  # h
_ANY_TIME = datetime(2024, 7, 1, 12)  # for a place whose zone's name alone counts
_CHOSEN = "The file names no hemisphere: the place on land in the clock's zone was used."
_DROPPED = "The file names no hemisphere: its place was not used."


def resolve_hemisphere(metadata: PhotoMetadata) -> tuple[PhotoMetadata, tuple[CodedWarning, ...]]:
    """The metadata with the one place that fits the clock, or without a place; and what is to be said of it.

    Args:
        metadata: of a photo's file.
    """
    if not metadata.locations or metadata.location is not None:
        return metadata, ()
    stated, time = offset_in_file(metadata), metadata.local_time or _ANY_TIME
    on_land = [place for place in metadata.locations if not is_at_sea(*place)]
    if stated is not None:  # clocks of which zones are as far ahead of UTC
        by_place = ((place, clock_offsets(*place, time)) for place in on_land)
        close = [p for p, zones in by_place if any(abs(z.hours - stated[0]) < _MAX_OFFSET_ERROR for z in zones)]
        on_land = close or on_land
    known = replace(metadata, locations=())
    if len(on_land) != 1:
        return known, (CodedWarning(_DROPPED, WarningCode.LOCATION_OPEN),)
    latitude, longitude = on_land[0]
    return replace(known, latitude=latitude, longitude=longitude), (CodedWarning(_CHOSEN, WarningCode.LOCATION_OPEN),)

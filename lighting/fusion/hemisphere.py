"""The hemisphere of a place whose file states none: by the clock's zone, for photos are taken on land.

A place without north or south, east or west is up to four places. Three of Munich's four lie in the sea, and of those
on land few keep the zone that the clock shows.
"""

from dataclasses import replace
from datetime import datetime

from lighting.fusion.timezones import ZoneOffset, is_at_sea, offset_in_file, offsets_of_place
from lighting.photo.metadata import PhotoMetadata
from lighting.records import CodedWarning, WarningCode

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
    fitting = [place for place in on_land if stated and _keeps(offsets_of_place(*place, time), stated[0])] or on_land
    known = replace(metadata, locations=())
    if len(fitting) != 1:
        return known, (CodedWarning(_DROPPED, WarningCode.LOCATION_OPEN),)
    latitude, longitude = fitting[0]
    return replace(known, latitude=latitude, longitude=longitude), (CodedWarning(_CHOSEN, WarningCode.LOCATION_OPEN),)


def _keeps(zones: tuple[ZoneOffset, ...], utc_offset: float) -> bool:
    """Whether clocks of one of the zones are as far ahead of UTC [h]."""
    return any(abs(zone.hours - utc_offset) < _MAX_OFFSET_ERROR for zone in zones)

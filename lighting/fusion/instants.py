"""The one place where the clocks of photos and clips become instants in UTC.

The offset from UTC is, in this order, the user's, the file's, that of clock against GPS, that of other photos, and
that of the zone of the place. Where clock and GPS contradict each other, both are kept with weights; the pixels choose.
So they do where a clip's file says UTC and its camera may have written local time there.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta

from lighting.errors import CodedWarning, WarningCode
from lighting.formatting import format_utc_offset
from lighting.fusion.time_zones import ZONE_OF_PLACE, clock_offsets, offset_at, offset_in_file
from lighting.fusion.user_input import UserInput
from lighting.photo.clock import MAX_CLOCK_DIFFERENCE, nearest_utc_offset
from lighting.photo.metadata import PhotoMetadata
from lighting.photo.timestamps import to_utc

USER = "user"  # where an instant comes from, as the record says it; ZONE_OF_PLACE and OFFSET_RULES have the others
GPS = "GPS"
OTHER_PHOTOS = "other photos"

_ROLLOVER = timedelta(weeks=1024)  # after which GPS receivers count their weeks from 0 again
_FIRST_YEAR_OF_ZONES = 1970  # before which zone files, as some are built, give a country another one's clocks
_OLD_ZONE = "Zone files differ before 1970: if {} is wrong, state the offset from UTC."
_NO_FIX = "The GPS time is of a receiver without a fix"
_NEAR = timedelta(hours=26)  # within which a clock and GPS lie whose zone is unknown
_MONTH = timedelta(days=30)
_RECEIVER_EPOCHS = tuple(  # days that receivers without a fix show: of their weeks' zero, and of their programs
    datetime(*day, tzinfo=UTC)
    for day in ((1970, 1, 1), (1980, 1, 1), (1980, 1, 6), (1999, 8, 22), (2000, 1, 1), (2019, 4, 7))
)
_RESETS = {1970: 24.0, 1980: 24.0, 2000: 24.0, 2016: 6.0}  # years that clocks begin with, h in which none shows right
_LAST_YEAR_WITHOUT_GPS = 1990  # of clocks that are wrong beside a GPS time

# Weights of GPS against a contradicting clock. What goes wrong with either mostly makes it too early: a fix that is
# old, weeks that count from 0 again, a clock that was reset.
_SURE, _AGREED, _LIKELY, _EVEN, _UNLIKELY = 0.99, 0.95, 0.9, 0.5, 0.25
_PLAIN = 0.8  # probability with the pixels, from which UTC that may be local time needs no warning


@dataclass(frozen=True)
class Instant:
    """An instant at which a photo may have been taken."""

    utc_time: datetime
    """Utc time, aware."""
    utc_offset: float | None
    """Hours, of the clock that is believed, or else of the place."""
    source: str
    """Of the instant: USER, GPS, OTHER_PHOTOS, ZONE_OF_PLACE or a name of OFFSET_RULES."""
    weight: float = 1.0
    """Probability before the pixels."""
    clock: str = ""
    """Which photos of one camera have in common."""


@dataclass(frozen=True, eq=False, repr=False)
class _ClockConflict:
    """Clock and GPS that contradict each other, or UTC that may be local time."""

    sentence: str
    """How, without a full stop."""
    agreed: str | None = None
    """Of instants, the `clock` by which the two do not contradict each other."""
    sure: float = 0.0
    """Probability of that instant, 0 to 1, from which there is nothing to be said."""
    readings: tuple[str, str] = ("the camera's clock", "the camera's clock")
    """What the sentence calls the clock of the file, and that of the place's zone."""


@dataclass(frozen=True)
class PhotoInstants:
    """When a photo may have been taken, by its file and its user."""

    instants: tuple[Instant, ...] = ()
    """Weights sum to 1; none where the time or its zone is unknown."""
    conflict: _ClockConflict | None = None
    """How GPS and clock contradict each other. None: they do not."""
    warnings: tuple[str, ...] = ()
    """Sentences for people."""

    @property
    def likeliest(self) -> Instant | None:
        """The instant that counts without pixels; None where there is none."""
        return max(self.instants, key=lambda instant: instant.weight, default=None)

    def conflict_warnings(self, used: Instant | None, probability: float = 0.0) -> tuple[str, ...]:
        """Return the warning of clocks that contradict each other, which says what was used, if they do.

        Args:
            used: the instant that was chosen.
            probability: 0 to 1, of that instant with the pixels.
        """
        conflict = self.conflict
        if conflict is None or used is None or (used.clock == conflict.agreed and probability >= conflict.sure):
            return ()
        chosen = "the GPS time" if used.clock == GPS else conflict.readings[used.clock != "file"]
        return (CodedWarning(f"{conflict.sentence}: {chosen} was used.", WarningCode.CLOCK_CONTRADICTED),)


def resolve_instants(
    metadata: PhotoMetadata, user_input: UserInput, shared_offset: float | None = None
) -> PhotoInstants:
    """When a photo may have been taken.

    Args:
        metadata: what the photo's file says, with the place that counts.
        user_input: what the user states.
        shared_offset: h, of the clock by other photos of the same camera; None is unknown.
    """
    found = _resolve_instants(metadata, user_input, shared_offset)
    likeliest = found.likeliest
    if likeliest is None or likeliest.source != ZONE_OF_PLACE or likeliest.utc_time.year >= _FIRST_YEAR_OF_ZONES:
        return found
    sentence = _OLD_ZONE.format(format_utc_offset(likeliest.utc_offset or 0.0))
    return replace(found, warnings=(*found.warnings, CodedWarning(sentence)))


def _resolve_instants(metadata: PhotoMetadata, user_input: UserInput, shared_offset: float | None) -> PhotoInstants:
    if user_input.time is not None:
        return _instants_of_user(metadata, user_input.time, user_input.utc_offset)
    if user_input.utc_offset is not None and metadata.local_time is not None:
        return _instants_of_stated_offset(metadata, user_input.utc_offset)
    clock = _instants_of_clock(metadata, shared_offset)
    if metadata.local_time is not None and metadata.gps_time is None and _is_reset(metadata.local_time):
        return _without_time(f"The camera's clock, {_format(metadata.local_time)}, was reset")
    if metadata.gps_time is None:
        return PhotoInstants(clock, _utc_doubt(metadata, clock))
    if metadata.local_time is None:
        if _is_epoch(metadata.gps_time):
            return _without_time(_NO_FIX)
        return PhotoInstants((_gps_instant(metadata, metadata.gps_time),))
    return _reconcile(metadata, clock, metadata.gps_time, metadata.local_time)


def _instants_of_user(metadata: PhotoMetadata, time: datetime, utc_offset: float | None) -> PhotoInstants:
    if (offset := time.utcoffset()) is not None:
        return PhotoInstants((Instant(time.astimezone(UTC), offset / timedelta(hours=1), USER),))
    if utc_offset is not None:
        return PhotoInstants((Instant(to_utc(time, utc_offset), utc_offset, USER),))
    return PhotoInstants(_instants_in_zones(replace(metadata, local_time=time)))


def _instants_of_stated_offset(metadata: PhotoMetadata, utc_offset: float) -> PhotoInstants:
    """The instant of the file's local time at the user's offset, which replaces the file's."""
    assert metadata.local_time is not None
    instant = Instant(to_utc(metadata.local_time, utc_offset), utc_offset, USER)
    in_file = offset_in_file(metadata)
    is_doubted = metadata.utc_probability is not None
    if in_file is None or is_doubted or abs(in_file[0] - utc_offset) * timedelta(hours=1) <= MAX_CLOCK_DIFFERENCE:
        return PhotoInstants((instant,))
    stated, replaced = format_utc_offset(utc_offset), format_utc_offset(in_file[0])
    sentence = f"Your offset from UTC, {stated}, replaced the file's, {replaced} ({in_file[1]})."
    return PhotoInstants((instant,), warnings=(CodedWarning(sentence, WarningCode.OFFSET_REPLACED),))


def _instants_of_clock(metadata: PhotoMetadata, shared_offset: float | None) -> tuple[Instant, ...]:
    """The instants by the photo's own clock."""
    if metadata.local_time is None:
        return ()
    if (in_file := offset_in_file(metadata)) is not None:
        hours, source = in_file
        stated = Instant(to_utc(metadata.local_time, hours), hours, source, clock="file")
        return (stated,) if metadata.utc_probability is None else _utc_or_local(metadata, stated)
    if shared_offset is not None:
        return (Instant(to_utc(metadata.local_time, shared_offset), shared_offset, OTHER_PHOTOS, clock="file"),)
    return _instants_in_zones(metadata)


def _instants_in_zones(metadata: PhotoMetadata) -> tuple[Instant, ...]:
    """The instants of a local time in the zones of its place; none without a place."""
    if metadata.local_time is None or metadata.location is None:
        return ()
    zones = clock_offsets(*metadata.location, metadata.local_time)
    return tuple(
        Instant(to_utc(metadata.local_time, zone.hours), zone.hours, ZONE_OF_PLACE, zone.weight, zone.name)
        for zone in zones
    )


def _utc_or_local(metadata: PhotoMetadata, stated: Instant) -> tuple[Instant, ...]:
    """The instant that a file states in UTC, and those of the same clock if it shows the place's time."""
    local = [instant for instant in _instants_in_zones(metadata) if instant.utc_time != stated.utc_time]
    share = 1.0 if metadata.utc_probability is None or not local else metadata.utc_probability
    shared = (replace(instant, weight=instant.weight * (1.0 - share)) for instant in local)
    return (replace(stated, weight=share), *shared)


def _utc_doubt(metadata: PhotoMetadata, clock: tuple[Instant, ...]) -> _ClockConflict | None:
    """That UTC may be local time; None where nothing doubts it, or the two are one."""
    if metadata.utc_probability is None or metadata.local_time is None or len(clock) < 2:
        return None
    sentence = f"The file's time, {_format(metadata.local_time)} UTC, may be local time, as many cameras write it"
    return _ClockConflict(sentence, "file", _PLAIN, ("UTC", "local time"))


def _gps_instant(metadata: PhotoMetadata, gps_time: datetime, weight: float = 1.0) -> Instant:
    offset = None if metadata.location is None else offset_at(*metadata.location, gps_time)
    return Instant(gps_time, offset, GPS, weight, GPS)


# GPS against the clock.


def _reconcile(
    metadata: PhotoMetadata, clock: tuple[Instant, ...], gps_time: datetime, local_time: datetime
) -> PhotoInstants:
    """The instants of a clock and of GPS, which may contradict each other."""
    if agreeing := _agreeing(clock, gps_time):
        return _believed_together(metadata, agreeing, gps_time)
    for shift, name in _date_errors(gps_time, local_time):
        shifted = gps_time + shift
        sentence = f"The GPS date is off by {name}"
        free = metadata.utc_offset is None and abs(shift) >= _ROLLOVER
        if agreeing := _agreeing(clock, shifted) or (_clock_by_gps(local_time, shifted) if free else ()):
            return PhotoInstants(agreeing, _ClockConflict(sentence))
    return _without_impossible(metadata, clock, gps_time, local_time) or _weigh(metadata, clock, gps_time, local_time)


def _without_impossible(
    metadata: PhotoMetadata, clock: tuple[Instant, ...], gps_time: datetime, local_time: datetime
) -> PhotoInstants | None:
    """The instants of the one of two clocks that can be right; None where both can be."""
    by_clock = clock[0].utc_time if clock else local_time.replace(tzinfo=UTC)
    is_reset = _is_reset(local_time) or local_time.year <= _LAST_YEAR_WITHOUT_GPS
    latest = datetime.now(UTC) + _NEAR
    if _is_epoch(gps_time) and is_reset:
        return _without_time("The camera's clock was reset and GPS had no fix")
    if _is_epoch(gps_time):
        return _clock_alone(clock, _NO_FIX)
    if is_reset:
        sentence = f"The camera's clock, {_format(local_time)}, was reset"
    elif by_clock > latest >= gps_time:
        sentence = f"The camera's clock, {_format(local_time)}, is of the future"
    elif gps_time > latest:
        return _clock_alone(clock, f"The GPS time, {_format(gps_time)}, is of the future")
    elif not clock:
        sentence = _format_conflict(by_clock - gps_time)
    else:
        return None
    return PhotoInstants((_gps_instant(metadata, gps_time),), _ClockConflict(sentence))


def _clock_alone(clock: tuple[Instant, ...], sentence: str) -> PhotoInstants:
    """The instants of a clock beside a GPS time that a sentence doubts; none where its zone is unknown."""
    return PhotoInstants(clock, _ClockConflict(sentence)) if clock else _without_time(sentence)


def _without_time(sentence: str) -> PhotoInstants:
    return PhotoInstants(warnings=(CodedWarning(f"{sentence}: no time was used.", WarningCode.CLOCK_CONTRADICTED),))


def _believed_together(metadata: PhotoMetadata, agreeing: tuple[Instant, ...], gps_time: datetime) -> PhotoInstants:
    """The instant that clock and GPS agree on; where no clock of the place has that offset, the pixels may object."""
    zones = _instants_in_zones(metadata)
    if metadata.utc_offset is not None or not zones or agreeing[0].utc_offset in {zone.utc_offset for zone in zones}:
        return PhotoInstants(agreeing)
    off_days = (abs(abs(zone.utc_time - gps_time) - timedelta(days=1)) for zone in zones)
    if by_date := next((z for z, off in zip(zones, off_days, strict=True) if off <= MAX_CLOCK_DIFFERENCE), None):
        # of one time of day, on the place's side of the date line
        return PhotoInstants((replace(by_date, weight=1.0),))
    share = _AGREED if agreeing[0].utc_offset else _EVEN  # some programs write the local time in place of GPS's
    instants = (replace(agreeing[0], weight=share), *(replace(z, weight=z.weight * (1.0 - share)) for z in zones))
    sentence = _format_conflict(zones[0].utc_time - gps_time)
    return PhotoInstants(instants, _ClockConflict(sentence, agreed=agreeing[0].clock))


def _agreeing(clock: Iterable[Instant], gps_time: datetime) -> tuple[Instant, ...]:
    """The instants of a clock that GPS agrees with, as one where they are of one instant."""
    near = [instant for instant in clock if abs(instant.utc_time - gps_time) <= MAX_CLOCK_DIFFERENCE]
    return (replace(near[0], weight=1.0),) if near else ()


def _clock_by_gps(local_time: datetime, gps_time: datetime) -> tuple[Instant, ...]:
    """The instant of a clock of unknown zone that is an offset of this world ahead of GPS."""
    hours = nearest_utc_offset(local_time - gps_time.replace(tzinfo=None))
    return () if hours is None else (Instant(to_utc(local_time, hours), hours, GPS, clock="file"),)


def _date_errors(gps_time: datetime, local_time: datetime) -> Iterable[tuple[timedelta, str]]:
    """What GPS receivers' dates are off by: rollovers of the week, and the date of another zone's day."""
    ahead = local_time - gps_time.replace(tzinfo=None)
    for rollovers in (1, 2, -1):
        if abs(ahead - rollovers * _ROLLOVER) < _NEAR:
            yield rollovers * _ROLLOVER, f"{abs(rollovers) * 1024} weeks, a rollover"
    if gps_time.date() == local_time.date():  # some programs write the local date beside the universal time
        for days in (1, -1):
            yield timedelta(days=days), "a day"


def _is_epoch(gps_time: datetime) -> bool:
    """Whether a receiver that never had a fix shows this time."""
    return any(timedelta() <= gps_time - epoch < timedelta(days=1) for epoch in _RECEIVER_EPOCHS)


def _is_reset(local_time: datetime) -> bool:
    """Whether a clock that was just reset shows this time."""
    since = local_time - datetime(local_time.year, 1, 1)
    return since < timedelta(hours=_RESETS.get(local_time.year, 0.0))


def _weigh(
    metadata: PhotoMetadata, clock: tuple[Instant, ...], gps_time: datetime, local_time: datetime
) -> PhotoInstants:
    """Both instants with their weights, for the pixels to choose."""
    by_clock = max(clock, key=lambda instant: instant.weight)
    share = _gps_weight(metadata, by_clock, gps_time, local_time)
    instants = (*(replace(m, weight=m.weight * (1.0 - share)) for m in clock), _gps_instant(metadata, gps_time, share))
    return PhotoInstants(instants, _ClockConflict(_format_conflict(by_clock.utc_time - gps_time)))


def _gps_weight(metadata: PhotoMetadata, by_clock: Instant, gps_time: datetime, local_time: datetime) -> float:
    """The probability (0 to 1) that GPS is right, and not the clock."""
    late = gps_time - by_clock.utc_time
    if abs(abs(late) - timedelta(hours=12)) <= MAX_CLOCK_DIFFERENCE:
        return _LIKELY  # a clock set to the other half of the day
    hours = nearest_utc_offset(local_time - gps_time.replace(tzinfo=None))
    if hours == 0.0 and metadata.utc_offset:
        return 1.0 - _LIKELY  # a program that wrote the local time in place of GPS's
    in_zone = {instant.utc_offset for instant in _instants_in_zones(metadata)}
    if hours is not None and hours in in_zone:
        return _LIKELY  # clock, GPS and place agree; the offset beside the clock does not
    if abs(late) > _MONTH:
        is_new_year = (local_time.month, local_time.day) == (1, 1)
        return (_SURE if is_new_year else _AGREED) if late > timedelta() else 1.0 - _AGREED
    return 1.0 - _UNLIKELY if late > timedelta() else _UNLIKELY


def _format(time: datetime) -> str:
    return f"{time:%Y-%m-%d %H:%M}" + (" UTC" if time.tzinfo else "")


def _format_conflict(difference: timedelta) -> str:
    return f"Clock and GPS differ by {_format_difference(difference)}"


def _format_difference(difference: timedelta) -> str:
    minutes = round(abs(difference) / timedelta(minutes=1))
    if minutes < 60:
        return f"{minutes} min"
    if abs(minutes - 24 * 60) <= 2:
        return "a day"
    if minutes < 48 * 60:
        return f"{minutes // 60} h {minutes % 60:02d} min"
    return f"{minutes / 1440:.0f} days"


# Several photos of one clock.


def resolve_together(metadata: Sequence[PhotoMetadata], user_input: UserInput) -> list[PhotoInstants]:
    """When photos taken together may have been taken; instant k of each is by the same clock or zone.

    Args:
        metadata: of each photo, with the place that counts for all.
        user_input: what the user states of all.
    """
    alone = [resolve_instants(m, user_input) for m in metadata]
    offset = next((hours for one in alone if (hours := _offset_of_file(one)) is not None), None)
    each = alone if offset is None else [resolve_instants(m, user_input, offset) for m in metadata]
    weights = dict.fromkeys((instant.clock for one in each for instant in one.instants), 0.0)
    for clock in weights:  # in the photos that have it
        shares = [sum(m.weight for m in one.instants if m.clock == clock) for one in each if one.instants]
        weights[clock] = math.fsum(shares) / len(shares)
    return [replace(one, instants=_in_order(one, weights)) for one in each]


def _offset_of_file(one: PhotoInstants) -> float | None:
    """The offset from UTC [h] of a clock that the file tells, and that GPS does not contradict."""
    is_doubted = one.conflict is not None and one.conflict.agreed is None
    likeliest = one.likeliest
    return None if likeliest is None or is_doubted or likeliest.clock != "file" else likeliest.utc_offset


def _in_order(one: PhotoInstants, weights: Mapping[str, float]) -> tuple[Instant, ...]:
    """An instant of each clock, with these weights; a photo without it has its likeliest there."""
    if (likeliest := one.likeliest) is None:
        return ()
    by_clock = {instant.clock: instant for instant in reversed(one.instants)}
    return tuple(replace(by_clock.get(clock, likeliest), weight=weight) for clock, weight in weights.items())

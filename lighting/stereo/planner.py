"""When to photograph: a plan under modelled skies of a place or under measured ones, and its record and headlines."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import date, timedelta, timezone
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lighting.color import luminance
from lighting.envmap.latlong import shrink_envmap
from lighting.errors import EnvironmentMapError, ErrorCode, ParameterError
from lighting.files.exr import read_envmap
from lighting.geometry import Floats, latlong_directions
from lighting.photo.clock import UTC_OFFSET_RANGE, YEAR_RANGE
from lighting.probe.bracket import probes_in
from lighting.records import Json
from lighting.stereo.light_vectors import SKY_HEIGHT, Skies, skies_from_maps
from lighting.stereo.plan_records import Plan, PlanRequest
from lighting.stereo.schedule import (
    ONE_SKY,
    ClockLocation,
    DayProgress,
    SkyDay,
    Weather,
    clear_brightness,
    days_between,
    gray_skies,
    make_plan,
    modelled_day,
)
from lighting.validation import OPTIONAL_RANGES, check_range

MAX_PROBE_GAP = 20.0  # min between two probes that photos may be planned in


def _probe_days(folder: Path, utc_offset: float = 0.0) -> dict[date, dict[float, Path]]:
    """The maps of each day by minutes since midnight, both by a clock at `utc_offset` hours from UTC.

    Folders without a time in their maps are named by that clock. Raises ProbeError where there is no probe.
    """
    zone = timezone(timedelta(hours=utc_offset))
    days: dict[date, dict[float, Path]] = {}
    for probe in probes_in(folder, zone):
        local = probe.time.astimezone(zone)
        days.setdefault(local.date(), {})[60.0 * local.hour + local.minute + local.second / 60] = probe.path
    return days


def day_maps(folder: Path, day: date, utc_offset: float = 0.0) -> dict[float, Path]:
    """List the maps of one day by minutes since midnight; none where the folder has none of that day.

    Args:
        folder: of probes, in the SkyDB's layout.
        day: by the clock at `utc_offset`.
        utc_offset: h, of that clock and of the folders' names where the maps have no time.
    """
    return _probe_days(folder, utc_offset).get(day, {})


def _read_day(day: date, files: Mapping[float, Path]) -> SkyDay:
    """The probes of one day by minutes since midnight; ParameterError where there are fewer than two of it."""
    if len(files) < 2:
        sentence = f"There is one probe of {day}; a plan needs two or more of a day."
        raise ParameterError(sentence, code=ErrorCode.INSUFFICIENT)
    minutes = np.array(sorted(files))
    skies = gray_skies(read_skies([files[minute] for minute in minutes]))
    tolerance = min(float(np.diff(minutes).max()), MAX_PROBE_GAP) / 2
    return SkyDay(day, minutes, tolerance, skies, ONE_SKY)


def read_skies(files: list[Path]) -> Skies:
    """Read maps as skies of at most SKY_HEIGHT rows, the sun taken out of where a map is brightest.

    Args:
        files: OpenEXR maps of one size.

    Raises:
        EnvironmentMapError: a map cannot be read, or sizes differ.
    """
    parts = list(map(_read_sky, files))
    if len({sky.radiance.shape for sky in parts}) > 1:
        raise EnvironmentMapError("The probes differ in size; all must have the same number of rows.")
    return Skies.join(parts)


def _read_sky(file: Path) -> Skies:
    image = read_envmap(file)
    skies = skies_from_maps(image[None], _brightest_direction(image)[None])
    return Skies(shrink_envmap(skies.radiance[0], SKY_HEIGHT)[None], skies.sun_direction, skies.sun_irradiance)


def _brightest_direction(image: NDArray[np.float32]) -> Floats:
    """The direction (3,) of the brightest spot of a map (H, 2H, 3): the mean of its brightest pixels by luminance."""
    light = luminance(image)
    top = light >= 0.5 * light.max()
    mean = (latlong_directions(len(image))[top] * light[top][:, None]).sum(axis=0)
    return np.asarray(mean / max(float(np.linalg.norm(mean)), 1e-12))


@dataclass(frozen=True)
class ModelledSkies:
    """A place and days there under a kind of sky; ParameterError for another one and for what is out of range."""

    latitude: float
    """Deg, positive north."""
    longitude: float
    """Deg, positive east."""
    first: date
    """The first day."""
    last: date
    """The last day."""
    sky: Weather = "clear"
    """The weather."""
    utc_offset: float | None = None
    """H; None is the longitude's, a whole number of hours."""

    def __post_init__(self) -> None:
        check_range("latitude", self.latitude, *OPTIONAL_RANGES["latitude"])
        check_range("longitude", self.longitude, *OPTIONAL_RANGES["longitude"])
        if self.sky not in _SKY_TEXT:
            sentence = f"The sky {self.sky!r} is not known; it must be one of {', '.join(_SKY_TEXT)}."
            raise ParameterError(sentence, "sky", ErrorCode.UNKNOWN)
        if self.utc_offset is not None:
            check_range("utc_offset", self.utc_offset, *UTC_OFFSET_RANGE)
        for name, day in (("first", self.first), ("last", self.last)):
            check_range(name, day.year, YEAR_RANGE[0] + 1, YEAR_RANGE[1] - 1, "The year")
        days_between(self.first, self.last)

    @property
    def location(self) -> ClockLocation:
        """Where, with the clock of the plan."""
        offset = round(self.longitude / 15) if self.utc_offset is None else self.utc_offset
        return ClockLocation(self.latitude, self.longitude, float(offset))


@dataclass(frozen=True)
class MeasuredSkies:
    """A folder of probes, and the days of it that count; None is no limit."""

    folder: Path
    """Of the probes."""
    first: date | None = None
    """The first day. None: any."""
    last: date | None = None
    """The last day. None: any."""
    utc_offset: float = 0.0
    """Hours, of the clock that days and times are told by."""

    def days(self) -> dict[date, dict[float, Path]]:
        """List the maps of each day that counts.

        Raises:
            ProbeError: the folder has no probe.
            ParameterError: it has none of these days.
        """
        days = _probe_days(self.folder, self.utc_offset)
        first, last = self.first or min(days), self.last or self.first or max(days)
        days_between(first, last)
        chosen = {day: files for day, files in days.items() if first <= day <= last}
        if not chosen:
            when = f"on {first}" if first == last else f"from {first} to {last}"
            sentence = f"{self.folder} has no probes {when}; it has some from {min(days)} to {max(days)}."
            raise ParameterError(sentence, "first", ErrorCode.MISSING)
        return chosen


PlanSkies = ModelledSkies | MeasuredSkies


def plan_photos(skies: PlanSkies, question: PlanRequest, progress: DayProgress = iter) -> Plan:
    """Plan the best day.

    Args:
        skies: of the days to compare.
        question: what is to be photographed.
        progress: passes the days on as they are read.

    Raises:
        ParameterError: no window of any day has light.
    """
    if isinstance(skies, MeasuredSkies):
        files = skies.days()
        return make_plan(list(files), lambda day, _: _read_day(day, files[day]), question, progress=progress)
    location, weather, days = skies.location, skies.sky, days_between(skies.first, skies.last)
    reference = clear_brightness(location, days)

    def read(day: date, coarse: bool) -> SkyDay:
        return modelled_day(location, day, weather, coarse=coarse)

    return make_plan(days, read, question, reference, progress)


def plan_record(skies: PlanSkies, plan: Plan) -> Json:
    """Return the question and its answer as JSON.

    Args:
        skies: what was planned for.
        plan: its answer.
    """
    if isinstance(skies, MeasuredSkies):
        return {"sky": "probes", "utc_offset": skies.utc_offset, **plan.to_dict()}
    return {**asdict(skies.location), "sky": skies.sky, **plan.to_dict()}


def plan_title(skies: PlanSkies, plan: Plan) -> str:
    """Format a headline: when and where, under which sky.

    Args:
        skies: what was planned for.
        plan: its answer.
    """
    if isinstance(skies, MeasuredSkies):
        return f"{plan.day}, measured skies of {skies.folder.name}"
    location = skies.location
    north, east = "N" if location.latitude >= 0 else "S", "E" if location.longitude >= 0 else "W"
    location_text = f"{abs(location.latitude):.2f}° {north} {abs(location.longitude):.2f}° {east}"
    return f"{plan.day}, {location_text}, {_SKY_TEXT[skies.sky]}"


def plan_conditions(skies: PlanSkies, question: PlanRequest) -> str:
    """Format what a plan holds for.

    Args:
        skies: what was planned for.
        question: what is to be photographed.
    """
    offset = skies.utc_offset if isinstance(skies, MeasuredSkies) else skies.location.utc_offset
    facing = "surface all around and up" if question.facing is None else f"surface facing {question.facing:g}°"
    minutes, sign = round(abs(offset) * 60), "+" if offset >= 0 else "-"
    clock = f"UTC{sign}{minutes // 60:02d}:{minutes % 60:02d}"
    return f"{facing}, {question.shots} photos a window, noise {question.noise:g} %, times {clock}"


_SKY_TEXT = {"clear": "clear sky", "overcast": "overcast", "mixed": "broken cloud"}

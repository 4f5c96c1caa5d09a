"""A sun study: the light of the hours of a day at a photo's place, as maps and as one animated USD.

The sun is that of the ephemeris, turned by the camera's heading. The sky is the model's, at the photo's turbidity and
exposure. Where the sun shines on the photo, its power is to the model's as it is there. Else, in shade or under
clouds, it is that of a clear sky. The place around the photo is relit: a guess, for its shadows stay.
"""

import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, date, datetime, timedelta, timezone
from pathlib import Path
from typing import Self

import numpy as np

from lighting.envmap.relighting import edit_lighting
from lighting.errors import CodedWarning, ErrorCode, ParameterError, SceneError
from lighting.fields import describe_fields
from lighting.files import output_folder_error, write_file
from lighting.fusion.time_zones import offset_at
from lighting.geometry import wrap_azimuth
from lighting.map_options import DEFAULT_MAP, MapOptions
from lighting.photo_estimate import Estimate
from lighting.record_json import json_line
from lighting.records import Lighting
from lighting.scene.records import SunPath
from lighting.scene.usd import DAY_STAGE, animate_usd_sun
from lighting.scene.writer import write_scene
from lighting.solar_position import sun_position

RECORDS, STAGE_FOLDER = "lighting.jsonl", "usd"
STEP_RANGE = (5.0, 360.0)  # minutes between two maps
_FINE_STEP = 10.0  # minutes, at most, between two suns of the stage, which are interpolated
_GUESS = "The place around the photo is relit: a guess."
_CLEAR = "The sun does not shine on the photo, so its power is that of a clear sky."
_NO_PLACE = "The place is not known: state latitude and longitude."
_NO_HEADING = "Where the camera points is not known: state the heading, or the photo's time and place."
_NO_SUN = "The sun does not rise there on {}."


@dataclass(frozen=True)
class StudyHour:
    """The light at a time of the day."""

    time: datetime
    """On the clock of the place, with its offset from UTC."""
    lighting: Lighting
    """The photo's camera, and this time's light."""

    @property
    def map_name(self) -> str:
        """Of the map's file."""
        return f"{self.time:%H%M}.exr"


@dataclass(frozen=True, eq=False)
class SunStudy:
    """The light of a day at a photo's place."""

    hours: tuple[StudyHour, ...]
    """While the sun is above the horizon, by time."""
    path: SunPath
    """The sun from the first hour to the last, in finer steps."""
    warnings: tuple[str, ...]
    """What its user must know, in sentences."""


def plan_study(
    lighting: Lighting, day: date, minutes: float, *, heading: float | None = None, keep_location: bool = False
) -> SunStudy:
    """Return the light of a day, at equal times from midnight on, while the sun is above the horizon.

    Args:
        lighting: of the photo, with its place and heading.
        day: on the calendar of the place.
        minutes: between two times, 5 to 360.
        heading: deg from true north, where the camera points if the light has no heading; None: unknown.
        keep_location: whether the lights hold latitude and longitude.

    Raises:
        ParameterError: place or heading are unknown, `minutes` is out of range, or the sun does not rise.
    """
    low, high = STEP_RANGE
    if not low <= minutes <= high:
        sentence = f"Hours of a study are {low:g} to {high:g} minutes apart, not {minutes:g}."
        raise ParameterError(sentence, "every", ErrorCode.OUT_OF_RANGE)
    if lighting.camera_heading is None and heading is not None:  # no time tells more
        lighting = replace(lighting, camera_heading=heading % 360.0)
    place = _Place.of(lighting)
    base = lighting if keep_location else replace(lighting, latitude=None, longitude=None)
    hours = tuple(_lights(base, place, _times(place, day, minutes)))
    if not hours:
        raise ParameterError(_NO_SUN.format(day), "date", ErrorCode.OUT_OF_RANGE)
    radius = lighting.camera_heading_radius_90
    turned = f"All suns may be turned by {radius or 0.0:.0f}°, as the heading may (9 of 10 lie within)."
    told = (_GUESS, *(() if lighting.sun_shines else (_CLEAR,)), *((turned,) if radius else ()))
    return SunStudy(hours, _sun_path(base, place, hours), told)


def write_sun_study(
    estimate: Estimate,
    study: SunStudy,
    folder: str | os.PathLike[str],
    options: MapOptions = DEFAULT_MAP,
    *,
    overwrite: bool = False,
    name: str = "photo",
) -> list[Path]:
    """Write a map and a record of each hour, and the photo's USD scene with a stage in which the sun moves.

    Args:
        estimate: of the photo.
        study: of its light.
        folder: new or empty unless `overwrite`.
        options: of the maps.
        overwrite: whether files in the folder may be replaced.
        name: of the photo, for the records.

    Returns:
        The stage, the records and the maps.

    Raises:
        SceneError: the folder cannot be written.
    """
    target = Path(folder)
    if objection := output_folder_error(target, overwrite=overwrite, what="the study", need="a study is a folder"):
        raise SceneError(objection)
    target.mkdir(exist_ok=True)
    stage = target / STAGE_FOLDER
    write_scene(estimate.make_scene(options), "usd", stage, overwrite=overwrite)
    for hour in study.hours:
        shown = estimate.replace(lighting=hour.lighting)
        shown.render(options).write(target / hour.map_name)
        shown.render(replace(options, disc=False)).write(stage / hour.map_name)
    for file, text in animate_usd_sun(study.path).items():
        write_file(stage / file, text.encode())
    lines = (json_line(name, hour.lighting, outputs={"map": hour.map_name}) for hour in study.hours)
    write_file(target / RECORDS, "".join(f"{line}\n" for line in lines).encode())
    return [stage / DAY_STAGE, target / RECORDS, *(target / hour.map_name for hour in study.hours)]


@dataclass(frozen=True)
class _Place:
    latitude: float
    longitude: float
    heading: float  # of the camera

    @classmethod
    def of(cls, lighting: Lighting) -> Self:
        """That of a record; ParameterError where part of it is unknown."""
        if lighting.latitude is None or lighting.longitude is None:
            raise ParameterError(_NO_PLACE, "latitude", ErrorCode.MISSING)
        if lighting.camera_heading is None:
            raise ParameterError(_NO_HEADING, "heading", ErrorCode.MISSING)
        return cls(lighting.latitude, lighting.longitude, lighting.camera_heading)

    def local(self, time: datetime) -> datetime:
        """An instant on the clock there."""
        return time.astimezone(timezone(timedelta(hours=offset_at(self.latitude, self.longitude, time))))


def _times(place: _Place, day: date, minutes: float) -> list[datetime]:
    """The instants of a day from midnight on, in UTC."""
    utc = midnight = datetime(day.year, day.month, day.day, tzinfo=UTC)
    for _ in range(2):  # for the offset is that of the instant
        midnight = utc - timedelta(hours=offset_at(place.latitude, place.longitude, midnight))
    count = math.ceil(25 * 60 / minutes)  # a day may have 25 hours
    times = [midnight + timedelta(minutes=minutes * number) for number in range(count)]
    return [time for time in times if place.local(time).date() == day]


def _lights(lighting: Lighting, place: _Place, times: Sequence[datetime]) -> Iterator[StudyHour]:
    """The light at those of the times at which the sun is up."""
    moments = np.array([time.replace(tzinfo=None) for time in times], "datetime64[us]")
    azimuths, elevations = sun_position(moments, place.latitude, place.longitude)
    for time, azimuth, elevation in zip(times, azimuths.tolist(), elevations.tolist(), strict=True):
        if elevation >= 0:
            local = place.local(time)
            light = _relight(lighting, float(wrap_azimuth(azimuth - place.heading)), min(elevation, 90.0))
            yield StudyHour(local, _at_time(light, local))


def _relight(lighting: Lighting, azimuth: float, elevation: float) -> Lighting:
    """The light with its sun elsewhere; by the model alone where the photo's does not shine."""
    clear = replace(lighting, sun_irradiance=None, sky_irradiance=None, sky_cover=None, sun_visibility=1.0)
    base = lighting if lighting.sun_shines else clear
    sun = {"sun_azimuth": round(azimuth, 3), "sun_elevation": round(elevation, 3), "sun_visibility": 1.0}
    return edit_lighting(base, sun)


def _at_time(light: Lighting, local: datetime) -> Lighting:
    """The record of a time: its sun is as sure as the heading is."""
    offset = local.utcoffset()
    assert offset is not None
    across = math.cos(math.radians(light.sun_elevation))
    return replace(
        light,
        radius_50=round((light.camera_heading_radius_50 or 0.0) * across, 2),
        radius_90=round((light.camera_heading_radius_90 or 0.0) * across, 2),
        sun_candidates=(),
        utc_time=local.astimezone(UTC),
        utc_offset=offset / timedelta(hours=1),
        time_source="user",
        warnings=(*light.warnings, CodedWarning(_GUESS)),
    )


def _sun_path(lighting: Lighting, place: _Place, hours: Sequence[StudyHour]) -> SunPath:
    """Suns from the first hour to the last, and the maps."""
    first, last = hours[0].time, hours[-1].time
    minutes = (last - first) / timedelta(minutes=1)
    count = max(1, math.ceil(minutes / _FINE_STEP))
    times = [(first + (last - first) * number / count).astimezone(UTC) for number in range(count + 1)]
    suns = list(_lights(lighting, place, times))
    midnight = first.replace(hour=0, minute=0, second=0, microsecond=0)

    def code(time: datetime) -> float:
        return (time - midnight) / timedelta(hours=1)

    return SunPath(
        np.array([code(sun.time) for sun in suns]),
        tuple(sun.lighting for sun in suns),
        {code(hour.time): hour.map_name for hour in hours},
    )


describe_fields(StudyHour, SunStudy)

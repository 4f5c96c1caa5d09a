"""Metadata as a phone would have recorded it: a place and time with the panorama's sun, a compass heading, the lens.

Like the crops, it depends on the panorama's name and the crop's index alone.
"""

from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray

from export.crops import generator
from export.evaluation.records import Truth
from lighting.evidence import sun_position, zones
from lighting.geometry import angles
from lighting.photo import PhotoFacts
from lighting.photo.exif import HeadingReference
from lighting.records import EvidenceKind

LOCAL_TIME = "local time+place"  # a part of what is known: a time without its zone
LATITUDES = (-55.0, 65.0)  # deg, where people live
FIRST_DAY, DAYS = np.datetime64("2015-01-01T00:00:00"), 3652
STEP = 300  # s, between the moments of a day that are tried first
COMPASS_MEDIAN = 17.0  # deg, median error of a phone's heading
COMPASS_ERROR = 25.2  # deg, standard deviation of the normal distribution with that median, which is 0.6745 of it
GROSS = 0.05  # share of headings that point anywhere


@dataclass(frozen=True)
class Sighting:
    """When and where the sun stood at an elevation."""

    time: datetime  # aware, in UTC
    latitude: float
    longitude: float
    compass: float  # deg clockwise from true north, of the sun


@dataclass(frozen=True)
class Taken:
    """A photo's metadata, and where its camera really pointed."""

    facts: PhotoFacts
    heading: float  # deg clockwise from true north
    gross: bool  # whether the compass pointed anywhere


def sighting(elevation: float, rng: np.random.Generator) -> Sighting:
    """A random place and a time at which the sun has an elevation [deg] there."""
    while True:
        latitude, longitude = rng.uniform(*LATITUDES), rng.uniform(-180, 180)
        day = FIRST_DAY + np.timedelta64(int(rng.integers(DAYS)), "D")
        passing = _passings(elevation, day + np.arange(0, 86400, STEP), latitude, longitude)
        if len(passing):
            seconds = rng.choice(passing) + np.arange(STEP)
            azimuth, height = sun_position(seconds, latitude, longitude)
            best = int(np.argmin(np.abs(height - elevation)))
            return Sighting(seconds[best].item().replace(tzinfo=UTC), latitude, longitude, float(azimuth[best]))


def _passings(elevation: float, times: NDArray[np.datetime64], latitude: float, longitude: float) -> NDArray[Any]:
    """Those of the times (N,) after which the sun crosses the elevation before the next one."""
    above = sun_position(times, latitude, longitude)[1] > elevation
    return times[np.flatnonzero(above[1:] != above[:-1])]


def take_metadata(truth: Truth, crops_each: int) -> list[Taken]:
    """The metadata of each crop; crops that are not scored have no sun and get an empty record."""
    seen = {name: _sighting_of(truth, i) for i, name in enumerate(truth.panorama) if truth.scored[i]}
    return [
        _taken(truth, i, seen[name], i % crops_each) if truth.scored[i] else Taken(PhotoFacts(), float("nan"), False)
        for i, name in enumerate(truth.panorama)
    ]


def _sighting_of(truth: Truth, i: int) -> Sighting:
    return sighting(float(angles(truth.sun[i])[1]), generator(truth.panorama[i], 0, "sighting"))


def _taken(truth: Truth, i: int, seen: Sighting, index: int) -> Taken:
    rng = generator(truth.panorama[i], index, "compass")
    heading = (seen.compass - float(angles(truth.sun[i])[0])) % 360.0
    gross = bool(rng.random() < GROSS)
    error = rng.uniform(-180, 180) if gross else rng.normal(0, COMPASS_ERROR)
    zone = rng.choice(zones(seen.latitude, seen.longitude))
    facts = PhotoFacts(
        local_time=(seen.time + timedelta(hours=float(zone))).replace(tzinfo=None),
        utc_offset=float(zone),
        utc_time=seen.time,
        latitude=seen.latitude,
        longitude=seen.longitude,
        heading=(heading + error) % 360.0,
        heading_reference=HeadingReference.TRUE,
        vertical_fov=float(truth.camera[i, 2]),
    )
    return Taken(facts, heading, gross)


def only(facts: PhotoFacts, parts: tuple[str, ...]) -> PhotoFacts:
    """The facts reduced to `parts`, which are some of LOCAL_TIME, TIME_AND_PLACE, HEADING and FOCAL_LENGTH."""
    kept = facts
    if EvidenceKind.TIME_AND_PLACE not in parts:
        kept = replace(kept, utc_time=None, utc_offset=None)
    if EvidenceKind.TIME_AND_PLACE not in parts and LOCAL_TIME not in parts:
        kept = replace(kept, local_time=None, latitude=None, longitude=None)
    if EvidenceKind.HEADING not in parts:
        kept = replace(kept, heading=None, heading_reference=None)
    return kept if EvidenceKind.FOCAL_LENGTH in parts else replace(kept, vertical_fov=None)

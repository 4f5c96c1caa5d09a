"""Days at rendered places, hour by hour from a tripod: the sun's path with exact truth, and what is fitted to it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from export.turns.groups import predictions
from export.turns.sets import HEIGHT, WIDTH, Taken
from export.turns.walk import Daylight, Standpoint, Walk
from lighting.evidence import Evidence, sun_position
from lighting.evidence.fit import KINDS, Fit, Range, Series, fit
from lighting.geometry import Floats, wrap_azimuth
from lighting.model import Model
from lighting.photo import PhotoFacts
from lighting.records import Lighting

LOWEST = 6.0  # deg, of a sun whose light is rendered
PHOTOS = 6  # over the day
EXPOSURE = 0.02
FIRST_PLACE = 100  # number of the first day's place


@dataclass(frozen=True, eq=False)
class Day:
    """Photos of one place over a day, and what is true of them."""

    series: Series
    heading: float  # deg
    latitude: float
    day_of_year: int


def day(model: Model, number: int) -> Day:
    """Day `number`, the same in every run."""
    rng = np.random.default_rng([31, number])
    latitude, longitude = rng.uniform(-60, 60), rng.uniform(-180, 180)
    times, turbidity = _daylight(rng, latitude, longitude), float(rng.uniform(2, 5))
    at = Standpoint((0.0, 0.0), float(rng.uniform(0, 360)), 2.0, 0.0, float(rng.uniform(45, 60)))
    suns = [tuple(float(v) for v in sun_position(time, latitude, longitude)) for time in times]
    lights = [
        Lighting(float(wrap_azimuth(azimuth)), elevation, turbidity=turbidity, exposure=EXPOSURE)
        for azimuth, elevation in suns
    ]
    photos = [Taken(pixels, at.camera(4 / 3)) for pixels in _photos(Walk(FIRST_PLACE + number), at, lights)]
    facts = [
        PhotoFacts(
            local_time=t.replace(tzinfo=None), utc_offset=0.0, utc_time=t, latitude=latitude, longitude=longitude
        )
        for t in times
    ]
    evidence = [Evidence(((elevation, azimuth),)) for azimuth, elevation in suns]
    series = Series(predictions(model, photos), facts, evidence, np.zeros(PHOTOS))
    return Day(series, at.azimuth % 360.0, latitude, times[0].timetuple().tm_yday)


def _photos(walk: Walk, at: Standpoint, lights: Sequence[Lighting]) -> Iterator[NDArray[np.uint8]]:
    """The place under one light after the other."""
    for light in lights:
        walk.light = Daylight.of(light)
        yield walk.photo(at, WIDTH // 2, HEIGHT // 2)


def _daylight(rng: np.random.Generator, latitude: float, longitude: float) -> list[datetime]:
    """PHOTOS moments (UTC) evenly over what is light of a day of 2026, a quarter hour or more apart."""
    noon = datetime(2026, 1, 1, 12, tzinfo=UTC) + timedelta(days=int(rng.integers(365)), hours=-longitude / 15)
    moments = [noon + timedelta(minutes=int(minute)) for minute in np.arange(-720, 720, 5)]
    utc = np.array([moment.replace(tzinfo=None) for moment in moments], dtype="datetime64[us]")
    up = np.flatnonzero(sun_position(utc, latitude, longitude)[1] > LOWEST)
    if len(up) < 4 * PHOTOS:
        return _daylight(rng, latitude, longitude)
    return [moments[int(i)] for i in np.linspace(up[0], up[-1], PHOTOS)]


def figures(model: Model, count: int) -> dict[str, dict[str, float]]:
    """Errors of what is fitted to `count` days, and how often the truth is in its regions."""
    days = [day(model, number) for number in tqdm(range(count), unit="day")]
    fits = {kind: [fit(d.series, kind) for d in days] for kind in KINDS}
    rows = {f"heading [deg], fitting {kind}": _headings(days, found) for kind, found in fits.items()}
    truths = {
        "latitude [deg]": ("latitude", "latitude", np.array([d.latitude for d in days])),
        "declination of the date [deg]": ("time", "day_of_year", np.array([float(d.day_of_year) for d in days])),
        "clock [h]": ("time", "clock_shift", np.zeros(count)),
    }
    for name, (kind, quantity, truth) in truths.items():
        ranges = [getattr(found, quantity) for found in fits[kind]]
        rows[name] = _ranges(ranges, truth, quantity == "day_of_year")
    return rows


def _headings(days: Sequence[Day], found: Sequence[Fit]) -> dict[str, float]:
    error = np.array([abs(float(wrap_azimuth(f.heading - d.heading))) for f, d in zip(found, days, strict=True)])
    half, most = (np.array([getattr(f, f"heading_radius_{s}") for f in found]) for s in (50, 90))
    return _row(error, error <= half, error <= most)


def _ranges(found: Sequence[Range], truth: Floats, by_declination: bool) -> dict[str, float]:
    best = np.array([r.best for r in found])
    error = np.abs(_declination(best) - _declination(truth)) if by_declination else np.abs(best - truth)
    half, most = (_held([getattr(r, name) for r in found], truth) for name in ("in_50", "in_90"))
    return _row(error, half, most)


def _held(intervals: Sequence[tuple[tuple[float, float], ...]], truth: Floats) -> NDArray[np.bool_]:
    """Whether each truth lies in one of its intervals."""
    return np.array([any(low <= t <= high for low, high in own) for own, t in zip(intervals, truth, strict=True)])


def _row(error: Floats, half: NDArray[np.bool_], most: NDArray[np.bool_]) -> dict[str, float]:
    return {
        "error, 50 %": float(np.median(error)),
        "90 %": float(np.quantile(error, 0.9)),
        "in 50 % region [%]": 100 * float(np.mean(half)),
        "in 90 % region [%]": 100 * float(np.mean(most)),
    }


def _declination(day_of_year: Floats) -> Floats:
    """The sun's declination [deg], to half a degree."""
    return np.asarray(-23.44 * np.cos(2 * np.pi * (day_of_year + 10) / 365.25))

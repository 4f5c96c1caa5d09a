"""Place and time from light: heading, latitude, or date and clock, fitted to the sun's path over several photos."""

import reprlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import TYPE_CHECKING, Any

import numpy as np

from lighting.errors import ParameterError
from lighting.evidence.answer import by_exposure, reasons
from lighting.evidence.ephemeris import sun_position
from lighting.evidence.facts import ZONE_LEAD, location_of, merge, of_one_place
from lighting.evidence.frames import contrary_up, frames
from lighting.evidence.fusion import Evidence
from lighting.evidence.given import Given
from lighting.evidence.metadata import elsewhere
from lighting.evidence.path import Paths, follow
from lighting.evidence.sun import suns
from lighting.geometry import Floats
from lighting.photo import PhotoFacts
from lighting.records import SUITABLE, Prediction

if TYPE_CHECKING:
    from lighting.turns import Placed

KINDS = ("heading", "latitude", "time")
LATITUDES = np.arange(-70.0, 71.0)  # deg, tried
LEADS = np.arange(*ZONE_LEAD, 0.25)  # h that a zone's clocks are ahead of the sun's, tried where no longitude is known
DAY_STEP, SHIFT_STEP = 4, 0.5  # days of the year and hours of the clock tried, apart


@dataclass(frozen=True)
class Range:
    """What is likely of one quantity."""

    best: float
    in_50: tuple[tuple[float, float], ...]  # intervals that hold 50 % of the probability, the shortest in sum
    in_90: tuple[tuple[float, float], ...]

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return {"best": self.best, "in_50": [list(i) for i in self.in_50], "in_90": [list(i) for i in self.in_90]}


@dataclass(frozen=True)
class Fit:
    """What was fitted: the first camera's heading [deg from true north] always, and what else was asked for."""

    heading: float
    heading_radius_50: float
    heading_radius_90: float
    latitude: Range | None = None  # deg
    day_of_year: Range | None = None  # of the first photo, 1 to 365; intervals end with the year and begin with it
    clock_shift: Range | None = None  # h to add to the photos' clocks, of which the zone is known
    utc_minus_clock: Range | None = None  # h to add to clocks of unknown zone for UTC: zone and error together
    warnings: tuple[str, ...] = ()  # about the photos, which are numbered from 1

    def to_dict(self) -> dict[str, Any]:
        """As JSON; what was not asked for is left out."""
        heading = {"best": self.heading, "radius_50": self.heading_radius_50, "radius_90": self.heading_radius_90}
        asked = {name: getattr(self, name) for name in ("latitude", "day_of_year", "clock_shift", "utc_minus_clock")}
        warned = {"warnings": list(self.warnings)} if self.warnings else {}
        found = {name: value.to_dict() for name, value in asked.items() if value is not None}
        return {"heading": heading, **found, **warned}


@dataclass(frozen=True, eq=False)
class Series:
    """Photos in one frame: what the network says, when they were taken, how their cameras are turned."""

    predictions: Sequence[Prediction]
    facts: Sequence[PhotoFacts]  # of one place
    evidence: Sequence[Evidence]
    turns: Floats  # (n,) deg clockwise from the first photo
    warnings: tuple[str, ...] = ()  # about the photos, which are numbered from 1
    place_given: bool = False  # whether the place is what the user says


def series_of(
    predictions: Sequence[Prediction],
    facts: Sequence[PhotoFacts],
    given: Given,
    headings: Sequence[float] | None = None,
    placed: "Sequence[Placed] | None" = None,
) -> Series:
    """Photos of one place brought into one frame by `headings` [deg] or matches; ParameterError where neither does."""
    merged = [merge(fact, given) for fact in of_one_place(facts)]
    evidence = [Evidence(tuple(suns(f)), vertical_fov=f.vertical_fov) for f in merged]
    turned = frames(evidence, headings, placed)
    apart = np.flatnonzero(turned.group != turned.group[0])
    if len(apart):
        raise ParameterError(
            f"Photo {apart[0] + 1} shows nothing that the first one shows: its heading must be stated."
        )
    warnings = _warnings(predictions, facts, merged, given, placed)
    return Series(
        predictions, merged, evidence, turned.turn - turned.turn[0], warnings, place_given=given.latitude is not None
    )


def _warnings(
    predictions: Sequence[Prediction],
    facts: Sequence[PhotoFacts],
    used: Sequence[PhotoFacts],
    given: Given,
    placed: "Sequence[Placed] | None",
) -> tuple[str, ...]:
    """What speaks against single photos."""
    said = []
    for number, (prediction, own, common) in enumerate(zip(predictions, facts, used, strict=True), 1):
        of_place = elsewhere(own, common) if given.use_exif and given.latitude is None else ()
        turned = () if placed is None else contrary_up(prediction, placed[number - 1])
        said += [f"Photo {number}: {text}" for text in (*of_place, *turned, *_doubts(prediction, common))]
    return tuple(said)


def _doubts(prediction: Prediction, facts: PhotoFacts) -> tuple[str, ...]:
    """Sentences about a photo that is no ordinary one of outdoors by daylight, as its pixels or its exposure say."""
    evidence = Evidence(exposure_value=facts.exposure_value)
    if prediction.light is None or by_exposure(prediction.light.suitable, evidence) >= SUITABLE:
        return ()
    return reasons(evidence)


def fit(series: Series, kind: str) -> Fit:
    """One of KINDS; ParameterError for another, and where the photos do not say what it needs."""
    if kind not in KINDS:
        raise ParameterError(f"{reprlib.repr(kind)} cannot be fitted; it must be one of {', '.join(KINDS)}.")
    found = {"heading": _heading, "latitude": _latitude, "time": _time}[kind](series)
    return replace(found, warnings=(*found.warnings, *series.warnings))


def _heading(series: Series) -> Fit:
    """The heading alone: one path for each zone that the photos' clocks may follow."""
    counts = {len(e.candidates) for e in series.evidence}
    if len(counts) > 1 or not counts.pop():
        raise ParameterError("A heading is fitted to photos that all say when and where they were taken.")
    candidates = np.array([e.candidates for e in series.evidence], dtype=np.float64)
    paths = Paths(candidates[..., 0].T, candidates[..., 1].T, np.ones(candidates.shape[1]))
    return _fitted(series, _utc(series) or _local(series), paths)[0]


def _latitude(series: Series) -> Fit:
    """Heading and latitude: a path for each of LATITUDES and each longitude that is possible."""
    times = _utc(series)
    if times is None:
        raise ParameterError("A latitude is fitted to photos that all say when they were taken, with the zone.")
    longitudes = _longitudes(series.facts[0])
    latitude, longitude = (v.ravel() for v in np.meshgrid(LATITUDES, longitudes, indexing="ij"))
    azimuth, elevation = sun_position(_moments(times), latitude[:, None], longitude[:, None])
    found, probability = _fitted(series, times, Paths(elevation, azimuth, np.cos(np.radians(latitude))))
    by_latitude = probability.reshape(len(LATITUDES), -1).sum(axis=1)
    unused = ("The latitude that was given was not used, since it is what is fitted.",) if series.place_given else ()
    return replace(found, latitude=likely(LATITUDES, by_latitude), warnings=unused)


def _longitudes(facts: PhotoFacts) -> Floats:
    """The longitude that is known, or those at which clocks follow the photo's zone [deg]."""
    if facts.longitude is not None:
        return np.array([facts.longitude])
    if facts.utc_offset is None:
        raise ParameterError("A latitude is fitted to photos that say their longitude or the zone of their clock.")
    return np.asarray(15.0 * (facts.utc_offset - LEADS))


def _time(series: Series) -> Fit:
    """Heading, day of the year and clock: a path for every DAY_STEP days and SHIFT_STEP hours."""
    utc = _utc(series)
    place, times = location_of(series.facts[0]), utc or _local(series)
    if place is None or times is None:
        raise ParameterError("Date and time are fitted to photos that say where they are and how far apart in time.")
    days, shifts = np.arange(0, 365, DAY_STEP), np.arange(-12.0, 12.0, SHIFT_STEP)
    day, shift = (v.ravel() for v in np.meshgrid(days, shifts, indexing="ij"))
    start = np.datetime64(f"{times[0].year}-01-01T00:00:00", "s") - np.datetime64(times[0].date(), "s")
    moved = start + (86400 * day + 3600 * shift).astype(int).astype("timedelta64[s]")
    azimuth, elevation = sun_position(_moments(times) + moved[:, None], *place)
    found, probability = _fitted(series, times, Paths(elevation, azimuth, np.ones(len(day))))
    table = probability.reshape(len(days), len(shifts))
    date, shift = _in_year(likely(days + 1.0, table.sum(axis=1))), likely(shifts, table.sum(axis=0))
    found = replace(found, day_of_year=date)
    return replace(found, utc_minus_clock=shift) if utc is None else replace(found, clock_shift=shift)


def _fitted(series: Series, times: list[datetime] | None, paths: Paths) -> tuple[Fit, Floats]:
    """The heading, and the probabilities (H,) of the paths."""
    hours = np.zeros(len(series.turns)) if times is None else np.array([t.timestamp() / 3600.0 for t in times])
    followed = follow(series.predictions, series.turns, hours, paths)
    found = followed.heading
    best, half, most = (round(v, 2) for v in (found.best, found.radius_50, found.radius_90))
    return Fit(best % 360.0, half, most), followed.probability


def _utc(series: Series) -> list[datetime] | None:
    """When the photos were taken, or None where not all know it."""
    times = [f.utc_time for f in series.facts if f.utc_time is not None]
    return times if len(times) == len(series.facts) else None


def _local(series: Series) -> list[datetime] | None:
    """The same by the photos' clocks, of whatever zone."""
    times = [f.local_time for f in series.facts if f.local_time is not None]
    return times if len(times) == len(series.facts) else None


def _moments(times: Sequence[datetime]) -> np.ndarray[Any, np.dtype[np.datetime64]]:
    """The times (n,) as numpy has them, without their zone."""
    return np.array([t.replace(tzinfo=None) for t in times], dtype="datetime64[us]")


def likely(values: Floats, probability: Floats) -> Range:
    """The range of a quantity by probabilities (N,) of evenly spaced values (N,)."""
    p = probability / probability.sum()
    half, whole = _intervals(values, p, 0.5), _intervals(values, p, 0.9)
    inside = [(values >= low) & (values <= high) for low, high in half]
    strongest = max(inside, key=lambda mask: float(p[mask].sum()))
    best = float(p[strongest] @ values[strongest] / p[strongest].sum())
    return Range(round(best, 2), half, whole)


def _in_year(days: Range) -> Range:
    """The range of days with its intervals cut to the year, 1 to 365."""
    half, most = (
        tuple((max(low, 1.0), min(high, 365.0)) for low, high in intervals) for intervals in (days.in_50, days.in_90)
    )
    return Range(days.best, half, most)


def _intervals(values: Floats, p: Floats, share: float) -> tuple[tuple[float, float], ...]:
    """The likeliest values that hold a share of the probability, neighbours joined."""
    order = np.argsort(-p, kind="stable")
    count = int(np.searchsorted(np.cumsum(p[order]), share)) + 1
    held = np.sort(order[:count])
    runs = np.split(held, np.flatnonzero(np.diff(held) > 1) + 1)
    half = 0.5 * float(values[1] - values[0])
    return tuple((float(values[run[0]] - half), float(values[run[-1]] + half)) for run in runs)

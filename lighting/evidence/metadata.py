"""What a photo's metadata and its user know, turned into evidence about the sun, the heading and the lens."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.errors import ParameterError
from lighting.evidence.declination import TYPICAL_DECLINATION, declination
from lighting.evidence.ephemeris import (
    ASTRONOMICAL_TWILIGHT,
    CIVIL_TWILIGHT,
    NAUTICAL_TWILIGHT,
    SUN_RADIUS,
    sun_position,
)
from lighting.evidence.fusion import COMPASS_SPREAD, Evidence, Fused
from lighting.photo.clock import OFFSETS, YEARS, in_utc
from lighting.photo.exif import PhotoFacts
from lighting.records import OPTIONAL_RANGES, RANGES, Lighting, check_range, lighting_from

GIVEN_HEADING_SPREAD = 10.0  # deg, of a heading that the user states: read from a map rather than from a phone

# Hours from UTC that clocks follow somewhere, summer times included.
ZONES = (*range(-12, 15), -9.5, -3.5, -2.5, 3.5, 4.5, 5.5, 5.75, 6.5, 8.75, 9.5, 10.5, 12.75, 13.75)
CLOCK_ERROR = 0.1  # h, by which a camera's clock may differ from the satellites' and still tell the zone
ZONE_LEAD = (-1.25, 3.5)  # h that a zone's clocks may be ahead of the sun's mean time there (Arunachal, western China)

_IN_TWILIGHT = "the answer is the sky of a sun on the horizon, brighter than this one, without direct sunlight."


@dataclass(frozen=True)
class Given:
    """What the user says of a photo, which takes the place of what its metadata say; None is unsaid.

    Raises ParameterError for what cannot be true or contradicts itself.
    """

    use_exif: bool = True
    time: datetime | None = None  # aware, or local
    utc_offset: float | None = None  # h, of a local time, the photo's or the one given
    latitude: float | None = field(default=None, repr=False)  # deg, positive north
    longitude: float | None = field(default=None, repr=False)  # deg, positive east
    heading: float | None = None  # deg clockwise from true north
    vertical_fov: float | None = None  # deg, of the upright photo
    keep_location: bool = False  # whether the answer may hold latitude and longitude

    def __post_init__(self) -> None:
        ranges = {"utc_offset": OFFSETS, "heading": (-360.0, 360.0), "vertical_fov": RANGES["vertical_fov"]}
        for name, (low, high) in {**ranges, **{key: OPTIONAL_RANGES[key] for key in ("latitude", "longitude")}}.items():
            if (value := getattr(self, name)) is not None:
                check_range(name, value, low, high)
        if (self.latitude is None) != (self.longitude is None):
            raise ParameterError("A latitude needs a longitude and the other way round.")
        self._check_time()

    def said(self) -> dict[str, Any]:
        """What it says, by name, without what is unsaid."""
        return {f.name: value for f in fields(self) if (value := getattr(self, f.name)) != f.default}

    def _check_time(self) -> None:
        if self.time is not None and not YEARS[0] <= self.time.year <= YEARS[1]:
            raise ParameterError(f"The time must lie in the years {YEARS[0]} to {YEARS[1]}.")
        if self.time is not None and self.time.tzinfo is not None and self.utc_offset is not None:
            raise ParameterError("The time already has its offset from UTC; another one contradicts it.")
        if not self.use_exif and self.time is None and self.utc_offset is not None:
            raise ParameterError("An offset from UTC needs a time.")
        if not self.use_exif and (self.time is None) != (self.latitude is None):
            raise ParameterError("A time needs a place, and a place a time.")


@dataclass(frozen=True)
class Known:
    """The evidence about one photo, and what its answer is to say beside it."""

    evidence: Evidence = field(default_factory=Evidence)
    warnings: tuple[str, ...] = ()
    sun_is_up: bool = True  # False where time and place say that no direct sunlight reaches the photo
    is_night: bool = False  # its time and place are of a night too dark for these skies, and were not used
    location: tuple[float, float] | None = field(default=None, repr=False)  # latitude and longitude for the answer


def known(facts: PhotoFacts, given: Given) -> Known:
    """What is known of a photo by its facts and by its user.

    Raises ParameterError where the user's own time or place is one of night; what the photo alone says never does.
    """
    merged = merge(facts, given)
    candidates, warnings = _suns(merged), _missing(merged, given)
    highest = max((elevation for elevation, _ in candidates), default=0.0)
    if highest < CIVIL_TWILIGHT and (given.time is not None or given.latitude is not None):
        raise ParameterError(_below_horizon(merged, highest) + "too dark for these skies.")
    if highest < -SUN_RADIUS:
        consequence = _IN_TWILIGHT if highest >= CIVIL_TWILIGHT else "time and place were not used."
        warnings = (*warnings, _below_horizon(merged, highest) + consequence)
    evidence = Evidence(
        candidates=_in_twilight_on_the_horizon(candidates) if highest >= CIVIL_TWILIGHT else (),
        vertical_fov=merged.vertical_fov,
        **_compass(merged, given),
    )
    sun_is_up = not CIVIL_TWILIGHT <= highest < -SUN_RADIUS
    location = _place(merged) if given.keep_location else None
    return Known(evidence, warnings, sun_is_up, bool(candidates) and highest < CIVIL_TWILIGHT, location)


def known_together(facts: Sequence[PhotoFacts], given: Given) -> list[Known]:
    """The same of photos of one place and light; where one says that it was night, no time is believed."""
    there = of_one_place(facts)
    found = [known(fact, given) for fact in (there if given.utc_offset is not None else _by_one_clock(there))]
    return [_timeless(k) for k in found] if any(k.is_night for k in found) else found


def _timeless(known: Known) -> Known:
    if not known.evidence.candidates:
        return known
    warning = "Another photo taken with it says that it was night: time and place were not used."
    evidence = replace(known.evidence, candidates=())
    return replace(known, evidence=evidence, warnings=(*known.warnings, warning), sun_is_up=True)


def _place(facts: PhotoFacts) -> tuple[float, float] | None:
    return None if facts.latitude is None or facts.longitude is None else (facts.latitude, facts.longitude)


def merge(facts: PhotoFacts, given: Given) -> PhotoFacts:
    """The photo's facts with the user's in their place; a time replaces time and offset, a place the whole place."""
    merged = facts if given.use_exif else PhotoFacts()
    if given.time is not None:
        merged = replace(merged, **_time_of(given.time))
    if given.utc_offset is not None and merged.local_time is not None:
        in_zone = in_utc(merged.local_time, given.utc_offset)
        merged = replace(merged, utc_offset=given.utc_offset, utc_time=in_zone)
    if given.latitude is not None:
        merged = replace(merged, latitude=given.latitude, longitude=given.longitude)
    if given.heading is not None:
        merged = replace(merged, heading=given.heading, heading_reference="true")
    return replace(merged, vertical_fov=given.vertical_fov) if given.vertical_fov is not None else merged


def _time_of(time: datetime) -> dict[str, Any]:
    if time.tzinfo is None:
        return {"local_time": time, "utc_offset": None, "utc_time": None}
    return {"local_time": time.replace(tzinfo=None), "utc_offset": None, "utc_time": time.astimezone(UTC)}


def of_one_place(facts: Sequence[PhotoFacts]) -> list[PhotoFacts]:
    """The facts of photos taken together: the place is that of the first that has one, and so is the zone."""
    place = next((f for f in facts if f.latitude is not None), PhotoFacts())
    there = [replace(f, latitude=place.latitude, longitude=place.longitude) for f in facts]
    offset = next((hours for f in facts if (hours := _zone_of(f)) is not None), None)
    return there if offset is None else [_in_zone(f, offset) for f in there]


def _by_one_clock(facts: list[PhotoFacts]) -> list[PhotoFacts]:
    """The facts without local times of no known zone, where another photo's time has one: its moment is surer."""
    surer = any(f.utc_time is not None for f in facts)
    return [replace(f, local_time=None) if surer and f.utc_time is None else f for f in facts]


def _zone_of(facts: PhotoFacts) -> float | None:
    """Hours from UTC, as stated or as the clock differs from the satellites' time; None where that is no zone's."""
    if facts.utc_offset is not None or facts.local_time is None or facts.utc_time is None:
        return facts.utc_offset
    ahead = (facts.local_time - facts.utc_time.replace(tzinfo=None)).total_seconds() / 3600
    nearest = round(4 * ahead) / 4
    return nearest if nearest in ZONES and abs(ahead - nearest) < CLOCK_ERROR else None


def _in_zone(facts: PhotoFacts, utc_offset: float) -> PhotoFacts:
    if facts.local_time is None or facts.utc_time is not None:
        return facts
    return replace(facts, utc_offset=utc_offset, utc_time=in_utc(facts.local_time, utc_offset))


def _missing(merged: PhotoFacts, given: Given) -> tuple[str, ...]:
    """What the user said in vain."""
    if given.time is not None and merged.latitude is None:
        return ("The time was not used, because the photo does not say where it was taken.",)
    if given.latitude is not None and merged.local_time is None and merged.utc_time is None:
        return ("The place was not used, because the photo does not say when it was taken.",)
    if given.utc_offset is not None and merged.local_time is None:
        return ("The offset from UTC was not used, because the photo has no local time.",)
    return ()


def _suns(facts: PhotoFacts) -> tuple[tuple[float, float], ...]:
    """The sun's elevation and compass azimuth [deg]: one for a time in UTC, one a zone for a local time, or none."""
    if (place := _place(facts)) is None:
        return ()
    azimuth, elevation = sun_position(_times(facts, place[1]), *place)
    return tuple(zip(elevation.tolist(), azimuth.tolist(), strict=True))


def _times(facts: PhotoFacts, longitude: float) -> NDArray[np.datetime64]:
    """The moments (N,) in UTC at which the photo may have been taken, in the order of the zones."""
    if facts.utc_time is not None:
        return np.array([facts.utc_time.replace(tzinfo=None)], dtype="datetime64[us]")
    if facts.local_time is None:
        return np.array([], dtype="datetime64[us]")
    return np.array([facts.local_time - timedelta(hours=zone) for zone in zones(longitude)], dtype="datetime64[us]")


def zones(longitude: float) -> tuple[float, ...]:
    """Hours from UTC that clocks at a longitude [deg] may follow."""
    low, high = ZONE_LEAD
    return tuple(zone for zone in sorted(ZONES) if (zone - longitude / 15.0 - low) % 24.0 <= high - low)


def _in_twilight_on_the_horizon(suns: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    return tuple((max(el, 0.0) if el >= CIVIL_TWILIGHT else el, azimuth) for el, azimuth in suns)


def _below_horizon(facts: PhotoFacts, highest: float) -> str:
    """What the highest of the possible elevations [deg], a negative one, means: the beginning of a sentence."""
    return (
        f"At that time and place the sun is {-highest:.1f}° below the horizon ({_phase(highest, facts)}; civil "
        "twilight ends at 6°, nautical at 12°, astronomical at 18°): "
    )


def _phase(elevation: float, facts: PhotoFacts) -> str:
    polar = _is_polar_night(facts)
    if elevation < ASTRONOMICAL_TWILIGHT:
        return "polar night" if polar else "night"
    kind = "civil" if elevation >= CIVIL_TWILIGHT else "nautical" if elevation >= NAUTICAL_TWILIGHT else "astronomical"
    return f"{kind} twilight of the polar night" if polar else f"{kind} twilight"


def _is_polar_night(facts: PhotoFacts) -> bool:
    if (place := _place(facts)) is None:
        return False
    around = _times(facts, place[1])[:1] + np.arange(-12, 13).astype("timedelta64[h]")
    return bool(np.max(sun_position(around, *place)[1]) < -SUN_RADIUS)


def _compass(facts: PhotoFacts, given: Given) -> dict[str, Any]:
    """The heading from true north and its spread [deg], as Evidence takes them."""
    if facts.heading is None:
        return {}
    if given.heading is not None:
        return {"heading": facts.heading % 360.0, "heading_spread": GIVEN_HEADING_SPREAD}
    if facts.heading_reference == "true":
        return {"heading": facts.heading % 360.0, "heading_spread": COMPASS_SPREAD}
    off = _declination(facts)
    if facts.heading_reference == "magnetic" and off is not None:
        return {"heading": (facts.heading + off) % 360.0, "heading_spread": COMPASS_SPREAD}
    doubt = TYPICAL_DECLINATION if off is None else off
    return {"heading": facts.heading % 360.0, "heading_spread": math.hypot(COMPASS_SPREAD, doubt)}


def _declination(facts: PhotoFacts) -> float | None:
    time = facts.utc_time or facts.local_time
    place = _place(facts)
    return None if time is None or place is None else declination(*place, time)


def lighting_of(fused: Fused, known: Known) -> Lighting:
    """The answer about one photo, with what it rests on."""
    lighting = lighting_from(fused.prediction, fused.sun)
    heading = fused.camera_heading
    told: dict[str, Any] = {"evidence": fused.used, "warnings": (*known.warnings, *fused.warnings)}
    if heading is not None:
        told["camera_heading"] = round(heading.best, 2) % 360.0
        told["camera_heading_radius_50"] = round(heading.radius_50, 2)
        told["camera_heading_radius_90"] = round(heading.radius_90, 2)
        told["camera_heading_probability"] = tuple(round(float(p), 6) for p in heading.probability)
    if fused.relative_heading is not None:
        told["relative_heading"] = round(fused.relative_heading.best, 2) % 360.0
    if not known.sun_is_up:
        told["sun_visibility"] = 0.0
    if known.location is not None:
        told["latitude"], told["longitude"] = known.location
    return replace(lighting, **told)

"""The record of a photo's light, `Lighting`, and that of its light probe; to and from objects of JSON."""

import math
import reprlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from enum import StrEnum
from functools import cached_property
from typing import Any

import numpy as np

from lighting.errors import ErrorCode, ParameterError
from lighting.fields import (
    COLOR_RANGES,
    PLAIN_RANGES,
    RANGES,
    Json,
    check_range,
    convert_numpy_numbers,
    describe_fields,
    flatten_record,
    nest_fields,
    record_path,
    round_all,
    round_significant,
)
from lighting.formatting import format_azimuth, format_sun_elevation
from lighting.geometry import EYE_HEIGHT, Floats, direction
from lighting.sky import PAINTED_SKY, SKY_MODEL, SKY_MODELS, format_sky_models

Color = tuple[float, float, float]  # linear Rec.709

GROUND_ALBEDO = 0.3  # the sky fits of the training data assume it too
MIN_SUITABLE = 0.5  # `suitable` below it earns a warning
_MIN_SURE_VISIBILITY = 0.8  # from which the sun has its full irradiance
_VISIBILITY_EXPONENT = 5.0  # of the fall below it, by panoramas of `train` that the networks asked never saw
SURE_RADIUS = 45.0  # deg, largest `radius_90` of a sure answer; `export evaluate` prints what such answers are worth
SURROUNDINGS_SHAPE = (12, 24, 3)  # rows from zenith to nadir, columns of azimuth with 0 in the middle, RGB
GROUND_REFLECTANCE = 0.12  # of ground that a photo does not show: about the median under overcast HDR panoramas
_SPOT = {"spot_pixel": (2, 0.0, 1e6), "spot_direction": (3, -1.0, 1.0)}  # how many numbers, and their range
MIN_SPOT_DESCENT = 1e-3  # sine of the angle below the horizon at which an object may stand
_UNIT_TOLERANCE = 1e-3  # of a unit vector's length


class EvidenceKind(StrEnum):
    """What an answer may rest on, in the order of its list."""

    PIXELS = "pixels"
    TIME_AND_PLACE = "time+place"
    HEADING = "heading"
    FOCAL_LENGTH = "focal length"
    GRAVITY = "gravity"
    SHADOW = "shadow"
    DRAWN_CAMERA = "drawn camera"
    CAMERA_EXPOSURE = "camera exposure"
    TURNS = "turns"
    OTHER_PHOTOS = "other photos"


@dataclass(frozen=True)
class SunCandidate:
    """One of the suns that an answer thinks possible. A value out of range is a ParameterError."""

    azimuth: float
    """Deg, -180 to 180: 0 = where the camera points, positive to the right."""
    elevation: float
    """Deg above the horizon, -4.2 to 90."""
    probability: float
    """Share of the probability, 0 to 1, that lies nearer to it than to the others."""

    def __post_init__(self) -> None:
        convert_numpy_numbers(self, "azimuth", "elevation", "probability")
        check_range("sun_candidates", self.azimuth, *RANGES["sun_azimuth"])
        check_range("sun_candidates", self.elevation, *RANGES["sun_elevation"])
        check_range("sun_candidates", self.probability, 0.0, 1.0)


class Trust(StrEnum):
    """How far an answer's sun can be trusted, in one word."""

    SURE = "sure"
    """The sun shines, and is where the answer has it: `export evaluate` prints how often within 45 deg."""
    UNSURE = "unsure"
    """The sun shines, and may be elsewhere; or this may be no outdoor daylight photo."""
    NO_SUN = "no sun"
    """Direct sunlight probably does not reach the scene, so no shadow tells where the sun is."""


@dataclass(frozen=True)
class Lighting:
    """The light of one photo, and the camera that took it. A value out of range is a ParameterError."""

    sun_azimuth: float
    """Deg, -180 to 180: 0 = where the camera points, positive to the right."""
    sun_elevation: float
    """Deg above the horizon, -4.2 to 90; below 0 it is twilight."""
    turbidity: float
    """Linke's turbidity as Hosek and Wilkie use it, 1 to 10: 2 is very clear, 10 hazy."""
    exposure: float
    """Factor, 1e-6 to 1e6: the clear sky's radiance times it is the photo's linear values."""
    ground_albedo: float = GROUND_ALBEDO
    """Share of light, 0 to 1, that the ground reflects, as the sky's model assumes it."""
    sun_visibility: float = 1.0
    """Probability, 0 to 1, that direct sunlight reaches the scene."""
    radius_50: float = 0.0
    """Deg, 0 to 180: the cone around the sun's direction with half of the probability. 0: stated by hand."""
    radius_90: float = 0.0
    """Deg, 0 to 180: the cone around the sun's direction with nine tenths of the probability. 0: stated by hand."""
    sun_candidates: tuple[SunCandidate, ...] = ()
    """Up to three suns, at least 40 deg apart: first the answer, then the likeliest others. Empty: stated by hand."""
    camera_elevation: float = 0.0
    """Deg, -90 to 90: positive looks up."""
    camera_roll: float = 0.0
    """Deg, -180 to 180: positive turns the camera clockwise, the horizon counter-clockwise."""
    vertical_fov: float = 50.0
    """Deg, 1 to 170: vertical field of view of the upright photo."""
    model_name: str = "none"
    """Name of the network; "none" where no network said it."""
    model_version: str = "0"
    """Version of the network, such as 4.3.0."""
    evidence: tuple[str, ...] = ()
    """What the answer rests on: values of EvidenceKind, in its order."""
    warnings: tuple[str, ...] = ()
    """Sentences for people, above all about evidence that contradicts the pixels."""
    camera_heading: float | None = None
    """Deg, 0 to 360, clockwise from true north: where the camera points. None: unknown."""
    camera_heading_radius_50: float | None = None
    """Deg, 0 to 180, to either side of the heading that hold half of its probability. None: unknown."""
    camera_heading_radius_90: float | None = None
    """Deg, 0 to 180, to either side of the heading that hold nine tenths of its probability. None: unknown."""
    camera_heading_probability: tuple[float, ...] = ()
    """Probability, 0 to 1, of each of 360 whole degrees; empty where the heading is unknown."""
    relative_heading: float | None = None
    """Deg, 0 to 360, clockwise from the first of several photos. None: a single photo, or north is known."""
    latitude: float | None = field(default=None, repr=False)
    """Deg, -90 to 90, positive north. None: unknown, or not asked for by `keep_location`."""
    longitude: float | None = field(default=None, repr=False)
    """Deg, -180 to 180, positive east. None: unknown, or not asked for by `keep_location`."""
    utc_time: datetime | None = None
    """When the photo was taken, as the answer believes, with its offset from UTC. None: not used."""
    utc_offset: float | None = None
    """Hours, -12 to 14, local minus universal time. None: unknown."""
    time_source: str | None = None
    """Where the time comes from: user, file (as "GPS"), other photos, zone of the place. None: not used."""
    sky_model: str = SKY_MODEL
    """One of SKY_MODELS: what `turbidity` and `exposure` are of."""
    sun_irradiance: Color | None = None
    """RGB, 0 to 1e6, of a surface that faces the sun, in the photo's linear units. None: the sky model's."""
    sky_irradiance: Color | None = None
    """RGB, 0 to 1e6, of level ground by the sky without the sun, in the same units. None: the sky model's."""
    sky_cover: float | None = None
    """0 to 1: clear to overcast; goes with `sky_irradiance`. None: clear."""
    ground_color: Color | None = None
    """RGB, 0 to 1: the ground's reflectance. None: unknown."""
    suitable: float | None = None
    """Probability, 0 to 1, that this is an ordinary photo of outdoors by daylight. None: unknown."""
    sky_painted: str | None = None
    """One of SKY_MODELS, which paints the sky of SKY_MODEL. None: that model."""
    camera_height: float = EYE_HEIGHT
    """Meters above the ground, 0.1 to 20,000; 1.6 where nothing tells it."""
    ground_visible: float | None = None
    """Share of the picture, 0 to 1, that shows firm, level ground near by. None: not sought."""
    spot_pixel: tuple[float, float] | None = None
    """(x, y) of the upright photo, 0 to 1e6 pixels, where an object may stand. None: no such spot, or not sought."""
    spot_direction: Color | None = None
    """Unit vector, each -1 to 1, from the camera to the spot, +Y up. None: as `spot_pixel`."""

    def __post_init__(self) -> None:
        for name, (low, high) in PLAIN_RANGES.items():
            value = getattr(self, name)
            if not _is_within(value, low, high) and (value is not None or name in RANGES):
                convert_numpy_numbers(self, name)
                check_range(name, getattr(self, name), low, high)
        for name, (low, high) in COLOR_RANGES.items():
            self._check_numbers(name, "three numbers: red, green and blue", 3, low, high)
        self._check_headings()
        object.__setattr__(self, "sun_candidates", _read_candidates(self.sun_candidates))
        for name in ("model_name", "model_version"):
            if not isinstance(text := getattr(self, name), str):
                raise ParameterError.wrong_type(name, "a text", text)
        _check_time(self.utc_time, self.time_source)
        object.__setattr__(self, "evidence", tuple(map(_evidence_kind, _texts("evidence", self.evidence))))
        object.__setattr__(self, "warnings", _texts("warnings", self.warnings))
        _check_sky_model("sky_model", self.sky_model)
        if self.sky_painted is not None:
            _check_sky_model("sky_painted", self.sky_painted)
        self._check_both("sun_irradiance", "sky_irradiance")
        if self.sky_cover is not None and self.sky_irradiance is None:
            predicate = "needs sky.irradiance and sun.irradiance too."
            raise ParameterError.about("sky_cover", predicate, ErrorCode.CONTRADICTION)
        self._check_spot()

    def _check_numbers(self, name: str, what: str, count: int, low: float, high: float) -> None:
        """Check a tuple of numbers, which may be None."""
        value = getattr(self, name)
        if value is None or (_are_within(value, low, high) and len(value) == count):
            return
        convert_numpy_numbers(self, name)
        value = getattr(self, name)
        if not isinstance(value, tuple) or len(value) != count:
            raise ParameterError.about(name, f"must be {what}.", ErrorCode.WRONG_TYPE)
        for number in value:
            check_range(name, number, low, high)

    def _check_headings(self) -> None:
        name, value = "camera_heading_probability", self.camera_heading_probability
        if _are_within(value, 0.0, 1.0) and len(value) in (0, 360):
            return
        convert_numpy_numbers(self, name)
        values: object = self.camera_heading_probability
        if not isinstance(values, tuple):
            raise ParameterError.wrong_type(name, "a list of numbers", values)
        if values and len(values) != 360:
            predicate = f"has {len(values)} values; it must have 360."
            raise ParameterError.about(name, predicate, ErrorCode.OUT_OF_RANGE)
        for number in values:
            check_range(name, number, 0.0, 1.0)

    def _check_both(self, *names: str) -> None:
        missing = [name for name in names if getattr(self, name) is None]
        if len(missing) == 1:
            sentence = f"{' and '.join(map(record_path, names))} go together; the record has only one of them."
            raise ParameterError(sentence, missing[0], ErrorCode.MISSING)

    def _check_spot(self) -> None:
        for name, (count, low, high) in _SPOT.items():
            self._check_numbers(name, f"{count} numbers", count, low, high)
        self._check_both("spot_pixel", "spot_direction")
        if self.spot_direction is not None and abs(math.hypot(*self.spot_direction) - 1) > _UNIT_TOLERANCE:
            raise ParameterError.about("spot_direction", "must be a vector of length 1.", ErrorCode.OUT_OF_RANGE)
        if self.spot_direction is not None and self.spot_direction[1] > -MIN_SPOT_DESCENT:
            raise ParameterError.about("spot_direction", "must point below the horizon.", ErrorCode.OUT_OF_RANGE)

    @property
    def map_sky(self) -> str:
        """What paints the clear part of the sky, of SKY_MODELS: `sky_painted`, unless `sky_model` is no SKY_MODEL.

        That of a sun below the horizon is PAINTED_SKY where the record names none.
        """
        if self.sky_model != SKY_MODEL:
            return self.sky_model
        return self.sky_painted or (SKY_MODEL if self.sun_elevation >= 0 else PAINTED_SKY)

    @property
    def sun_painted(self) -> bool:
        """Whether maps hold the sun unless asked otherwise: where it shines, for its shadows are sharp."""
        return self.sun_shines

    @property
    def sun_shines(self) -> bool:
        """Whether direct sunlight has a probability of at least one half."""
        return self.sun_visibility >= 0.5

    @property
    def trust(self) -> Trust:
        """How far the sun's direction can be trusted."""
        if not self.sun_shines:
            return Trust.NO_SUN
        doubtful = self.suitable is not None and self.suitable < MIN_SUITABLE
        return Trust.UNSURE if doubtful or self.radius_90 > SURE_RADIUS else Trust.SURE

    @cached_property
    def sun_direction(self) -> Floats:
        """Unit vector (3,) towards the sun, in the frame of geometry.py; read-only."""
        vector = direction(self.sun_azimuth, self.sun_elevation)
        vector.flags.writeable = False
        return vector

    def to_dict(self) -> Json:
        """Return the JSON record; it adds `sun.direction` and `trust`, and omits what is unknown."""
        derived = {"sun_direction": tuple(round(float(v), 6) for v in self.sun_direction), "trust": self.trust.value}
        return nest_fields(vars(self) | derived)

    @classmethod
    def from_dict(cls, record: Mapping[str, Any]) -> "Lighting":
        """Read a record of `to_dict`; absent optional fields take defaults, derived values are ignored.

        It must have sun.azimuth, sun.elevation, sky.turbidity and sky.exposure.

        Args:
            record: an object of JSON.

        Raises:
            ParameterError: a field is missing, of the wrong type or out of range; named as in the record, sun.azimuth.
        """
        values = flatten_record(record)
        try:
            return cls(**values)
        except ParameterError as error:
            raise error.renamed(record_path) from error


def visibility_attenuation(visibility: float) -> float:
    """The share of its irradiance that the sun keeps, by the probability that its light reaches the scene.

    The network predicts the power of a sun that may be covered as something between none and that of a clear sky.
    Where it doubts that the sun shines, a sun painted at that power casts a shadow that is not in the photo.

    Args:
        visibility: the probability, 0 to 1.
    """
    return float(np.clip(visibility / _MIN_SURE_VISIBILITY, 0.0, 1.0) ** _VISIBILITY_EXPONENT)


def describe_trust(lighting: Lighting) -> str:
    """Say how far the sun can be trusted, and what helps: "unsure: mark a shadow, or give time and place".

    Args:
        lighting: any.
    """
    if lighting.trust == Trust.NO_SUN:
        return f"{Trust.NO_SUN}: set the sun by eye if you want one"
    if lighting.trust == Trust.SURE or lighting.radius_90 <= SURE_RADIUS:
        return str(lighting.trust)
    missing = {EvidenceKind.SHADOW: "mark a shadow", EvidenceKind.TIME_AND_PLACE: "give time and place"}
    helps = [words for kind, words in missing.items() if kind not in lighting.evidence]
    helps += ["pick another sun"] if len(lighting.sun_candidates) > 1 else []
    *first, last = helps or ["set the sun by eye"]
    return f"{lighting.trust}: {', '.join(first)}{' or ' if first else ''}{last}"


def describe_sun(lighting: Lighting) -> str:
    """Say where the sun is, and how sure that is; a record that was written by hand may have no radii.

    Args:
        lighting: any.
    """
    radii = f" (50 % within {lighting.radius_50:.1f}°, 90 % within {lighting.radius_90:.1f}°)"
    sun = f"sun {format_azimuth(lighting.sun_azimuth, 1)}, {format_sun_elevation(lighting.sun_elevation, 1)}"
    return sun + (radii if lighting.radius_90 else "")


def describe_candidates(lighting: Lighting) -> str:
    """Say where else the sun of an unsure answer may be: "or 120° left, 25° high (31 %)"; "" of any other.

    Args:
        lighting: any.
    """
    return ", ".join(
        f"or {format_azimuth(sun.azimuth)}, {format_sun_elevation(sun.elevation)} ({100 * sun.probability:.0f} %)"
        for sun in (lighting.sun_candidates[1:] if lighting.trust == Trust.UNSURE else ())
    )


def check_lighting(thing: object) -> None:
    """Raise ParameterError for what is no Lighting.

    Args:
        thing: what a caller passed as one.
    """
    if not isinstance(thing, Lighting):
        sentence = f"A Lighting is needed, not {type(thing).__name__}; an estimate has one as `lighting`."
        raise ParameterError(sentence, code=ErrorCode.WRONG_TYPE)


@dataclass(frozen=True, eq=False)
class MainLight:
    """The sun as a directional light."""

    direction: Floats
    """(3,) unit vector towards it."""
    irradiance: Floats
    """(3,) linear Rec.709 of a surface that faces it, in the photo's linear units; 0: it is not seen."""
    lux: float
    """Lux, 0 or more, on such a surface, as far as the record's exposure tells it."""
    kelvin: float | None
    """Correlated color temperature, 1000 to 40000; None of no light."""

    def to_dict(self) -> Json:
        """Return it as JSON."""
        return {
            "direction": round_all(self.direction),
            "irradiance": round_all(self.irradiance),
            "lux": round_significant(self.lux),
            "kelvin": None if self.kelvin is None else round(self.kelvin),
        }


@dataclass(frozen=True, eq=False)
class LightProbe:
    """Radiance from all directions but the sun, and the sun as the main light."""

    coefficients: Floats
    """(9, 3) of linear Rec.709 radiance of the functions 1, y, z, x, xy, yz, 3z² - 1, xz and x² - y²."""
    main_light: MainLight
    """The sun."""

    def to_dict(self) -> Json:
        """Return it as `light_probe` of a JSON record."""
        return {"coefficients": [round_all(row) for row in self.coefficients], "main_light": self.main_light.to_dict()}


describe_fields(SunCandidate, Lighting, MainLight, LightProbe)


def _is_within(value: object, low: float, high: float) -> bool:
    """Whether a value is a plain number of a range; of any other, `check_range` says what is wrong, if anything."""
    return type(value) in (float, int) and low <= value <= high  # type: ignore[operator]


def _are_within(values: object, low: float, high: float) -> bool:
    """Whether values are a tuple of plain numbers of a range."""
    return type(values) is tuple and all(_is_within(value, low, high) for value in values)


def _check_sky_model(field: str, name: object) -> None:
    if not isinstance(name, str) or name not in SKY_MODELS:
        predicate = f"is {reprlib.repr(name)}; the known ones are {format_sky_models()}."
        raise ParameterError.about(field, predicate, ErrorCode.UNKNOWN)


def _check_time(utc_time: object, source: object) -> None:
    if utc_time is not None and not (isinstance(utc_time, datetime) and utc_time.tzinfo is not None):
        raise ParameterError.wrong_type("utc_time", "a time with its offset from UTC", utc_time)
    if not isinstance(source, str | None):
        raise ParameterError.wrong_type("time_source", "a text", source)


def _read_candidates(values: object) -> tuple[SunCandidate, ...]:
    """Candidates, also as objects of JSON."""
    try:
        assert isinstance(values, list | tuple)
        return tuple(sun if isinstance(sun, SunCandidate) else SunCandidate(**sun) for sun in values)
    except (AssertionError, TypeError) as error:
        predicate = "must be a list of suns, each with azimuth, elevation and probability."
        raise ParameterError.about("sun_candidates", predicate, ErrorCode.WRONG_TYPE) from error


def _texts(name: str, values: object) -> tuple[str, ...]:
    if not isinstance(values, list | tuple) or not all(isinstance(value, str) for value in values):
        raise ParameterError.wrong_type(name, "a list of texts", values)
    return tuple(values)


def _evidence_kind(word: str) -> str:
    """The plain text of a kind of evidence; ParameterError for another word."""
    if word not in tuple(EvidenceKind):
        known = ", ".join(map(repr, map(str, EvidenceKind)))
        predicate = f"has an unknown word {reprlib.repr(str(word))}; it may hold {known}."
        raise ParameterError.about("evidence", predicate, ErrorCode.UNKNOWN)
    return str(word)

"""UserInput: time, location, heading and lens that the user states of a photo."""

import math
import reprlib
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from datetime import datetime

import numpy as np

import lighting.fusion.marks as marks
from lighting.errors import ErrorCode, ParameterError, warn_of_old_name
from lighting.fields import OPTIONAL_RANGES, RANGES, check_location, check_range, convert_numpy_numbers, describe_fields
from lighting.fusion.marks import DrawnCamera, KnownCamera, LevelLines, Line, Reference, ShadowMark
from lighting.photo.timestamps import UTC_OFFSET_RANGE, YEAR_RANGE, parse_time, parse_utc_offset

_RANGES = {"utc_offset": UTC_OFFSET_RANGE, "heading": (-360.0, 360.0), "vertical_fov": RANGES["vertical_fov"]}
_RANGES |= {"camera_height": RANGES["camera_height"], **{n: OPTIONAL_RANGES[n] for n in ("latitude", "longitude")}}

DRAWN_FIELDS = ("shadows", "horizon", "verticals", "reference", "camera", "spot")  # of UserInput, in one photo alone


@dataclass(frozen=True, init=False)
class UserInput:
    """What the user states of a photo; it replaces what the photo's metadata say. None: not stated."""

    metadata: bool = True
    """Whether the photo's own metadata count."""
    time: datetime | None = None
    """When the photo was taken, with its offset from UTC, or local."""
    utc_offset: float | None = None
    """Hours, -12 to 14, positive east, of a local time: the photo's or `time`."""
    latitude: float | None = field(default=None, repr=False)
    """Deg, -90 to 90, positive north."""
    longitude: float | None = field(default=None, repr=False)
    """Deg, -180 to 180, positive east."""
    heading: float | None = None
    """Deg, -360 to 360, clockwise from true north: where the camera points."""
    vertical_fov: float | None = None
    """Deg, 1 to 170: vertical field of view of the upright photo."""
    camera_height: float | None = None
    """Meters above the ground, 0.1 to 20,000."""
    keep_location: bool = False
    """Whether the answer may hold latitude and longitude."""
    shadows: tuple[ShadowMark, ...] = ()
    """What the user marked in the photo, in pixels of the upright picture."""
    horizon: Line | None = None
    """Two points of the horizon: x, y, x, y in pixels of the upright picture."""
    verticals: tuple[Line | LevelLines, ...] = ()
    """Edges that stand upright in the world, each x, y, x, y in pixels as `horizon`; and level ones."""
    reference: Reference | None = None
    """A thing of known size, which gives the camera's height."""
    camera: KnownCamera | None = None
    """The camera that another program has found, such as fSpy."""
    spot: tuple[float, float] | None = None
    """(x, y) in pixels of the upright picture: where an object stands. None: where the photo shows room."""

    def __init__(
        self,
        *,
        metadata: bool = True,
        time: datetime | str | None = None,
        utc_offset: float | str | None = None,
        latitude: float | None = None,
        longitude: float | None = None,
        heading: float | None = None,
        vertical_fov: float | None = None,
        camera_height: float | None = None,
        keep_location: bool = False,
        shadows: Sequence[ShadowMark | str] = (),
        horizon: Line | str | None = None,
        verticals: Sequence[Line | LevelLines | str] = (),
        reference: Reference | str | None = None,
        camera: KnownCamera | None = None,
        spot: tuple[float, float] | str | None = None,
        lat: float | None = None,
        lon: float | None = None,
        fov: float | None = None,
        use_exif: bool | None = None,
    ) -> None:
        """State what is known; the names are those of the command line and of HTTP.

        Args:
            metadata: whether the photo's own metadata count.
            time: when it was taken, also as a text such as "2024-06-01T14:30+02:00".
            utc_offset: h, -12 to 14, positive east, also as a text such as "+02:00".
            latitude: deg, -90 to 90, positive north.
            longitude: deg, -180 to 180, positive east.
            heading: deg, -360 to 360, clockwise from true north.
            vertical_fov: deg, 1 to 170, of the upright photo.
            camera_height: m above the ground, 0.1 to 20,000.
            keep_location: whether the answer may hold latitude and longitude.
            shadows: Shadow, OwnShadow, ShadowLine and LitSide of `lighting.fusion.marks`, also as texts such as
                "310,820,455,790"; see `read_shadow`.
            horizon: x, y, x, y of two points of the horizon in pixels of the upright picture, also as a text.
            verticals: lines along edges that stand upright in the world, as `horizon`; and LevelLines of
                `lighting.fusion.marks`, also as texts, see `read_edge`.
            reference: a thing of known size, also as a text such as "310,820,305,400,1.8"; see `read_reference` of
                `lighting.fusion.marks`.
            camera: that another program has found, such as `read_fspy` of `lighting.fusion.fspy` reads.
            spot: x and y of where an object stands on the ground, in pixels of the upright picture, also as a text.
            lat: short for `latitude`.
            lon: short for `longitude`.
            fov: short for `vertical_fov`.
            use_exif: the old name of `metadata`; warns of it.

        Raises:
            ParameterError: a value is out of range, or values contradict each other.
        """
        if use_exif is not None:
            warn_of_old_name("lighting.UserInput.use_exif")
            metadata = use_exif
        values: dict[str, object] = {
            "metadata": metadata,
            "time": parse_time(time) if isinstance(time, str) else time,
            "utc_offset": parse_utc_offset(utc_offset) if isinstance(utc_offset, str) else utc_offset,
            "latitude": _stated_once("latitude", latitude, lat),
            "longitude": _stated_once("longitude", longitude, lon),
            "heading": heading,
            "vertical_fov": _stated_once("vertical_fov", vertical_fov, fov),
            "camera_height": camera_height,
            "keep_location": keep_location,
            "shadows": tuple(marks.read_shadow(mark) if isinstance(mark, str) else mark for mark in shadows),
            "horizon": marks.read_line(horizon, "horizon") if isinstance(horizon, str) else horizon,
            "verticals": tuple(marks.read_edge(edge) if isinstance(edge, str) else edge for edge in verticals),
            "reference": marks.read_reference(reference) if isinstance(reference, str) else reference,
            "camera": camera,
            "spot": marks.read_spot(spot) if isinstance(spot, str) else spot,
        }
        for name, value in values.items():
            object.__setattr__(self, name, value)
        self._check()

    @property
    def use_exif(self) -> bool:
        """The old name of `metadata`; warns of it."""
        warn_of_old_name("lighting.UserInput.use_exif")
        return self.metadata

    def _check(self) -> None:
        for name in ("metadata", "keep_location"):
            if not isinstance(getattr(self, name), bool):
                raise ParameterError.wrong_type(name, "True or False", getattr(self, name))
        if stated := [name for name in _RANGES if getattr(self, name) is not None]:
            convert_numpy_numbers(self, *stated)
            for name in stated:
                check_range(name, getattr(self, name), *_RANGES[name])
            check_location(self.latitude, self.longitude)
        if self.shadows:
            marks.check_marks(self.shadows)
        if self.spot is not None:
            marks.check_spot(self.spot)
        self._check_camera()
        self._check_time()

    @property
    def drawn_fields(self) -> tuple[str, ...]:
        """The stated fields that are of one photo alone, for they are drawn in it."""
        return tuple(n for n in DRAWN_FIELDS if getattr(self, n) not in (None, ()))

    @property
    def drawn_camera(self) -> DrawnCamera | None:
        """What the user states of the camera in the photo; None: nothing."""
        if self.camera is None and self.horizon is None and not self.verticals:
            return None
        levels = tuple(edge for edge in self.verticals if isinstance(edge, LevelLines))
        upright = tuple(edge for edge in self.verticals if not isinstance(edge, LevelLines))
        return DrawnCamera(self.horizon, upright, levels, self.camera)

    def _check_camera(self) -> None:
        if self.horizon is not None:
            marks.check_line(self.horizon, "horizon")
        for edge in self.verticals:
            marks.check_edge(edge)
        if self.reference is not None:
            marks.check_reference(self.reference)
            if self.camera_height is not None:
                sentence = "A thing of known size gives the camera's height; leave out one of both."
                raise ParameterError(sentence, "reference", ErrorCode.CONTRADICTION)
        if self.camera is None:
            return
        if not isinstance(self.camera, KnownCamera):
            sentence = f"A camera is a KnownCamera, not {type(self.camera).__name__}."
            raise ParameterError(sentence, "camera", ErrorCode.WRONG_TYPE)
        for name, field_name in (("elevation", "camera_elevation"), ("roll", "camera_roll"), ("vertical_fov",) * 2):
            check_range("camera", getattr(self.camera, name), *RANGES[field_name])
        if self.horizon is not None or self.verticals or self.vertical_fov is not None:
            sentence = "A camera is known, so horizon, upright lines and field of view are, too; leave them out."
            raise ParameterError(sentence, "camera", ErrorCode.CONTRADICTION)

    def explicit_fields(self) -> dict[str, object]:
        """The fields that the user stated, by name."""
        return {f.name: value for f in fields(self) if (value := getattr(self, f.name)) != f.default}

    def _check_time(self) -> None:
        if not isinstance(self.time, datetime | None):
            raise ParameterError.wrong_type("time", "a datetime or a text such as 2024-06-01T14:30", self.time)
        if self.time is not None and not YEAR_RANGE[0] <= self.time.year <= YEAR_RANGE[1]:
            sentence = f"The time must lie in the years {YEAR_RANGE[0]} to {YEAR_RANGE[1]}."
            raise ParameterError(sentence, "time", ErrorCode.OUT_OF_RANGE)
        if self.time is not None and self.time.tzinfo is not None and self.utc_offset is not None:
            sentence = "The time already has its offset from UTC; another one contradicts it."
            raise ParameterError(sentence, "utc_offset", ErrorCode.CONTRADICTION)
        if not self.metadata and self.time is None and self.utc_offset is not None:
            raise ParameterError("An offset from UTC needs a time.", "time", ErrorCode.MISSING)
        if not self.metadata and (self.time is None) != (self.latitude is None):
            missing = "time" if self.time is None else "latitude"
            raise ParameterError("A time needs a place, and a place a time.", missing, ErrorCode.MISSING)


def _stated_once(name: str, value: float | None, short: float | None) -> float | None:
    """The value of a field that has a short form."""
    if value is not None and short is not None:
        raise ParameterError.about(name, "is given twice, once in its short form; give it once.", ErrorCode.DUPLICATE)
    return short if value is None else value


NO_USER_INPUT = UserInput()
describe_fields(UserInput)


def check_user_input(value: object) -> None:
    """Raise ParameterError for what is no UserInput.

    Args:
        value: what a caller passed.
    """
    if not isinstance(value, UserInput):
        sentence = f"What is known of a photo is a UserInput, not {type(value).__name__}."
        raise ParameterError(sentence, code=ErrorCode.WRONG_TYPE)


def check_headings(photos: int, headings: Sequence[float] | None, heading: float | None = None) -> None:
    """Raise ParameterError unless there is one heading for each of several photos, or none at all.

    Args:
        photos: how many there are.
        headings: deg, finite numbers; None where they are not stated.
        heading: deg, that of one photo; None where it is not stated.
    """
    if not isinstance(headings, Sequence | np.ndarray | None):
        sentence = f"headings are a list of degrees, not {reprlib.repr(headings)}."
        raise ParameterError(sentence, "headings", ErrorCode.WRONG_TYPE)
    if headings is not None:
        if photos == 1 or len(headings) != photos:
            one = "headings are those of several photos; one photo has a heading."
            sentence = one if photos == 1 else f"{photos} photos need {photos} headings, not {len(headings)}."
            raise ParameterError(sentence, "headings", ErrorCode.CONTRADICTION)
        for angle in headings:
            degrees = angle.item() if isinstance(angle, np.generic) else angle
            check_range("headings", degrees, -math.inf, math.inf, "A heading")
    if heading is not None and photos > 1:
        sentence = "heading is that of one photo; photos taken together have headings."
        raise ParameterError(sentence, "heading", ErrorCode.CONTRADICTION)


def read_headings(text: str) -> list[float]:
    """Degrees in "0,45,90", as `Estimator.estimate_views` takes them.

    Args:
        text: degrees, -360 to 360, separated by commas.

    Raises:
        ParameterError: for any other text.
    """
    try:
        headings = [float(part) for part in text.split(",")]
    except ValueError as error:
        sentence = f"{text!r} is not a list of degrees such as 0,45,90."
        raise ParameterError(sentence, "headings", ErrorCode.MALFORMED) from error
    for angle in headings:
        check_range("headings", angle, -360.0, 360.0, "A heading")
    return headings

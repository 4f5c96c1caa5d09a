"""UserInput: time, location, heading and lens that the user states of a photo."""

import math
import reprlib
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from datetime import datetime

import numpy as np

from lighting.errors import ErrorCode, ParameterError
from lighting.photo.clock import UTC_OFFSET_RANGE, YEAR_RANGE
from lighting.validation import OPTIONAL_RANGES, RANGES, check_location, check_range, convert_numpy_numbers

_RANGES = {"utc_offset": UTC_OFFSET_RANGE, "heading": (-360.0, 360.0), "vertical_fov": RANGES["vertical_fov"]}
_RANGES["camera_height"] = RANGES["camera_height"]
_RANGES |= {name: OPTIONAL_RANGES[name] for name in ("latitude", "longitude")}


@dataclass(frozen=True)
class UserInput:
    """What the user states of a photo; it replaces what the photo's metadata say. None: not stated.

    Raises ParameterError for values out of range and for values that contradict each other.
    """

    use_exif: bool = True  # whether the photo's own metadata count
    time: datetime | None = None  # aware, or local
    utc_offset: float | None = None  # h, positive east, of a local time: the photo's or `time`
    latitude: float | None = field(default=None, repr=False)  # deg, positive north, -90 to 90
    longitude: float | None = field(default=None, repr=False)  # deg, positive east, -180 to 180
    heading: float | None = None  # deg clockwise from true north, -360 to 360
    vertical_fov: float | None = None  # deg, of the upright photo
    camera_height: float | None = None  # m above the ground, 0.1 to 20,000
    keep_location: bool = False  # whether the answer may hold latitude and longitude

    def __post_init__(self) -> None:
        for name in ("use_exif", "keep_location"):
            if not isinstance(getattr(self, name), bool):
                predicate = f"must be True or False, not {reprlib.repr(getattr(self, name))}."
                raise ParameterError.about(name, predicate, ErrorCode.WRONG_TYPE)
        convert_numpy_numbers(self, *_RANGES)
        for name, (low, high) in _RANGES.items():
            if (value := getattr(self, name)) is not None:
                check_range(name, value, low, high)
        check_location(self.latitude, self.longitude)
        self._check_time()

    def explicit_fields(self) -> dict[str, object]:
        """The fields that the user stated, by name."""
        return {f.name: value for f in fields(self) if (value := getattr(self, f.name)) != f.default}

    def _check_time(self) -> None:
        if not isinstance(self.time, datetime | None):
            kind = reprlib.repr(self.time)
            predicate = f"must be a datetime, not {kind}; lighting.photo.clock.parse_time makes one of a text."
            raise ParameterError.about("time", predicate, ErrorCode.WRONG_TYPE)
        if self.time is not None and not YEAR_RANGE[0] <= self.time.year <= YEAR_RANGE[1]:
            sentence = f"The time must lie in the years {YEAR_RANGE[0]} to {YEAR_RANGE[1]}."
            raise ParameterError(sentence, "time", ErrorCode.OUT_OF_RANGE)
        if self.time is not None and self.time.tzinfo is not None and self.utc_offset is not None:
            sentence = "The time already has its offset from UTC; another one contradicts it."
            raise ParameterError(sentence, "utc_offset", ErrorCode.CONTRADICTION)
        if not self.use_exif and self.time is None and self.utc_offset is not None:
            raise ParameterError("An offset from UTC needs a time.", "time", ErrorCode.MISSING)
        if not self.use_exif and (self.time is None) != (self.latitude is None):
            missing = "time" if self.time is None else "latitude"
            raise ParameterError("A time needs a place, and a place a time.", missing, ErrorCode.MISSING)


NO_USER_INPUT = UserInput()


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
        _check_each_heading(photos, headings)
    if heading is not None and photos > 1:
        sentence = "heading is that of one photo; photos taken together have headings."
        raise ParameterError(sentence, "heading", ErrorCode.CONTRADICTION)


def _check_each_heading(photos: int, headings: Sequence[float]) -> None:
    if photos == 1:
        sentence = "headings are those of several photos; one photo has a heading."
        raise ParameterError(sentence, "headings", ErrorCode.CONTRADICTION)
    if len(headings) != photos:
        sentence = f"{photos} photos need {photos} headings, not {len(headings)}."
        raise ParameterError(sentence, "headings", ErrorCode.CONTRADICTION)
    for angle in headings:
        degrees = angle.item() if isinstance(angle, np.generic) else angle
        check_range("headings", degrees, -math.inf, math.inf, "A heading")


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

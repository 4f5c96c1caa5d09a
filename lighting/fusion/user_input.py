"""What the user says about a photo."""

import reprlib
from dataclasses import dataclass, field, fields
from datetime import datetime
from typing import Any

from lighting.errors import ErrorCode, ParameterError
from lighting.photo.metadata import UTC_OFFSET_RANGE, YEAR_RANGE
from lighting.validation import OPTIONAL_RANGES, RANGES, check_place, check_range, plain_numbers


@dataclass(frozen=True)
class UserInput:
    """What the user says about a photo; it replaces what the photo's metadata say. None is not given.

    Raises ParameterError for values out of range and for values that contradict each other.
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
        for name in ("use_exif", "keep_location"):
            if not isinstance(getattr(self, name), bool):
                predicate = f"must be True or False, not {reprlib.repr(getattr(self, name))}."
                raise ParameterError.about(name, predicate, ErrorCode.WRONG_TYPE)
        plain_numbers(self, "utc_offset", "latitude", "longitude", "heading", "vertical_fov")
        ranges = {"utc_offset": UTC_OFFSET_RANGE, "heading": (-360.0, 360.0), "vertical_fov": RANGES["vertical_fov"]}
        for name, (low, high) in {**ranges, **{key: OPTIONAL_RANGES[key] for key in ("latitude", "longitude")}}.items():
            if (value := getattr(self, name)) is not None:
                check_range(name, value, low, high)
        check_place(self.latitude, self.longitude)
        self._check_time()

    def explicit_fields(self) -> dict[str, Any]:
        """The fields that the user gave, by name."""
        return {f.name: value for f in fields(self) if (value := getattr(self, f.name)) != f.default}

    def _check_time(self) -> None:
        if not isinstance(self.time, datetime | None):
            kind = reprlib.repr(self.time)
            predicate = f"must be a datetime, not {kind}; lighting.photo.metadata.parse_time makes one of a text."
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


def check_user_input(thing: object) -> None:
    """Raise ParameterError for what is no UserInput."""
    if not isinstance(thing, UserInput):
        sentence = f"What is known of a photo is a UserInput, not {type(thing).__name__}."
        raise ParameterError(sentence, code=ErrorCode.WRONG_TYPE)


NO_USER_INPUT = UserInput()

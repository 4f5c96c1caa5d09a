"""The types of parameters and of record fields, each with unit, range and example in the OpenAPI document."""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    ValidationError,
    WithJsonSchema,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError, PydanticKnownError, core_schema

from lighting.errors import ErrorCode, ParameterError
from lighting.fields import COLOR_RANGES, OPTIONAL_RANGES, RANGES, parameter_name
from lighting.fusion.user_input import read_headings
from lighting.map_options import Adjustments, Names, OptionText, names_in, parse_sun
from lighting.photo.timestamps import parse_time, parse_utc_offset
from lighting.records import GROUND_ALBEDO

_MAX_SERVED_HEIGHT = 2048  # rows; rendering that many takes about 0.5 GB


class NotNull:
    """A parameter that may be left out is never null, even where its type in Python is optional."""

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        plain = handler(schema)
        return {**plain.pop("anyOf", [{}])[0], **plain}


class RegistryName:
    """A name in a registry, which is read late, so that entries added after import count."""

    def __init__(self, registry: Names) -> None:
        self.registry = registry

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_after_validator_function(self._check, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {**handler(schema), "enum": list(names_in(self.registry))}

    def _check(self, name: str) -> str:
        if name in (names := names_in(self.registry)):
            return name
        *others, last = map(repr, names)
        raise PydanticKnownError("literal_error", {"expected": f"{', '.join(others)} or {last}"})


class InRange(NotNull):
    """A number in [low, high]; the error for any other value states that range."""

    def __init__(self, low: float, high: float, **documented: Any) -> None:
        self.limits = {"minimum": low, "maximum": high}  # also members of the error
        self.documented = documented

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.no_info_wrap_validator_function(self._check, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        return {**super().__get_pydantic_json_schema__(schema, handler), **self.limits, **self.documented}

    def _check(self, value: Any, parse: Callable[[Any], float]) -> float:
        try:
            number = parse(value)
        except ValidationError:
            number = float("nan")
        if self.limits["minimum"] <= number <= self.limits["maximum"]:
            return number
        low, high = self.limits.values()
        context = {**self.limits, "code": ErrorCode.OUT_OF_RANGE.value}
        raise PydanticCustomError("range", f"must be a number from {low:g} to {high:g}", context)


def parameter_range(name: str, meaning: str, example: float) -> InRange:
    """The range of a parameter, with its documentation.

    Args:
        name: a key of RANGES or OPTIONAL_RANGES.
        meaning: the description, with the unit.
        example: a value in the range.
    """
    return InRange(*(RANGES | OPTIONAL_RANGES)[name], description=meaning, examples=[example])


def field_error(field: str | None, reason: str, code: ErrorCode = ErrorCode.CONTRADICTION) -> PydanticCustomError:
    """An error that names its field, as a check of several fields together must.

    Args:
        field: the parameter at fault; None lets pydantic name it.
        reason: a sentence for people.
        code: the same for programs.
    """
    context = {"reason": reason, "code": code.value} | ({"field": field} if field else {})
    return PydanticCustomError("parameter", "{reason}", context)


@contextmanager
def field_errors() -> Iterator[None]:
    """Let a ParameterError of the block, or of a decorated function, become the error of a field."""
    try:
        yield
    except ParameterError as error:
        renamed = error.renamed(parameter_name)
        raise field_error(renamed.field, str(renamed), renamed.code) from error


def _check_even(number: int) -> int:
    if number % 2:
        raise field_error(None, "must be an even number", ErrorCode.OUT_OF_RANGE)
    return number


def _parse_flag(value: object) -> object:
    """Accept only `true` and `false`, as the OpenAPI document says."""
    if isinstance(value, str):
        if value not in ("true", "false"):
            raise PydanticCustomError("flag", "must be true or false")
        return value == "true"
    return value


@field_errors()
def _parse_sun_or_flag(value: object) -> object:
    """Accept `true`, `false` and a direction such as 40,25, which comes as a list of one text, or of two."""
    text = ",".join(map(str, value)) if isinstance(value, list) else value
    if not isinstance(text, str) or text in ("true", "false"):
        return _parse_flag(text)
    if "," not in text:
        raise PydanticCustomError("flag", "must be true, false, or AZIMUTH,ELEVATION in degrees such as 40,25")
    sun = parse_sun(text)
    Adjustments(sun=sun)  # which checks its range
    return sun


Flag = Annotated[bool, BeforeValidator(_parse_flag)]
FlagOrAuto = Annotated[bool | None, BeforeValidator(_parse_flag), NotNull()]
SunOrFlag = Annotated[
    tuple[float, float] | bool | None,
    BeforeValidator(_parse_sun_or_flag),
    WithJsonSchema(
        {"type": "string", "pattern": r"^(true|false|-?[0-9.]+,-?[0-9.]+)$", "examples": ["40,25", "false"]}
    ),
]


def option_parameter(text: OptionText, default: object) -> tuple[Any, Any]:
    """The type and the default of the parameter that is an option of the library.

    Args:
        text: what people read of the option.
        default: its value unless stated.
    """
    field: Any = Field(default, description=str(text.help))
    if text.choices is not None:
        kind: Any = Annotated[str, RegistryName(text.choices)]
        return (Annotated[kind | None, NotNull()] if default is None else kind), field
    if text.range is None:
        return Flag, field
    low, high = text.range
    if isinstance(default, int) and not isinstance(default, bool):
        limited = InRange(low, min(high, _MAX_SERVED_HEIGHT), multipleOf=2, description=str(text.help))
        return Annotated[int, limited, AfterValidator(_check_even)], default
    limited = InRange(low, high, description=str(text.help), examples=[text.example])
    return (Annotated[float | None, limited] if default is None else Annotated[float, limited]), default


SunAzimuth = Annotated[
    float, parameter_range("sun_azimuth", "deg, 0 = where the camera points, positive to the right", -41.2)
]
SunElevation = Annotated[float, parameter_range("sun_elevation", "deg above the horizon", 33.0)]
Turbidity = Annotated[float, parameter_range("turbidity", "Linke turbidity: 2 is very clear, 10 is hazy", 3.4)]
Exposure = Annotated[float, parameter_range("exposure", "factor from sky radiance to the photo's linear values", 5.0)]
CameraElevation = Annotated[float, parameter_range("camera_elevation", "deg, positive looks up", 4.1)]
CameraRoll = Annotated[float, parameter_range("camera_roll", "deg, positive turns the camera clockwise", -0.6)]
GroundAlbedo = Annotated[float, parameter_range("ground_albedo", "of the ground that the sky lights", GROUND_ALBEDO)]
VerticalFov = Annotated[float, parameter_range("vertical_fov", "deg, vertical field of view", 48.7)]
SkyCover = Annotated[float, parameter_range("sky_cover", "0 clear, 1 overcast; needs both irradiances", 0.2)]
Irradiance = Annotated[float, InRange(*COLOR_RANGES["sky_irradiance"])]
Reflectance = Annotated[float, InRange(*COLOR_RANGES["ground_color"])]
SUN_IRRADIANCE = "red, green, blue of a surface that faces the sun, in the photo's linear units"
SKY_IRRADIANCE = "red, green, blue of open level ground by the sky without the sun, in the photo's linear units"
GROUND_COLOR = "red, green, blue: the ground's reflectance; unknown, `ground_albedo` counts, or 0.12 with irradiances"

# Parameters that come as text: how each is read, and its pattern in the OpenAPI document.

_DATE = r"[0-9]{4}-[01][0-9]-[0-3][0-9]"
_CLOCK = r"[0-2][0-9]:[0-5][0-9](:[0-5][0-9])?"
_OFFSET = r"[0-1][0-9]:[0-5][0-9]"


@field_errors()
def _parse_time(text: str) -> datetime:
    """Read a time; the plus sign of its offset may have become a space in the URL."""
    return parse_time(re.sub(r"(T\S+) (\d\d:?\d\d)$", r"\1+\2", text.strip()))


@field_errors()
def _check_headings(text: str) -> str:
    """Check the text and return it: pydantic would read a list from repeated parameters."""
    read_headings(text)
    return text


def _text_schema(pattern: str, example: str) -> WithJsonSchema:
    return WithJsonSchema({"type": "string", "pattern": f"^{pattern}$", "examples": [example]})


Time = Annotated[
    datetime | None,
    BeforeValidator(_parse_time),
    _text_schema(rf"{_DATE}T{_CLOCK}(Z|[+-]{_OFFSET})?", "2024-06-01T08:53"),
]
Offset = Annotated[
    float | None,
    BeforeValidator(field_errors()(parse_utc_offset)),
    _text_schema(rf"([+-]?{_OFFSET}|[+-]?1?[0-9]([.][0-9]+)?|Z)", "+02:00"),
]
Headings = Annotated[
    str | None,
    BeforeValidator(_check_headings),
    _text_schema(r"-?[0-9]{1,3}([.][0-9]+)?(,-?[0-9]{1,3}([.][0-9]+)?)*", "0,45,90"),
]


@field_errors()
def _split_triple(text: Any) -> list[str] | None:
    """Split "0.9,0.8,0.7", which comes as a list of one text, or of three."""
    if text is None:
        return None
    joined = text if isinstance(text, str) else ",".join(map(str, text))
    numbers = joined.split(",")
    if len(numbers) != 3:
        raise ParameterError(f"{joined!r} is not three numbers such as 0.9,0.8,0.7.", code=ErrorCode.MALFORMED)
    return numbers


_NUMBER = r"[0-9]+([.][0-9]+)?(e[+-]?[0-9]+)?"
_AS_TEXT = (
    BeforeValidator(_split_triple),
    _text_schema(f"{_NUMBER},{_NUMBER},{_NUMBER}", "0.9,0.8,0.7"),
)
Irradiances = Annotated[tuple[Irradiance, Irradiance, Irradiance] | None, *_AS_TEXT]
Reflectances = Annotated[tuple[Reflectance, Reflectance, Reflectance] | None, *_AS_TEXT]

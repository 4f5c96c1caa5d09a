"""Parameters that come as texts: how each is read, and its pattern in the OpenAPI document."""

import re
from collections.abc import Callable
from datetime import datetime
from typing import Annotated, Any

from pydantic import BeforeValidator, WithJsonSchema
from pydantic_core import PydanticCustomError

from lighting.errors import ErrorCode, ParameterError
from lighting.evidence import read_headings
from lighting.photo import read_offset, read_time
from lighting.ranges import parameter_name
from server.values import Irradiance, Reflectance

_DATE, _CLOCK, _OFFSET = (
    r"[0-9]{4}-[01][0-9]-[0-3][0-9]",
    r"[0-2][0-9]:[0-5][0-9](:[0-5][0-9])?",
    r"[0-1][0-9]:[0-5][0-9]",
)


def misfit(field: str | None, reason: str, code: ErrorCode = ErrorCode.CONTRADICTION) -> PydanticCustomError:
    """An error that names the field at fault itself, as a check of several fields together must."""
    context = {"reason": reason, "code": code.value} | ({"field": field} if field else {})
    return PydanticCustomError("parameter", "{reason}", context)


def in_words(read: Callable[[str], Any]) -> Callable[[str], Any]:
    """The reader, with its ParameterError turned into the error of a field."""

    def parsed(text: str) -> Any:
        try:
            return read(text)
        except ParameterError as error:
            named = error.renamed(parameter_name)
            raise misfit(named.field, str(named), named.code) from error

    return parsed


def _time(text: str) -> datetime:
    """Read a time; the plus sign of its offset may have become a space in the URL."""
    return read_time(re.sub(r"(T\S+) (\d\d:?\d\d)$", r"\1+\2", text.strip()))


def _headings(text: str) -> str:
    """Check the text and return it: pydantic would read a list from repeated parameters."""
    read_headings(text)
    return text


def _text(pattern: str, example: str) -> WithJsonSchema:
    return WithJsonSchema({"type": "string", "pattern": f"^{pattern}$", "examples": [example]})


Time = Annotated[
    datetime | None,
    BeforeValidator(in_words(_time)),
    _text(rf"{_DATE}T{_CLOCK}(Z|[+-]{_OFFSET})?", "2024-06-01T08:53"),
]
Offset = Annotated[
    float | None,
    BeforeValidator(in_words(read_offset)),
    _text(rf"([+-]?{_OFFSET}|[+-]?1?[0-9]([.][0-9]+)?|Z)", "+02:00"),
]
Headings = Annotated[
    str | None,
    BeforeValidator(in_words(_headings)),
    _text(r"-?[0-9]{1,3}([.][0-9]+)?(,-?[0-9]{1,3}([.][0-9]+)?)*", "0,45,90"),
]


def _triple(text: Any) -> list[str] | None:
    """Split "0.9,0.8,0.7", which comes as a list of one text, or of three."""
    if text is None:
        return None
    joined = text if isinstance(text, str) else ",".join(map(str, text))
    numbers = joined.split(",")
    if len(numbers) != 3:
        raise ParameterError(f"{joined!r} is not three numbers such as 0.9,0.8,0.7.", code=ErrorCode.MALFORMED)
    return numbers


_NUMBER = r"[0-9]+([.][0-9]+)?(e[+-]?[0-9]+)?"
_AS_TEXT = (BeforeValidator(in_words(_triple)), _text(f"{_NUMBER},{_NUMBER},{_NUMBER}", "0.9,0.8,0.7"))
Irradiances = Annotated[tuple[Irradiance, Irradiance, Irradiance] | None, *_AS_TEXT]
Reflectances = Annotated[tuple[Reflectance, Reflectance, Reflectance] | None, *_AS_TEXT]

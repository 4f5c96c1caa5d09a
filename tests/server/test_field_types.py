"""Ranges and flags as pydantic checks them."""

from typing import Annotated

import pytest
from pydantic import TypeAdapter, ValidationError

from server.field_types import Flag, Height, InRange, SunElevation


@pytest.mark.parametrize("value", [-1, 91, "nan", "high", None])
def test_a_number_out_of_its_range_is_refused_with_the_range(value: object) -> None:
    with pytest.raises(ValidationError) as caught:
        TypeAdapter(SunElevation).validate_python(value)
    (error,) = caught.value.errors()
    assert error["ctx"] == {"minimum": 0.0, "maximum": 90.0}
    assert error["msg"] == "must be a number from 0 to 90"


def test_the_range_is_in_the_document() -> None:
    schema = TypeAdapter(Annotated[float | None, InRange(1, 2, description="any")]).json_schema()
    assert schema == {"type": "number", "minimum": 1, "maximum": 2, "description": "any"}


@pytest.mark.parametrize("value", [15, 17, 2050])
def test_a_height_is_even_and_in_its_range(value: int) -> None:
    assert TypeAdapter(Height).validate_python(512) == 512
    with pytest.raises(ValidationError):
        TypeAdapter(Height).validate_python(value)


@pytest.mark.parametrize("text", ["True", "1", "yes", ""])
def test_a_flag_is_true_or_false_alone(text: str) -> None:
    assert TypeAdapter(Flag).validate_python("true") is True
    assert TypeAdapter(Flag).validate_python("false") is False
    with pytest.raises(ValidationError, match="must be true or false"):
        TypeAdapter(Flag).validate_python(text)

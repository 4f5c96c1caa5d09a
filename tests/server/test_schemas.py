"""Records, and the types of their fields and of parameters, as pydantic checks them."""

from typing import Annotated, Any

import pytest
from pydantic import TypeAdapter, ValidationError

from lighting.map_options import MapOptions, option_texts
from lighting.records import Lighting
from server.field_types import Flag, InRange, SunElevation, option_parameter
from server.schemas import LightingRecord

RECORD: dict[str, Any] = {
    "sun": {"azimuth": -41.2, "elevation": 33.0, "visibility": 0.9},
    "sky": {"turbidity": 3.4, "exposure": 0.021},
    "camera": {"elevation": 4.0, "heading": 90.0},
    "place": {"latitude": 48.0, "longitude": 11.5},
}


def test_a_record_becomes_the_librarys() -> None:
    lighting = LightingRecord.model_validate(RECORD).to_lighting()
    assert lighting == Lighting(
        -41.2, 33.0, 3.4, 0.021, sun_visibility=0.9, camera_elevation=4.0, camera_heading=90.0,
        latitude=48.0, longitude=11.5,
    )  # fmt: skip


def test_the_strength_of_the_light_becomes_the_librarys() -> None:
    strong = {
        **RECORD,
        "sun": {**RECORD["sun"], "irradiance": [1.9, 1.5, 0.9]},
        "sky": {**RECORD["sky"], "model": "cie-3", "irradiance": [0.4, 0.5, 0.8], "cover": 0.2},
        "ground": {"color": [0.12, 0.11, 0.1]},
        "suitable": 0.9,
    }
    lighting = LightingRecord.model_validate(strong).to_lighting()
    assert lighting.sun_irradiance == (1.9, 1.5, 0.9)
    assert (lighting.sky_model, lighting.sky_cover, lighting.suitable) == ("cie-3", 0.2, 0.9)
    assert lighting.ground_color == (0.12, 0.11, 0.1)
    assert LightingRecord.model_validate(lighting.to_dict()).to_lighting() == lighting


def test_an_answers_record_comes_back_with_its_time_and_its_sky() -> None:
    time = {"utc": "2026-06-21T19:35:00Z", "utc_offset": 2.0, "source": "user"}
    sky = {**RECORD["sky"], "painted": "prague"}
    lighting = LightingRecord.model_validate({**RECORD, "time": time, "sky": sky}).to_lighting()
    assert lighting.map_sky == "prague"
    assert lighting.to_dict()["time"] == time
    assert lighting.to_dict()["sky"]["painted"] == "prague"


@pytest.mark.parametrize("irradiance", [[1.0, 2.0], [1.0, 2.0, -1.0], "white"])
def test_an_irradiance_is_three_numbers(irradiance: object) -> None:
    with pytest.raises(ValidationError):
        LightingRecord.model_validate({**RECORD, "sky": {**RECORD["sky"], "irradiance": irradiance}})


def test_computed_and_unknown_fields_of_a_record_are_ignored() -> None:
    derived = {**RECORD, "sun": {**RECORD["sun"], "direction": [9.0, 9.0, 9.0]}, "unknown": 1}
    assert LightingRecord.model_validate(derived).to_lighting() == LightingRecord.model_validate(RECORD).to_lighting()


@pytest.mark.parametrize("value", [-4.3, 91, "nan", "high", None])
def test_a_number_out_of_its_range_is_refused_with_the_range(value: object) -> None:
    with pytest.raises(ValidationError) as caught:
        TypeAdapter(SunElevation).validate_python(value)
    (error,) = caught.value.errors()
    assert error["ctx"] == {"minimum": -4.2, "maximum": 90.0, "code": "out-of-range"}
    assert error["msg"] == "must be a number from -4.2 to 90"


def test_the_range_is_in_the_document() -> None:
    schema = TypeAdapter(Annotated[float | None, InRange(1, 2, description="any")]).json_schema()
    assert schema == {"type": "number", "minimum": 1, "maximum": 2, "description": "any"}


@pytest.mark.parametrize("value", [15, 17, 2050])
def test_a_height_is_even_and_in_its_range(value: int) -> None:
    height, default = option_parameter(option_texts(MapOptions)["height"], MapOptions.height)
    assert TypeAdapter(height).validate_python(default) == 512
    with pytest.raises(ValidationError):
        TypeAdapter(height).validate_python(value)


@pytest.mark.parametrize("text", ["True", "1", "yes", ""])
def test_a_flag_is_true_or_false_alone(text: str) -> None:
    assert TypeAdapter(Flag).validate_python("true") is True
    assert TypeAdapter(Flag).validate_python("false") is False
    with pytest.raises(ValidationError, match="must be true or false"):
        TypeAdapter(Flag).validate_python(text)

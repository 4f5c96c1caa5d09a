"""Records as pydantic checks them."""

from typing import Any

import pytest
from pydantic import ValidationError

from lighting.records import Lighting
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


@pytest.mark.parametrize("irradiance", [[1.0, 2.0], [1.0, 2.0, -1.0], "white"])
def test_an_irradiance_is_three_numbers(irradiance: object) -> None:
    with pytest.raises(ValidationError):
        LightingRecord.model_validate({**RECORD, "sky": {**RECORD["sky"], "irradiance": irradiance}})


def test_computed_and_unknown_fields_of_a_record_are_ignored() -> None:
    derived = {**RECORD, "sun": {**RECORD["sun"], "direction": [9.0, 9.0, 9.0]}, "unknown": 1}
    assert LightingRecord.model_validate(derived).to_lighting() == LightingRecord.model_validate(RECORD).to_lighting()

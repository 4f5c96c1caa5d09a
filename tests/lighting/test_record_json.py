"""Lines of JSON that hold a photo's light."""

import json

import pytest

from lighting.errors import ParameterError
from lighting.record_json import json_line, record_with_coefficients, unwrap_record
from lighting.records import Lighting
from lighting.sky.clear_sky import sky_coefficients

LIGHT = Lighting(sun_azimuth=-41.2, sun_elevation=33.0, turbidity=3.4, exposure=0.02, ground_albedo=0.2)


def test_the_full_record_adds_the_sky_models_coefficients_and_changes_nothing_else() -> None:
    record = record_with_coefficients(LIGHT)
    coefficients = record["sky"].pop("coefficients")
    assert record == LIGHT.to_dict()
    assert coefficients == sky_coefficients(33.0, 3.4, 0.2)
    assert {name: len(row) for name, row in coefficients.items()} == {"r": 9, "g": 9, "b": 9, "radiance": 3}


def test_the_coefficients_follow_from_the_record_when_it_is_read_again() -> None:
    record = record_with_coefficients(LIGHT)
    record["sky"]["coefficients"] = {"r": []}
    assert record_with_coefficients(Lighting.from_dict(record)) == record_with_coefficients(LIGHT)


@pytest.mark.parametrize(("answer", "key"), [(LIGHT, "lighting"), ("The photo is empty.", "error")])
def test_a_line_holds_the_record_or_the_error(answer: Lighting | str, key: str) -> None:
    line = json_line("a\nb.jpg", answer)
    assert "\n" not in line
    assert json.loads(line) == {
        "file": "a\nb.jpg",
        key: answer if isinstance(answer, str) else record_with_coefficients(answer),
    }


@pytest.mark.parametrize("text", [json.dumps(record_with_coefficients(LIGHT)), json_line("a.jpg", LIGHT)])
def test_one_record_is_taken_bare_or_from_a_line(text: str) -> None:
    assert Lighting.from_dict(unwrap_record(json.loads(text))) == LIGHT


@pytest.mark.parametrize("field", ["error", "lightings"])
def test_an_error_and_several_records_are_not_one(field: str) -> None:
    with pytest.raises(ParameterError, match="The JSON holds") as caught:
        unwrap_record({field: "Gone."})
    assert caught.value.field == field

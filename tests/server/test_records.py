"""Lighting records that clients send."""

import json
from typing import Any

import pytest
from fastapi.exceptions import RequestValidationError

from lighting.files import full_record, json_line
from lighting.records import Lighting
from server.problems import ProblemError
from server.records import parse_record

LIGHT = Lighting(sun_azimuth=-41.2, sun_elevation=33.0, turbidity=3.4, exposure=0.02)


@pytest.mark.parametrize("text", [json.dumps(full_record(LIGHT)), json_line("photo.jpg", LIGHT)])
def test_a_record_is_read_bare_or_from_a_line_of_estimate(text: str) -> None:
    assert parse_record(text.encode()) == LIGHT


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
def test_a_record_is_read_as_editors_and_powershell_encode_it(encoding: str) -> None:
    assert parse_record(json.dumps(full_record(LIGHT)).encode(encoding)) == LIGHT


@pytest.mark.parametrize("data", [b"", b"{", b"\xff\xfe", b"\xff\xfe\x00\xd8", b'{"a": "\xff"}'])
def test_what_is_not_json_is_a_problem(data: bytes) -> None:
    with pytest.raises(ProblemError, match="not JSON"):
        parse_record(data)


@pytest.mark.parametrize("content", [{"lightings": [full_record(LIGHT)] * 2}, {"file": "x.jpg", "error": "Gone."}])
def test_an_answer_about_several_photos_and_an_error_are_no_record(content: dict[str, Any]) -> None:
    with pytest.raises(ProblemError) as caught:
        parse_record(json.dumps(content).encode())
    (error,) = caught.value.more["errors"]
    assert (error["field"], error["place"]) == (list(content)[-1], "body")


@pytest.mark.parametrize("record", [[], 7, {}, {"sun": {}}, {"lighting": None}])
def test_wrong_fields_are_named_below_the_body(record: Any) -> None:
    with pytest.raises(RequestValidationError) as caught:
        parse_record(json.dumps(record).encode())
    assert all(error["loc"][0] == "body" for error in caught.value.errors())


@pytest.mark.parametrize(
    ("text", "field"),
    [
        ('{"sun": {"azimuth": 1, "elevation": 2, "azimuth": 3}, "sky": {"turbidity": 3, "exposure": 4}}', "azimuth"),
        ('{"lighting": {}, "lighting": {}}', "lighting"),
    ],
)
def test_a_key_that_is_given_twice_is_refused_and_named(text: str, field: str) -> None:
    with pytest.raises(ProblemError, match=f"^{field}: The key '{field}' stands twice.$") as caught:
        parse_record(text.encode())
    (error,) = caught.value.more["errors"]
    assert (error["field"], error["place"]) == (field, "body")


def test_among_the_coefficients_unknown_ones_are_ignored_as_elsewhere() -> None:
    record = full_record(LIGHT)
    record["sky"]["coefficients"] |= {str(number): 1 for number in range(9000)}
    assert parse_record(json.dumps(record).encode()) == LIGHT


def test_of_a_long_list_the_first_wrong_item_is_named() -> None:
    record = full_record(LIGHT)
    record |= {"evidence": [1] * 30_000, "warnings": [1] * 30_000}
    record["sun"]["direction"] = record["sky"]["coefficients"]["r"] = ["x"] * 30_000
    with pytest.raises(RequestValidationError) as caught:
        parse_record(json.dumps(record).encode())
    assert len(caught.value.errors()) == 4


@pytest.mark.parametrize("text", ["[" * 50_000, '{"sky": {"coefficients": {"\\ud800": 1}}}'])
def test_json_that_nothing_could_hold_is_a_problem(text: str) -> None:
    with pytest.raises(ProblemError, match="not JSON"):
        parse_record(text.encode())

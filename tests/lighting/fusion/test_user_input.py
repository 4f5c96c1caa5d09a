"""What the user may say, and what contradicts itself."""

import math
import pickle
from dataclasses import replace
from datetime import datetime
from typing import Any

import numpy as np
import pytest

from lighting.errors import ParameterError
from lighting.fusion.user_input import UserInput, check_headings, read_headings
from tests.helpers.predictions import MORNING


@pytest.mark.parametrize(
    "stated",
    [
        {"latitude": 90.1, "longitude": 0.0},
        {"latitude": 0.0, "longitude": math.nan},
        {"latitude": 10.0},
        {"longitude": 10.0},
        {"time": MORNING, "utc_offset": 2.0},
        {"time": MORNING.replace(year=2101)},
        {"time": MORNING.replace(year=1)},
        {"utc_offset": 15.0},
        {"heading": 400.0},
        {"vertical_fov": 0.0},
        {"metadata": False, "time": MORNING},
        {"metadata": False, "latitude": 1.0, "longitude": 2.0},
        {"metadata": False, "utc_offset": 2.0},
        {"time": "the first of June"},
        {"time": MORNING.date()},
        {"latitude": np.float32("nan"), "longitude": 0.0},
        {"metadata": None},
        {"keep_location": "no"},
    ],
)
def test_the_impossible_and_the_contradictory_are_refused_in_one_sentence(stated: dict[str, Any]) -> None:
    with pytest.raises(ParameterError, match=r"^[^\n]*\.$"):
        UserInput(**stated)


def test_numbers_of_numpy_are_taken() -> None:
    place: dict[str, Any] = {"latitude": np.float32(48.5), "longitude": np.int64(11)}
    assert UserInput(**place) == UserInput(latitude=48.5, longitude=11)


@pytest.mark.parametrize("headings", [90.0, 0, {0.0, 90.0}])
def test_what_is_no_list_of_headings_is_refused(headings: Any) -> None:
    with pytest.raises(ParameterError, match=r"^headings are a list of degrees, not .*\.$"):
        check_headings(2, headings)


@pytest.mark.parametrize(
    ("photos", "headings", "heading", "sentence"),
    [
        (1, [0.0], None, "one photo has a heading"),
        (3, [0.0, 1.0], None, "3 photos need 3 headings, not 2"),
        (2, [0.0, math.inf], None, "must be a finite number"),
        (2, None, 10.0, "photos taken together have headings"),
    ],
)
def test_headings_are_those_of_several_photos(
    photos: int, headings: list[float] | None, heading: float | None, sentence: str
) -> None:
    with pytest.raises(ParameterError, match=sentence):
        check_headings(photos, headings, heading)


def test_headings_are_read_from_a_text() -> None:
    assert read_headings("0,45.5,-90") == [0.0, 45.5, -90.0]
    for text in ("0;45", "0,", "0,400"):
        with pytest.raises(ParameterError):
            read_headings(text)


def test_short_forms_and_texts_are_those_of_the_command_line() -> None:
    short = UserInput(time="2024-06-01T14:30", utc_offset="+02:00", lat=48.1, lon=11.6, fov=60.0)
    long = UserInput(
        time=datetime(2024, 6, 1, 14, 30), utc_offset=2.0, latitude=48.1, longitude=11.6, vertical_fov=60.0
    )
    assert short == long
    assert replace(short, heading=90.0) == replace(long, heading=90.0)
    assert pickle.loads(pickle.dumps(short)) == short


@pytest.mark.parametrize("name", ["lat", "lon", "fov"])
def test_a_value_is_stated_once(name: str) -> None:
    long = {"lat": "latitude", "lon": "longitude", "fov": "vertical_fov"}[name]
    with pytest.raises(ParameterError, match=f"^{long} is given twice") as caught:
        UserInput(**{name: 1.0, long: 1.0})  # type: ignore[arg-type]
    assert caught.value.field == long
    with pytest.raises(TypeError, match="latitud"):
        UserInput(latitud=3.0)  # type: ignore[call-arg]

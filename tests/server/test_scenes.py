"""Scenes for tools, from a photo and from parameters alone."""

import json
import zipfile
from dataclasses import replace
from datetime import datetime
from io import BytesIO
from typing import Any
from urllib.parse import urlencode

import numpy as np
import pytest
from PIL import Image
from starlette.testclient import TestClient

from lighting.estimator import Estimator
from lighting.fusion.user_input import UserInput
from lighting.photo.reader import read_photo
from lighting.records import Lighting
from lighting.scene import EXPORTERS
from lighting.scene.records import PLATE_SIDE, make_scene
from lighting.scene.writer import zip_scene
from tests.conftest import encode, munich, scene
from tests.server.conftest import SKY, jpeg_headers, problem

PHONE = encode(scene(320, 240), exif=munich())


def named(query: dict[str, Any]) -> dict[str, Any]:
    """Parameters by their names, of which `for` is a word of Python."""
    return {"for" if name == "tool" else name: value for name, value in query.items()}


def post(client: TestClient, data: bytes = PHONE, **query: Any) -> Any:
    return client.post(f"/v1/scene?{urlencode({'height': 16, **named(query)})}", content=data, headers=jpeg_headers())


def get(client: TestClient, headers: dict[str, str] | None = None, **query: Any) -> Any:
    return client.get("/v1/scene", params={**SKY, "height": 16, "plate_height": 60, **named(query)}, headers=headers)


def files(answer: Any) -> dict[str, bytes]:
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"] == "application/zip"
    with zipfile.ZipFile(BytesIO(answer.content)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@pytest.mark.parametrize("tool", EXPORTERS)
def test_a_photo_makes_the_scene_of_the_library(client: TestClient, estimator: Estimator, tool: str) -> None:
    estimate = estimator(read_photo(PHONE))
    plate = read_photo(PHONE, target=PLATE_SIDE)
    scene = make_scene(plate, estimate.lighting, map_height=16, segments=estimate.segments)
    expected = zip_scene(scene, tool)
    assert post(client, tool=tool).content == expected


def test_options_go_to_their_tool(client: TestClient) -> None:
    assert b'upAxis = "Z"' in files(post(client, tool="usd", up_axis="Z"))["scene.usda"]


def test_a_scene_takes_the_photos_metadata_and_what_the_client_knows(client: TestClient) -> None:
    def record(**query: Any) -> Any:
        return json.loads(files(post(client, tool="usd", **query))["lighting.json"])

    assert "time+place" in record()["evidence"]
    assert "place" not in record()
    assert record(metadata="false", vertical_fov=40)["camera"]["vertical_fov"] == 40
    assert "pixels" in record(metadata="false")["evidence"]


@pytest.mark.parametrize("tool", EXPORTERS)
def test_a_sky_makes_a_scene_with_a_grey_plate(client: TestClient, tool: str) -> None:
    camera: dict[str, Any] = {"camera_elevation": 4.0, "camera_roll": -2.0, "vertical_fov": 40.0}
    answer = get(client, tool=tool, plate_width=90, **camera)
    if tool == "usd":
        held = files(answer)
        assert Lighting.from_dict(json.loads(held["lighting.json"])) == Lighting(**SKY, **camera)
        with Image.open(BytesIO(held["plate.png"])) as plate:
            assert plate.size == (90, 60)
            assert np.unique(np.asarray(plate)).tolist() == [128]
    assert files(answer)


def test_a_cache_may_keep_a_scene(client: TestClient) -> None:
    first = get(client, tool="usd")
    assert first.headers["cache-control"] == "public, max-age=86400"
    again = get(client, tool="usd", headers={"If-None-Match": first.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    assert get(client, tool="usd").content == first.content
    others = [
        get(client, tool="mitsuba"),
        get(client, tool="usd", up_axis="Z"),
        get(client, tool="usd", sun="false"),
    ]
    assert len({answer.headers["etag"] for answer in [first, *others]}) == 4


@pytest.mark.parametrize(
    ("query", "field", "words"),
    [
        ({}, "for", "missing"),
        ({"tool": "maya"}, "for", "'blender'"),
        ({"tool": "gltf", "up_axis": "Z"}, "up_axis", "up_axis goes with for=usd"),
        ({"tool": "usd", "up_axis": "X"}, "up_axis", "'Y' or 'Z'"),
        ({"tool": "usd", "height": "17"}, "height", "even"),
    ],
)
def test_what_no_tool_takes_is_refused(client: TestClient, query: dict[str, Any], field: str, words: str) -> None:
    for answer in (get(client, **query), post(client, **query)):
        body = problem(answer, 422, "invalid")
        assert [error["field"] for error in body["errors"]] == [field]
        assert words in body["detail"]


def test_a_plate_has_its_range_and_a_photo_has_no_such_parameter(client: TestClient) -> None:
    (error,) = problem(get(client, tool="usd", plate_width=31), 422, "invalid")["errors"]
    assert (error["field"], error["minimum"], error["maximum"]) == ("plate_width", 32, PLATE_SIDE)
    problem(post(client, tool="usd", plate_width=64), 422, "invalid")


@pytest.mark.parametrize("tool", EXPORTERS)
def test_warnings_are_those_of_the_library(client: TestClient, estimator: Estimator, tool: str) -> None:
    """Of the light, and of a spot that the picture does not show: a camera that looks up sees no ground."""
    upwards: dict[str, Any] = {"camera_elevation": 40.0, "vertical_fov": 40.0, "camera_roll": 0.0}
    evening = "2024-06-01T21:30+02:00"
    given = UserInput(time=datetime.fromisoformat(evening))
    lighting = replace(estimator(read_photo(PHONE), given).lighting, **upwards)
    expected = list(make_scene(read_photo(PHONE), lighting, map_height=16).warnings)
    answer = post(client, tool=tool, time=evening, **upwards)
    assert len(expected) >= 2
    assert "below the picture's edge" in expected[-1]
    assert json.loads(answer.headers["lighting-warnings"]) == expected
    (of_sky,) = json.loads(get(client, tool=tool, **upwards).headers["lighting-warnings"])
    assert of_sky.startswith("The object would stand")


def test_without_warnings_there_is_no_header(client: TestClient) -> None:
    assert "lighting-warnings" not in get(client, tool="usd").headers


def test_a_bad_photo_makes_no_scene(client: TestClient) -> None:
    problem(post(client, b"text", tool="usd"), 400, "unreadable-photo")

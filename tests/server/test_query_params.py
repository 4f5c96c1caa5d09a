"""Tests of query params."""

import json
import logging
import math
import zipfile
from datetime import datetime, timedelta, timezone
from io import BytesIO
from typing import Any
from urllib.parse import urlencode

import numpy as np
import pytest
from pydantic import ValidationError
from starlette.testclient import TestClient

from lighting.cli.photos import _OPTIONS
from lighting.envmap.relighting import adjust_lighting
from lighting.envmap.render import render
from lighting.estimator import Estimator
from lighting.fields import OPTIONAL_RANGES, RANGES
from lighting.files.exr import read_exr
from lighting.fusion.user_input import UserInput
from lighting.map_options import Adjustments
from lighting.photo.reader import read_photo
from lighting.record_json import record_with_coefficients
from lighting.registration.features import has_opencv
from server.problems import ProblemError
from server.query_params import (
    SUN_BY_DEFAULT,
    EnvmapQuery,
    LightingsQuery,
    MapQuery,
    PhotoSceneQuery,
    SkyProbeQuery,
    UserInputQuery,
    check_photo_headings,
    refuse_photo_parameters,
)
from tests.conftest import encode, munich, scene
from tests.helpers.predictions import without_probe
from tests.server.conftest import client_of, jpeg_headers, problem, together

SUMMER = timezone(timedelta(hours=2))  # of Munich


def error_of(error: ProblemError) -> tuple[str, int]:
    (found,) = error.errors
    return found["field"], error.kind.status


@pytest.mark.parametrize(
    ("photos", "query", "field"),
    [
        (1, LightingsQuery(headings="0,90"), "headings"),
        (3, LightingsQuery(headings="0,90"), "headings"),
        (2, LightingsQuery(heading=90.0), "heading"),
    ],
)
def test_headings_must_fit_the_number_of_photos(photos: int, query: LightingsQuery, field: str) -> None:
    with pytest.raises(ProblemError) as caught:
        check_photo_headings(photos, query)
    assert error_of(caught.value) == (field, 422)


def test_headings_that_fit_are_taken() -> None:
    check_photo_headings(1, LightingsQuery(heading=90.0))
    check_photo_headings(2, LightingsQuery(headings="0,90"))
    check_photo_headings(4, LightingsQuery())


def test_a_record_takes_nothing_that_describes_a_photo() -> None:
    refuse_photo_parameters(EnvmapQuery.model_validate({"sky": "perez"}))
    for query, field in (
        (EnvmapQuery(vertical_fov=50.0), "vertical_fov"),
        (EnvmapQuery.model_validate({"around": "photo"}), "around"),
        (EnvmapQuery.model_validate({"surroundings": False}), "around"),
    ):
        with pytest.raises(ProblemError) as caught:
            refuse_photo_parameters(query)
        assert error_of(caught.value) == (field, 422)


PHONE = encode(scene(320, 240), exif=munich())
OTHER = encode(scene(320, 240)[:, ::-1].copy(), exif=munich(GPSImgDirection=150.0))
PLAIN = encode(scene(320, 240))
NOON: dict[str, Any] = {"time": "2024-06-01T12:00+02:00", "latitude": "48.1375", "longitude": "11.575"}
MUNICH = ("48.1375", "11.575")


def ask(client: TestClient, data: Any = PLAIN, path: Any = "/v1/lighting", **query: Any) -> Any:
    return client.post(f"{path}?{urlencode(query)}", content=data, headers=jpeg_headers())


def estimate(client: TestClient, data: bytes = PLAIN, **query: Any) -> dict[str, Any]:
    answer = ask(client, data, **query)
    assert answer.status_code == 200, answer.text
    record: dict[str, Any] = answer.json()
    return without_probe({name: value for name, value in record.items() if name != "links"})


def test_the_metadata_of_a_photo_count_unless_they_are_refused(client: TestClient, estimator: Estimator) -> None:
    photo = read_photo(PHONE)
    assert estimate(client, PHONE) == record_with_coefficients(estimator(photo).lighting)
    assert "time+place" in estimate(client, PHONE)["evidence"]
    assert estimate(client, PHONE, metadata="false") == record_with_coefficients(
        estimator(photo, UserInput(metadata=False)).lighting
    )


@pytest.mark.parametrize(
    ("query", "given"),
    [
        (NOON, {"time": datetime(2024, 6, 1, 12, tzinfo=SUMMER), "latitude": 48.1375, "longitude": 11.575}),
        (
            {**NOON, "time": "2024-06-01T12:00", "utc_offset": "2", "heading": 20, "vertical_fov": 40},
            {
                "time": datetime(2024, 6, 1, 12), "utc_offset": 2.0, "heading": 20.0, "vertical_fov": 40.0,
                "latitude": 48.1375, "longitude": 11.575,
            },
        ),
        ({"vertical_fov": 40, "metadata": "false"}, {"vertical_fov": 40.0, "metadata": False}),
    ],
)  # fmt: skip
def test_what_the_client_knows_counts_as_for_the_library(
    client: TestClient, estimator: Estimator, query: dict[str, Any], given: dict[str, Any]
) -> None:
    for data in (PLAIN, PHONE):
        assert estimate(client, data, **query) == record_with_coefficients(
            estimator(read_photo(data), UserInput(**given)).lighting
        )


def test_a_plus_that_the_url_made_a_space_is_a_plus(client: TestClient) -> None:
    right = ask(client, **NOON).json()
    for query in ("time=2024-06-01T12:00+02:00", "time=2024-06-01T12:00&utc_offset=+02:00"):
        answer = client.post(f"/v1/lighting?{query}&lat=48.1375&lon=11.575", content=PLAIN, headers=jpeg_headers())
        assert answer.json() == right


def test_maps_and_previews_take_the_same_parameters(client: TestClient, estimator: Estimator) -> None:
    given = UserInput(time=datetime(2024, 6, 1, 12, tzinfo=SUMMER), latitude=48.1375, longitude=11.575, heading=100.0)
    expected = estimator(read_photo(PLAIN), given).lighting
    image, lighting = read_exr(BytesIO(ask(client, path="/v1/envmap", height=32, heading=100, **NOON).content))
    assert lighting == expected
    np.testing.assert_allclose(image, render(expected, 32), rtol=1e-3)
    assert ask(client, path="/v1/preview", heading=100, **NOON).content != ask(client, path="/v1/preview").content


def test_the_probability_is_that_of_all_that_is_known(client: TestClient, estimator: Estimator) -> None:
    found = estimator(read_photo(PHONE))
    told = estimate(client, PHONE, probability="true")["probability"]["probability"]
    assert np.allclose(told, found.distribution.probability, rtol=1e-5)
    assert not np.allclose(told, estimator.predict(read_photo(PHONE)).sun_probability, rtol=1e-2)


def test_when_the_sun_is_painted_is_told_alike() -> None:
    assert all(SUN_BY_DEFAULT in str(query.model_fields["sun"].description) for query in (MapQuery, PhotoSceneQuery))


def test_names_are_those_of_the_command_line() -> None:
    options: set[str] = set()
    for option in _OPTIONS.values():
        command: Any = option(lambda: None)
        options.add(command.__click_params__[0].opts[0].removeprefix("--"))
    assert {name.replace("_", "-") for name in UserInputQuery.model_fields} == options - {"no-metadata"} | {"metadata"}


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ({"exif": "false"}, {"metadata": "false"}),
        ({"lat": "48", "lon": "11"}, {"latitude": "48", "longitude": "11"}),
        ({"fov": "40"}, {"vertical_fov": "40"}),
        ({"tool": "usd"}, {"for": "usd"}),
        (
            {"photo_exposure": "5", "exposure": "7", "vertical_fov": "40"},
            {"photo_exposure": "5", "sky_exposure": "7", "camera_vertical_fov": "40"},
        ),
    ],
    ids=lambda names: " ".join(names),
)
def test_old_names_are_read_until_the_next_release(old: dict[str, str], new: dict[str, str]) -> None:
    of_scene = {} if {"tool", "for"} & {*old, *new} else {"for": "usd"}
    asked, told = (PhotoSceneQuery.model_validate(names | of_scene) for names in (old, new))
    assert asked == told
    assert (
        not (old.keys() - {"exposure", "vertical_fov", "photo_exposure"})
        & PhotoSceneQuery.model_json_schema()["properties"].keys()
    )


def test_a_parameter_by_its_old_and_its_new_name_is_refused() -> None:
    with pytest.raises(ValidationError, match="is the same as latitude; give one of them"):
        UserInputQuery.model_validate({"lat": "48", "latitude": "48", "longitude": "11"})


@pytest.mark.parametrize(
    ("name", "value", "limits"),
    [
        ("latitude", "90.1", OPTIONAL_RANGES["latitude"]),
        ("latitude", "nan", OPTIONAL_RANGES["latitude"]),
        ("longitude", "-181", OPTIONAL_RANGES["longitude"]),
        ("longitude", "east", OPTIONAL_RANGES["longitude"]),
        ("heading", "361", (-360, 360)),
        ("vertical_fov", "0", RANGES["vertical_fov"]),
        ("vertical_fov", "", RANGES["vertical_fov"]),
    ],
)
def test_a_number_out_of_range_is_named_with_its_range(
    client: TestClient, name: str, value: str, limits: tuple[float, float]
) -> None:
    (error,) = problem(ask(client, **{**NOON, name: value}), 422, "invalid")["errors"]
    assert (error["field"], error["minimum"], error["maximum"]) == (name, *limits)


SKY = {"sun_azimuth": 0, "sun_elevation": 30, "turbidity": 3, "height": 32}


@pytest.mark.parametrize(
    ("colours", "field", "words"),
    [
        ({"sun_irradiance": "1,1,1", "sky_irradiance": "1e30,1,1"}, "sky_irradiance.0", "from 0 to 1e+06"),
        ({"sun_irradiance": "1,nan,1", "sky_irradiance": "1,1,1"}, "sun_irradiance.1", "from 0 to 1e+06"),
        ({"ground_color": "0,0,2"}, "ground_color.2", "from 0 to 1"),
        ({"ground_color": "1,2"}, "ground_color", "'1,2' is not three numbers"),
        ({"sun_irradiance": "1,1,1"}, "sky_irradiance", "go together"),
        ({"sky_cover": "0.5"}, "sky_cover", "needs sky_irradiance and sun_irradiance"),
    ],
)
def test_a_wrong_colour_is_named_with_its_range(
    client: TestClient, colours: dict[str, str], field: str, words: str
) -> None:
    of_a_sky = client.get("/v1/envmap", params={**SKY, **colours})
    for answer in (of_a_sky, ask(client, PLAIN, "/v1/envmap", **colours)):
        (error,) = problem(answer, 422, "invalid")["errors"]
        assert error["field"] == field
        assert words in error["detail"]
        assert ("maximum" in error) == ("." in field)


@pytest.mark.parametrize(
    ("query", "field", "words"),
    [
        ({"time": "noon"}, "time", "is not a time"),
        ({"time": "2024-02-30T12:00"}, "time", "is not a time"),
        ({"time": "2024-06-01"}, "time", "without a time"),
        ({"utc_offset": "20"}, "utc_offset", "-12 to 14"),
        ({"utc_offset": "CET"}, "utc_offset", "not an offset"),
        ({"metadata": "no"}, "metadata", "true or false"),
        ({"latitude": "48"}, "longitude", "go together"),
        ({**NOON, "time": "1850-06-01T12:00Z"}, "time", "1900 to 2100"),
        ({**NOON, "utc_offset": "2"}, "utc_offset", "contradicts"),
        ({"metadata": "false", "utc_offset": "2"}, "time", "needs a time"),
        ({"metadata": "false", "time": "2024-06-01T12:00Z"}, "latitude", "needs a place"),
        ({"breadth": "48"}, "breadth", "is not known here"),
        ({"longitude": "11"}, "latitude", "go together"),
        ({"metadata": "false", "latitude": "48", "longitude": "11"}, "time", "needs a place"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(
    client: TestClient, query: dict[str, Any], field: str, words: str
) -> None:
    body = problem(ask(client, **query), 422, "invalid")
    assert [error["field"] for error in body["errors"]] == [field]
    assert words in body["detail"]
    assert "Value error" not in body["detail"]


@pytest.mark.parametrize("path", ["/v1/lighting", "/v1/envmap", "/v1/preview"])
def test_night_is_refused_where_the_client_stated_it(client: TestClient, path: str) -> None:
    night = {**NOON, "time": "2024-06-01T00:30+02:00"}
    body = problem(ask(client, path=path, **night), 422, "invalid")
    assert body["detail"].startswith("At that time and place the sun is")
    assert body["errors"] == [{"field": "time", "place": "query", "detail": body["detail"], "code": "night"}]
    polar: dict[str, Any] = {"time": "2024-12-21T12:00Z", "latitude": 85, "longitude": 0}
    assert "polar night" in problem(ask(client, path=path, **polar), 422, "invalid")["detail"]


@pytest.mark.parametrize(
    ("headings", "words"), [("0,90", "photos"), ("0;90", "list of degrees"), ("0,400", "-360 to 360")]
)
def test_headings_that_cannot_be_are_refused(client: TestClient, headings: str, words: str) -> None:
    body = problem(ask(client, path="/v1/lightings", headings=headings), 422, "invalid")
    assert [error["field"] for error in body["errors"]] == ["headings"]
    assert words in body["detail"]


def test_a_record_takes_nothing_that_belongs_to_a_photo(client: TestClient) -> None:
    record = ask(client, PHONE).json()
    (error,) = problem(client.post("/v1/envmap?height=16&vertical_fov=40", json=record), 422, "invalid")["errors"]
    assert error["field"] == "vertical_fov"


def test_coordinates_are_told_to_nobody_but_who_asks(client: TestClient, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG):
        silent = [ask(client, PHONE), ask(client, **NOON), ask(client, **{**NOON, "time": "2024-06-01T00:30Z"})]
        silent.append(ask(client, PHONE, path="/v1/envmap", height=16))
        kept = estimate(client, PHONE, keep_location="true")
        assert ask(client, keep_location="true", **NOON).json()["place"] == {"latitude": 48.1375, "longitude": 11.575}
    for answer in silent:
        assert not any(part.encode() in answer.content for part in MUNICH)
    assert kept["place"]["latitude"] == pytest.approx(48.1375)
    logged = [record.getMessage() for record in caplog.records if record.name.startswith(("server", "lighting"))]
    assert any("/v1/envmap" in line for line in logged)
    assert not any(part in line for part in MUNICH for line in logged)


@pytest.mark.parametrize("headings", [None, [0.0, 45.0]])
@pytest.mark.needs("cv2")
def test_photos_of_one_form_are_taken_together(
    client: TestClient, estimator: Estimator, headings: list[float] | None
) -> None:
    query = {} if headings is None else {"headings": ",".join(map(str, headings))}
    found = estimator.estimate_views(
        [read_photo(PHONE), read_photo(OTHER)], UserInput(), headings, register=has_opencv()
    )
    answer = together(client, PHONE, OTHER, **query).json()
    assert list(answer) == ["lightings"]
    for record, estimate in zip(answer["lightings"], found, strict=True):
        assert record.pop("links")["envmap"].startswith("envmap?")
        assert record == json.loads(json.dumps(record_with_coefficients(estimate.lighting, estimate.light_probe())))


def test_each_of_several_has_its_probability_and_its_relative_heading(client: TestClient) -> None:
    records = together(client, PLAIN, PLAIN, PLAIN, probability="true").json()["lightings"]
    assert len(records) == 3
    assert all(sum(record["probability"]["probability"]) == pytest.approx(1, abs=1e-3) for record in records)
    assert records[0]["camera"]["relative_heading"] == 0


def test_one_photo_alone_is_a_list_of_one_record(client: TestClient) -> None:
    assert together(client, PHONE).json() == {"lightings": [ask(client, PHONE).json()]}


def test_the_route_of_one_photo_refuses_several_and_names_the_other(client: TestClient) -> None:
    files = [("photo", ("p.jpg", PLAIN, "image/jpeg"))] * 2
    body = problem(client.post("/v1/lighting", files=files), 422, "invalid")
    assert "POST /v1/lightings takes several." in body["detail"]


def test_a_bad_photo_among_several_is_named(client: TestClient) -> None:
    detail = problem(together(client, PLAIN, b"text", PLAIN), 400, "unreadable-photo")["detail"]
    assert detail.startswith("Photo 2 of 3, 1.jpg: This is a text")
    small = client_of(client.app.state.service.estimator, max_pixels=200_000)  # type: ignore[attr-defined]
    large = encode(scene(640, 480))
    assert "Photo 3 of 3, 2.jpg: " in problem(together(small, PLAIN, PLAIN, large), 413, "too-large")["detail"]


def test_there_may_be_so_many_photos(client: TestClient, estimator: Estimator) -> None:
    assert together(client, *[PLAIN] * 8, headings=",".join("0" * 8)).status_code == 200  # which need no matching
    few = client_of(estimator, max_photos=2)
    assert together(few, PLAIN, PLAIN).status_code == 200
    for photos in (3, 17, 40):
        assert "At most 2 photos are taken" in problem(together(few, *[PLAIN] * photos), 422, "invalid")["detail"]


@pytest.mark.parametrize("path", ["/v1/envmap", "/v1/preview"])
def test_elsewhere_a_form_holds_one_photo(client: TestClient, path: str) -> None:
    form = [("photo", ("a.jpg", PLAIN, "image/jpeg"))] * 2
    assert "One photo is taken here" in problem(client.post(path, files=form), 422, "invalid")["detail"]


@pytest.mark.parametrize(("query", "field"), [({"headings": "0,45,90"}, "headings"), ({"heading": "45"}, "heading")])
def test_what_is_said_of_several_photos_must_fit_their_number(
    client: TestClient, query: dict[str, str], field: str
) -> None:
    (error,) = problem(together(client, PLAIN, PLAIN, **query), 422, "invalid")["errors"]
    assert error["field"] == field


def test_a_compression_that_goes_with_no_such_format_is_named(client: TestClient) -> None:
    answer = client.get("/v1/envmap", params={**SKY, "format": "png", "compression": "none"})
    assert [error["field"] for error in problem(answer, 422, "invalid")["errors"]] == ["compression"]


def test_the_two_switches_of_former_days_say_what_is_around() -> None:
    assert EnvmapQuery.model_validate({"detail": "true"}).view().around is None
    assert EnvmapQuery.model_validate({"surroundings": "true"}).view().around == "place"
    assert EnvmapQuery.model_validate({"surroundings": "true", "detail": "false"}).view().around == "photo"
    assert EnvmapQuery.model_validate({"surroundings": "false", "detail": "true"}).view().around == "plain"
    for old in ({"detail": "maybe"}, {"detail": "true", "around": "photo"}):
        with pytest.raises(ValidationError, match=r"detail|around"):
            EnvmapQuery.model_validate(old)


def test_a_compression_goes_with_exr_alone_and_its_default_with_all() -> None:
    assert MapQuery.model_validate({"format": "png", "compression": "zip"}).file_options().format == "png"
    assert MapQuery.model_validate({"format": "exr", "compression": "pxr24"}).file_options().compression == "pxr24"
    with pytest.raises(ValidationError, match="compression goes with the format exr"):
        MapQuery.model_validate({"format": "hdr", "compression": "pxr24"})


# Another light, under the names of the command line


@pytest.mark.parametrize(
    ("query", "adjusted"),
    [
        ({"sun": "40,25"}, Adjustments(sun=(40.0, 25.0))),
        ({"exposure": "-1.5", "haze": "8"}, Adjustments(exposure=-1.5, haze=8.0)),
        ({"overcast": "true"}, Adjustments(overcast=True)),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, dict) else "",
)
def test_a_light_is_adjusted_as_on_the_command_line(
    client: TestClient, estimator: Estimator, query: dict[str, str], adjusted: Adjustments
) -> None:
    expected = adjust_lighting(estimator(read_photo(PLAIN)).lighting, adjusted)
    of_photo = ask(client, path="/v1/envmap", height=32, **query)
    record = estimate(client)
    of_record = client.post(f"/v1/envmap?height=32&{urlencode(query)}", json=record)
    in_form = client.post("/v1/envmap", files={"photo": PLAIN}, data={"height": "32", **query})
    for answer in (of_photo, of_record, in_form):
        assert answer.status_code == 200, answer.text
        assert read_exr(BytesIO(answer.content))[1] == expected


def test_a_scene_and_a_preview_are_adjusted_too(client: TestClient) -> None:
    answer = ask(client, path="/v1/scene", height=16, sun="40,25", **{"for": "usd"})
    with zipfile.ZipFile(BytesIO(answer.content)) as archive:
        assert json.loads(archive.read("lighting.json"))["sun"]["azimuth"] == 40.0
    drawn = [ask(client, path="/v1/preview", **query).content for query in ({}, {"exposure": "1"})]
    assert drawn[0] != drawn[1]


@pytest.mark.parametrize(
    ("query", "field", "words"),
    [
        ({"sun": "40"}, "sun", "true, false, or AZIMUTH,ELEVATION"),
        ({"sun": "40,95"}, "sun", "elevation is 95"),
        ({"sun": "north,25"}, "sun", "such as 40,25"),
        ({"exposure": "21"}, "exposure", "from -20 to 20"),
        ({"haze": "0"}, "haze", "from 1 to 10"),
        ({"overcast": "yes"}, "overcast", "true or false"),
    ],
)
def test_an_adjustment_that_cannot_be_is_refused(
    client: TestClient, query: dict[str, str], field: str, words: str
) -> None:
    (error,) = problem(ask(client, path="/v1/envmap", **query), 422, "invalid")["errors"]
    assert error["field"] == field
    assert words in error["detail"]


def test_photos_that_are_not_together_are_estimated_alone(client: TestClient) -> None:
    files = [("photo", PLAIN), ("photo", OTHER)]
    answer = client.post("/v1/lightings", files=files, data={"together": "false"}).json()["lightings"]
    assert ["other photos" in light["evidence"] for light in answer] == [False, False]
    alone = estimate(client, PLAIN)
    assert answer[0]["sun"] == alone["sun"]
    refused = client.post("/v1/lightings?together=false&headings=0,90", files=files)
    assert problem(refused, 422, "invalid")["errors"][0]["field"] == "headings"


def test_a_light_probe_is_for_an_engine_by_its_old_name_too() -> None:
    sky = {"sun_azimuth": "10", "sun_elevation": "30", "turbidity": "3"}
    for name in ("for", "format", "tool"):
        assert SkyProbeQuery.model_validate({**sky, name: "threejs"}).tool == "threejs"
    assert SkyProbeQuery.model_validate(sky).tool == "record"
    with pytest.raises(ValidationError, match="is the same as for"):
        SkyProbeQuery.model_validate({**sky, "for": "unity", "format": "unity"})


def test_what_is_drawn_in_a_photo_counts_as_for_the_library(client: TestClient, estimator: Estimator) -> None:
    drawn = {
        "horizon": "0,110,319,118",
        "vertical": "20,20,22,200;300,20,297,200",
        "reference": "160,220,160,150,1.8",
        "shadow": "160,220,230,225",
    }
    given = UserInput(
        horizon=drawn["horizon"],
        verticals=drawn["vertical"].split(";"),
        reference=drawn["reference"],
        shadows=[drawn["shadow"]],
    )
    found = estimate(client, PLAIN, **drawn)
    assert found == record_with_coefficients(estimator(read_photo(PLAIN), given).lighting)
    assert {"shadow", "drawn camera"} <= set(found["evidence"])


def test_a_camera_of_fspy_counts_as_for_the_library(client: TestClient) -> None:
    rows = np.eye(4).tolist()  # level, and looks along the world's third axis
    camera = {"cameraTransform": {"rows": rows}, "principalPoint": {"x": 0.0, "y": 0.0}, "horizontalFieldOfView": 1.0}
    text = json.dumps(camera | {"imageWidth": 320, "imageHeight": 240})
    found = estimate(client, PLAIN, camera=text)["camera"]
    assert (found["elevation"], found["roll"]) == pytest.approx((0.0, 0.0), abs=1e-3)
    assert found["vertical_fov"] == pytest.approx(math.degrees(2 * math.atan(0.75 * math.tan(0.5))), abs=0.01)


@pytest.mark.parametrize(
    ("query", "field"),
    [
        ({"horizon": "1,2,3"}, "horizon"),
        ({"vertical": "1,2,3,4"}, "vertical"),
        ({"vertical": "level:1,2,300,4"}, "vertical"),
        ({"camera": "{}"}, "camera"),
        ({"camera": "[" * 9000}, "camera"),
        ({"reference": "1,2,300,4,x"}, "reference"),
        ({"reference": "1,2,300,4,2", "camera_height": "2"}, "reference"),
        ({"shadow": "1,2"}, "shadow"),
    ],
)
def test_what_is_drawn_wrong_is_named(client: TestClient, query: dict[str, str], field: str) -> None:
    answer = ask(client, **query)
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["field"] == field


def test_a_sun_is_picked_by_its_number(client: TestClient, estimator: Estimator) -> None:
    light = estimator(read_photo(PLAIN)).lighting
    _, picked = read_exr(BytesIO(ask(client, path="/v1/envmap", height=32, pick=2).content))
    assert picked is not None
    assert (picked.sun_azimuth, picked.sun_elevation) == (
        light.sun_candidates[1].azimuth,
        light.sun_candidates[1].elevation,
    )
    for query in ({"pick": "4"}, {"pick": "2", "sun": "40,25"}):
        answer = ask(client, path="/v1/envmap", **query)
        assert (answer.status_code, answer.json()["errors"][0]["field"]) == (422, "pick")

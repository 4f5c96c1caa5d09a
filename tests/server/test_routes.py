"""The answers to good requests."""

import asyncio
from io import BytesIO
from typing import Any
from urllib.parse import parse_qs, urljoin, urlsplit

import numpy as np
import pytest
from PIL import Image
from starlette.testclient import TestClient

from lighting.decoding import lighting_from_prediction
from lighting.envmap.render import render
from lighting.estimator import Estimator
from lighting.files.exr import read_exr
from lighting.ground import find_lit_spot
from lighting.photo.reader import read_photo
from lighting.record_json import record_with_coefficients
from lighting.records import Lighting
from lighting.registration.features import has_opencv
from lighting.scene import EXPORTERS
from lighting.sky import SKY_MODELS
from server import responses
from tests.conftest import TINY, encode, scene
from tests.helpers.predictions import without_probe
from tests.server.conftest import SKY

JPEG = {"Content-Type": "image/jpeg"}


def form(data: bytes, name: str = "photo.jpg", kind: str = "image/jpeg") -> dict[str, Any]:
    return {"files": {"photo": (name, data, kind)}}


def test_a_form_and_a_raw_body_give_the_record_of_the_library(
    client: TestClient, jpeg: bytes, estimator: Estimator
) -> None:
    expected = record_with_coefficients(estimator(read_photo(jpeg)).lighting)
    for answer in (
        client.post("/v1/lighting", **form(jpeg)),
        client.post("/v1/lighting", content=jpeg, headers=JPEG),
    ):
        assert answer.status_code == 200
        record = without_probe({name: value for name, value in answer.json().items() if name != "links"})
        assert record == expected
        assert answer.headers["lighting-model"] == "tiny 0.0.1"


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "WEBP", "HEIF"])
def test_every_format_of_photos_is_taken(client: TestClient, kind: str) -> None:
    media = {"HEIF": "image/heic"}.get(kind, f"image/{kind.lower()}")
    data = encode(scene(160, 120), kind)
    assert client.post("/v1/lighting", content=data, headers={"Content-Type": media}).status_code == 200


def test_the_link_leads_to_the_map_of_the_estimate(client: TestClient, jpeg: bytes) -> None:
    record = client.post("/v1/lighting", content=jpeg, headers=JPEG).json()
    link = record["links"]["envmap"]
    assert urlsplit(link).path == "envmap"
    assert float(parse_qs(urlsplit(link).query)["sun_azimuth"][0]) == record["sun"]["azimuth"]
    linked = client.get(urljoin("/v1/lighting", f"{link}&height=64"))
    posted = client.post("/v1/envmap?height=64", content=jpeg, headers=JPEG)
    assert linked.status_code == posted.status_code == 200
    assert np.array_equal(pixels(linked.content), pixels(posted.content))


def pixels(exr: bytes) -> Any:
    return read_exr(BytesIO(exr))[0]


def test_the_probability_is_added_when_asked_for(client: TestClient, jpeg: bytes, estimator: Estimator) -> None:
    assert "probability" not in client.post("/v1/lighting?probability=false", content=jpeg, headers=JPEG).json()
    answer = client.post("/v1/lighting?probability=true", content=jpeg, headers=JPEG).json()["probability"]
    expected = estimator.predict(read_photo(jpeg)).sun_probability
    assert answer["grid"] == TINY.sun_grid
    assert np.allclose(answer["probability"], expected, rtol=1e-5)
    assert len(answer["azimuth"]) == len(answer["elevation"]) == len(expected)
    assert 0 < min(answer["elevation"]) < max(answer["elevation"]) < 90


@pytest.mark.parametrize("sun", [True, False])
def test_a_sky_is_rendered_from_parameters_alone(client: TestClient, sun: bool) -> None:
    answer = client.get("/v1/envmap", params={**SKY, "ground_albedo": 0.5, "sun": str(sun).lower(), "height": 64})
    assert answer.headers["content-type"] == "image/x-exr"
    image, lighting = read_exr(BytesIO(answer.content))
    expected = Lighting(**SKY, ground_albedo=0.5)
    assert lighting == expected
    np.testing.assert_allclose(image, render(expected, 64, sun=sun), rtol=1e-3)


def test_maps_come_in_three_formats(client: TestClient) -> None:
    files = {format: client.get("/v1/envmap", params={**SKY, "height": 32, "format": format}) for format in FORMATS}
    assert {format: answer.headers["content-type"] for format, answer in files.items()} == FORMATS
    assert files["hdr"].content.startswith(b"#?RADIANCE")
    assert Image.open(BytesIO(files["png"].content)).size == (64, 32)


FORMATS = {"exr": "image/x-exr", "hdr": "image/vnd.radiance", "png": "image/png"}


def test_a_cache_may_keep_a_map_and_ask_again(client: TestClient) -> None:
    query = {**SKY, "height": 32}
    first = client.get("/v1/envmap", params=query)
    assert first.headers["cache-control"] == "public, max-age=86400"
    etag = first.headers["etag"]
    for known in (etag, etag.removeprefix("W/"), f'"other", {etag}', "*"):
        again = client.get("/v1/envmap", params=query, headers={"If-None-Match": known})
        assert (again.status_code, again.content, again.headers["etag"]) == (304, b"", etag)
    assert client.get("/v1/envmap", params=query, headers={"If-None-Match": '"other"'}).status_code == 200


def test_answers_to_photos_have_the_tag_of_their_bytes(client: TestClient) -> None:
    def tag(path: str) -> str:
        return str(client.post(path, content=encode(scene(64, 48)), headers=JPEG).headers["etag"])

    paths = ("/v1/lighting", "/v1/envmap?height=16", "/v1/envmap?height=32", "/v1/scene?for=gltf&height=16")
    tags = [tag(path) for path in paths]
    assert len(set(tags)) == 4
    assert [tag(path) for path in paths] == tags
    assert "etag" not in client.post("/v1/lighting", content=b"no photo", headers=JPEG).headers


def test_a_post_ignores_if_none_match(client: TestClient, jpeg: bytes) -> None:
    """RFC 9110, 13.2.1: it neither selects nor modifies a representation, so that there is nothing to compare with."""
    first = client.post("/v1/lighting", content=jpeg, headers=JPEG)
    for tag in (first.headers["etag"], "*"):
        again = client.post("/v1/lighting", content=jpeg, headers={**JPEG, "If-None-Match": tag})
        assert (again.status_code, again.content) == (200, first.content)


def test_the_bytes_of_a_file_are_read_for_their_tag_in_a_thread(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A hundred megabytes would hold up the event loop."""
    photo, tag_bytes = encode(scene(64, 48)), responses.tag_bytes

    def tag_in_thread(data: bytes) -> str:
        with pytest.raises(RuntimeError):
            asyncio.get_running_loop()
        return tag_bytes(data)

    monkeypatch.setattr(responses, "tag_bytes", tag_in_thread)
    for path in ("/v1/scene?for=gltf&height=16", "/v1/envmap?height=16"):
        answer = client.post(path, content=photo, headers=JPEG)
        assert answer.headers["etag"] == tag_bytes(answer.content)


def test_equal_skies_share_a_tag_and_others_do_not(client: TestClient) -> None:
    def tag(**changed: Any) -> str:
        return client.get("/v1/envmap", params={**SKY, "height": 32, **changed}).headers["etag"]

    assert tag(turbidity="3.40") == tag(ground_albedo=0.3) == tag(sun="true") == tag()
    others = [tag(turbidity=3.5), tag(height=34), tag(format="hdr"), tag(sun="false"), tag(ground_albedo=0.2)]
    assert len({tag(), *others}) == 6


def test_a_record_is_rendered_as_it_was_edited(client: TestClient, jpeg: bytes) -> None:
    record = client.post("/v1/lighting", content=jpeg, headers=JPEG).json()
    record["sun"]["elevation"] = 12.5
    answer = client.post("/v1/envmap?height=64", json=record)
    image, lighting = read_exr(BytesIO(answer.content))
    assert lighting == Lighting.from_dict(record)
    np.testing.assert_allclose(image, render(Lighting.from_dict(record), 64), rtol=1e-3)


def test_a_line_of_the_command_line_is_a_record_too(client: TestClient, jpeg: bytes) -> None:
    record = client.post("/v1/lighting", content=jpeg, headers=JPEG).json()
    bare, line = (client.post("/v1/envmap", json=body) for body in (record, {"file": "a.jpg", "lighting": record}))
    assert (bare.status_code, line.status_code) == (200, 200)
    assert bare.content == line.content


def test_a_record_needs_only_sun_and_sky(client: TestClient) -> None:
    record = {"sun": {"azimuth": 10, "elevation": 30}, "sky": {"turbidity": 3, "exposure": 0.02}}
    answer = client.post("/v1/envmap?height=16", json=record)
    assert read_exr(BytesIO(answer.content))[1] == Lighting.from_dict(record)


def test_the_sun_of_a_photo_is_painted_where_it_shines_or_where_asked(
    client: TestClient, jpeg: bytes, estimator: Estimator
) -> None:
    lighting = lighting_from_prediction(estimator.predict(read_photo(jpeg)))
    assert lighting.sun_visibility >= 0.5
    for query, sun in {"": True, "&sun=false": False, "&sun=true": True}.items():
        answer = client.post(f"/v1/envmap?height=64{query}", **form(jpeg))
        np.testing.assert_allclose(pixels(answer.content), render(lighting, 64, sun=sun), rtol=1e-3)


@pytest.mark.slow
def test_the_preview_is_a_picture(client: TestClient, jpeg: bytes) -> None:
    answer = client.post("/v1/preview", **form(jpeg))
    assert answer.headers["content-type"] == "image/png"
    assert Image.open(BytesIO(answer.content)).width == 1600


def test_a_photo_comes_back_upright_as_jpeg_without_metadata(client: TestClient) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6  # to be turned a quarter clockwise
    exif[0x010F] = "Maker"
    answer = client.post("/v1/photo", **form(encode(scene(64, 48), "WEBP", exif=exif)))
    assert answer.headers["content-type"] == "image/jpeg"
    shown = Image.open(BytesIO(answer.content))
    assert (shown.size, dict(shown.getexif())) == ((48, 64), {})
    assert client.post("/v1/photo", **form(b"no photo")).status_code == 400


def test_routes_without_parameters_refuse_any(client: TestClient, jpeg: bytes) -> None:
    for answer in (client.post("/v1/photo?side=512", **form(jpeg)), client.get("/v1/model?side=")):
        expected = {"field": "side", "place": "query", "detail": "is not known here", "code": "unknown"}
        assert (answer.status_code, answer.json()["errors"]) == (422, [expected])


def test_the_model_describes_itself(client: TestClient) -> None:
    answer = client.get("/v1/model").json()
    assert answer == {
        "name": "tiny", "version": "0.0.1", "licence": "Apache-2.0", "grid": "rings:3x8", "accuracy": {},
        "matching": has_opencv(), "scene_tools": [*EXPORTERS], "sky_models": [*SKY_MODELS],
        "scene_labels": {tool: entry.label for tool, entry in EXPORTERS.items()},
        "map_formats": [*FORMATS], "jobs": False,
    }  # fmt: skip


@pytest.mark.parametrize("there", [True, False])
def test_the_model_says_whether_photos_are_matched(
    client: TestClient, monkeypatch: pytest.MonkeyPatch, there: bool
) -> None:
    monkeypatch.setattr("lighting.registration.features.has_opencv", lambda: there)
    assert client.get("/v1/model").json()["matching"] is there


def test_head_is_get_without_the_body(client: TestClient) -> None:
    for path in ("/", "/livez", "/v1/model"):
        get, head = client.get(path), client.head(path)
        assert (head.status_code, head.content) == (200, b"")
        assert head.headers["content-length"] == get.headers["content-length"]


def test_a_record_with_one_irradiance_alone_is_refused(client: TestClient) -> None:
    record = {"sun": {"azimuth": 9, "elevation": 30, "irradiance": [1, 1, 1]}, "sky": {"turbidity": 3, "exposure": 1}}
    answer = client.post("/v1/envmap?height=16", json=record)
    assert answer.status_code == 422
    (error,) = answer.json()["errors"]
    assert (error["field"], error["place"], error["code"]) == ("sky.irradiance", "body", "missing")
    assert "go together" in error["detail"]


def test_the_shape_of_the_sky_and_the_place_are_choices(client: TestClient, jpeg: bytes) -> None:
    def image(query: str) -> bytes:
        return client.post(f"/v1/envmap?height=32&{query}", content=jpeg, headers=JPEG).content

    bare = image("")
    assert image("surroundings=false") == bare
    assert len({bare, image("surroundings=true"), image("sky=preetham")}) == 3


def test_detail_is_a_choice_where_the_place_is_shown(client: TestClient, jpeg: bytes) -> None:
    def image(query: str) -> bytes:
        return client.post(f"/v1/envmap?height=64&{query}", content=jpeg, headers=JPEG).content

    detailed = image("surroundings=true")
    assert image("surroundings=true&detail=true") == detailed
    assert image("surroundings=true&detail=false") != detailed
    assert image("surroundings=false&detail=true") == image("surroundings=false&detail=false")


def test_the_mask_of_the_ground_is_a_png(client: TestClient, jpeg: bytes) -> None:
    answer = client.post("/v1/ground", **form(jpeg))
    assert answer.headers["content-type"] == "image/png"
    with Image.open(BytesIO(answer.content)) as mask:
        assert (mask.mode, mask.size) == ("RGB", (256, 192))
    record = client.post("/v1/lighting?camera_height=12", **form(jpeg)).json()
    assert record["camera"]["height"] == 12.0
    assert not {"visible", "spot"} & set(record.get("ground", {}))  # this network does not tell what photos show
    assert client.post("/v1/ground?camera_height=0", **form(jpeg)).status_code == 422


def test_the_light_of_another_day(client: TestClient, jpeg: bytes) -> None:
    place = "latitude=48.14&longitude=11.58"
    answer = client.post(f"/v1/day?date=2026-12-21&every=120&heading=90&{place}", **form(jpeg)).json()
    assert [hour["time"] for hour in answer["hours"]] == [f"2026-12-21T{hour}:00:00+01:00" for hour in (10, 12, 14, 16)]
    noon = answer["hours"][1]["lighting"]
    assert noon["sun"]["elevation"] == pytest.approx(18.4, abs=0.3)
    assert noon["sun"]["azimuth"] == pytest.approx(177 - 90, abs=3)
    assert "place" not in noon
    assert "The place around the photo is relit: a guess." in answer["warnings"]
    for query, field in ((f"heading=90&{place}&date=x", "date"), ("heading=90&date=2026-12-21", "latitude")):
        refused = client.post(f"/v1/day?{query}", **form(jpeg))
        assert refused.status_code == 422
        assert refused.json()["errors"][0]["field"] == field


def test_the_nearest_ground_in_the_sun(client: TestClient, jpeg: bytes) -> None:
    mask = np.asarray(Image.open(BytesIO(client.post("/v1/ground", **form(jpeg)).content)))
    for point in ((0.5, 0.8), (0.0, 1.0)):
        answer = client.post("/v1/ground/lit-spot?x={}&y={}".format(*point), **form(jpeg))
        assert answer.json() == {"spot": (spot := find_lit_spot(mask, point)) and list(spot)}
    assert client.post("/v1/ground/lit-spot?x=1.1&y=0", **form(jpeg)).status_code == 422

"""Tests of request body."""

import gzip
import json
import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from typing import Any

import pytest
from fastapi.exceptions import RequestValidationError
from PIL import Image
from starlette.testclient import TestClient

from lighting.estimator import Estimator
from lighting.record_json import MAX_RECORD_BYTES, json_line, record_with_coefficients
from lighting.records import Lighting
from server.problems import ProblemError
from server.request_body import parse_record
from tests.conftest import encode, scene
from tests.helpers.photos import chunk, png
from tests.server.conftest import client_of, problem

LIGHT = Lighting(sun_azimuth=-41.2, sun_elevation=33.0, turbidity=3.4, exposure=0.02)


@pytest.mark.parametrize("text", [json.dumps(record_with_coefficients(LIGHT)), json_line("photo.jpg", LIGHT)])
def test_a_record_is_read_bare_or_from_a_line_of_estimate(text: str) -> None:
    assert parse_record(text.encode()) == LIGHT


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be"])
def test_a_record_is_read_as_editors_and_powershell_encode_it(encoding: str) -> None:
    assert parse_record(json.dumps(record_with_coefficients(LIGHT)).encode(encoding)) == LIGHT


@pytest.mark.parametrize("data", [b"", b"{", b"\xff\xfe", b"\xff\xfe\x00\xd8", b'{"a": "\xff"}'])
def test_what_is_not_json_is_a_problem(data: bytes) -> None:
    with pytest.raises(ProblemError, match="not JSON"):
        parse_record(data)


@pytest.mark.parametrize(
    "content", [{"lightings": [record_with_coefficients(LIGHT)] * 2}, {"file": "x.jpg", "error": "Gone."}]
)
def test_an_answer_about_several_photos_and_an_error_are_no_record(content: dict[str, Any]) -> None:
    with pytest.raises(ProblemError) as caught:
        parse_record(json.dumps(content).encode())
    (error,) = caught.value.errors
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
    with pytest.raises(ProblemError, match=f"^{field}: The key '{field}' is given twice.$") as caught:
        parse_record(text.encode())
    (error,) = caught.value.errors
    assert (error["field"], error["place"]) == (field, "body")


def test_among_the_coefficients_unknown_ones_are_ignored_as_elsewhere() -> None:
    record = record_with_coefficients(LIGHT)
    record["sky"]["coefficients"] |= {str(number): 1 for number in range(9000)}
    assert parse_record(json.dumps(record).encode()) == LIGHT


def test_of_a_long_list_the_first_wrong_item_is_named() -> None:
    record = record_with_coefficients(LIGHT)
    record |= {"evidence": [1] * 30_000, "warnings": [1] * 30_000}
    record["sun"]["direction"] = record["sky"]["coefficients"]["r"] = ["x"] * 30_000
    with pytest.raises(RequestValidationError) as caught:
        parse_record(json.dumps(record).encode())
    assert len(caught.value.errors()) == 4


@pytest.mark.parametrize("text", ["[" * 50_000, '{"sky": {"coefficients": {"\\ud800": 1}}}'])
def test_json_that_nothing_could_hold_is_a_problem(text: str) -> None:
    with pytest.raises(ProblemError, match="not JSON"):
        parse_record(text.encode())


LIMIT = 300_000  # bytes
BOUNDARY = "frontier"
GOOD = encode(scene(320, 240))


@pytest.fixture
def client(estimator: Estimator) -> Iterator[TestClient]:
    """A service with low limits, which must answer a good request after whatever the test did."""
    client = client_of(estimator, max_bytes=LIMIT, max_pixels=1_000_000)
    yield client
    assert client.post("/v1/lighting", content=GOOD, headers={"Content-Type": "image/jpeg"}).status_code == 200
    assert client.app.state.service.limiter.admitted == 0  # type: ignore[attr-defined]


TEXT_BOMB = chunk(b"zTXt", b"Comment\0\0" + zlib.compress(bytes(100_000_000), 9))

BAD_PHOTOS = {
    "empty": (b"", 400),
    "text": (b"This is no picture.", 400),
    "zeros": (bytes(10_000), 400),
    "half a JPEG": (GOOD[: len(GOOD) // 2], 400),
    "a JPEG's first bytes": (GOOD[:20], 400),
    "a JPEG without its first byte": (GOOD[1:], 400),
    "GIF": (encode(scene(64, 64), "GIF"), 400),
    "BMP": (encode(scene(64, 64), "BMP"), 400),
    "a TIFF of floats": (encode(Image.new("F", (64, 64)), "TIFF"), 400),
    "a RAW file without a preview": (b"FUJIFILMCCD-RAW 0201" + bytes(200), 400),
    "SVG": (b'<?xml version="1.0"?><svg xmlns="http://www.w3.org/2000/svg" width="99" height="99"/>', 400),
    "PostScript": (b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 99 99\n", 400),
    "1 x 1": (encode(scene(1, 1), "PNG"), 400),
    "30000 x 1": (encode(Image.new("L", (30_000, 1)), "PNG"), 400),
    "1 x 30000": (encode(Image.new("L", (1, 30_000)), "PNG"), 400),
    "0 x 0": (png(0, 0, b"\0"), 400),
    "a PNG over the pixel limit": (encode(Image.new("L", (2000, 2000)), "PNG"), 413),
    "a PNG of 10^10 pixels": (png(100_000, 100_000, b"\0" * 100), 413),
    "a PNG of 2^62 pixels": (png(2**31 - 1, 2**31 - 1, b"\0" * 100), 413),
    "a PNG whose comment inflates to 100 MB": (png(400, 400, bytes(401), TEXT_BOMB), 400),
    "HEIC brand and nothing else": (b"\0\0\0\x18ftypheic\0\0\0\0mif1heic", 400),
    "ZIP with the name of a JPEG": (b"PK\x03\x04" + bytes(26) + b"photo.jpg" + GOOD[:100], 400),
    "HTML before a JPEG": (b"<html><script>alert(1)</script></html>" + GOOD, 400),
    "over the byte limit": (GOOD + bytes(LIMIT), 413),
}
KINDS = {400: "unreadable-photo", 413: "too-large"}


@pytest.mark.parametrize("name", BAD_PHOTOS)
@pytest.mark.parametrize("path", ["/v1/lighting", "/v1/envmap", "/v1/preview"])
def test_a_raw_body_that_is_no_photo(client: TestClient, path: str, name: str) -> None:
    data, status = BAD_PHOTOS[name]
    problem(client.post(path, content=data, headers={"Content-Type": "image/png"}), status, KINDS[status])


@pytest.mark.parametrize("name", BAD_PHOTOS)
def test_a_file_in_a_form_that_is_no_photo(client: TestClient, name: str) -> None:
    data, status = BAD_PHOTOS[name]
    problem(client.post("/v1/lighting", files={"photo": ("x.jpg", data, "image/jpeg")}), status, KINDS[status])


@pytest.mark.parametrize("media", ["image/jpeg", "multipart/form-data; boundary=frontier", "application/json"])
def test_a_body_without_a_length_is_counted_as_it_comes(client: TestClient, media: str) -> None:
    sent = 0

    def endless() -> Iterator[bytes]:
        nonlocal sent
        yield f'--{BOUNDARY}\r\nContent-Disposition: form-data; name="photo"; filename="a"\r\n\r\n'.encode()
        for _ in range(100):
            sent += 50_000
            yield bytes(50_000)

    answer = client.post("/v1/envmap", content=endless(), headers={"Content-Type": media})
    assert "larger than the limit" in problem(answer, 413, "too-large")["detail"]


@pytest.mark.parametrize("lie", ["-1", "abc", "1e3", "9" * 30])
def test_a_strange_length_does_no_harm(client: TestClient, lie: str) -> None:
    headers = {"Content-Type": "image/jpeg", "Content-Length": lie}
    answer = client.post("/v1/lighting", content=GOOD, headers=headers)
    assert answer.status_code == (413 if lie.startswith("9") else 200)


OTHER_TYPES = [
    None,
    "",
    "text/plain",
    "application/x-www-form-urlencoded",
    "application/octet-stream",
    "image/gif",
    "image/*",
    "image",
    "image/jpg",
    "image/pjpeg",
    "image/x-png",
    "image/tif",
    "application/json",
    "multipart/mixed; boundary=x",
    "é/é",
]


@pytest.mark.parametrize("media", OTHER_TYPES)
def test_a_photo_is_taken_by_its_bytes_whatever_its_content_type(client: TestClient, media: str | None) -> None:
    headers = {} if media is None else {b"Content-Type": media.encode("latin-1")}
    answer = client.request("POST", "/v1/lighting", content=GOOD, headers=headers)
    assert answer.status_code == 200, answer.text
    for other in (b"", b"GIF89a", b"GIF89a" + bytes(50), b'{"photo": "AAAA"}', b"photo=@photo.jpg"):
        answer = client.request("POST", "/v1/lighting", content=other, headers=headers)
        problem(answer, 415, "unsupported-type")
        assert "image/jpeg" in answer.headers["accept"]
        assert "application/json" not in answer.headers["accept"]


@pytest.mark.parametrize("kind", ["PNG", "WEBP", "TIFF", "AVIF", "HEIF"])
def test_every_format_is_known_by_its_bytes(client: TestClient, kind: str) -> None:
    assert client.request("POST", "/v1/lighting", content=encode(scene(160, 120), kind)).status_code == 200


def test_chunks_smaller_than_a_head_are_put_together(client: TestClient) -> None:
    content = iter([GOOD[:1], GOOD[1:5], GOOD[5:]])
    assert client.request("POST", "/v1/lighting", content=content).status_code == 200


@pytest.mark.parametrize(("path", "media"), [("/v1/lighting", "image/jpeg"), ("/v1/envmap", "application/json")])
@pytest.mark.parametrize("coding", ["gzip", "GZIP", "gzip, br", "zstd"])
def test_a_body_with_a_content_encoding_is_415(client: TestClient, path: str, media: str, coding: str) -> None:
    headers = {"Content-Type": media, "Content-Encoding": coding}
    answer = client.post(path, content=gzip.compress(GOOD), headers=headers)
    assert "Content-Encoding" in problem(answer, 415, "unsupported-type")["detail"]
    assert answer.headers["accept-encoding"] == "identity"


def test_the_identity_is_no_content_encoding(client: TestClient) -> None:
    headers = {"Content-Type": "image/jpeg", "Content-Encoding": "identity"}
    assert client.post("/v1/lighting", content=GOOD, headers=headers).status_code == 200


def test_json_is_taken_where_a_record_is(client: TestClient) -> None:
    problem(client.post("/v1/preview", json={}), 415, "unsupported-type")
    assert "application/json" in client.post("/v1/envmap", content=b"", headers={}).headers["accept"]


@pytest.mark.parametrize("media", ["image/png", "image/webp", "IMAGE/JPEG", "image/jpeg; charset=klingon"])
def test_the_bytes_say_what_a_photo_is(client: TestClient, media: str) -> None:
    assert client.post("/v1/lighting", content=GOOD, headers={"Content-Type": media}).status_code == 200


def exif_garbage() -> bytes:
    segment = b"Exif\0\0MM\0*\xff\xff\xff\xff" + bytes(range(256)) * 8
    return GOOD[:2] + b"\xff\xe1" + struct.pack(">H", len(segment) + 2) + segment + GOOD[2:]


@pytest.mark.parametrize(
    "data",
    [
        exif_garbage(),
        GOOD + b"PK\x03\x04 a ZIP behind the photo",
        GOOD + b"<script>alert(1)</script>",
        GOOD + GOOD[:1000],
    ],
    ids=["EXIF garbage", "ZIP behind", "HTML behind", "another begun"],
)
def test_oddities_around_a_good_photo_are_left_alone(client: TestClient, data: bytes) -> None:
    assert client.post("/v1/lighting", content=data, headers={"Content-Type": "image/jpeg"}).status_code == 200


def form(*parts: bytes, end: bytes = b"--frontier--\r\n") -> bytes:
    return b"".join(b"--frontier\r\n" + part + b"\r\n" for part in parts) + end


FILE = b'Content-Disposition: form-data; name="photo"; filename="p.jpg"\r\n\r\n' + GOOD
OTHER = b'Content-Disposition: form-data; name="other"; filename="p.jpg"\r\n\r\n' + GOOD
TEXT = b'Content-Disposition: form-data; name="photo"\r\n\r\ntext'
NAMELESS = b"Content-Disposition: form-data\r\n\r\ntext"
FIELD = b'Content-Disposition: form-data; name="note"\r\n\r\ntext'

BAD_FORMS = {
    "empty": (b"", 400),
    "no part": (form(), 422),
    "another field": (form(OTHER), 422),
    "text in the field": (form(TEXT), 422),
    "text and a file": (form(TEXT, FILE), 422),
    "nine files": (form(*[FILE] * 9), 422),
    "seventeen files": (form(*[FILE] * 17), 422),
    "text behind a file": (form(FILE, TEXT), 422),
    "too many fields": (form(*[FIELD] * 65), 400),
    "a nameless part": (form(NAMELESS), 400),
    "no disposition": (form(b"\r\n" + GOOD), 400),
    "another boundary": (form(FILE).replace(b"frontier", b"limit"), 400),
    "cut short": (form(FILE)[:3000], 400),
    "cut in the headers": (form(FILE)[:40], 400),
    "no end": (form(FILE, end=b""), 400),
    "noise": (bytes(range(256)) * 20, 400),
}


@pytest.mark.parametrize("name", BAD_FORMS)
def test_a_form_that_is_not_as_it_should_be(client: TestClient, name: str) -> None:
    data, status = BAD_FORMS[name]
    headers = {"Content-Type": f"multipart/form-data; boundary={BOUNDARY}"}
    body = problem(client.post("/v1/lighting", content=data, headers=headers), status, FORM_KINDS[status])
    assert status == 400 or body["errors"][0]["field"] == ("other" if name == "another field" else "photo")


FORM_KINDS = {400: "unreadable-body", 422: "invalid"}


@pytest.mark.parametrize("parameters", ["", "; boundary=", f"; boundary={'x' * 500}", "; boundary=é"])
def test_a_form_without_a_boundary_of_use_is_400(client: TestClient, parameters: str) -> None:
    headers = {b"Content-Type": f"multipart/form-data{parameters}".encode("latin-1")}
    answer = client.post("/v1/lighting", content=form(FILE), headers=headers)
    assert answer.status_code in (400, 422)
    assert answer.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize("charset", ["utf-16", "klingon", "idna", "rot13", "zlib"])
def test_a_form_in_a_wrong_charset_does_no_harm(client: TestClient, charset: str) -> None:
    headers = {"Content-Type": f"multipart/form-data; boundary={BOUNDARY}; charset={charset}"}
    assert client.post("/v1/lighting", content=form(FILE), headers=headers).status_code in (200, 400, 422)


def test_names_that_are_no_text_are_refused_in_words(client: TestClient) -> None:
    named = rb'Content-Disposition: form-data; name="\ud800"; filename="\ud800"' + b"\r\n\r\ntext"
    for part, status, name in (
        (named, 422, "invalid"),
        (named.replace(rb"\ud800", b"photo", 1), 400, "unreadable-photo"),
    ):
        headers = {"Content-Type": f"multipart/form-data; boundary={BOUNDARY}; charset=unicode_escape"}
        body = problem(client.post("/v1/lightings", content=form(FILE, part), headers=headers), status, name)
        assert "\ud800" in body["detail"]


def test_a_file_in_a_form_may_have_any_name(client: TestClient) -> None:
    for name in ("../../etc/passwd", "a\0b", "x" * 2000, "фото.jpg", ""):
        files: Any = {"photo": (name or "p", GOOD, "text/html")}
        assert client.post("/v1/lighting", files=files).status_code == 200, name


@pytest.mark.parametrize("path", ["/v1/lighting", "/v1/envmap", "/v1/preview", "/v1/scene?for=usd"])
def test_wrong_fields_of_a_form_are_named_with_their_place(client: TestClient, path: str) -> None:
    files: Any = {"photo": ("p.jpg", GOOD, "image/jpeg")}
    body = problem(client.post(path, files=files, data={"lat": "9999", "note": "hello"}), 422, "invalid")
    assert [(error["field"], error["place"]) for error in body["errors"]] == [("latitude", "form"), ("note", "form")]


def test_the_fields_of_a_form_are_parameters(client: TestClient) -> None:
    files: Any = {"photo": ("p.jpg", GOOD, "image/jpeg")}
    for path, fields in (
        ("/v1/lighting", {"camera_height": "12", "probability": "true"}),
        ("/v1/envmap", {"height": "16", "format": "png", "turbidity": "9"}),
        ("/v1/scene", {"tool": "gltf", "height": "16"}),
    ):
        by_url = client.post(path, params=fields, files=files)
        by_form = client.post(path, data=fields, files=files)
        (one, value), *others = fields.items()
        by_both = client.post(path, params={one: value}, data=dict(others), files=files)
        assert by_url.status_code == 200, by_url.text
        assert by_url.content == by_form.content == by_both.content
    for first, second in (({"fov": "50"}, {"fov": "50"}), ({}, {"fov": ["50", "60"]})):
        (error,) = problem(client.post("/v1/lighting", params=first, data=second, files=files), 422, "invalid")[
            "errors"
        ]
        assert (error["field"], error["place"], error["code"]) == ("fov", "form", "duplicate")
    for data in ({"exif": "x" * 70_000}, {f"name{number}": "1" for number in range(70)}):
        problem(client.post("/v1/lighting", data=data, files=files), 400, "unreadable-body")
    (error,) = problem(client.post("/v1/photo", data={"fov": "50"}, files=files), 422, "invalid")["errors"]
    assert (error["field"], error["place"]) == ("fov", "form")


def test_a_text_in_place_of_the_photo_is_told_how_to_send_one(client: TestClient) -> None:
    body = problem(client.post("/v1/lighting", files={"photo": (None, "p.jpg")}), 422, "invalid")
    assert "curl -F photo=@FILE" in body["detail"]


def test_a_file_in_another_field_is_named(client: TestClient) -> None:
    files: Any = dict.fromkeys(("photo", "other"), ("p.jpg", GOOD, "image/jpeg"))
    (error,) = problem(client.post("/v1/lighting", files=files), 422, "invalid")["errors"]
    assert (error["field"], error["place"]) == ("other", "form")


def test_a_parameter_of_the_url_is_placed_there(client: TestClient) -> None:
    headers = {"Content-Type": "image/jpeg"}
    (error,) = problem(
        client.post("/v1/lighting?latitude=9999&longitude=1", content=GOOD, headers=headers), 422, "invalid"
    )["errors"]
    assert (error["field"], error["place"]) == ("latitude", "query")
    record = {"sun": {"azimuth": 999, "elevation": 2}, "sky": {"turbidity": 3, "exposure": 0.1}}
    (error,) = problem(client.post("/v1/envmap", json=record), 422, "invalid")["errors"]
    assert (error["field"], error["place"]) == ("sun.azimuth", "body")


def test_a_record_has_a_limit_of_its_own_as_on_the_command_line(estimator: Estimator) -> None:
    client = client_of(estimator)
    body = b'{"sun": "' + b"x" * MAX_RECORD_BYTES + b'"}'
    answer = client.post("/v1/envmap", content=body, headers={"Content-Type": "application/json"})
    assert "limit of 1 MB" in problem(answer, 413, "too-large")["detail"]


def test_an_answer_is_taken_as_a_record_however_it_was_edited(estimator: Estimator) -> None:
    client = client_of(estimator)
    headers = {"Content-Type": "image/jpeg"}
    record = client.post("/v1/lighting?probability=true", content=GOOD, headers=headers).json()
    record["surroundings"] = {"rows": 24, "columns": 48, "factors": [[0.123, 0.456, 0.789]] * 24 * 48}
    body = json.dumps(record, indent=4).encode("utf-16")
    answer = client.post("/v1/envmap?height=16", content=body, headers={"Content-Type": "application/json"})
    assert answer.status_code == 200


def test_no_upload_ever_reaches_the_disk(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    import tempfile

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a temporary file")

    monkeypatch.setattr(tempfile, "TemporaryFile", refuse)
    monkeypatch.setattr(tempfile.SpooledTemporaryFile, "rollover", refuse)
    large = BytesIO(encode(scene(900, 800), "JPEG", quality=100))
    assert client.post("/v1/lighting", files={"photo": ("p.jpg", large, "image/jpeg")}).status_code == 200

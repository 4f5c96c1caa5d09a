"""Errors: every one is problem+json, says which field and range, and gives nothing away."""

import json
import logging
from typing import Any

import pytest
from fastapi import FastAPI
from starlette.testclient import TestClient

from lighting.errors import LightingError, ModelError, ParameterError, PhotoError, PhotoTooLargeError
from lighting.estimator import Estimator
from lighting.fields import RANGES
from lighting.photo import sandbox
from lighting.scene import EXPORTERS
from server import problems
from server.problems import MAX_ERRORS
from tests.server.conftest import SKY, client_of, problem

JPEG = {"Content-Type": "image/jpeg"}


def test_an_unknown_path_is_404_and_names_itself_without_harm(client: TestClient) -> None:
    assert problem(client.get("/nothing"), 404, "not-found")["instance"] == "/nothing"
    strange = problem(client.get("/v1/%3Cb%3E%0d%0a%C3%A9"), 404, "not-found")["instance"]
    assert strange == "/v1/%3Cb%3E%0D%0A%C3%A9"


@pytest.mark.parametrize(
    ("method", "path", "instead"),
    [
        ("GET", "/healthz", "GET /readyz"),
        ("POST", "/healthz", "GET /readyz"),
        ("GET", "/v1/stereo/plan?lat=47&lon=10&date=2026-06-21", "`lighting stereo plan`"),
    ],
)
def test_a_removed_route_is_410_and_names_what_to_use(client: TestClient, method: str, path: str, instead: str) -> None:
    assert instead in problem(client.request(method, path), 410, "removed")["detail"]


@pytest.mark.parametrize(
    "path", ["/v1/lighting?fov=50&fov=60", "/v1/envmap?height=64&sun=true&height=64", "/v1/model?a=&a="]
)
def test_what_is_said_twice_is_refused_by_name(client: TestClient, jpeg: bytes, path: str) -> None:
    name = path.rsplit("&", 1)[1].partition("=")[0]
    answer = client.get(path) if "model" in path else client.post(path, content=jpeg, headers=JPEG)
    (error,) = problem(answer, 422, "invalid")["errors"]
    assert error == {"field": name, "place": "query", "detail": "is given more than once", "code": "duplicate"}


@pytest.mark.parametrize(
    ("method", "path", "allowed"),
    [
        ("GET", "/v1/lighting", "POST"),
        ("PUT", "/v1/envmap", "GET, HEAD, POST"),
        ("DELETE", "/v1/model", "GET, HEAD"),
        ("POST", "/livez", "GET, HEAD"),
        ("OPTIONS", "/v1/preview", "POST"),
        ("HEAD", "/v1/preview", "POST"),
        ("TEAPOT", "/v1/envmap", "GET, HEAD, POST"),
        ("POST", "/", "GET, HEAD"),
    ],
)
def test_a_method_that_is_not_allowed_is_405_and_names_all_that_are(
    client: TestClient, method: str, path: str, allowed: str
) -> None:
    answer = client.request(method, path)
    if method != "HEAD":
        problem(answer, 405, "method-not-allowed")
    assert (answer.status_code, answer.headers["allow"]) == (405, allowed)


@pytest.mark.parametrize("name", ["sun_azimuth", "sun_elevation", "turbidity", "exposure", "ground_albedo"])
@pytest.mark.parametrize("value", ["-1e9", "1e9", "nan", "inf", "-inf", "blue", "", "0x10", "1,5"])
def test_a_parameter_out_of_range_is_422_with_its_range(client: TestClient, name: str, value: str) -> None:
    body = problem(client.get("/v1/envmap", params={**SKY, name: value}), 422, "invalid")
    low, high = RANGES[name]
    (error,) = body["errors"]
    assert (error["field"], error["minimum"], error["maximum"]) == (name, low, high)
    assert f"from {low:g} to {high:g}" in body["detail"]


@pytest.mark.parametrize(
    ("value", "words"), [("15", "16 to 2048"), ("4096", "2048"), ("33", "even"), ("1.5", "number")]
)
def test_a_height_must_be_even_and_in_range(client: TestClient, value: str, words: str) -> None:
    (error,) = problem(client.get("/v1/envmap", params={**SKY, "height": value}), 422, "invalid")["errors"]
    assert error["field"] == "height"
    assert words in error["detail"]


@pytest.mark.parametrize(
    ("query", "words"),
    [
        ({"format": "jpeg"}, "must be 'exr', 'hdr' or 'png'"),
        ({"format": "exrr"}, "must be 'exr', 'hdr' or 'png'; did you mean exr?"),
        ({"format": ""}, "must be 'exr', 'hdr' or 'png'"),
        ({"sun": "yes"}, "must be true or false"),
        ({"sun": ""}, "must be true or false"),
        ({"yaws": "3"}, "is not known here; did you mean yaw?"),
        ({"sun_elevaton": "3"}, "is not known here; did you mean sun_elevation?"),
        ({"width": "1024"}, "is not known here; did you mean height?"),
        ({"rotation": "90"}, "is not known here; did you mean yaw?"),
        ({"x": "3"}, "is not known here"),
        ({"y" * 9000: "3"}, "is not known here"),
    ],
)
def test_unknown_names_and_words_are_422(client: TestClient, query: dict[str, str], words: str) -> None:
    (error,) = problem(client.get("/v1/envmap", params={**SKY, **query}), 422, "invalid")["errors"]
    assert error["field"] in query
    assert error["detail"] == words


def test_a_sun_of_one_number_is_told_the_second(client: TestClient, jpeg: bytes) -> None:
    answer = client.post("/v1/envmap?sun=40", content=jpeg, headers={"Content-Type": "image/jpeg"})
    (error,) = problem(answer, 422, "invalid")["errors"]
    assert error["detail"] == "must be true, false, or AZIMUTH,ELEVATION in degrees such as 40,25"


def test_a_choice_that_is_missing_is_told_with_its_values(client: TestClient) -> None:
    (error,) = problem(client.get("/v1/scene", params=SKY), 422, "invalid")["errors"]
    assert (error["field"], error["code"]) == ("for", "missing")
    assert error["detail"] == f"is missing; it is one of {', '.join(EXPORTERS)}"


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("/v1/estimate", "There is no such route. Did you mean POST /v1/lighting? GET /docs lists all."),
        ("/estimate", "There is no such route. Did you mean POST /v1/lighting? GET /docs lists all."),
        ("/health", "There is no such route. Did you mean GET /livez? GET /docs lists all."),
        ("/v1/hdri", "There is no such route. Did you mean POST /v1/envmap? GET /docs lists all."),
        ("/v1/lightning", "There is no such route. Did you mean /v1/lighting? GET /docs lists all."),
        ("/v1/lightings/", "There is no such route. Did you mean /v1/lightings? GET /docs lists all."),
        ("/v1/enviromap", "There is no such route. Did you mean /v1/envmap? GET /docs lists all."),
        ("/openapi.yaml", "There is no such route. Did you mean /openapi.json? GET /docs lists all."),
        ("/" + "x" * 9000, "There is no such route. GET /docs lists all."),
    ],
)
def test_a_path_that_is_no_route_is_told_a_similar_one(client: TestClient, path: str, words: str) -> None:
    assert problem(client.get(path), 404, "not-found")["detail"] == words


def test_of_very_many_errors_the_first_are_named(client: TestClient) -> None:
    answer = client.get("/v1/envmap", params=dict.fromkeys(map(str, range(500)), "1"))
    body = problem(answer, 422, "invalid")
    assert len(body["errors"]) == MAX_ERRORS
    assert body["detail"].endswith(f"; and {3 + 500 - MAX_ERRORS} more")  # three are missing


def test_every_missing_parameter_is_named(client: TestClient) -> None:
    errors = problem(client.get("/v1/envmap"), 422, "invalid")["errors"]
    assert {error["field"] for error in errors} == set(SKY) - {"exposure"}
    assert {error["detail"] for error in errors} == {"is missing"}


@pytest.mark.parametrize(
    ("section", "name", "value", "limits"),
    [
        ("sun", "azimuth", 181, RANGES["sun_azimuth"]),
        ("sun", "elevation", -4.3, RANGES["sun_elevation"]),
        ("sun", "visibility", 2, RANGES["sun_visibility"]),
        ("sky", "turbidity", "3", RANGES["turbidity"]),
        ("sky", "exposure", True, RANGES["exposure"]),
        ("sky", "ground_albedo", None, RANGES["ground_albedo"]),
        ("camera", "vertical_fov", 0.5, RANGES["vertical_fov"]),
        ("sky", "exposure", int("9" * 400), RANGES["exposure"]),
    ],
)
def test_a_field_of_a_record_out_of_range_is_422_with_its_range(
    client: TestClient, section: str, name: str, value: object, limits: tuple[float, float]
) -> None:
    record: dict[str, Any] = {"sun": {"azimuth": 1, "elevation": 2}, "sky": {"turbidity": 3, "exposure": 0.1}}
    record = {**record, section: {**record.get(section, {}), name: value}}
    (error,) = problem(client.post("/v1/envmap", json=record), 422, "invalid")["errors"]
    assert (error["field"], error["minimum"], error["maximum"]) == (f"{section}.{name}", *limits)


OBJECT = "must be a JSON object"
BOTH = '"sun": {"azimuth": 1, "elevation": 2}, "sky": {"turbidity": 3, "exposure": 4}'


@pytest.mark.parametrize(
    ("body", "detail"),
    [
        ("[]", f"body: {OBJECT}"),
        ("3", f"body: {OBJECT}"),
        ("null", f"body: {OBJECT}"),
        ('"text"', f"body: {OBJECT}"),
        ("{}", "sun: is missing; sky: is missing"),
        ('{"sun": 3}', f"sun: {OBJECT}; sky: is missing"),
        ('{"sky": {"model": "preetham"}}', "sun: is missing; sky.turbidity: is missing; sky.exposure: is missing"),
        (f'{{{BOTH}, "ground": {{"color": [0.1]}}}}', "ground.color: must have at least 3 values"),
        (f'{{{BOTH}, "ground": {{"color": [0, 0, 0, 0]}}}}', "ground.color: must have at most 3 values"),
        (f'{{{BOTH}, "ground": {{"color": 0.1}}}}', "ground.color: must be a list"),
        (f'{{{BOTH}, "model": {{"name": 7}}}}', "model.name: must be a text"),
        (f'{{{BOTH[:-1]}, "coefficients": []}}}}', f"sky.coefficients: {OBJECT}"),
    ],
)
def test_json_that_is_no_record_is_422_in_plain_words(client: TestClient, body: str, detail: str) -> None:
    answer = client.post("/v1/envmap", content=body, headers={"Content-Type": "application/json"})
    assert problem(answer, 422, "invalid")["detail"] == detail


@pytest.mark.parametrize("body", [b"", b"{", b"\xff\xfe{\x00", b'{"sun": NaN!}', b"[" * 50_000, b'{"a": "\x80"}'])
def test_a_body_that_is_not_json_is_400(client: TestClient, body: bytes) -> None:
    answer = client.post("/v1/envmap", content=body, headers={"Content-Type": "application/json; charset=utf-16"})
    problem(answer, 400, "unreadable-body")


def test_nan_in_a_record_is_422(client: TestClient) -> None:
    body = json.dumps({"sun": {"azimuth": 1, "elevation": float("nan")}, "sky": {"turbidity": 3, "exposure": 1}})
    answer = client.post("/v1/envmap", content=body, headers={"Content-Type": "application/json"})
    assert problem(answer, 422, "invalid")["errors"][0]["field"] == "sun.elevation"


@pytest.mark.parametrize(
    ("error", "status", "name"),
    [
        (PhotoError("Bad."), 400, "unreadable-photo"),
        (PhotoTooLargeError("Big."), 413, "too-large"),
        (ParameterError("Wrong."), 422, "invalid"),
        (ModelError("/secret/path is broken."), 500, "internal"),
        (LightingError("/secret/path"), 500, "internal"),
        (RuntimeError("/secret/path"), 500, "internal"),
        (MemoryError("/secret/path"), 500, "internal"),
    ],
)
def test_whatever_the_library_raises_has_its_problem(
    app: FastAPI, client: TestClient, error: Exception, status: int, name: str, monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture, jpeg: bytes,
) -> None:  # fmt: skip
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr(app.state.service, "estimate", fail)
    with caplog.at_level(logging.ERROR, "server"):
        answer = client.post("/v1/lighting", content=jpeg, headers=JPEG)
    body = problem(answer, status, name)
    assert "secret" not in answer.text + str(answer.headers)
    assert (body["request_id"] in caplog.text) == (status == 500)
    assert client.get("/livez").status_code == 200


def test_a_fault_of_ours_in_a_decoder_is_500_and_logged(
    client: TestClient, jpeg: bytes, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    code = "from lighting.photo import reader; reader.find_layout = lambda *_, **__: missing; "
    monkeypatch.setattr(sandbox, "_WORKER_CODE", code + sandbox._WORKER_CODE)
    monkeypatch.setattr(sandbox, "_idle", decoders := list[Any]())
    for _ in range(2):  # the decoder goes on
        caplog.clear()
        body = problem(client.post("/v1/lighting", content=jpeg, headers=JPEG), 500, "internal")
        assert "missing" not in json.dumps(body)
        assert body["request_id"] in caplog.text
        assert "NameError: name 'missing' is not defined" in caplog.text
    (decoder,) = decoders
    decoder.end()


def test_a_route_that_breaks_is_500_with_every_header(app: FastAPI, client: TestClient) -> None:
    @app.get("/broken")
    async def broken() -> None:
        raise ZeroDivisionError("secret")

    answer = client.get("/broken")
    problem(answer, 500, "internal")
    assert "secret" not in answer.text


def test_headers_of_http_errors_are_passed_on(app: FastAPI, client: TestClient) -> None:
    from fastapi import HTTPException

    @app.get("/later")
    async def later() -> None:
        raise HTTPException(503, "internals", {"Retry-After": "7"})

    answer = client.get("/later")
    assert problem(answer, 503, "service-unavailable")["detail"] == "Service Unavailable."
    assert answer.headers["retry-after"] == "7"


def test_kinds_have_different_names() -> None:
    assert len({kind.type for kind in problems.KINDS}) == len(problems.KINDS)


def test_a_service_without_its_network_is_503(estimator: Estimator, jpeg: bytes) -> None:
    client = client_of(estimator)
    client.app.state.service.loaded_estimator = None  # type: ignore[attr-defined]
    for answer in (
        client.post("/v1/lighting", content=jpeg, headers=JPEG),
        client.get("/v1/model"),
        client.get("/readyz"),
    ):
        assert problem(answer, 503, "not-ready")
        assert answer.headers["retry-after"] == "1"
    assert client.get("/v1/envmap", params={**SKY, "height": 16}).status_code == 200
    assert client.get("/livez").status_code == 200

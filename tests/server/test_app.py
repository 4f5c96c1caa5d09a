"""The app as a whole: its network, its middleware, its document."""

from pathlib import Path

import pytest
from fastapi import FastAPI
from starlette.testclient import TestClient

from lighting.errors import ModelError
from lighting.estimator import Estimator
from server.app import _EXPOSED_HEADERS, create_app
from server.settings import Settings, SettingsError
from tests.server.conftest import client_of


def test_the_network_is_loaded_once_at_the_start_with_the_threads_set(network: Path) -> None:
    app = create_app(Settings(model=network, threads=3))
    service = app.state.service
    assert service.loaded_estimator is None
    with TestClient(app):
        estimator = service.estimator
        assert estimator.model.session.get_session_options().intra_op_num_threads == 3
        service.load()
        assert service.estimator is estimator


def test_a_service_without_a_network_does_not_start(tmp_path: Path) -> None:
    app = create_app(Settings(model=tmp_path / "none.onnx"))
    with pytest.raises(ModelError, match="no network"), TestClient(app):
        pass


def test_a_file_of_keys_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="cannot be read"):
        create_app(Settings(api_keys_file=tmp_path / "none"))


def test_an_origin_that_may_call_sees_the_exposed_headers(estimator: Estimator) -> None:
    client = client_of(estimator, cors_origins=("https://page.example",))
    answer = client.get("/v1/model", headers={"Origin": "https://page.example"})
    assert answer.headers["access-control-allow-origin"] == "https://page.example"
    assert answer.headers["access-control-expose-headers"] == ", ".join(_EXPOSED_HEADERS)


def test_an_origin_that_may_call_may_ask_whether_its_copy_is_still_good(estimator: Estimator) -> None:
    client = client_of(estimator, cors_origins=("https://page.example",))
    asked = {"Access-Control-Request-Method": "GET", "Access-Control-Request-Headers": "if-none-match"}
    assert client.options("/v1/envmap", headers={"Origin": "https://page.example", **asked}).status_code == 200


def test_the_document_says_how_many_photos_a_form_may_hold(estimator: Estimator) -> None:
    document = client_of(estimator, max_photos=3).get("/openapi.json").json()
    body = document["paths"]["/v1/lightings"]["post"]["requestBody"]["content"]["multipart/form-data"]
    assert body["schema"]["properties"]["photo"]["maxItems"] == 3


def test_the_document_holds_the_schemas_of_bodies_and_errors(app: FastAPI) -> None:
    schemas = app.openapi()["components"]["schemas"]
    assert {"Problem", "LightingRecord", "LightingEstimate", "SunPart", "PlacePart"} <= set(schemas)
    assert app.openapi()["info"]["license"]["identifier"] == "Apache-2.0"

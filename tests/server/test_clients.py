"""Generated clients: they send every default that the OpenAPI document declares, and every example it gives."""

import importlib
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import anyio
import pytest
from fastapi import FastAPI
from starlette.testclient import TestClient

import lighting.envmap.surroundings as surroundings
import lighting.scene.records as records
from lighting.envmap.surroundings import render_view
from lighting.scene import EXPORTERS
from lighting.scene.records import make_scene
from server import tasks
from tests.conftest import encode, scene
from tests.helpers.pages import ROOT
from tests.helpers.service import started

Document = dict[str, Any]
PHOTO = encode(scene(64, 48))
NODE = ROOT / "tests" / "node"


@pytest.fixture
def client(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> TestClient:
    """A client of a service that draws small maps, whatever the size asked for."""
    monkeypatch.setattr(
        surroundings, "render_view", lambda lighting, _, **options: render_view(lighting, 16, **options)
    )
    for module in (tasks, records):
        monkeypatch.setattr(module, "make_scene", lambda *a, **options: make_scene(*a, **{**options, "map_height": 16}))
    return client


@pytest.fixture
def document(client: TestClient) -> Document:
    answer: Document = client.get("/openapi.json").json()
    return answer


def parameters(document: Document, path: str, method: str) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = document["paths"][path][method].get("parameters", [])
    return [parameter for parameter in found if parameter["in"] == "query"]


def words(value: Any) -> str:
    return json.dumps(value) if isinstance(value, bool) else str(value)


def declared(document: Document, path: str, method: str) -> dict[str, str]:
    """Every default of an operation's parameters, as a generated client sends it."""
    schemas = {parameter["name"]: parameter["schema"] for parameter in parameters(document, path, method)}
    return {name: words(s["default"]) for name, s in schemas.items() if s.get("default") is not None}


def examples(document: Document, path: str, method: str) -> dict[str, str]:
    """The example of each parameter that has one."""
    schemas = {parameter["name"]: parameter["schema"] for parameter in parameters(document, path, method)}
    return {name: words(s["examples"][0]) for name, s in schemas.items() if s.get("examples")}


def ask(client: TestClient, path: str, method: str, query: dict[str, str], photos: int = 1) -> Any:
    files = [("photo", ("p.jpg", PHOTO, "image/jpeg"))] * photos
    return client.request(method, path, params=query, files=files if method == "post" else None)


REQUIRED = {"/v1/scene": {"for": "usd"}}
OPERATIONS = [
    ("/v1/lighting", "post"), ("/v1/lightings", "post"), ("/v1/envmap", "get"), ("/v1/envmap", "post"),
    ("/v1/preview", "post"), ("/v1/scene", "get"), ("/v1/scene", "post"),
]  # fmt: skip


def needed(document: Document, path: str, method: str) -> dict[str, str]:
    """The parameters without which there is no answer, as their examples say them."""
    names = {parameter["name"] for parameter in parameters(document, path, method) if parameter.get("required")}
    said = {name: value for name, value in examples(document, path, method).items() if name in names}
    return {**said, **REQUIRED.get(path, {})}


@pytest.mark.parametrize(("path", "method"), OPERATIONS)
def test_every_default_is_accepted(client: TestClient, document: Document, path: str, method: str) -> None:
    query = {**declared(document, path, method), **needed(document, path, method)}
    answer = ask(client, path, method, query)
    assert answer.status_code == 200, answer.text


@pytest.mark.parametrize("method", ["get", "post"])
@pytest.mark.parametrize("tool", EXPORTERS)
def test_each_tool_takes_every_default(client: TestClient, document: Document, tool: str, method: str) -> None:
    query = {**needed(document, "/v1/scene", method), **declared(document, "/v1/scene", method), "for": tool}
    assert "up_axis" in query
    answer = ask(client, "/v1/scene", method, query)
    assert (answer.status_code, answer.content[:2]) == (200, b"PK"), answer.text


def test_a_record_takes_the_defaults_of_a_photo(client: TestClient, document: Document) -> None:
    record = {"sun": {"azimuth": 1, "elevation": 2}, "sky": {"turbidity": 3, "exposure": 0.1}}
    answer = client.post("/v1/envmap", params=declared(document, "/v1/envmap", "post"), json=record)
    assert answer.status_code == 200, answer.text


@pytest.mark.parametrize(("path", "method"), OPERATIONS)
def test_the_examples_do_not_contradict_each_other(
    client: TestClient, document: Document, path: str, method: str
) -> None:
    query = {**examples(document, path, method), **REQUIRED.get(path, {})}
    headings = query.pop("headings", None)  # of several photos, where heading is that of one
    answer = ask(client, path, method, query)
    assert answer.status_code == 200, answer.text
    if headings:
        query.pop("heading")
        several = ask(client, path, method, {**query, "headings": headings}, headings.count(",") + 1)
        assert several.status_code == 200, several.text


def test_the_link_of_the_examples_is_their_sky(client: TestClient, document: Document) -> None:
    (link,) = document["components"]["schemas"]["Links"]["properties"]["envmap"]["examples"]
    said = examples(document, "/v1/envmap", "get")
    linked = dict(part.split("=") for part in link.partition("?")[2].split("&"))
    assert {**said, "sun": "true"}.items() >= linked.items()
    assert client.get(f"/v1/{link}").status_code == 200  # as a client of /v1/lighting resolves it


@pytest.mark.slow
@pytest.mark.needs("openapi_python_client")
def test_a_client_by_openapi_python_client_gets_the_five_scenes(
    app: FastAPI, client: TestClient, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The client's own functions with nothing but the tool and the sky, so that all defaults are those it generated."""
    import httpx

    (tmp_path / "openapi.json").write_text(client.get("/openapi.json").text)
    (tmp_path / "config.yml").write_text("post_hooks: []\npackage_name_override: lighting_client\n")
    command = [sys.executable, "-m", "openapi_python_client", "generate", "--path", "openapi.json"]
    options = ["--config", "config.yml", "--meta", "none", "--output-path", "lighting_client"]
    done = subprocess.run([*command, *options], cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr + done.stdout
    monkeypatch.syspath_prepend(tmp_path)
    made = importlib.import_module("lighting_client")
    render = importlib.import_module("lighting_client.api.lighting.render_scene")
    tools = importlib.import_module("lighting_client.models")
    arguments = {"transport": httpx.ASGITransport(app=app)}
    service = made.Client(base_url="http://service", httpx_args=arguments, raise_on_unexpected_status=False)

    async def ask_all() -> dict[str, int]:
        kind = next(getattr(tools, name) for name in dir(tools) if name.endswith("SceneFor"))
        sky = {"sun_azimuth": -41.2, "sun_elevation": 33.0, "turbidity": 3.4}
        found = {}
        for tool in EXPORTERS:
            answer = await render.asyncio_detailed(client=service, for_=kind(tool), **sky)
            assert answer.content[:2] == b"PK", answer.content
            found[tool] = int(answer.status_code)
        return found

    assert anyio.run(ask_all) == dict.fromkeys(EXPORTERS, 200)


@pytest.mark.slow
@pytest.mark.needs("node", "tests/node")
def test_a_client_by_openapi_typescript_has_types_that_are_true(
    client: TestClient, network: Path, photo_path: Path, tmp_path: Path
) -> None:
    """It is compiled strictly against the types of the document and then asks a real service."""
    (tmp_path / "openapi.json").write_text(client.get("/openapi.json").text)
    (tmp_path / "node_modules").symlink_to(NODE / "node_modules")
    (tmp_path / "client.ts").write_text((NODE / "client.ts").read_text())
    (tmp_path / "package.json").write_text('{"type": "module"}')
    options = ["--strict", "--target", "es2022", "--module", "esnext", "--moduleResolution", "bundler"]
    for command in (
        ["openapi-typescript", "openapi.json", "-o", "api.d.ts"],
        ["tsc", *options, "--lib", "es2023,dom", "--types", "node", "--skipLibCheck", "client.ts"],
    ):
        program = [str(NODE / "node_modules" / ".bin" / command[0]), *command[1:]]
        done = subprocess.run(program, cwd=tmp_path, capture_output=True, text=True, timeout=240, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    with started(network) as server:
        url = f"http://127.0.0.1:{server.port}"
        asked = subprocess.run(
            ["node", "client.js", url, str(photo_path)], cwd=tmp_path, capture_output=True, text=True, timeout=240
        )
    assert asked.returncode == 0, asked.stderr
    answer = json.loads(asked.stdout)
    assert isinstance(answer.pop("azimuth"), int | float)
    assert answer == {"lights": 2, "bytes": 200, "field": "vertical_fov", "tools": list(EXPORTERS), "jobs": False}

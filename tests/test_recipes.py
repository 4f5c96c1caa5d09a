"""The recipes of CONTRIBUTING.md for a route and for an option of maps, carried out.

A route is one function and one model of its parameters; an option is one field and its use. The recipes for a sky model
and a scene tool are carried out by tests/test_registries.py, the one for a metadata rule by
tests/lighting/fusion/test_time_zones.py, the one for an augmentation by tests/export/crops/test_augmentation.py.
"""

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import numpy as np
import pytest
from fastapi import Query, Response
from pydantic import Field
from starlette.testclient import TestClient

from lighting.estimator import Estimator
from lighting.files.exr import read_exr
from lighting.map_options import MapKeywords, MapOptions
from lighting.model import Model
from lighting.records import Lighting
from server import query_params
from server.app import create_app
from server.dependencies import AdmissionDep
from server.routes import router
from server.settings import Settings

KEY = "0123456789abcdef"


class ToyQuery(query_params.Query):
    """The parameters of a toy route."""

    count: int = Field(1, ge=1, le=3, description="how many times the toy speaks")


def speak(count: int) -> str:
    """The work, which runs beside the event loop."""
    return "toy " * count


async def run_toy(admission: AdmissionDep, query: Annotated[ToyQuery, Query()]) -> Response:
    """What a contributor writes in server/routes.py."""
    return Response(await admission.run(speak, query.count), media_type="text/plain")


@pytest.fixture(autouse=True)
def _toy_route() -> Iterator[None]:
    before = len(router.routes)
    router.get("/toy", summary="A toy", response_class=Response)(run_toy)
    yield
    del router.routes[before:]


@pytest.fixture
def client(network: Path) -> TestClient:
    return TestClient(create_app(Settings(api_keys=KEY), Estimator(Model.load(network, threads=1))))


def test_a_route_answers_what_its_function_gives(client: TestClient) -> None:
    answer = client.get("/v1/toy?count=2", headers={"Authorization": f"Bearer {KEY}"})
    assert (answer.status_code, answer.text) == (200, "toy toy ")


def test_a_route_has_keys_problems_and_a_description_without_another_line(client: TestClient) -> None:
    assert client.get("/v1/toy").status_code == 401
    client.headers["Authorization"] = f"Bearer {KEY}"
    for query, field in (("count=9", "count"), ("cuont=2", "cuont"), ("count=1&count=2", "count")):
        answer = client.get(f"/v1/toy?{query}")
        assert answer.headers["content-type"] == "application/problem+json"
        assert answer.status_code == 422
        assert field in answer.text
    operation = client.get("/openapi.json").json()["paths"]["/v1/toy"]["get"]
    assert operation["summary"] == "A toy"
    assert {parameter["name"] for parameter in operation["parameters"]} >= {"count"}
    assert {"401", "422"} <= set(operation["responses"])


# What a contributor writes for an option "mirror": a field of MapOptions, and its use in render_map.
MIRROR = """
import dataclasses
from lighting import map_options

@dataclasses.dataclass(frozen=True)
class Options(map_options.MapOptions):
    mirror: bool = map_options.option(False, map_options.OptionText("mirror the map"))

map_options.MapOptions, map_options.DEFAULT_MAP = Options, Options()
from lighting import photo_estimate
render_map = photo_estimate.render_map

def render(lighting, options=map_options.DEFAULT_MAP, context=None):
    made = render_map(lighting, options, context)
    return dataclasses.replace(made, strips=lambda: (s[:, ::-1] for s in made.strips())) if options.mirror else made

photo_estimate.render_map = render
"""


def with_mirror(code: str, *arguments: str | Path) -> str:
    """What a process prints in which maps have the option."""
    command = [sys.executable, "-c", MIRROR + code, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout


def test_an_option_of_maps_is_one_field_and_its_use(tmp_path: Path) -> None:
    record = tmp_path / "record.json"
    record.write_text(
        json.dumps(Lighting(sun_azimuth=-40.0, sun_elevation=35.0, turbidity=3.0, exposure=1.0).to_dict())
    )
    code = "from lighting.cli import cli\ncli(prog_name='lighting')"
    for name, switches in (("plain", []), ("mirror", ["--mirror"])):
        with_mirror(code, "render", record, "--height", "32", "-q", "-o", tmp_path / f"{name}.exr", *switches)
    plain, mirrored = (read_exr(tmp_path / f"{name}.exr")[0] for name in ("plain", "mirror"))
    assert np.array_equal(plain[:, ::-1], mirrored)
    assert not np.array_equal(plain, mirrored)
    _, options_of_maps = with_mirror(code, "envmap", "--help").split("\nMap:")
    assert "--mirror" in options_of_maps.partition("\nExamples:")[0]


def test_requests_and_jobs_have_the_option_too() -> None:
    code = """
from server.job_kinds import MAP_OPTIONS
from server.query_params import EnvmapQuery, SkyQuery
sky = dict(sun_azimuth=1, sun_elevation=2, turbidity=3)
print(EnvmapQuery(mirror="true").view().mirror, SkyQuery(**sky, mirror="true").view().mirror, "mirror" in MAP_OPTIONS)
"""
    assert with_mirror(code) == "True True True\n"


def test_python_knows_the_types_of_all_options_of_maps() -> None:
    old = {"surroundings", "detail"}
    assert MapKeywords.__annotations__.keys() - old == MapOptions.__dataclass_fields__.keys() - {"height"}

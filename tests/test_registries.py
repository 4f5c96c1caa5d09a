"""A sky model and a scene tool, each one file and one entry, are used through the command line and HTTP."""

import io
import json
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
from starlette.testclient import TestClient

from lighting.cli import cli
from lighting.estimator import Estimator
from lighting.files.exr import read_exr
from lighting.model import Model
from lighting.records import Lighting
from lighting.scene import EXPORTERS
from lighting.sky import SKY_MODELS
from server.app import create_app
from server.settings import Settings
from tests.helpers.processes import error_of, invoke_command
from tests.helpers.scenes import EASTERN, PICTURE, TEXT, TOY

SKY: dict[str, Any] = {"sun_azimuth": -40.0, "sun_elevation": 35.0, "turbidity": 3.0, "exposure": 1.0}
REGISTER = """
from lighting.scene import EXPORTERS
from lighting.sky import SKY_MODELS
from tests.helpers.scenes import EASTERN, TOY
EXPORTERS["toy"], SKY_MODELS["eastern"] = TOY, EASTERN
"""


@pytest.fixture(autouse=True)
def _registered(monkeypatch: pytest.MonkeyPatch) -> None:
    context = click.Context(cli)
    for name in cli.list_commands(context):  # their help says what there was at import, and stays for other tests
        cli.get_command(context, name)
    monkeypatch.setitem(SKY_MODELS, "eastern", EASTERN)
    monkeypatch.setitem(EXPORTERS, "toy", TOY)


@pytest.fixture
def record_path(tmp_path: Path) -> Path:
    path = tmp_path / "record.json"
    path.write_text(json.dumps(Lighting(**SKY).to_dict()))
    return path


@pytest.fixture
def client(network: Path) -> TestClient:
    return TestClient(create_app(Settings(), Estimator(Model.load(network, threads=1))))


def in_new_process(code: str, *arguments: str | Path) -> str:
    """What a process prints in which both are registered before anything else is imported."""
    command = [sys.executable, "-c", REGISTER + code, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout


def is_eastern(image: np.ndarray[Any, Any]) -> bool:
    """Whether the toy's sky is in a map: of its two sides the right is brighter."""
    upper = image[: len(image) // 2].mean(axis=-1)
    width = upper.shape[1]
    return bool(upper[:, width // 2 :].mean() > 1.1 * upper[:, : width // 2].mean())


def test_the_command_line_paints_the_sky(record_path: Path, tmp_path: Path) -> None:
    arguments: list[str | Path] = ["render", record_path, "--height", "32", "--no-sun"]
    assert invoke_command(*arguments, "-o", tmp_path / "plain.exr").exit_code == 0
    assert invoke_command(*arguments, "-o", tmp_path / "toy.exr", "--sky", "eastern").exit_code == 0
    plain, toy = (read_exr(tmp_path / f"{name}.exr") for name in ("plain", "toy"))
    assert not is_eastern(plain[0])
    assert is_eastern(toy[0])
    assert toy[1] is not None
    assert (toy[1].sky_model, toy[1].map_sky) == ("hosek-wilkie", "eastern")
    assert "eastern" in error_of(invoke_command(*arguments, "-o", tmp_path / "x.exr", "--sky", "blue"), 2)


def test_the_service_paints_the_sky(client: TestClient) -> None:
    query = {**SKY, "height": 32, "sun": "false"}
    answer = client.get("/v1/envmap", params={**query, "sky": "eastern"})
    assert answer.status_code == 200
    assert is_eastern(read_exr(io.BytesIO(answer.content))[0])
    record = {**Lighting(**SKY, sky_model="eastern").to_dict()}
    answer = client.post("/v1/envmap?height=32&sun=false", json=record)
    assert is_eastern(read_exr(io.BytesIO(answer.content))[0])
    refused = client.get("/v1/envmap", params={**query, "sky": "blue"})
    assert refused.status_code == 422
    assert "'eastern'" in refused.json()["detail"]


def test_the_command_line_writes_the_scene(photo_path: Path, record_path: Path, tmp_path: Path) -> None:
    arguments: list[str | Path] = ["scene", photo_path, "--for", "toy", "--lighting", record_path, "-q"]
    assert invoke_command(*arguments, "-o", tmp_path / "out", "--unit", "cm").exit_code == 0
    assert (tmp_path / "out" / TEXT).read_text() == "sun -40 35\ncamera 160 cm\n"
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [PICTURE, TEXT]
    said = error_of(invoke_command(*arguments, "-o", tmp_path / "other", "--up-axis", "z"), 2)
    assert said == "--up-axis goes with --for usd."
    said = error_of(invoke_command("scene", photo_path, "--for", "usd", "--unit", "m", "-o", tmp_path / "other"), 2)
    assert said == "--unit goes with --for toy."


@pytest.mark.parametrize("own", ["photo", "record"])
def test_the_scene_replaces_neither_photo_nor_record(photo_path: Path, record_path: Path, own: str) -> None:
    photo, record = photo_path, record_path
    if own == "photo":
        photo = photo_path.rename(photo_path.with_name(PICTURE))
    else:
        record = record_path.rename(record_path.with_name(TEXT))
    before = photo.read_bytes(), record.read_bytes()
    arguments: list[str | Path] = ["scene", photo, "--for", "toy", "--lighting", record, "--overwrite"]
    said = error_of(invoke_command(*arguments, "-o", photo.parent), 2)
    assert said == f"The scene would replace {photo if own == 'photo' else record}; choose another folder."
    assert (photo.read_bytes(), record.read_bytes()) == before


def test_the_service_writes_the_scene(client: TestClient) -> None:
    answer = client.get("/v1/scene", params={**SKY, "for": "toy", "plate_width": 64, "plate_height": 48})
    assert answer.status_code == 200
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert archive.read(TEXT) == b"sun -40 35\ncamera 1.6 m\n"
    refused = client.get("/v1/scene", params={**SKY, "for": "maya"})
    assert "'toy'" in refused.json()["detail"]


def test_the_service_lists_both(client: TestClient) -> None:
    card = client.get("/v1/model").json()
    assert "toy" in card["scene_tools"]
    assert (card["scene_labels"]["toy"], card["scene_labels"]["threejs"]) == ("A toy", "three.js")
    assert "eastern" in card["sky_models"]
    paths = client.get("/openapi.json").json()["paths"]
    parameters = {
        path: {parameter["name"]: parameter["schema"] for parameter in paths[path]["get"]["parameters"]}
        for path in ("/v1/envmap", "/v1/scene")
    }
    assert "toy" in parameters["/v1/scene"]["for"]["enum"]
    assert "eastern" in parameters["/v1/envmap"]["sky"]["enum"]


def test_help_and_the_options_of_requests_know_what_was_there_at_the_start() -> None:
    code = "from lighting.cli import cli\ncli(prog_name='lighting')"
    said = " ".join(in_new_process(code, "scene", "--help").split())
    assert f"{'|'.join(name for name in EXPORTERS if name != 'toy')}|toy]" in said
    assert "--unit [m|cm] With --for toy; m by default." in said
    assert "eastern or cie-1 to cie-15" in " ".join(in_new_process(code, "render", "--help").split())
    code = """
from server.query_params import SkySceneQuery
sky = dict(sun_azimuth=1, sun_elevation=2, turbidity=3)
print(SkySceneQuery.model_validate({"for": "toy", "unit": "cm", **sky}).options())
"""
    assert in_new_process(code) == "{'unit': 'cm'}\n"

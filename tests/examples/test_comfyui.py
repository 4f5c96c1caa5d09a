"""The nodes for ComfyUI, against a stand-in of the parts of its API that it uses (comfy_api.latest, V3)."""

import asyncio
import importlib.util
import json
import re
import sys
import tomllib
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lighting.records import Lighting
from lighting.version import __version__
from server.settings import Settings
from tests.helpers.pages import ROOT, text

FOLDER = Path(__file__).parents[2] / "examples" / "comfyui"


OPTIONS = {  # of inputs and outputs, in ComfyUI's comfy_api/latest/_io.py
    "Image": {"display_name", "optional", "tooltip"},
    "Int": {"display_name", "optional", "tooltip", "default", "min", "max", "step"},
    "Boolean": {"display_name", "optional", "tooltip", "default", "label_on", "label_off"},
    "String": {"display_name", "optional", "tooltip", "default", "multiline", "placeholder", "force_input"},
}
OUTPUTS = ("Image", "Mask", "Float", "String")


class _Port:
    """An input or output: its name and options."""

    options: frozenset[str] = frozenset({"display_name", "tooltip", "is_output_list"})

    def __init__(self, id: str, **options: Any) -> None:
        assert set(options) <= self.options, options
        self.id, self.named = id, options


class _Node:
    pass


class _Extension:
    pass


class _Output(tuple):  # type: ignore[type-arg]
    def __new__(cls, *values: Any) -> "_Output":
        return super().__new__(cls, values)


@pytest.fixture
def module(monkeypatch: pytest.MonkeyPatch) -> Any:
    inputs = {kind: type("Input", (_Port,), {"options": frozenset(names)}) for kind, names in OPTIONS.items()}
    kinds = {kind: SimpleNamespace(Input=inputs.get(kind), Output=_Port) for kind in {*OPTIONS, *OUTPUTS}}
    latest: Any = ModuleType("comfy_api.latest")
    latest.io = SimpleNamespace(ComfyNode=_Node, Schema=SimpleNamespace, NodeOutput=_Output, **kinds)
    latest.ComfyExtension = _Extension
    monkeypatch.setitem(sys.modules, "comfy_api", ModuleType("comfy_api"))
    monkeypatch.setitem(sys.modules, "comfy_api.latest", latest)
    spec = importlib.util.spec_from_file_location("outdoor_lighting_nodes", FOLDER / "__init__.py")
    assert spec is not None
    assert spec.loader is not None
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


def nodes_of(module: Any) -> list[Any]:
    return list(asyncio.run(asyncio.run(module.comfy_entrypoint()).get_node_list()))


@pytest.mark.slow
def test_the_node_gives_map_sun_and_mask(module: Any) -> None:
    import torch
    from PIL import Image

    with Image.open(FOLDER.parent / "wide_street.jpg") as file:
        photo = np.asarray(file.convert("RGB").resize((320, 240)), dtype=np.float32) / 255
    node, camera = nodes_of(module)
    schema = node.define_schema()
    assert [port.id for port in schema.inputs] == ["photo", "map_height", "sun"]
    ids = [port.id for port in (*schema.inputs, *schema.outputs)]
    assert len(set(ids)) == len(ids)  # as Schema.validate demands
    values = node.execute(photo=torch.from_numpy(photo)[None], map_height=64, sun=True)  # by name, as ComfyUI
    assert len(values) == len(schema.outputs) == 5
    envmap, azimuth, elevation, lit, record = values
    assert (tuple(envmap.shape), envmap.dtype) == ((1, 64, 128, 3), torch.float32)
    assert envmap.max() > 10  # the sun
    assert tuple(lit.shape[:1]) == (1,)
    assert 0 <= lit.min() <= lit.max() <= 1
    assert (azimuth, elevation) == tuple(json.loads(record)["sun"][name] for name in ("azimuth", "elevation"))
    without = node.execute(photo=torch.from_numpy(photo)[None], map_height=64, sun=False)[0]
    assert without.max() < envmap.max()

    _, fov_y, *tilt, _ = camera.execute(photo=torch.from_numpy(photo)[None], record=record)
    light = Lighting.from_dict(json.loads(record))
    assert (fov_y, *tilt) == (light.vertical_fov, light.camera_elevation, light.camera_roll)


@pytest.mark.parametrize(("elevation", "roll"), [(0.0, 0.0), (20.0, 0.0), (-10.0, 5.0), (30.0, -40.0)])
def test_the_camera_is_that_of_moge_and_geocalib(module: Any, elevation: float, roll: float) -> None:
    """Of a picture 320 wide and 240 high.

    GeoCalib's gravity, from roll r and pitch p, is (-sin r cos p, -cos r cos p, sin p): x right, y down, z ahead.
    MoGe's intrinsics are of a picture one wide and one high.
    """
    import torch

    light = Lighting(0.0, 30.0, 3.0, 1.0, vertical_fov=60.0, camera_elevation=elevation, camera_roll=roll)
    _, camera = nodes_of(module)
    record = json.dumps(light.to_dict())
    fov_x, *angles, described = camera.execute(photo=torch.zeros(1, 240, 320, 3), record=record)
    assert angles == [60.0, elevation, roll]
    values, (r, p) = json.loads(described), np.radians((roll, elevation))
    assert values["up"] == pytest.approx([-np.sin(r) * np.cos(p), -np.cos(r) * np.cos(p), np.sin(p)])
    (fx, _, cx), (_, fy, cy), _ = values["intrinsics"]
    assert (cx, cy, fx * 320, fy * 240) == pytest.approx((0.5, 0.5, *[values["focal_length_pixels"]] * 2))
    assert np.degrees(2 * np.arctan(0.5 / np.array([fx, fy]))) == pytest.approx([fov_x, 60.0])


CORE = {  # of ComfyUI's own nodes in the workflow, the types of outputs and the names of inputs
    "LoadImage": (["IMAGE", "MASK"], []),
    "PreviewImage": ([], ["images"]),
    "MaskPreview": ([], ["mask"]),
    "PreviewAny": ([], ["source"]),
}


def test_the_workflow_is_of_these_nodes(module: Any) -> None:
    """Every link leads from an output to an input of its type, and every node's sockets are those of its schema."""
    workflow = json.loads(text(FOLDER / "example_workflows" / "photo_light.json"))
    nodes = {node["id"]: node for node in workflow["nodes"]}
    schemas = {schema.node_id: schema for schema in (node.define_schema() for node in nodes_of(module))}
    assert {node["type"] for node in nodes.values()} == {*schemas, *CORE}
    for node in nodes.values():
        names = [socket["name"] for socket in node["inputs"]]
        if node["type"] in CORE:
            assert ([out["type"] for out in node["outputs"]], names) == CORE[node["type"]]
            continue
        schema = schemas[node["type"]]
        sockets = [port.id for port in schema.inputs if port.id in names]
        assert names == sockets
        assert len(node["widgets_values"]) == len(schema.inputs) - len(sockets)
        shown = [port.named.get("display_name", port.id) for port in schema.outputs]
        assert [out["name"] for out in node["outputs"]] == shown
    for number, source, output, target, socket, kind in workflow["links"]:
        assert number in nodes[source]["outputs"][output]["links"]
        assert nodes[source]["outputs"][output]["type"] == kind
        assert nodes[target]["inputs"][socket]["link"] == number
        assert nodes[target]["inputs"][socket]["type"] in (kind, "*")
    assert (FOLDER / "example_workflows" / "photo_light.jpg").read_bytes().startswith(b"\xff\xd8")


def test_the_pack_has_what_the_registry_reads() -> None:
    pack = tomllib.loads(text(FOLDER / "pyproject.toml"))
    assert {"name", "description", "version", "license", "dependencies", "urls"} <= set(pack["project"])
    assert pack["project"]["version"] == __version__
    assert re.fullmatch(r"[a-z0-9-]{1,100}", pack["project"]["name"])
    assert {"PublisherId", "DisplayName"} <= set(pack["tool"]["comfy"])
    assert (pack["tool"]["comfy"]["PublisherId"], pack["project"]["urls"]["Repository"]) == ("", "")  # of who publishes
    major, minor, _ = __version__.split(".")
    assert pack["project"]["dependencies"] == [f"outdoor-lighting>={major}.{minor},<{major}.{int(minor) + 1}"]


COLORS = {"red", "yellow", "green", "blue", "indigo", "purple", "pink", "gray"}  # that the Hub takes


def test_the_front_matter_fits_the_image_and_the_hub() -> None:
    page, image = text(ROOT / "examples" / "huggingface" / "README.md"), text(ROOT / "Dockerfile")
    _, matter, prose = page.split("---\n", 2)
    values = dict(re.findall(r"^(\w+): (.+)$", matter, re.MULTILINE))
    assert values["sdk"] == "docker"
    assert f"EXPOSE {values['app_port']}\n" in image
    assert {values["colorFrom"], values["colorTo"]} <= COLORS
    assert len(values["short_description"]) <= 60
    named = set(re.findall(r"`LIGHTING_(\w+)`", prose))
    assert named == {"HOSTS", "FRAME_ORIGINS"}
    assert {name.lower() for name in named} <= set(Settings.model_fields)

"""The node for ComfyUI, against a stand-in of the parts of its API that it uses (comfy_api.latest, V3)."""

import asyncio
import importlib.util
import json
import re
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from server.settings import Settings
from tests.helpers.pages import ROOT, text

FOLDER = Path(__file__).parents[2] / "examples" / "comfyui"


OPTIONS = {  # of inputs and outputs, in ComfyUI's comfy_api/latest/_io.py
    "Image": {"display_name", "optional", "tooltip"},
    "Int": {"display_name", "optional", "tooltip", "default", "min", "max", "step"},
    "Boolean": {"display_name", "optional", "tooltip", "default", "label_on", "label_off"},
}
OUTPUTS = ("Image", "Mask", "Float", "String")


class _Port:
    """An input or output: its name and options."""

    options: frozenset[str] = frozenset({"display_name", "tooltip", "is_output_list"})

    def __init__(self, id: str, **options: Any) -> None:
        assert set(options) <= self.options, options
        self.id = id


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


@pytest.mark.slow
def test_the_node_gives_map_sun_and_mask(module: Any) -> None:
    import torch
    from PIL import Image

    with Image.open(FOLDER.parent / "wide_street.jpg") as file:
        photo = np.asarray(file.convert("RGB").resize((320, 240)), dtype=np.float32) / 255
    (node,) = asyncio.run(asyncio.run(module.comfy_entrypoint()).get_node_list())
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

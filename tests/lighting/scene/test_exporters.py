"""The entries of EXPORTERS; the modules keep to them."""

import inspect
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from lighting.errors import SceneError
from lighting.scene import EXPORTERS, Exporter, unsupported_options
from lighting.scene.records import Scene
from lighting.scene.writer import write_scene, zip_scene
from tests.helpers.scenes import plain_scene


@pytest.mark.parametrize("tool", EXPORTERS)
def test_a_writer_takes_the_options_of_its_entry(tool: str) -> None:
    write = getattr(import_module(f"lighting.scene.{tool}"), f"write_{tool}")
    parameters = inspect.signature(write).parameters
    options = EXPORTERS[tool].options
    assert set(parameters) - {"scene", "folder"} == set(options)
    assert all(parameters[name].default == option.default for name, option in options.items())


def test_an_option_of_another_tool_is_named_with_its_tool() -> None:
    assert unsupported_options({"up_axis", "height"}, "gltf") == {"up_axis": "usd"}
    assert unsupported_options({"up_axis"}, "usd") == {}
    assert unsupported_options({"height"}, "blender") == {}
    assert EXPORTERS["usd"].options["up_axis"].choices == ("Y", "Z")


@pytest.mark.parametrize("tool", EXPORTERS)
def test_a_scene_holds_the_files_of_its_entry(tool: str, tmp_path: Path) -> None:
    write_scene(plain_scene(), tool, tmp_path / "out")
    of_bpy = {"scene.blend"}  # which is there where the module bpy is
    written = {path.relative_to(tmp_path / "out").as_posix() for path in (tmp_path / "out").rglob("*")}
    assert written | of_bpy == set(EXPORTERS[tool].files) | of_bpy


def test_a_file_that_the_entry_does_not_list_is_never_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def write(_scene: Scene, folder: Path) -> None:
        for name in ("toy.txt", "photo.jpg"):
            (folder / name).write_text("toy", encoding="utf-8")

    monkeypatch.setitem(EXPORTERS, "toy", Exporter(write, files=("toy.txt",)))
    (tmp_path / "photo.jpg").write_text("the user's")
    sentence = r"^The exporter for toy wrote photo\.jpg, which its entry does not list\.$"
    with pytest.raises(SceneError, match=sentence):
        write_scene(plain_scene(), "toy", tmp_path, overwrite=True)
    with pytest.raises(SceneError, match=sentence):
        zip_scene(plain_scene(), "toy")
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("photo.jpg", "the user's")]


def test_the_list_of_tools_needs_no_numpy() -> None:
    code = "import sys, lighting.scene; print(list(lighting.scene.EXPORTERS), 'numpy' in sys.modules)"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout == f"{list(EXPORTERS)} False\n"

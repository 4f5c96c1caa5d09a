"""Scenes as folders and archives: whole or not at all, and nobody else's files."""

import inspect
import json
import os
import subprocess
import sys
import zipfile
from dataclasses import replace
from importlib import import_module
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lighting.errors import SceneError
from lighting.files.deflate import encode_png
from lighting.files.exr import read_exr
from lighting.record_json import record_with_coefficients
from lighting.scene import EXPORTERS, Exporter, blender, unsupported_options
from lighting.scene.records import Scene
from lighting.scene.writer import (
    Files,
    encode_lit_ground,
    encode_shared_files,
    fill_template,
    write_scene,
    zip_scene,
)
from tests.helpers.scenes import PLAIN, plain_scene, save_files, sunlit_scene


def test_a_new_folder_holds_the_scene_alone(tmp_path: Path) -> None:
    write_scene(plain_scene(), "mitsuba", tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert {"scene.xml", "plate.png", "environment.exr", "lighting.json"} < {
        p.name for p in (tmp_path / "out").iterdir()
    }
    assert np.array_equal(np.asarray(Image.open(tmp_path / "out" / "plate.png")), PLAIN)
    assert (tmp_path / "out").stat().st_mode & 0o777 == 0o755


@pytest.mark.skipif(os.name != "posix", reason="Windows has neither")
def test_a_scene_has_the_process_s_permissions_and_removes_what_killed_ones_left(tmp_path: Path) -> None:
    import fcntl

    left = [tmp_path / f".lighting-scene-{number:016x}" for number in range(3)]
    for folder in left:
        folder.mkdir()
        (folder / "plate.png").touch()
    (left[1] / "letter.txt").touch()
    for folder in left:
        os.utime(folder, (0, 0))
    alive = os.open(left[2], os.O_RDONLY)
    fcntl.flock(alive, fcntl.LOCK_EX)  # as a process that still writes
    before = os.umask(0o027)
    try:
        write_scene(plain_scene(), "mitsuba", tmp_path / "out")
    finally:
        os.umask(before)
        os.close(alive)
    assert (tmp_path / "out").stat().st_mode & 0o777 == 0o750
    assert sorted(path.name for path in tmp_path.iterdir()) == [left[1].name, left[2].name, "out"]


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="Windows has no SIGKILL")
def test_a_killed_scene_leaves_nothing_for_long(tmp_path: Path) -> None:
    code = "import os, signal\nfrom lighting.scene import writer\nfrom tests.helpers.scenes import plain_scene\n"
    code += "writer.Path.replace = lambda *_: os.kill(os.getpid(), signal.SIGKILL)\n"
    code += f"writer.write_scene(plain_scene(), 'mitsuba', {str(tmp_path / 'out')!r})"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == -9
    (left,) = tmp_path.iterdir()
    os.utime(left, (0, 0))
    write_scene(plain_scene(), "mitsuba", tmp_path / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_overwriting_replaces_the_scene_and_nothing_else(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    write_scene(plain_scene(), "mitsuba", folder)
    (folder / "mine.txt").write_text("keep")
    with pytest.raises(SceneError, match="is not empty; --overwrite replaces"):
        write_scene(plain_scene(turbidity=6.0), "mitsuba", folder)
    assert json.loads((folder / "lighting.json").read_text())["sky"]["turbidity"] == 3.0
    write_scene(plain_scene(turbidity=6.0), "mitsuba", folder, overwrite=True)
    assert json.loads((folder / "lighting.json").read_text())["sky"]["turbidity"] == 6.0
    assert (folder / "mine.txt").read_text() == "keep"
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_an_empty_folder_is_filled(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    write_scene(plain_scene(), "mitsuba", tmp_path / "out")
    assert (tmp_path / "out" / "scene.xml").is_file()


def test_the_folder_may_be_the_current_one_or_a_link(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    write_scene(sunlit_scene(), "gltf", ".")
    assert list(here.iterdir())
    other, link = tmp_path / "other", tmp_path / "link"
    other.mkdir()
    link.symlink_to(other)
    write_scene(sunlit_scene(), "gltf", link)
    assert link.is_symlink()
    assert sorted(p.name for p in other.iterdir()) == sorted(p.name for p in here.iterdir())


def test_what_fails_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written: list[Path] = []

    def fail(path: Path, _data: bytes) -> None:
        if written:
            raise OSError(28, "No space left on device")
        path.touch()
        written.append(path)

    monkeypatch.setattr(Path, "write_bytes", fail)
    with pytest.raises(SceneError, match=r"out cannot be written: No space left on device\.$"):
        write_scene(plain_scene(), "mitsuba", tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_tool_is_named(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"'maya' is not known; it must be one of blender, usd, gltf"):
        write_scene(plain_scene(), "maya", tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("tool", EXPORTERS)
def test_an_archive_holds_what_the_folder_holds(tmp_path: Path, tool: str) -> None:
    write_scene(plain_scene(), tool, tmp_path / "out")
    with zipfile.ZipFile(BytesIO(zip_scene(plain_scene(), tool))) as archive:
        assert archive.testzip() is None
        on_disk = {path.name for path in (tmp_path / "out").iterdir()} - {blender.BLEND_FILE}  # which needs a disk
        assert sorted(archive.namelist()) == sorted(on_disk)


def test_one_scene_makes_one_archive() -> None:
    assert zip_scene(plain_scene(), "mitsuba") == zip_scene(plain_scene(), "mitsuba")


def test_a_scene_beside_one_for_another_tool_is_in_the_same_light(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    write_scene(plain_scene(), "usd", folder)
    write_scene(plain_scene(), "mitsuba", folder, overwrite=True)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    with pytest.raises(SceneError, match=r"holds a scene for usd in other light, scene\.usda"):
        write_scene(plain_scene(turbidity=6.0), "mitsuba", folder, overwrite=True)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    write_scene(plain_scene(turbidity=6.0), "gltf", folder, overwrite=True)  # which has all in one file
    assert {name: (folder / name).read_bytes() for name in before} == before


def test_the_shared_files_hold_plate_map_and_record(tmp_path: Path) -> None:
    scene = plain_scene()
    save_files(tmp_path, encode_shared_files(scene))
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "environment.exr",
        "ground.png",
        "lighting.json",
        "lit_ground.png",
        "plate.png",
    ]
    assert json.loads((tmp_path / "lighting.json").read_text()) == record_with_coefficients(
        scene.lighting, scene.light_probe
    )
    image, lighting = read_exr(tmp_path / "environment.exr")
    np.testing.assert_allclose(image, scene.environment, rtol=1e-3)
    assert lighting == scene.lighting


def test_the_plate_is_the_photo() -> None:
    with Image.open(BytesIO(encode_png(plain_scene().plate))) as plate:
        assert np.array_equal(np.asarray(plate), PLAIN)


def test_the_mask_is_white_in_the_sun_and_black_in_shade() -> None:
    lit = np.array([[0.0, 0.5, 1.0]], np.float32)
    with Image.open(BytesIO(encode_lit_ground(replace(plain_scene(), lit_ground=lit), movable=True))) as mask:
        assert mask.mode == "L"
        assert np.asarray(mask).tolist() == [[0, 128, 255]]


def test_a_template_must_get_every_value() -> None:
    page = fill_template("viewer.html", {"scene": "{}", "three": "1", "viewer": "2", "note": "3"}).decode()
    assert "$" not in page
    with pytest.raises(KeyError):
        fill_template("viewer.html", {"scene": "{}"})


@pytest.mark.parametrize("tool", EXPORTERS)
def test_a_writer_takes_the_options_of_its_entry(tool: str) -> None:
    module = {"filament": "cubemap", "page": "threejs"}.get(tool, tool)  # two encode cubemaps, two pages
    encode = getattr(import_module(f"lighting.scene.{module}"), f"encode_{tool}")
    parameters = inspect.signature(encode).parameters
    options = EXPORTERS[tool].options
    assert set(parameters) - {"scene"} == set(options)
    off = {name: False for name, option in options.items() if not option.choices}  # a switch
    assert all(parameters[name].default == off.get(name, option.default) for name, option in options.items())


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
    def encode(_scene: Scene) -> Files:
        return {"toy.txt": b"toy", "photo.jpg": b"toy"}

    monkeypatch.setitem(EXPORTERS, "toy", Exporter(encode, label="A toy", files=("toy.txt",)))
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

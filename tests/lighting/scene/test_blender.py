"""The folder for Blender: its numbers, its script, and the failure of a Blender that is there; with bpy, the .blend."""

import ast
import json
import os
import subprocess
import sys
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from lighting.color import srgb_decode
from lighting.errors import SceneError
from lighting.geometry import direction, to_z_up
from lighting.scene import EXPORTERS, blender
from lighting.scene.writer import write_scene, zip_scene
from tests.helpers.engines import PYTHON, folder_in_chroot, needs_blender, needs_engines, run_in_chroot
from tests.helpers.processes import invoke_command
from tests.helpers.scenes import half_shaded_scene, save_files, shaded_spot_scene, sunlit_scene


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A scene as it is written where Blender is not installed."""
    monkeypatch.setattr(blender, "find_spec", lambda _name: None)
    save_files(tmp_path, blender.encode_blender(sunlit_scene()))
    return tmp_path


@pytest.fixture
def numbers(folder: Path) -> dict[str, Any]:
    return dict(json.loads((folder / "scene.json").read_text()))


def test_the_folder_is_whole_without_blender(folder: Path) -> None:
    names = {"scene.py", "scene.json", "plate.png", "environment.exr", "lit_ground.png", "ground.png", "lighting.json"}
    assert {path.name for path in folder.iterdir()} == names


def test_the_script_is_python_that_needs_blender_alone(folder: Path) -> None:
    tree = ast.parse((folder / "scene.py").read_text(encoding="utf-8"))
    imports = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    froms = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert (imports | froms) - set(sys.stdlib_module_names) == {"bpy", "mathutils"}


def test_the_script_reads_what_is_written(folder: Path, numbers: dict[str, Any]) -> None:
    tree = ast.parse((folder / "scene.py").read_text(encoding="utf-8"))
    read = {
        node.slice.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Subscript)
        and isinstance(node.slice, ast.Constant)
        and isinstance(node.value, ast.Name)
        and node.value.id == "numbers"
    }
    groups = [numbers, *(value for value in numbers.values() if isinstance(value, dict)), numbers["sky"]["native"]]
    of_extension = {"photo_size"}
    assert read | of_extension == {key for group in groups for key in group}


def test_z_is_up_and_the_camera_looks_along_y(numbers: dict[str, Any]) -> None:
    matrix = np.array(numbers["camera"]["matrix"])
    assert matrix[:3, 3] == pytest.approx([0, 0, 1.6])
    assert -matrix[:3, 2] == pytest.approx(to_z_up(direction(0.0, -12.0)))
    assert np.linalg.det(matrix) == pytest.approx(1.0)
    assert numbers["sun"]["direction"] == pytest.approx(to_z_up(direction(-40.0, 35.0)))
    assert numbers["sky"]["native"]["sun_direction"] == numbers["sun"]["direction"]


def test_what_the_compositor_knows_of_shade(folder: Path, numbers: dict[str, Any]) -> None:
    assert numbers["shade"] == pytest.approx(sunlit_scene().shadow.tolist())
    with Image.open(folder / numbers["lit_ground"]) as mask:
        assert mask.mode == "L"


def test_what_blender_knows_of_the_spot(folder: Path, numbers: dict[str, Any]) -> None:
    assert numbers["spot_in_shade"] is False
    save_files(folder, blender.encode_blender(shaded_spot_scene()))
    assert json.loads((folder / "scene.json").read_text())["spot_in_shade"] is True


def test_sun_and_lens(numbers: dict[str, Any]) -> None:
    irradiance = np.array(numbers["sun"]["colour"]) * numbers["sun"]["irradiance"]
    assert irradiance == pytest.approx(sunlit_scene().sun_irradiance)
    assert numbers["sun"]["angle"] == pytest.approx(0.5358)
    height = numbers["camera"]["sensor"][1]
    assert 2 * np.degrees(np.arctan(height / 2 / numbers["camera"]["focal_length"])) == pytest.approx(50.0)
    assert numbers["size"] == [480, 360]


def test_a_blender_that_fails_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blender, "find_spec", lambda name: ModuleSpec(name, None))
    monkeypatch.setattr(blender, "read_data", lambda _name: b"import sys; sys.exit('Error: no memory.')")
    with pytest.raises(SceneError, match=r"^Blender could not build scene\.blend: Error: no memory\.$"):
        write_scene(sunlit_scene(), "blender", tmp_path / "out", blend=True)
    assert not (tmp_path / "out").exists()


def test_without_blender_a_blend_is_refused_and_nothing_starts_unasked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(blender, "find_spec", lambda _name: None)
    monkeypatch.setattr(blender, "find_blender_program", lambda: None)
    sentence = r"^scene\.blend needs Blender, from blender\.org, or its module: pip install bpy\.$"
    with pytest.raises(SceneError, match=sentence):
        write_scene(sunlit_scene(), "blender", tmp_path / "out", blend=True)
    with pytest.raises(SceneError, match=sentence):
        zip_scene(sunlit_scene(), "blender", blend=True)
    monkeypatch.setattr(blender, "find_spec", lambda name: ModuleSpec(name, None))
    monkeypatch.setattr(blender, "find_blender", lambda: pytest.fail("It starts Blender."))
    write_scene(sunlit_scene(), "blender", tmp_path / "out")
    assert not (tmp_path / "out" / "scene.blend").exists()


@pytest.mark.slow
@needs_blender
def test_the_command_finds_a_program_that_is_blender(
    tmp_path: Path, photo_path: Path, network: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that runs the script after --python, as Blender does, by bpy."""
    program = tmp_path / "bin" / "blender"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nwhile [ "$1" != --python ]; do shift; done; shift; exec "{PYTHON}" "$@"\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(program.parent), prepend=os.pathsep)
    monkeypatch.setattr(blender, "find_spec", lambda _name: None)
    out = tmp_path / "out"
    result = invoke_command("scene", photo_path, "--for", "blender", "--blend", "-o", out, "--model", network)
    assert result.exit_code == 0, result.output
    assert (out / "scene.blend").stat().st_size > 100_000
    assert sorted(path.name for path in out.iterdir()) == sorted(EXPORTERS["blender"].files)


@pytest.mark.slow
@needs_blender
def test_blender_builds_its_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blender, "find_spec", lambda name: ModuleSpec(name, None))
    monkeypatch.setattr(sys, "executable", PYTHON)
    write_scene(sunlit_scene(), "blender", tmp_path / "out", blend=True)
    look = (
        "import os, bpy; bpy.ops.wm.open_mainfile(filepath=os.path.abspath('scene.blend'));"
        "print(sorted(o.name for o in bpy.data.objects))"
    )
    result = subprocess.run([PYTHON, "-c", look], cwd=tmp_path / "out", capture_output=True, text=True, check=True)
    assert "['Ball', 'Camera', 'Ground', 'Stick', 'Sun', 'Your object here']" in result.stdout


@pytest.mark.slow
@needs_blender
def test_no_shadow_darkens_shade(folder: Path, numbers: dict[str, Any]) -> None:
    """The ball's shadow begins on lit ground, in the picture's left half, and goes on in the shade at its right."""
    save_files(folder, blender.encode_blender(half_shaded_scene()))
    (folder / "scene.json").write_text(json.dumps(numbers | {"samples": 4}))
    subprocess.run([PYTHON, "scene.py", "--render"], cwd=folder, capture_output=True, check=True)
    plate = srgb_decode(half_shaded_scene().plate / 255.0)
    ratio = srgb_decode(np.asarray(Image.open(folder / "render.png").convert("RGB")) / 255.0) / plate
    assert np.median(ratio[297:305, 230:235]) < 0.3
    assert np.median(ratio[308:316, 284:292]) > 0.6
    assert np.median(ratio[320:325, 400:412]) > 0.9  # the stick's


@pytest.mark.slow
@needs_blender
def test_an_object_in_the_photos_shade_is_in_shade(folder: Path) -> None:
    """The ball is much darker at its top than one in the sun; its shadow on sunlit ground is the same."""
    save_files(folder, blender.encode_blender(shaded_spot_scene()))
    numbers = json.loads((folder / "scene.json").read_text()) | {"samples": 4}
    pictures_of = {}
    for in_shade in (True, False):
        (folder / "scene.json").write_text(json.dumps(numbers | {"spot_in_shade": in_shade}))
        subprocess.run([PYTHON, "scene.py", "--render"], cwd=folder, capture_output=True, check=True)
        pictures_of[in_shade] = srgb_decode(np.asarray(Image.open(folder / "render.png").convert("RGB")) / 255.0)
    top, shadow = np.s_[238:250, 223:254], np.s_[308:316, 284:292]
    assert pictures_of[True][top].mean() < 0.7 * pictures_of[False][top].mean()
    assert pictures_of[True][shadow] == pytest.approx(pictures_of[False][shadow], rel=0.1, abs=0.005)


@pytest.mark.slow
@needs_blender
def test_the_sun_lights_the_ground_alone_where_the_spot_is_in_shade(folder: Path) -> None:
    look = (
        "import os, bpy; bpy.ops.wm.open_mainfile(filepath=os.path.abspath('scene.blend'));"
        "lit = bpy.data.objects['Sun'].light_linking.receiver_collection;"
        "print('FOUND', lit and (lit.name, [o.name for o in lit.objects]))"
    )
    lit = []
    for scene in (shaded_spot_scene(), sunlit_scene()):
        save_files(folder, blender.encode_blender(scene))
        subprocess.run([PYTHON, "scene.py", "--save"], cwd=folder, capture_output=True, check=True)
        result = subprocess.run([PYTHON, "-c", look], cwd=folder, capture_output=True, text=True, check=True)
        lit.append(result.stdout.rpartition("FOUND ")[2].splitlines()[0])  # Blender may print more when it ends
    assert lit == ["('Lit by the Sun', ['Ground'])", "None"]


@pytest.mark.slow
@needs_blender
def test_blender_s_own_sky_is_as_bright_as_the_map(folder: Path) -> None:
    """Also under suns between the rows of its table, and below the horizon."""
    script = Path(__file__).parents[2] / "blender" / "native_sky.py"
    (folder / script.name).write_text(script.read_text())
    done = subprocess.run(
        [PYTHON, script.name, "-4", "-1.5", "0.5", "30"], cwd=folder, capture_output=True, text=True, check=True
    )
    if "no such sky" in done.stdout:
        pytest.skip("Blender has this sky from 5.0 on")
    stops = [float(line.rpartition(": ")[2]) for line in done.stdout.splitlines() if line.startswith("sun ")]
    assert len(stops) == 8
    assert np.abs(stops).max() < 0.15


LOOK = """
import bpy, json, os
scene = bpy.context.scene
homes = {group.name: sorted(thing.name for thing in group.objects) for group in scene.collection.children}
sky = next(node for node in scene.world.node_tree.nodes if node.type == "TEX_SKY")
others = [thing.name for thing in scene.collection.objects]
print("FOUND", json.dumps([bpy.app.version_string, homes, others, sky.label]))
"""
GROUPS = {
    "Photo": ["Camera"],
    "Ground": ["Ground"],
    "Lights": ["Sun"],
    "Objects": ["Ball", "Stick", "Your object here"],
}


@pytest.mark.slow
@needs_blender
def test_the_scene_has_collections(folder: Path) -> None:
    subprocess.run([PYTHON, "scene.py", "--save"], cwd=folder, capture_output=True, check=True)
    look = "import os, bpy; bpy.ops.wm.open_mainfile(filepath=os.path.abspath('scene.blend'))" + LOOK
    result = subprocess.run([PYTHON, "-c", look], cwd=folder, capture_output=True, text=True, check=True)
    _, homes, others, _ = json.loads(result.stdout.rpartition("FOUND")[2].splitlines()[0])
    assert (homes, others) == (GROUPS, [])


@needs_engines
def test_blender_52_builds_and_renders_the_scene() -> None:
    with folder_in_chroot() as folder:
        save_files(folder, blender.encode_blender(half_shaded_scene()))
        numbers = json.loads((folder / "scene.json").read_text())
        (folder / "scene.json").write_text(json.dumps(numbers | {"samples": 4}))
        (folder / "look.py").write_text(LOOK)
        program = "blender --background --factory-startup"
        printed = run_in_chroot(folder, f"{program} --python scene.py --python look.py -- --save --render")
        version, homes, others, sky = json.loads(printed.rpartition("FOUND")[2].splitlines()[0])
        assert (folder / "scene.blend").is_file()
        picture = srgb_decode(np.asarray(Image.open(folder / "render.png").convert("RGB")) / 255.0)
    assert version.startswith("5.2")
    assert (homes, others, sky) == (GROUPS, [], "MULTIPLE_SCATTERING")
    ratio = picture / srgb_decode(half_shaded_scene().plate / 255.0)
    assert np.median(ratio[297:305, 230:235]) < 0.3
    assert np.median(ratio[320:325, 400:412]) > 0.9  # the stick's

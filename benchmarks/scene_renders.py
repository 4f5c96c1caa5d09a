"""Render a scene's folder with the tool that it is for; `MissingToolError` names what this machine lacks."""

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from base64 import b64decode, b64encode
from collections.abc import Mapping
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from string import Template

import numpy as np
import OpenEXR
from numpy.typing import NDArray
from PIL import Image

from lighting.color import srgb_bytes
from lighting.scene.records import FAR, NEAR, Scene

HERE = Path(__file__).parent
GODOT_SCRIPT = HERE.parent / "tests" / "godot" / "render.gd"
NODE_MODULES = HERE.parent / "tests" / "node" / "node_modules"
CHROMIUM = ("chromium", "chromium-browser", "google-chrome", "chrome")
SECONDS = 1800  # that one render may take


class MissingToolError(Exception):
    """A program or module that a render needs is not on this machine."""


def render_blender(folder: Path, samples: int, blender: str | None) -> NDArray[np.uint8]:
    """By the folder's own script."""
    numbers = json.loads((folder / "scene.json").read_text())
    (folder / "scene.json").write_text(json.dumps({**numbers, "samples": samples}))
    _run([*_blender(blender, folder / "scene.py"), "--render"], folder)
    return _read(folder / "render.png")


def render_import(
    folder: Path, file: str, size: tuple[int, int], samples: int, blender: str | None
) -> NDArray[np.uint8]:
    """By Blender's own reader of USD."""
    script = _blender(blender, HERE / "scene_import.py")
    _run([*script, str(folder / file), str(folder / "render.png"), *map(str, (*size, samples))], folder)
    return _read(folder / "render.png")


def render_mitsuba(folder: Path, samples: int) -> NDArray[np.uint8]:
    """By the folder's own script."""
    if find_spec("mitsuba") is None:
        raise MissingToolError("the module mitsuba")
    _run([sys.executable, "composite.py", str(samples)], folder)
    return _read(folder / "composite.png")


def render_threejs(folder: Path, size: tuple[int, int]) -> NDArray[np.uint8]:
    """By a screenshot of the page."""
    return _screenshot(folder / "scene.html", size)


def render_babylon(folder: Path, size: tuple[int, int]) -> NDArray[np.uint8]:
    """By Babylon.js in Chromium, from scene.glb alone."""
    values = {"GLB": _base64(folder / "scene.glb")}
    values |= {"BABYLON": _module_file("babylonjs/babylon.js").as_uri()}
    values |= {"LOADERS": _module_file("babylonjs-loaders/babylonjs.loaders.min.js").as_uri()}
    return _drawn_by_page("scene_babylon.html", values, folder, size)


def render_filament(folder: Path, scene: Scene) -> NDArray[np.uint8]:
    """By Filament in Chromium, from scene.glb and the KTX cubemaps."""
    names = {"GLB": "scene.glb", "IBL": "environment_ibl.ktx", "SKYBOX": "environment_skybox.ktx"}
    _, up, forward = scene.camera_axes
    points = {"EYE": scene.camera_position, "TARGET": scene.camera_position + forward, "UP": up}
    values: dict[str, object] = {
        "FILAMENT": _module_file("filament/filament.js").as_uri(),
        "WASM": _base64(_module_file("filament/filament.wasm")),
        **{key: _base64(folder / name) for key, name in names.items()},
        **{key: point.tolist() for key, point in points.items()},
        **{"FOV": scene.vertical_fov, "NEAR": NEAR, "FAR": FAR},
    }
    return _drawn_by_page("scene_filament.html", values, folder, (scene.width, scene.height))


def _module_file(name: str) -> Path:
    """A file of tests/node/node_modules."""
    file = NODE_MODULES / name
    if not file.is_file():
        raise MissingToolError(f"{name.partition('/')[0]} (npm ci --prefix tests/node)")
    return file


def _base64(file: Path) -> str:
    return b64encode(file.read_bytes()).decode()


def _drawn_by_page(
    template: str, values: Mapping[str, object], folder: Path, size: tuple[int, int]
) -> NDArray[np.uint8]:
    """The picture that a page draws, in which a template's placeholders are replaced."""
    page = folder / "page.html"
    sized = {**values, "WIDTH": size[0], "HEIGHT": size[1]}
    page.write_text(Template((HERE / template).read_text(encoding="utf-8")).substitute(sized), encoding="utf-8")
    with tempfile.TemporaryDirectory() as profile:
        dumped = _run([*_chromium(profile), "--dump-dom", page.resolve().as_uri()], folder)
    found = re.search(r'<img id="drawn" src="data:image/png;base64,([^"]+)"', dumped)
    if found is None:
        raise RuntimeError(f"The page drew nothing: {dumped[-1000:]}")
    return np.asarray(Image.open(BytesIO(b64decode(found[1]))).convert("RGB"))


def render_godot(folder: Path) -> NDArray[np.uint8]:
    """By Godot in the chroot that LIGHTING_ENGINES names."""
    chroot = os.environ.get("LIGHTING_ENGINES", "")
    if not Path(chroot, "usr/bin/godot").exists() or os.geteuid() != 0:
        raise MissingToolError("Godot in the chroot of scripts/engines.sh (LIGHTING_ENGINES, as root)")
    with tempfile.TemporaryDirectory(dir=Path(chroot, "tmp")) as name:
        inside = Path(name, "scene")
        shutil.copytree(folder, inside)
        shutil.copy(GODOT_SCRIPT, inside)
        window = "xvfb-run -a -s '-screen 0 1024x768x24' godot --audio-driver Dummy --script render.gd -- scene"
        path = f"/{inside.relative_to(chroot)}"
        commands = f"cd {path} && export HOME={path} && godot --headless --import && {window}"
        _run(["chroot", chroot, "bash", "-c", commands], folder)
        pixels = OpenEXR.File(str(inside / "scene.exr")).channels()["RGB"].pixels
    return srgb_bytes(pixels)


def _screenshot(page: Path, size: tuple[int, int]) -> NDArray[np.uint8]:
    with tempfile.TemporaryDirectory() as profile:
        window = [f"--window-size={size[0]},{size[1]}", "--screenshot=render.png"]
        _run([*_chromium(profile), *window, page.resolve().as_uri() + "#plain"], page.parent)
    return _read(page.parent / "render.png")


def _chromium(profile: str) -> list[str]:
    """The command that runs Chromium without a window."""
    program = next(filter(None, map(shutil.which, CHROMIUM)), None)
    if program is None:
        raise MissingToolError("Chromium")
    options = ["--headless", "--no-sandbox", "--hide-scrollbars", "--no-first-run", "--disable-component-update"]
    webgl = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--virtual-time-budget=60000"]
    return [program, *options, *webgl, f"--user-data-dir={profile}"]


def _blender(blender: str | None, script: Path) -> list[str]:
    """The command that runs a script in Blender: by a Python that has bpy, or by the program."""
    if blender is None:
        blender = sys.executable if find_spec("bpy") else shutil.which("blender")
    if blender is None:
        raise MissingToolError("Blender (the module bpy, a program named blender, or --blender)")
    if "python" in Path(blender).name:
        return [blender, str(script)]
    return [blender, "--background", "--factory-startup", "--python", str(script), "--"]


def _run(command: list[str], folder: Path) -> str:
    """What a command prints; RuntimeError where it fails."""
    result = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=SECONDS, check=False)
    if result.returncode:
        raise RuntimeError(f"{command[0]} failed: {(result.stderr or result.stdout).strip()[-2000:]}")
    return result.stdout


def _read(path: Path) -> NDArray[np.uint8]:
    return np.asarray(Image.open(path).convert("RGB"))

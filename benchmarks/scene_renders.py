"""Render a scene's folder with the tool that it is for; `MissingToolError` names what this machine lacks."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import OpenEXR
from numpy.typing import NDArray
from PIL import Image

from lighting.color import srgb_bytes

HERE = Path(__file__).parent
GODOT_SCRIPT = HERE.parent / "tests" / "godot" / "render.gd"
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
    program = next(filter(None, map(shutil.which, CHROMIUM)), None)
    if program is None:
        raise MissingToolError("Chromium")
    with tempfile.TemporaryDirectory() as profile:
        options = ["--headless", "--no-sandbox", "--hide-scrollbars", "--no-first-run", "--disable-component-update"]
        webgl = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--virtual-time-budget=20000"]
        window = [f"--user-data-dir={profile}", f"--window-size={size[0]},{size[1]}", "--screenshot=render.png"]
        _run([program, *options, *webgl, *window, page.resolve().as_uri() + "#plain"], page.parent)
    return _read(page.parent / "render.png")


def _blender(blender: str | None, script: Path) -> list[str]:
    """The command that runs a script in Blender: by a Python that has bpy, or by the program."""
    if blender is None:
        blender = sys.executable if find_spec("bpy") else shutil.which("blender")
    if blender is None:
        raise MissingToolError("Blender (the module bpy, a program named blender, or --blender)")
    if "python" in Path(blender).name:
        return [blender, str(script)]
    return [blender, "--background", "--factory-startup", "--python", str(script), "--"]


def _run(command: list[str], folder: Path) -> None:
    result = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=SECONDS, check=False)
    if result.returncode:
        raise RuntimeError(f"{command[0]} failed: {(result.stderr or result.stdout).strip()[-2000:]}")


def _read(path: Path) -> NDArray[np.uint8]:
    return np.asarray(Image.open(path).convert("RGB"))

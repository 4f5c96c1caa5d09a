"""A photo's light as a scene for other tools: an entry of EXPORTERS and a module each.

`make_scene` computes a Scene once; `write_scene` and `zip_scene` have a tool's entry encode it. The command line, the
service and the checks that no file of the user is replaced read the entries. Nothing here needs numpy: the command
line's help reads it, too.
"""

import os
import shlex
from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

PLATE, ENVIRONMENT, RECORD = "plate.png", "environment.exr", "lighting.json"
LIT_GROUND, GROUND = "lit_ground.png", "ground.png"
CUBE_FACES = ("+X", "-X", "+Y", "-Y", "+Z", "-Z")
SHARED_FILES = (PLATE, ENVIRONMENT, RECORD, LIT_GROUND, GROUND)  # the same for every tool that has them


@dataclass(frozen=True)
class ExporterOption:
    """An option that a tool's writer takes by name."""

    choices: tuple[str, ...] = ()
    """The values that it takes. None: it is a switch, of commands and Python alone, for it starts a program."""
    default: str = ""
    """Its value unless stated; a switch is off."""
    help: str = ""
    """What a switch does."""


@dataclass(frozen=True)
class Exporter:
    """How scenes are written for one tool."""

    encode: Callable[..., dict[str, bytes]]
    """(scene, **options) to what its files hold, by name."""
    label: str
    """The tool's name, as people write it."""
    files: tuple[str, ...]
    """All that `encode` may make; the tool opens the first."""
    options: dict[str, ExporterOption] = field(default_factory=dict)
    """That `encode` takes, by name."""
    animate: Callable[..., dict[str, str]] | None = None
    """(CameraMotion) to the texts of files beside the scene's."""
    opened_by: str = "open {file}"
    """How to open the scene: {file} is the first of `files`, {folder} the folder."""

    def opening_command(self, folder: str) -> str:
        """Say how to open a scene, as a command where there is one.

        Args:
            folder: of the scene.
        """
        file = shlex.quote(os.path.join(folder, self.files[0]))  # noqa: PTH118  # pathlib would import more
        return self.opened_by.format(file=file, folder=shlex.quote(folder))


def _import_function(module: str, name: str) -> Callable[..., Any]:
    """A function of a module, which is imported when it is first called.

    Args:
        module: its dotted name.
        name: of the function.
    """

    def call(*arguments: Any, **options: Any) -> Any:
        return getattr(import_module(module), name)(*arguments, **options)

    return call


EXPORTERS: dict[str, Exporter] = {
    "blender": Exporter(
        _import_function("lighting.scene.blender", "encode_blender"),
        label="Blender",
        files=("scene.py", "scene.json", "scene.blend", *SHARED_FILES),
        options={"blend": ExporterOption(help="have Blender write scene.blend, which a double click opens")},
        animate=_import_function("lighting.scene.blender", "animate_blender"),
        opened_by="blender --python {file}",
    ),
    "usd": Exporter(
        _import_function("lighting.scene.usd", "encode_usd"),
        label="USD",
        files=("scene.usda", "scene.usdz", *SHARED_FILES),
        options={"up_axis": ExporterOption(("Y", "Z"), default="Y")},
        animate=_import_function("lighting.scene.usd", "animate_usd"),
        opened_by="usdview {file}, or import it into any program that reads USD; scene.usdz is for AR, without lights",
    ),
    "gltf": Exporter(
        _import_function("lighting.scene.gltf", "encode_gltf"),
        label="glTF",
        files=("scene.glb",),
        opened_by="drop {file} into any viewer of glTF, or import it",
    ),
    "filament": Exporter(
        _import_function("lighting.scene.cubemap", "encode_filament"),
        label="Filament",
        files=("scene.glb", "environment_ibl.ktx", "environment_skybox.ktx", "sh.txt", "light.json", RECORD),
        opened_by="open {file} at exposure 1, with environment_ibl.ktx beside it as an indirect light of intensity 1",
    ),
    "cubemap": Exporter(
        _import_function("lighting.scene.cubemap", "encode_cubemap"),
        label="Cubemap",
        files=("scene.glb", "environment.ktx2", *(f"{face}.hdr" for face in CUBE_FACES), RECORD),
        opened_by="open {file}, with environment.ktx2 or the six .hdr beside it as its cubemap",
    ),
    "threejs": Exporter(
        _import_function("lighting.scene.threejs", "encode_threejs"),
        label="three.js",
        files=("scene.html",),
        opened_by="open {file} in a browser",
    ),
    "page": Exporter(
        _import_function("lighting.scene.threejs", "encode_page"),
        label="Web page",
        files=("page.html",),
        opened_by="open {file} in any browser, or send it",
    ),
    "godot": Exporter(
        _import_function("lighting.scene.godot", "encode_godot"),
        label="Godot",
        files=(
            *("project.godot", "scene.tscn", "ground.gdshader", "backdrop.gdshader", *SHARED_FILES),
            *(f"{name}.import" for name in (PLATE, ENVIRONMENT, LIT_GROUND, GROUND)),
        ),
        opened_by="godot --editor {file}",
    ),
    "unreal": Exporter(
        _import_function("lighting.scene.unreal", "encode_unreal"),
        label="Unreal",
        files=(
            *("unreal_scene.py", "unreal_scene.json", "environment.hdr", "ground_albedo.png", "ground_emission.png"),
            *SHARED_FILES,
        ),
        opened_by="in a level of Unreal without lights, Tools > Execute Python Script: {file} "
        "(not run in the engine yet)",
    ),
    "unity": Exporter(
        _import_function("lighting.scene.unity", "encode_unity"),
        label="Unity",
        files=("scene.unitypackage",),
        opened_by="in Unity, Assets > Import Package > Custom Package: {file}, then Tools > Light from a Photo "
        "(not run in the engine yet)",
    ),
    "fspy": Exporter(
        _import_function("lighting.scene.fspy", "encode_fspy"),
        label="fSpy",
        files=("scene.fspy", "camera.json", *SHARED_FILES),
        opened_by="import {file} with fSpy's add-on for Blender, or camera.json beside it with fSpy's other importers",
    ),
    "mitsuba": Exporter(
        _import_function("lighting.scene.mitsuba", "encode_mitsuba"),
        label="Mitsuba",
        files=("scene.xml", "camera.xml", "light.xml", "object.xml", "composite.py", *SHARED_FILES),
        opened_by="mitsuba -m scalar_rgb {file}",
    ),
}


def unsupported_options(options: Collection[str], tool: str) -> dict[str, str]:
    """Those of the options that other tools alone take, each with such a tool.

    Args:
        options: names of them.
        tool: its name in EXPORTERS.
    """
    others = set(options) - set(EXPORTERS[tool].options)
    return {name: owner for owner, entry in EXPORTERS.items() for name in entry.options if name in others}


def animated_tools() -> list[str]:
    """The tools whose scenes can have a moving camera."""
    return [tool for tool, entry in EXPORTERS.items() if entry.animate]

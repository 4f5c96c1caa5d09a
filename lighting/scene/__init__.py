"""A photo's light as a scene for other tools: an entry of EXPORTERS and a module each.

`make_scene` computes a Scene once; `write_scene` and `zip_scene` have a tool's entry write it. The command line, the
service and the checks that no file of the user is replaced read the entries.
"""

from collections.abc import Collection
from typing import TYPE_CHECKING

from lighting.lazy import from_homes
from lighting.scene.tools import SHARED_FILES, Exporter, ExporterOption, import_function

if TYPE_CHECKING:
    from lighting.scene.common import PLATE_SIDE, CameraMotion, Scene, make_scene
    from lighting.scene.files import check_target, write_scene, zip_scene

__all__ = [
    "EXPORTERS",
    "PLATE_SIDE",
    "CameraMotion",
    "Exporter",
    "ExporterOption",
    "Scene",
    "animated_tools",
    "check_target",
    "make_scene",
    "unsupported_options",
    "write_scene",
    "zip_scene",
]

EXPORTERS: dict[str, Exporter] = {
    "blender": Exporter(
        import_function("lighting.scene.blender", "write"),
        files=("scene.py", "scene.json", "scene.blend", *SHARED_FILES),
        animate=import_function("lighting.scene.blender", "animate"),
    ),
    "usd": Exporter(
        import_function("lighting.scene.usd", "write"),
        files=("scene.usda", *SHARED_FILES),
        options={"up_axis": ExporterOption(("Y", "Z"), default="Y")},
        animate=import_function("lighting.scene.usd", "animate"),
    ),
    "gltf": Exporter(import_function("lighting.scene.gltf", "write"), files=("scene.glb",), has_map=False),
    "threejs": Exporter(import_function("lighting.scene.threejs", "write"), files=("scene.html",)),
    "mitsuba": Exporter(
        import_function("lighting.scene.mitsuba", "write"),
        files=("scene.xml", "camera.xml", "light.xml", "object.xml", "composite.py", *SHARED_FILES),
    ),
}

_HOME = {
    "CameraMotion": "common",
    "PLATE_SIDE": "common",
    "Scene": "common",
    "check_target": "files",
    "make_scene": "common",
    "write_scene": "files",
    "zip_scene": "files",
}

__getattr__ = from_homes(__name__, _HOME)  # what needs numpy, so that the command line's help stays quick


def unsupported_options(options: Collection[str], tool: str) -> dict[str, str]:
    """Those of the options that other tools alone take, each with such a tool."""
    others = set(options) - set(EXPORTERS[tool].options)
    return {name: owner for owner, entry in EXPORTERS.items() for name in entry.options if name in others}


def animated_tools() -> list[str]:
    """The tools whose scenes can have a moving camera."""
    return [tool for tool, entry in EXPORTERS.items() if entry.animate]

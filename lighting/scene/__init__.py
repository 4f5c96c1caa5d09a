"""A photo's light as a scene for other tools; each tool has a module here.

`make_scene` computes a Scene once; `write_scene` and `zip_scene` have a tool's module write it.
"""

from typing import TYPE_CHECKING, Any

from lighting.scene.tools import TOOL_OF_OPTION, TOOLS, TOOLS_WITHOUT_MAP, UP_AXES, Tool, UpAxis, misplaced

if TYPE_CHECKING:
    from lighting.scene.common import PLATE_SIDE, Scene, make_scene
    from lighting.scene.files import check_target, write_scene, zip_scene

__all__ = [
    "PLATE_SIDE",
    "TOOLS",
    "TOOLS_WITHOUT_MAP",
    "TOOL_OF_OPTION",
    "UP_AXES",
    "Scene",
    "Tool",
    "UpAxis",
    "check_target",
    "make_scene",
    "misplaced",
    "write_scene",
    "zip_scene",
]

_IN_COMMON = ("PLATE_SIDE", "Scene", "make_scene")


def __getattr__(name: str) -> Any:
    """Import what needs numpy on first use, so that the command line's help stays quick."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{'common' if name in _IN_COMMON else 'files'}"), name)

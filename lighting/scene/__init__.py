"""A photo's light as a scene for other tools; each tool has a module here.

`make_scene` computes a Scene once; `write_scene` and `zip_scene` have a tool's module write it.
"""

from typing import TYPE_CHECKING

from lighting.lazy import from_homes
from lighting.scene.tools import (
    TOOL_OF_OPTION,
    TOOLS,
    TOOLS_WITHOUT_MAP,
    UP_AXES,
    Tool,
    UpAxis,
    misplaced,
    pictures_of,
)

if TYPE_CHECKING:
    from lighting.scene.axes import to_z_up
    from lighting.scene.common import PLATE_SIDE, Scene, make_scene
    from lighting.scene.files import check_target, write_scene, zip_scene
    from lighting.scene.usd import APERTURE_UNIT

__all__ = [
    "APERTURE_UNIT",
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
    "pictures_of",
    "to_z_up",
    "write_scene",
    "zip_scene",
]

_HOME = {
    "APERTURE_UNIT": "usd",
    "PLATE_SIDE": "common",
    "Scene": "common",
    "check_target": "files",
    "make_scene": "common",
    "to_z_up": "axes",
    "write_scene": "files",
    "zip_scene": "files",
}

__getattr__ = from_homes(__name__, _HOME)  # what needs numpy, so that the command line's help stays quick

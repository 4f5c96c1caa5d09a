"""The tools that scenes are written for, and which option belongs to which."""

from collections.abc import Collection
from typing import Literal, get_args

Tool = Literal["blender", "usd", "gltf", "threejs", "mitsuba"]
UpAxis = Literal["Y", "Z"]

TOOLS: tuple[Tool, ...] = get_args(Tool)  # each is a module here with `write(scene, folder, **options)`
UP_AXES: tuple[UpAxis, ...] = get_args(UpAxis)
TOOL_OF_OPTION: dict[str, Tool] = {"up_axis": "usd"}  # an option of a `write`: the one tool that takes it
TOOLS_WITHOUT_MAP: tuple[Tool, ...] = ("gltf",)
TOOLS_WITH_PLATE: tuple[Tool, ...] = ("blender", "usd", "mitsuba")  # as a file, PLATE; the others' is in their one file
PLATE, LIT_GROUND = "plate.png", "lit_ground.png"


def misplaced(options: Collection[str], tool: str) -> dict[str, Tool]:
    """Those of the options that another tool takes, each with that tool."""
    return {name: owner for name, owner in TOOL_OF_OPTION.items() if name in options and owner != tool}

"""The tools that scenes are written for, and which option belongs to which."""

from collections.abc import Collection
from typing import Literal, get_args

Tool = Literal["blender", "usd", "gltf", "threejs", "mitsuba"]
UpAxis = Literal["Y", "Z"]

TOOLS: tuple[Tool, ...] = get_args(Tool)  # each is a module here with `write(scene, folder, **options)`
UP_AXES: tuple[UpAxis, ...] = get_args(UpAxis)
TOOL_OF_OPTION: dict[str, Tool] = {"up_axis": "usd"}  # an option of a `write`: the one tool that takes it
TOOLS_WITHOUT_MAP: tuple[Tool, ...] = ("gltf",)
PLATE, LIT_GROUND = "plate.png", "lit_ground.png"


def pictures_of(tool: Tool) -> tuple[str, ...]:
    """The pictures in a tool's folder; glTF and three.js have theirs in their one file."""
    return (PLATE, LIT_GROUND) if tool in ("blender", "usd", "mitsuba") else ()


def misplaced(options: Collection[str], tool: str) -> dict[str, Tool]:
    """Those of the options that another tool takes, each with that tool."""
    return {name: owner for name, owner in TOOL_OF_OPTION.items() if name in options and owner != tool}

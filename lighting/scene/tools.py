"""What an entry of EXPORTERS says about a tool; light enough for the command line's help."""

from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

PLATE, ENVIRONMENT, RECORD, LIT_GROUND = "plate.png", "environment.exr", "lighting.json", "lit_ground.png"
SHARED_FILES = (PLATE, ENVIRONMENT, RECORD, LIT_GROUND)  # the same for every tool that has them


@dataclass(frozen=True)
class ExporterOption:
    """An option that a tool's writer takes by name."""

    choices: tuple[str, ...]
    default: str


@dataclass(frozen=True)
class Exporter:
    """How scenes are written for one tool."""

    write: Callable[..., None]  # (scene, folder, **options)
    files: tuple[str, ...]  # all that `write` may make; the tool opens the first
    options: dict[str, ExporterOption] = field(default_factory=dict)
    has_map: bool = True  # whether the scene holds the environment map
    animate: Callable[..., dict[str, str]] | None = None  # (CameraMotion) to the texts of files beside the scene's


def import_function(module: str, name: str) -> Callable[..., Any]:
    """A function of a module, which is imported when it is first called."""

    def call(*arguments: Any, **options: Any) -> Any:
        return getattr(import_module(module), name)(*arguments, **options)

    return call

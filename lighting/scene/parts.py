"""Files and conversions that several writers share."""

import json
from importlib.resources import files
from string import Template
from typing import Any, Protocol

import numpy as np

from lighting.files import encode_envmap, encode_png, full_record
from lighting.geometry import Floats
from lighting.scene.common import Scene

PLATE, ENVIRONMENT, RECORD = "plate.png", "environment.exr", "lighting.json"


class File(Protocol):
    """A file to be written, in a folder or an archive."""

    def write_bytes(self, data: bytes, /) -> object: ...

    def write_text(self, text: str, /, encoding: str) -> object: ...


class Folder(Protocol):
    """Where a tool's files go: a Path, or an archive in memory."""

    def __truediv__(self, name: str, /) -> File: ...


def write_shared_files(scene: Scene, folder: Folder) -> None:
    """Write PLATE, ENVIRONMENT and RECORD."""
    (folder / PLATE).write_bytes(plate_png(scene))
    (folder / ENVIRONMENT).write_bytes(encode_envmap(scene.environment, scene.lighting))
    (folder / RECORD).write_text(json.dumps(full_record(scene.lighting), indent=2) + "\n", encoding="utf-8")


def plate_png(scene: Scene) -> bytes:
    """The plate as PNG."""
    return encode_png(scene.plate, compress_level=3)


def data_text(name: str) -> str:
    """The text of a file in data/."""
    return (files("lighting") / "scene" / "data" / name).read_text(encoding="utf-8")


def filled(name: str, values: dict[str, Any]) -> str:
    """The same with its $placeholders replaced."""
    return Template(data_text(name)).substitute(values)


def to_z_up(vector: Floats) -> Floats:
    """Vectors (..., 3) of our frame where +Z is up and the camera looks along +Y."""
    x, y, z = np.moveaxis(np.asarray(vector), -1, 0)
    return np.stack([x, -z, y], axis=-1)


def colour_and_strength(irradiance: Floats) -> tuple[Floats, float]:
    """An irradiance (3,) as a colour (3,) whose largest channel is 1, and its strength; white and 0 for no light."""
    strength = float(irradiance.max())
    return (irradiance / strength if strength > 0 else np.ones(3)), strength

"""Files and conversions that several writers share."""

import json
from importlib.resources import files
from string import Template
from typing import Any, Protocol

import numpy as np

from lighting.files import encode_envmap, encode_png, full_record
from lighting.scene.common import Scene
from lighting.scene.tools import ENVIRONMENT, LIT_GROUND, PLATE, RECORD


class File(Protocol):
    """A file to be written, in a folder or an archive."""

    def write_bytes(self, data: bytes, /) -> object: ...

    def write_text(self, text: str, /, encoding: str) -> object: ...


class Folder(Protocol):
    """Where a tool's files go: a Path, or an archive in memory."""

    def __truediv__(self, name: str, /) -> File: ...


def write_shared_files(scene: Scene, folder: Folder) -> None:
    """Write SHARED_FILES."""
    (folder / PLATE).write_bytes(plate_png(scene))
    (folder / ENVIRONMENT).write_bytes(encode_envmap(scene.environment, scene.lighting))
    (folder / RECORD).write_text(json.dumps(full_record(scene.lighting), indent=2) + "\n", encoding="utf-8")
    (folder / LIT_GROUND).write_bytes(lit_ground_png(scene))


def plate_png(scene: Scene) -> bytes:
    """The plate as PNG."""
    return encode_png(scene.plate, compress_level=3)


def lit_ground_png(scene: Scene) -> bytes:
    """Where the plate's ground lies in sunlight, as PNG of one channel: 0 in shade, 255 in sunlight or above ground."""
    return encode_png(np.round(255 * scene.lit_ground).astype(np.uint8))


def data_text(name: str) -> str:
    """The text of a file in data/."""
    return (files("lighting") / "scene" / "data" / name).read_text(encoding="utf-8")


def filled(name: str, values: dict[str, Any]) -> str:
    """The same with its $placeholders replaced."""
    return Template(data_text(name)).substitute(values)

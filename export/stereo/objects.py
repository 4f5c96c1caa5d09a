"""The shapes that the normals are scored on: nine scanned objects (DiLiGenT, Shi et al., CVPR 2016), held-out meshes.

They lie beside the project where they are at hand, and never in it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from export.stereo.surfaces import Surface, is_held_out, random_turn, read_mesh, view

OBJECTS = ("bear", "buddha", "cat", "cow", "goblet", "harvest", "pot1", "pot2", "reading")

_MARGIN = 8  # pixels around an object
_VIEW = 224  # pixels each way of a mesh's view


@dataclass(frozen=True)
class Subject:
    """A shape to photograph."""

    name: str
    group: str  # "scanned objects" or "held-out meshes"
    surface: Surface
    scale: float = 0.0  # mm in a pixel; 0 is unknown


def subjects(data: Path, step: int = 1) -> Iterator[Subject]:
    """The shapes of a folder with `scanned_objects` and `meshes`, every `step`th pixel of each; none where it lacks."""
    for name in OBJECTS:
        if (data / "scanned_objects" / name).is_dir():
            yield _thinned(_scanned(data / "scanned_objects" / name), step)
    for file in sorted((data / "meshes").glob("*.obj")):
        if is_held_out(file):
            yield from (_thinned(subject, step) for subject in _views(file))


def _views(file: Path) -> Iterator[Subject]:
    """Two views of a mesh, the same every time."""
    rng, mesh = np.random.default_rng(0), read_mesh(file)
    for number in (1, 2):
        yield Subject(f"{file.stem} {number}", "held-out meshes", view(mesh, random_turn(rng), _VIEW, rng))


def _scanned(folder: Path) -> Subject:
    coded = np.asarray(Image.open(folder / "normal_map.png"), dtype=np.float32)
    mask = np.asarray(Image.open(folder / "mask.png").convert("L")) > 127
    depth = np.load(folder / "depth_gt.npz")["depth_gt"]
    mask &= np.isfinite(depth)
    normals = np.asarray(coded / 127.5 - 1)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-9)
    scale = float(np.median(depth[mask]) / np.loadtxt(folder / "K.txt")[0, 0])
    height = np.where(mask, -depth / scale, np.nan).astype(np.float32)
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    window = tuple(slice(max(0, found[0] - _MARGIN), found[-1] + 1 + _MARGIN) for found in (rows, columns))
    whole = Surface(np.asarray(normals * mask[..., None], dtype=np.float32), height, mask)
    return Subject(folder.name, "scanned objects", _cut(whole, window), scale)


def _cut(surface: Surface, window: Any) -> Surface:
    return Surface(surface.normals[window], surface.height[window], surface.mask[window])


def _thinned(subject: Subject, step: int) -> Subject:
    """Every `step`th pixel each way; heights stay in pixels."""
    if step == 1:
        return subject
    part = _cut(subject.surface, (slice(None, None, step), slice(None, None, step)))
    smaller = Surface(part.normals, np.asarray(part.height / step, dtype=np.float32), part.mask)
    return Subject(subject.name, subject.group, smaller, subject.scale * step)

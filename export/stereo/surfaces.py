"""Surfaces to light: what one camera sees of a mesh or of a made relief, as normals and heights.

The camera is orthographic, so that a picture's pixels are the unit of all three axes: x right, y up, z to the camera.
"""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats

Image = NDArray[np.float32]

HELD_OUT = ("spot", "skull", "demosthenes")  # meshes that training never sees

_SAMPLES = 14  # points on a mesh for each pixel of its picture, about half of which it covers


@dataclass(frozen=True)
class Surface:
    """What a camera sees of a shape."""

    normals: Image  # (H, W, 3), unit vectors in the camera frame; 0 outside the mask
    height: Image  # (H, W), z [pixels], larger is nearer; NaN outside the mask
    mask: NDArray[np.bool_]  # (H, W)


def is_held_out(path: Path) -> bool:
    """Whether an OBJ file holds one of HELD_OUT, by its name up to the first hyphen or underscore."""
    return path.stem.split("-")[0].split("_")[0] in HELD_OUT


def read_mesh(path: Path) -> tuple[Image, NDArray[np.intp]]:
    """Vertices (V, 3) and triangles (F, 3) of an OBJ file; faces of more corners are cut into fans."""
    vertices: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    for line in path.read_text().splitlines():
        word, *rest = line.split() or [""]
        if word == "v":
            vertices.append([float(value) for value in rest[:3]])
        elif word == "f":
            corners = [int(corner.split("/")[0]) - 1 for corner in rest]
            triangles += [(corners[0], a, b) for a, b in pairwise(corners[1:])]
    return np.array(vertices, dtype=np.float32), np.array(triangles, dtype=np.intp)


def vertex_normals(vertices: Image, triangles: NDArray[np.intp]) -> Image:
    """Unit normals (V, 3), those of the faces around a vertex weighted by their area."""
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    face = np.cross(b - a, c - a)
    total = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(total, triangles[:, corner], face)
    return np.asarray(total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-20))


def view(mesh: tuple[Image, NDArray[np.intp]], turn: Floats, size: int, rng: np.random.Generator) -> Surface:
    """A mesh turned by the matrix (3, 3) and fitted to a picture of `size` pixels each way.

    Each pixel shows the nearest of many points spread over the triangles by their area.
    """
    vertices, triangles = mesh
    normals = vertex_normals(vertices, triangles) @ turn.T.astype(np.float32)
    turned = vertices @ turn.T.astype(np.float32)
    low, high = turned.min(axis=0), turned.max(axis=0)
    turned = (turned - (low + high) / 2) * (0.94 * size / (high - low)[:2].max())
    points, facing = _spread(turned, normals, triangles, _SAMPLES * size * size, rng)
    front = facing[:, 2] > 0
    return _nearest(points[front], facing[front], size)


def _spread(
    vertices: Image, normals: Image, triangles: NDArray[np.intp], count: int, rng: np.random.Generator
) -> tuple[Image, Image]:
    """Points (N, 3) and their unit normals (N, 3), evenly over the area."""
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    chosen = triangles[np.searchsorted(np.cumsum(area) / area.sum(), np.sort(rng.random(count))).clip(0, len(area) - 1)]
    u, v = rng.random((2, count), dtype=np.float32)
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    weight = np.stack([1 - u - v, u, v], axis=1)[..., None]
    point = sum(vertices[chosen[:, corner]] * weight[:, corner] for corner in range(3))
    normal = sum(normals[chosen[:, corner]] * weight[:, corner] for corner in range(3))
    return np.asarray(point), np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-20))


def _nearest(points: Image, normals: Image, size: int) -> Surface:
    column = np.floor(points[:, 0] + size / 2).astype(np.intp)
    row = np.floor(size / 2 - points[:, 1]).astype(np.intp)
    pixel = row * size + column
    order = np.argsort(points[:, 2], kind="stable")  # the nearest last, so that it stays
    height = np.full(size * size, np.nan, dtype=np.float32)
    facing = np.zeros((size * size, 3), dtype=np.float32)
    height[pixel[order]] = points[order, 2]
    facing[pixel[order]] = normals[order]
    image = height.reshape(size, size)
    return Surface(facing.reshape(size, size, 3), image, np.isfinite(image))


def random_turn(rng: np.random.Generator) -> Floats:
    """A rotation (3, 3), all equally likely (Shoemake, Uniform Random Rotations, 1992)."""
    w, x, y, z = (q := rng.normal(size=4)) / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def of_height(height: Image, mask: NDArray[np.bool_]) -> Surface:
    """The surface of a height field (H, W) [pixels], whose slopes give the normals."""
    down, right = np.gradient(height)
    normals = np.stack([-right, down, np.ones_like(height)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    kept = np.where(mask, height, np.nan)
    return Surface((normals * mask[..., None]).astype(np.float32), kept.astype(np.float32), mask)


def turned(surface: Surface, quarters: int, *, mirrored: bool = False) -> Surface:
    """The surface turned counter-clockwise by quarters of a turn, after a mirror swapped left and right."""
    normals, height, mask = surface.normals, surface.height, surface.mask
    if mirrored:
        normals, height, mask = normals[:, ::-1] * np.array([-1, 1, 1], np.float32), height[:, ::-1], mask[:, ::-1]
    for _ in range(quarters % 4):
        normals = np.rot90(normals)[..., [1, 0, 2]] * np.array([-1, 1, 1], np.float32)
        height, mask = np.rot90(height), np.rot90(mask)
    return Surface(np.ascontiguousarray(normals), np.ascontiguousarray(height), np.ascontiguousarray(mask))

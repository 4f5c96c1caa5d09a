"""Surfaces to light: what one camera sees of a mesh or of a made relief, as normals and heights.

The camera is orthographic, so that a picture's pixels are the unit of all three axes: x right, y up, z to the camera.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats
from lighting.registration.rotations import cross_matrix

Image = NDArray[np.float32]
TriangleMesh = tuple[Image, NDArray[np.intp]]  # vertices (V, 3) and triangles (F, 3)

_HELD_OUT = ("spot", "skull", "demosthenes")  # meshes that training never sees

_SAMPLES = 14  # points on a mesh for each pixel of its picture, about half of which it covers


@dataclass(frozen=True)
class Surface:
    """What a camera sees of a shape."""

    normals: Image  # (H, W, 3), unit vectors in the camera frame; 0 outside the mask
    height: Image  # (H, W), z [pixels], larger is nearer; NaN outside the mask
    mask: NDArray[np.bool_]  # (H, W)


def is_held_out(path: Path) -> bool:
    """Whether an OBJ file holds one of _HELD_OUT, by its name up to the first hyphen or underscore.

    Args:
        path: of the file.
    """
    return path.stem.split("-")[0].split("_")[0] in _HELD_OUT


def read_mesh(path: Path) -> TriangleMesh:
    """The mesh of an OBJ file; faces of more corners are cut into fans.

    Args:
        path: of the file.
    """
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


def _vertex_normals(vertices: Image, triangles: NDArray[np.intp]) -> Image:
    """Unit normals (V, 3), those of the faces around a vertex weighted by their area."""
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    face = np.cross(b - a, c - a)
    total = np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(total, triangles[:, corner], face)
    return np.asarray(total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-20))


def project_mesh(mesh: TriangleMesh, rotation: Floats, size: int, rng: np.random.Generator) -> Surface:
    """A mesh rotated and fitted to a picture.

    Each pixel shows the nearest of many points spread over the triangles by their area.

    Args:
        mesh: vertices (V, 3) and triangles (F, 3).
        rotation: (3, 3) from the mesh's axes to the camera's.
        size: pixels each way.
        rng: of the points.
    """
    vertices, triangles = mesh
    normals = _vertex_normals(vertices, triangles) @ rotation.T.astype(np.float32)
    rotated = vertices @ rotation.T.astype(np.float32)
    low, high = rotated.min(axis=0), rotated.max(axis=0)
    rotated = (rotated - (low + high) / 2) * (0.94 * size / (high - low)[:2].max())
    points, facing = _spread(rotated, normals, triangles, _SAMPLES * size * size, rng)
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


def random_rotation(rng: np.random.Generator) -> Floats:
    """A rotation (3, 3), all equally likely [1].

    Args:
        rng: draws four normal values.

    References:
        [1] Shoemake, Uniform Random Rotations, Graphics Gems III, 1992.
    """
    quaternion = (q := rng.normal(size=4)) / np.linalg.norm(q)
    cross = cross_matrix(quaternion[1:])
    return np.asarray(np.eye(3) + 2 * (quaternion[0] * cross + cross @ cross))


def surface_from_height(height: Image, mask: NDArray[np.bool_]) -> Surface:
    """The surface of a height field, whose slopes give the normals.

    Args:
        height: (H, W) pixels.
        mask: (H, W) where the surface is.
    """
    down, right = np.gradient(height)
    normals = np.stack([-right, down, np.ones_like(height)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    kept = np.where(mask, height, np.nan)
    return Surface((normals * mask[..., None]).astype(np.float32), kept.astype(np.float32), mask)


def rotate_surface(surface: Surface, quarters: int, *, mirrored: bool = False) -> Surface:
    """The surface rotated about the viewing direction, counter-clockwise.

    Args:
        surface: the shape.
        quarters: of a full rotation.
        mirrored: whether left and right change places first.
    """
    normals, height, mask = surface.normals, surface.height, surface.mask
    if mirrored:
        normals, height, mask = normals[:, ::-1] * np.array([-1, 1, 1], np.float32), height[:, ::-1], mask[:, ::-1]
    for _ in range(quarters % 4):
        normals = np.rot90(normals)[..., [1, 0, 2]] * np.array([-1, 1, 1], np.float32)
        height, mask = np.rot90(height), np.rot90(mask)
    return Surface(np.ascontiguousarray(normals), np.ascontiguousarray(height), np.ascontiguousarray(mask))


# Procedural shapes: façades, carved panels, rough ground, heaps of ellipsoids, turned vessels.


def random_relief(size: int, rng: np.random.Generator) -> Surface:
    """A shape of a kind and with details drawn at random.

    Args:
        size: pixels each way.
        rng: of all that is random.
    """
    kind = _KINDS[rng.choice(len(_KINDS), p=_SHARES)]
    height = kind(size, rng)
    if rng.random() < 0.4:
        height = height + _rough(size, rng) * rng.uniform(0.2, 1.5)
    mask = np.isfinite(height)
    filled = np.where(mask, height, np.nanmin(height))
    padded = np.pad(mask, 1, mode="edge")
    # Pixels beside one outside the mask are left out: their slopes would be those of a cliff.
    inside = padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    return surface_from_height(filled.astype(np.float32), mask & inside)


def _rough(size: int, rng: np.random.Generator, roughness: float | None = None) -> Floats:
    """A field (size, size) of noise whose spectrum falls as a power of the frequency, of standard deviation 1."""
    power = rng.uniform(1.4, 2.6) if roughness is None else roughness
    frequency = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None, :])
    frequency[0, 0] = np.inf
    spectrum = np.fft.rfft2(rng.normal(size=(size, size))) / frequency**power
    field = np.fft.irfft2(spectrum, s=(size, size))
    return np.asarray(field / field.std())


def _ground(size: int, rng: np.random.Generator) -> Floats:
    return _rough(size, rng, rng.uniform(1.8, 3.0)) * size * rng.uniform(0.03, 0.15)


def _heap(size: int, rng: np.random.Generator) -> Floats:
    """The nearest of several ellipsoids, with nothing or a wall behind them."""
    y, x = np.mgrid[:size, :size] - (size - 1) / 2.0
    height = np.full((size, size), -np.inf)
    for index in range(rng.integers(1, 9)):
        spread = 0.1 if index == 0 else 0.35
        u, v = x - rng.normal(0, spread * size), y - rng.normal(0, spread * size)
        turn, (a, b, c) = rng.uniform(0, np.pi), size * rng.uniform(0.1, 0.45, 3)
        p, q = (u * np.cos(turn) + v * np.sin(turn)) / a, (v * np.cos(turn) - u * np.sin(turn)) / b
        inside = 1 - p * p - q * q
        height = np.maximum(height, np.where(inside > 0, c * np.sqrt(np.maximum(inside, 0)), -np.inf))
    back = 0.0 if rng.random() < 0.4 else np.nan
    return np.where(np.isfinite(height), height, back)


def _vessel(size: int, rng: np.random.Generator) -> Floats:
    """A body turned about an upright or tilted axis, with a profile of a few waves and perhaps flutes."""
    y, x = np.mgrid[:size, :size] - (size - 1) / 2.0
    turn = rng.normal(0, 0.3)
    x, y = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
    t = y / size
    radius = 0.3 + sum(rng.normal(0, 0.09 / k) * np.cos(np.pi * k * (2 * t + rng.uniform(0, 2))) for k in range(1, 6))
    radius = np.clip(radius, 0.06, 0.48) * size
    share = x / radius
    depth = radius * np.sqrt(np.maximum(1 - share**2, 0))
    if rng.random() < 0.4:
        depth = depth + rng.uniform(0.5, 2.5) * np.cos(rng.integers(6, 24) * np.arcsin(np.clip(share, -1, 1)))
    return np.where((np.abs(share) < 1) & (np.abs(t) < 0.47), depth, np.nan)


def _panel(size: int, rng: np.random.Generator) -> Floats:
    """A slab with carved strokes, raised or sunk, their flanks sloped."""
    y, x = np.mgrid[:size, :size].astype(float)
    near = np.full((size, size), np.inf)
    for _ in range(rng.integers(6, 40)):
        start, along = rng.uniform(0, size, 2), rng.normal(0, 0.12 * size, 2)
        length2 = max(float(along @ along), 1.0)
        t = np.clip(((x - start[0]) * along[0] + (y - start[1]) * along[1]) / length2, 0, 1)
        near = np.minimum(near, np.hypot(x - start[0] - t * along[0], y - start[1] - t * along[1]))
    width = rng.uniform(2, 8)
    depth = rng.choice([-1, 1]) * width * rng.uniform(0.3, 1.2)
    profile = np.clip(1 - near / width, 0, 1)
    profile = profile if rng.random() < 0.5 else np.minimum(1, 2 * profile)
    return np.asarray(depth * profile + x * rng.normal(0, 0.15) + y * rng.normal(0, 0.15))


def _facade(size: int, rng: np.random.Generator) -> Floats:
    """A wall of blocks and openings at several depths, its edges softened."""
    height = np.zeros((size, size))
    for _ in range(rng.integers(4, 30)):
        top, left = rng.integers(0, size, 2)
        tall, wide = rng.integers(size // 16, size // 2, 2)
        height[top : top + tall, left : left + wide] += rng.normal(0, 0.04 * size)
    kernel = np.exp(-0.5 * (np.fft.fftfreq(size) * size / rng.uniform(0.8, 3)) ** 2)
    kernel /= kernel.sum()
    soft = np.fft.fft2(kernel[:, None] * kernel[None, :])
    y, x = np.mgrid[:size, :size] / size
    lean = size * (x * rng.normal(0, 0.2) + y * rng.normal(0, 0.2))
    return np.asarray(np.fft.ifft2(np.fft.fft2(height) * soft).real + lean)


_KINDS: tuple[Callable[[int, np.random.Generator], Floats], ...] = (_ground, _heap, _vessel, _panel, _facade)
_SHARES = (0.2, 0.3, 0.25, 0.15, 0.1)

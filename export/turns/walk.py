"""Photos of one rendered place from several standpoints: exact turns with parallax.

One ray a sample finds what is seen; sunlight with its shadows, a sky that is brighter above, and a grain fixed to the
things shade it. It is not light transport, and has no noise that would differ from photo to photo.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from export.crops.crops import Camera
from export.towns.llvm import find_llvm
from export.towns.mesh import Mesh
from export.towns.place import EYE, place
from lighting.colour import tone_map
from lighting.geometry import camera_directions, direction

SAMPLES = 4  # rays per pixel, 2 x 2
SKY, SUN = 0.35, 0.9  # brightness of a white plane under each
GRAIN = ((0.05, 0.25), (0.25, 0.35), (1.2, 0.3), (6.0, 0.3))  # m and contrast of the layers
REPEATS = 64  # cells after which a layer of grain repeats

Floats = NDArray[np.floating[Any]]


@dataclass(frozen=True)
class Standpoint:
    """Where a photo is taken from and how the camera is held; angles in deg."""

    position: tuple[float, float]  # m, x and z over the ground
    azimuth: float
    elevation: float
    roll: float
    vertical_fov: float

    def camera(self, aspect: float) -> Camera:
        """The camera alone, of a photo of this width over height."""
        return Camera(self.azimuth, self.elevation, self.roll, self.vertical_fov, aspect)


class Walk:
    """A rendered place to walk through, the same for one number."""

    def __init__(self, number: int) -> None:
        find_llvm()
        import mitsuba as mi

        mi.set_variant("llvm_ad_rgb")
        rng = np.random.default_rng([21, number])
        meshes = place(rng)
        self.sun = direction(rng.uniform(-180, 180), rng.uniform(15, 60))
        self.lattice = rng.random((REPEATS, REPEATS, REPEATS)).astype(np.float32)
        self.colours = np.concatenate([mesh.albedo for mesh in meshes])
        self.scene = mi.load_dict({"type": "scene", "things": _mesh(mi, meshes)})

    def photo(self, at: Standpoint, width: int, height: int) -> NDArray[np.uint8]:
        """What is seen from there: (height, width, 3) sRGB."""
        towards = camera_directions(2 * width, 2 * height, at.vertical_fov, at.azimuth, at.elevation, at.roll)
        linear = self._radiance(towards.reshape(-1, 3), (at.position[0], EYE, at.position[1]))
        return np.asarray(tone_map(linear.reshape(height, 2, width, 2, 3).mean(axis=(1, 3))))

    def is_clear(self, at: Standpoint, arm: float = 1.5) -> bool:
        """Whether nothing in view is nearer than an arm [m], but for a tenth of the picture."""
        towards = camera_directions(32, 24, at.vertical_fov, at.azimuth, at.elevation, at.roll).reshape(-1, 3)
        hit, *_ = self._meet(towards, (at.position[0], EYE, at.position[1]))
        return float(np.mean(hit < arm)) < 0.1

    def _radiance(self, towards: Floats, origin: tuple[float, float, float]) -> NDArray[np.float32]:
        distance, face, normal = self._meet(towards, origin)
        seen = np.isfinite(distance)
        colour = np.array([0.35, 0.5, 0.8]) * (1.2 - 0.6 * np.clip(towards[:, 1:2], 0, 1))
        point = np.array(origin) + towards[seen] * distance[seen, None]
        facing = normal[seen] * -np.sign(np.sum(normal[seen] * towards[seen], axis=1, keepdims=True))
        lit = np.maximum(facing @ self.sun, 0.0) * self._sunlit(point + 0.01 * facing)
        light = SUN * lit + SKY * (0.6 + 0.4 * facing[:, 1])
        colour[seen] = self.colours[face[seen]] * (2.0 * light * self._grain(point))[:, None]
        return np.asarray(colour, dtype=np.float32)

    def _meet(self, towards: Floats, origin: tuple[float, float, float]) -> tuple[Floats, NDArray[np.intp], Floats]:
        """Distances (N,) [m], infinite for the sky, quads (N,) and normals (N, 3)."""
        import mitsuba as mi

        ray = mi.Ray3f(mi.Point3f(*(float(v) for v in origin)), mi.Vector3f(*towards.T.astype(np.float32)))
        found = self.scene.ray_intersect(ray)
        distance = np.where(np.array(found.is_valid()), np.array(found.t), np.inf)
        return distance, np.array(found.prim_index).astype(np.intp) // 2 % len(self.colours), np.array(found.n).T

    def _sunlit(self, point: Floats) -> Floats:
        import mitsuba as mi

        ray = mi.Ray3f(mi.Point3f(*point.T.astype(np.float32)), mi.Vector3f(*(float(v) for v in self.sun)))
        return 1.0 - np.array(self.scene.ray_test(ray)).astype(np.float64)

    def _grain(self, point: Floats) -> Floats:
        """A factor (N,) around 1 that belongs to a place in space (N, 3)."""
        layers = [1.0 + contrast * (2.0 * _smooth(self.lattice, point / size) - 1.0) for size, contrast in GRAIN]
        return np.asarray(np.prod(layers, axis=0))


def _smooth(lattice: NDArray[np.float32], point: Floats) -> Floats:
    """Values (N,) between those of a lattice (R, R, R) that repeats, at points (N, 3)."""
    low = np.floor(point).astype(np.int64)
    part = point - low
    total = np.zeros(len(point))
    for corner in np.ndindex(2, 2, 2):
        share = np.prod(np.where(np.array(corner), part, 1.0 - part), axis=1)
        total += share * lattice[tuple(((low + corner) % REPEATS).T)]
    return total


def _mesh(mi: Any, meshes: tuple[Mesh, ...]) -> Any:
    corners = np.concatenate([mesh.corners for mesh in meshes])
    count = len(corners)
    first = 4 * np.arange(count)[:, None]
    halves = np.stack([first + np.array(half) for half in ((0, 1, 2), (0, 2, 3))], axis=1)  # quad after quad
    made = mi.Mesh("quads", 4 * count, 2 * count)
    values = mi.traverse(made)
    values["vertex_positions"] = corners.ravel().astype(np.float32)
    values["faces"] = halves.ravel().astype(np.uint32)
    values.update()
    return made

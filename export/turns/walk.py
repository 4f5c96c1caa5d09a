"""Photos of one rendered place from several standpoints: exact turns with parallax.

One ray a sample finds what is seen; sunlight with its shadows, skylight from above, both of Hosek and Wilkie's model,
and a grain fixed to the things shade it. It is not light transport, and no noise differs from photo to photo.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from export.crops import Camera
from export.towns.llvm import find_llvm
from export.towns.mesh import Mesh
from export.towns.place import EYE, place
from export.turns.sets import well_exposed
from lighting.colour import tone_map
from lighting.envmap import render
from lighting.geometry import (
    Floats,
    Pinhole,
    camera_directions,
    latlong_directions,
    latlong_solid_angle,
    sample_latlong,
)
from lighting.records import Lighting
from lighting.sky.hosek_wilkie import SUN_SOLID_ANGLE, sun_radiance

SAMPLES = 4  # rays per pixel, 2 x 2
DOME = 128  # rows of the map of the sky
GRAIN = ((0.05, 0.25), (0.25, 0.35), (1.2, 0.3), (6.0, 0.3))  # m and contrast of the layers
REPEATS = 64  # cells after which a layer of grain repeats


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


@dataclass(frozen=True, eq=False)
class Daylight:
    """The light of a clear sky."""

    sun: Floats  # (3,) direction
    beam: Floats  # (3,) irradiance of a plane that faces the sun
    ambient: Floats  # (3,) irradiance of a horizontal plane by the sky
    dome: NDArray[np.float32]  # (DOME, 2 DOME, 3) radiance

    @classmethod
    def of(cls, light: Lighting) -> "Daylight":
        """That of a record."""
        dome = render(light, DOME, sun=False)
        upwards = latlong_directions(DOME)[..., 1:2]
        share = np.maximum(upwards, 0.0) * latlong_solid_angle(DOME)[:, None, None]
        beam = sun_radiance(light.sun_direction, light.turbidity) * (SUN_SOLID_ANGLE * light.exposure)
        return cls(light.sun_direction, np.asarray(beam), np.sum(dome * share, axis=(0, 1)), dome)


class Walk:
    """A rendered place to walk through, the same for one number, under a light of its own."""

    def __init__(self, number: int) -> None:
        find_llvm()
        import mitsuba as mi

        mi.set_variant("llvm_ad_rgb")
        rng = np.random.default_rng([21, number])
        meshes = place(rng)
        own = Lighting(float(rng.uniform(-180, 180)), float(rng.uniform(15, 60)), turbidity=3.0, exposure=0.02)
        self.light = Daylight.of(own)
        self.lattice = rng.random((REPEATS, REPEATS, REPEATS)).astype(np.float32)
        self.colours = np.concatenate([mesh.albedo for mesh in meshes])
        self.scene = mi.load_dict({"type": "scene", "things": _mesh(mi, meshes)})

    def photo(self, at: Standpoint, width: int, height: int) -> NDArray[np.uint8]:
        """What is seen from there: (height, width, 3) sRGB."""
        towards = camera_directions(Pinhole(2 * width, 2 * height, at.vertical_fov, at.azimuth, at.elevation, at.roll))
        linear = self._radiance(towards.reshape(-1, 3), (at.position[0], EYE, at.position[1]))
        mean = linear.reshape(height, 2, width, 2, 3).mean(axis=(1, 3))
        return np.asarray(tone_map(well_exposed(mean)))

    def is_clear(self, at: Standpoint, arm: float = 1.5) -> bool:
        """Whether nothing in view is nearer than an arm [m], but for a tenth of the picture."""
        towards = camera_directions(Pinhole(32, 24, at.vertical_fov, at.azimuth, at.elevation, at.roll)).reshape(-1, 3)
        hit, *_ = self._meet(towards, (at.position[0], EYE, at.position[1]))
        return float(np.mean(hit < arm)) < 0.1

    def _radiance(self, towards: Floats, origin: tuple[float, float, float]) -> NDArray[np.float32]:
        distance, face, normal = self._meet(towards, origin)
        seen = np.isfinite(distance)
        colour = sample_latlong(self.light.dome, towards).astype(np.float64)
        point = np.array(origin) + towards[seen] * distance[seen, None]
        facing = normal[seen] * -np.sign(np.sum(normal[seen] * towards[seen], axis=1, keepdims=True))
        lit = np.maximum(facing @ self.light.sun, 0.0) * self._sunlit(point + 0.01 * facing)
        light = self.light.beam * lit[:, None] + self.light.ambient * (0.6 + 0.4 * facing[:, 1:2])
        colour[seen] = self.colours[face[seen]] / np.pi * light * self._grain(point)[:, None]
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

        ray = mi.Ray3f(mi.Point3f(*point.T.astype(np.float32)), mi.Vector3f(*(float(v) for v in self.light.sun)))
        return 1.0 - np.array(self.scene.ray_test(ray)).astype(np.float64)

    def _grain(self, point: Floats) -> Floats:
        """A factor (N,) around 1 that belongs to a place in space (N, 3)."""
        layers = [1.0 + contrast * (2.0 * _smooth(self.lattice, point / size) - 1.0) for size, contrast in GRAIN]
        return np.asarray(np.prod(layers, axis=0))


def _smooth(lattice: NDArray[np.float32], point: Floats) -> Floats:
    """Values (N,) between those of a lattice (R, R, R) that repeats, at points (N, 3)."""
    from scipy import ndimage

    return np.asarray(ndimage.map_coordinates(lattice, point.T, np.float64, order=1, mode="grid-wrap"))


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

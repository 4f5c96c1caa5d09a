"""HDR panoramas of coloured quads under a sky, path traced by Mitsuba 3."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from export.towns.llvm import find_llvm
from export.towns.mesh import Mesh
from export.towns.place import EYE
from export.towns.sky import Sky
from lighting.geometry import Floats, Pinhole, camera_directions, direction

SKY_SAMPLES, SUN_SAMPLES = 12, 4  # paths per pixel
BOUNCES = 2
LEVEL, LOW = 0.9, 0.5  # least slope of a normal and greatest height [m] of level ground
ARM, CROWDED = 1.2, 0.1  # m, and the share of the horizon that may be nearer than that

_PAINTED = {"type": "mesh_attribute", "name": "vertex_color"}
_MATTE = {"type": "diffuse", "reflectance": _PAINTED}
_LACQUER = {
    "type": "blendbsdf",
    "weight": 0.12,
    "paint": _MATTE,
    "shine": {"type": "roughconductor", "material": "none", "alpha": 0.08},
}


Towards = Callable[[Any, Any, int], Any]  # of pixels' x and y, and the picture's rows, to directions


@dataclass(frozen=True, eq=False)
class Photographed:
    """A photo of a rendered place, in its parts."""

    sky: NDArray[np.float32]  # (h, w, 3) linear, lit by the sky alone
    sun: NDArray[np.float32]  # (h, w, 3) what the sun adds, without its disc
    ground: NDArray[np.bool_]  # (h, w) where level ground is seen
    lit: NDArray[np.bool_]  # (h, w) where the sun reaches it


class RenderedPlace:
    """A place under a sky, loaded into Mitsuba.

    Sunlight and skylight are traced separately: if sampled together, the sun would take most paths and the shade would
    be noisy.
    """

    def __init__(self, matte: Mesh, glossy: Mesh, sky: Sky) -> None:
        find_llvm()
        import mitsuba as mi

        mi.set_variant("llvm_ad_rgb")
        things = {"matte": _mesh(mi, matte, _MATTE), "glossy": _mesh(mi, glossy, _LACQUER)}
        turn = mi.ScalarTransform4f().rotate([0, 1, 0], 180)
        light = {"type": "envmap", "bitmap": mi.Bitmap(sky.radiance), "to_world": turn}
        beam = {
            "type": "directional",
            "direction": [float(-v) for v in sky.lighting.sun_direction],
            "irradiance": {"type": "rgb", "value": [float(v) for v in sky.sun_irradiance]},
        }
        self.sky = sky
        self.scene = mi.load_dict({"type": "scene", "light": light, **things})
        self.sunny = mi.load_dict({"type": "scene", "light": beam, **things})

    def panorama(self, height: int, seed: int) -> NDArray[np.float32]:
        """The panorama (height, 2 height, 3) seen from EYE, linear, in the sky's unit."""
        size = (height, 2 * height)
        image = self._trace(self.scene, SKY_SAMPLES, size, _all_around, seed)
        if self.sky.is_overcast:
            return image
        image += self._trace(self.sunny, SUN_SAMPLES, size, _all_around, seed + 1)
        return image + self.sky.disc(height) if self.sees_the_sun() else image

    def photo(self, camera: Pinhole, seed: int) -> Photographed:
        """What a camera at EYE sees, in its parts."""
        size, towards = (camera.height, camera.width), _through(camera)
        sky = self._trace(self.scene, SKY_SAMPLES, size, towards, seed)
        sun = np.zeros_like(sky)
        if not self.sky.is_overcast:
            sun = self._trace(self.sunny, SUN_SAMPLES, size, towards, seed + 1)
        return Photographed(sky, sun, *self._ground(camera))

    def _ground(self, camera: Pinhole) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which pixels (h, w) of a camera show level ground, and which of these the sun reaches."""
        import mitsuba as mi

        rays = camera_directions(camera).reshape(-1, 3).T.astype(np.float32)
        hit = self.scene.ray_intersect(mi.Ray3f(mi.Point3f(0, EYE, 0), mi.Vector3f(*rays)))
        up = np.abs(np.array(hit.n.y)) > LEVEL
        level = np.array(hit.is_valid()) & up & (np.array(hit.p.y) < LOW)
        sun = mi.Vector3f(*(float(v) for v in self.sky.lighting.sun_direction))
        hidden = np.array(self.scene.ray_test(mi.Ray3f(hit.p + mi.Vector3f(0, 1e-3, 0), sun)))
        shape = (camera.height, camera.width)
        return level.reshape(shape), (level & ~hidden).reshape(shape)

    def _trace(
        self, scene: Any, samples: int, size: tuple[int, int], towards: Towards, seed: int
    ) -> NDArray[np.float32]:
        """A picture (h, w, 3) of `size`, along the directions in which its pixels look."""
        import drjit as dr
        import mitsuba as mi

        sampler = mi.load_dict({"type": "multijitter", "sample_count": samples})
        sampler.set_samples_per_wavefront(samples)
        height, width = size
        count = height * width * samples
        sampler.seed(seed, count)
        pixel = dr.arange(mi.UInt32, count) // samples
        jitter = sampler.next_2d()
        along = towards(pixel % width + jitter.x, pixel // width + jitter.y, height)
        ray = mi.RayDifferential3f(mi.Ray3f(mi.Point3f(0, EYE, 0), along))
        integrator = mi.load_dict({"type": "path", "max_depth": BOUNCES + 1})
        radiance, _, _ = integrator.sample(scene, sampler, ray)
        mean = [np.array(dr.block_sum(c, samples)) / samples for c in (radiance.x, radiance.y, radiance.z)]
        return despeckle(np.stack(mean, -1).reshape(height, width, 3).astype(np.float32))

    def is_clear(self) -> bool:
        """Whether the camera stands free: under CROWDED of its horizon is nearer than ARM."""
        import drjit as dr
        import mitsuba as mi

        level = direction(np.linspace(-180, 180, 180, endpoint=False), np.zeros(180)).T.astype(np.float32)
        near = mi.Ray3f(mi.Ray3f(mi.Point3f(0, EYE, 0), mi.Vector3f(*level)), dr.auto.ad.Float(ARM))
        return float(np.mean(np.array(self.scene.ray_test(near)))) < CROWDED

    def sees_the_sun(self) -> bool:
        """Whether the sun can be seen from EYE."""
        return self.sunlit(np.array([[0.0, EYE, 0.0]])) == 1.0

    def sunlit(self, points: Floats) -> float:
        """Share of points (N, 3) that the sun reaches."""
        import mitsuba as mi

        origin = mi.Point3f(*np.asarray(points.T, dtype=np.float32))
        hidden = self.scene.ray_test(
            mi.Ray3f(origin, mi.Vector3f(*(float(v) for v in self.sky.lighting.sun_direction)))
        )
        return 1.0 - float(np.mean(np.array(hidden)))


def _all_around(x: Any, y: Any, height: int) -> Any:
    """Directions of continuous pixels of a panorama with `height` rows."""
    import drjit as dr
    import mitsuba as mi

    azimuth, elevation = (x / height - 1) * dr.pi, (0.5 - y / height) * dr.pi
    flat = dr.cos(elevation)
    return mi.Vector3f(dr.sin(azimuth) * flat, dr.sin(elevation), -dr.cos(azimuth) * flat)


def _through(camera: Pinhole) -> Towards:
    """Directions of a camera's continuous pixels."""

    def towards(x: Any, y: Any, _: int) -> Any:
        import drjit as dr
        import mitsuba as mi

        right, up, forward = (mi.Vector3f(*(float(v) for v in axis)) for axis in camera.axes)
        aside, above = x - camera.width / 2, camera.height / 2 - y
        return dr.normalize(right * aside + up * above + forward * camera.focal_length)

    return towards


def despeckle(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Values (H, W, C) clamped between the third lowest and the third highest of their 3 x 3 neighbourhoods."""
    padded = np.pad(image, ((1, 1), (1, 1), (0, 0)), mode="edge")
    height, width = image.shape[:2]
    around = np.stack([padded[y : y + height, x : x + width] for y in range(3) for x in range(3)])
    around.partition((2, 6), axis=0)
    return np.clip(image, around[2], around[6])


def _mesh(mi: Any, mesh: Mesh, bsdf: dict[str, Any]) -> Any:
    """Quads as a Mitsuba mesh whose vertices carry the albedo."""
    count = len(mesh.corners)
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict({"type": "twosided", "bsdf": bsdf})
    made = mi.Mesh("quads", 4 * count, 2 * count, props=properties)
    made.add_attribute("vertex_color", 3, np.repeat(mesh.albedo, 4, axis=0).ravel().astype(np.float32))
    first = 4 * np.arange(count)[:, None]
    values = mi.traverse(made)
    values["vertex_positions"] = mesh.corners.ravel().astype(np.float32)
    values["faces"] = (
        np.concatenate([first + np.array(half) for half in ((0, 1, 2), (0, 2, 3))]).ravel().astype(np.uint32)
    )
    values.update()
    return made

"""HDR panoramas of coloured quads under a sky, path traced by Mitsuba 3."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from export.towns.llvm import find_llvm
from export.towns.mesh import Mesh
from export.towns.place import EYE
from export.towns.sky import Sky
from lighting.geometry import Floats, direction

SKY_SAMPLES, SUN_SAMPLES = 12, 4  # paths per pixel
BOUNCES = 2
ARM, CROWDED = 1.2, 0.1  # m, and the share of the horizon that may be nearer than that

_PAINTED = {"type": "mesh_attribute", "name": "vertex_color"}
_MATTE = {"type": "diffuse", "reflectance": _PAINTED}
_LACQUER = {
    "type": "blendbsdf",
    "weight": 0.12,
    "paint": _MATTE,
    "shine": {"type": "roughconductor", "material": "none", "alpha": 0.08},
}


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
        image = self._trace(self.scene, SKY_SAMPLES, height, seed)
        if self.sky.is_overcast:
            return image
        image += self._trace(self.sunny, SUN_SAMPLES, height, seed + 1)
        return image + self.sky.disc(height) if self.sees_the_sun() else image

    def _trace(self, scene: Any, samples: int, height: int, seed: int) -> NDArray[np.float32]:
        import drjit as dr
        import mitsuba as mi

        sampler = mi.load_dict({"type": "multijitter", "sample_count": samples})
        sampler.set_samples_per_wavefront(samples)
        count = 2 * height * height * samples
        sampler.seed(seed, count)
        pixel = dr.arange(mi.UInt32, count) // samples
        jitter = sampler.next_2d()
        azimuth = ((pixel % (2 * height) + jitter.x) / height - 1) * dr.pi
        elevation = (0.5 - (pixel // (2 * height) + jitter.y) / height) * dr.pi
        flat = dr.cos(elevation)
        towards = mi.Vector3f(dr.sin(azimuth) * flat, dr.sin(elevation), -dr.cos(azimuth) * flat)
        ray = mi.RayDifferential3f(mi.Ray3f(mi.Point3f(0, EYE, 0), towards))
        integrator = mi.load_dict({"type": "path", "max_depth": BOUNCES + 1})
        radiance, _, _ = integrator.sample(scene, sampler, ray)
        mean = [np.array(dr.block_sum(c, samples)) / samples for c in (radiance.x, radiance.y, radiance.z)]
        return despeckle(np.stack(mean, -1).reshape(height, 2 * height, 3).astype(np.float32))

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

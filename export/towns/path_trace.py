"""HDR panoramas of coloured quads under a sky, path traced by Mitsuba 3 (LLVM; set DRJIT_LIBLLVM_PATH if it asks)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from export.towns.mesh import Floats, Mesh
from export.towns.place import EYE
from lighting.geometry import direction

SAMPLES = 12  # paths per pixel
BOUNCES = 2
ARM, CROWDED = 1.2, 0.1  # m, and the share of the horizon that may be so near
BAND = 24  # rows traced at once: bounds the memory

_PAINTED = {"type": "mesh_attribute", "name": "vertex_color"}
_MATTE = {"type": "diffuse", "reflectance": _PAINTED}
_LACQUER = {
    "type": "blendbsdf",
    "weight": 0.12,
    "paint": _MATTE,
    "shine": {"type": "roughconductor", "material": "none", "alpha": 0.08},
}


class Place:
    """A place under a sky, ready to be looked at."""

    def __init__(self, matte: Mesh, glossy: Mesh, sky: NDArray[np.float32]) -> None:
        import mitsuba as mi

        mi.set_variant("llvm_ad_rgb")
        turn = mi.ScalarTransform4f().rotate([0, 1, 0], 180)
        self.scene = mi.load_dict(
            {
                "type": "scene",
                "sky": {"type": "envmap", "bitmap": mi.Bitmap(sky), "to_world": turn},
                "matte": _mesh(mi, matte, _MATTE),
                "glossy": _mesh(mi, glossy, _LACQUER),
            }
        )

    def panorama(self, height: int, seed: int) -> NDArray[np.float32]:
        """What is seen from EYE: (height, 2 height, 3) linear, in the sky's unit."""
        return np.concatenate(
            [self._band(top, min(BAND, height - top), height, seed + top) for top in range(0, height, BAND)]
        )

    def _band(self, top: int, rows: int, height: int, seed: int) -> NDArray[np.float32]:
        import drjit as dr
        import mitsuba as mi

        sampler = mi.load_dict({"type": "independent"})
        count = 2 * height * rows * SAMPLES
        sampler.seed(seed, count)
        pixel = dr.arange(mi.UInt32, count) // SAMPLES
        jitter = sampler.next_2d()
        azimuth = ((pixel % (2 * height) + jitter.x) / height - 1) * dr.pi
        elevation = (0.5 - (dr.opaque(mi.UInt32, top) + pixel // (2 * height) + jitter.y) / height) * dr.pi
        flat = dr.cos(elevation)
        towards = mi.Vector3f(dr.sin(azimuth) * flat, dr.sin(elevation), -dr.cos(azimuth) * flat)
        ray = mi.RayDifferential3f(mi.Ray3f(mi.Point3f(0, EYE, 0), towards))
        integrator = mi.load_dict({"type": "path", "max_depth": BOUNCES + 1})
        radiance, _, _ = integrator.sample(self.scene, sampler, ray)
        mean = [np.array(dr.block_sum(c, SAMPLES)) / SAMPLES for c in (radiance.x, radiance.y, radiance.z)]
        return np.asarray(np.stack(mean, -1).reshape(rows, 2 * height, 3), dtype=np.float32)

    def is_clear(self) -> bool:
        """Whether the camera stands free: little of what is level with it is nearer than an arm."""
        import mitsuba as mi

        level = direction(np.linspace(-180, 180, 180, endpoint=False), np.zeros(180)).T.astype(np.float32)
        near = mi.Ray3f(mi.Point3f(0, EYE, 0), mi.Vector3f(*level), ARM, 0.0, [])
        return float(np.mean(np.array(self.scene.ray_test(near)))) < CROWDED

    def sunlit(self, sun: Floats, points: Floats) -> float:
        """Share of points (N, 3) from which nothing hides the sun."""
        import mitsuba as mi

        origin = mi.Point3f(*np.asarray(points.T, dtype=np.float32))
        hidden = self.scene.ray_test(mi.Ray3f(origin, mi.Vector3f(*(float(v) for v in sun))))
        return 1.0 - float(np.mean(np.array(hidden)))


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

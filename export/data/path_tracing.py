"""Mitsuba scenes, random skies."""

import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from export.data.panoramas import DataError
from export.data.procedural_towns import EYE, Mesh
from lighting.color import luminance
from lighting.envmap.render import render
from lighting.geometry import Floats, Pinhole, camera_directions, direction, latlong_directions
from lighting.records import Lighting
from lighting.sky.hosek_wilkie import SUN_SOLID_ANGLE, sun_radiance

# Skies over rendered places: clear, cloudy or overcast; the clear part and the sun are Hosek-Wilkie's.

HEIGHT = 256  # rows of the map that lights a place
EXPOSURE = 0.02  # of sky radiance; crops are exposed anew
OVERCAST, CLOUDY = 0.2, 0.4  # shares of the skies
OPACITY = 4.0  # a cloud hides the sun more than it hides the sky


@dataclass(frozen=True)
class Sky:
    """The light over a place, with the truth about it."""

    radiance: NDArray[np.float32]  # (HEIGHT, 2 HEIGHT, 3) without the sun, black below the horizon
    lighting: Lighting
    sunlight: float  # share of the sun's light that the clouds let through, 0 to 1

    @property
    def is_overcast(self) -> bool:
        """Whether the sky hides where the sun is."""
        return self.sunlight < 0.03

    @property
    def sun_irradiance(self) -> Floats:
        """Irradiance (3,) of the sunlight below the clouds, on a plane that faces the sun."""
        lighting = self.lighting
        radiance = sun_radiance(lighting.sun_direction, lighting.turbidity)
        return np.asarray(radiance * (SUN_SOLID_ANGLE * lighting.exposure * self.sunlight))

    def disc(self, height: int) -> NDArray[np.float32]:
        """The sun's disc alone, dimmed by the clouds: (height, 2 height, 3)."""
        sun = render(self.lighting, height, sun=True) - render(self.lighting, height, sun=False)
        sun[height // 2 :] = 0.0
        return np.asarray(sun * self.sunlight, dtype=np.float32)


def random_sky(rng: np.random.Generator) -> Sky:
    """A sky with any sun from 2 to 80 deg above the horizon and any turbidity from 1.8 to 9."""
    lighting = Lighting(
        sun_azimuth=rng.uniform(-180, 180),
        sun_elevation=float(rng.triangular(2, 20, 80)),
        turbidity=float(np.exp(rng.uniform(np.log(1.8), np.log(9)))),
        exposure=EXPOSURE,
    )
    draw = rng.random()
    if draw < OVERCAST:
        return Sky(_overcast(lighting, rng), lighting, 0.0)
    clear = render(lighting, HEIGHT, sun=False)
    clear[HEIGHT // 2 :] = 0.0
    return _cloudy(clear, lighting, rng) if draw < OVERCAST + CLOUDY else Sky(clear, lighting, 1.0)


def _overcast(lighting: Lighting, rng: np.random.Generator) -> NDArray[np.float32]:
    """The CIE overcast sky, at random brighter towards the hidden sun."""
    towards = latlong_directions(HEIGHT)
    up = towards[..., 1:2]
    glow = rng.uniform(0, 0.4) * np.exp(4 * (towards @ lighting.sun_direction - 1))[..., None]
    waves = 1 + rng.uniform(0, 0.25) * (_noise(rng, up) - 0.5)
    dome = np.where(up > 0, ((1 + 2 * up) / 3 + glow) * waves, 0.0) * np.exp(rng.normal(0, (0.05, 0.02, 0.06)))
    return dome.astype(np.float32)


def _cloudy(clear: NDArray[np.float32], lighting: Lighting, rng: np.random.Generator) -> Sky:
    """White clouds before a clear sky, brighter towards the sun, grey where they are thick."""
    towards = latlong_directions(HEIGHT)
    up, cosine = towards[..., 1:2], (towards @ lighting.sun_direction)[..., None]
    shape = _noise(rng, up)
    threshold = np.quantile(shape[: HEIGHT // 2], 1 - rng.uniform(0.1, 0.7))
    alpha = np.clip((shape - threshold) / rng.uniform(0.04, 0.3), 0, 1) * (up > 0) * np.clip(up / 0.06, 0, 1)
    white = float(np.median(luminance(clear[: HEIGHT // 2]))) * rng.uniform(1.2, 2.5)
    cloud = white * (1 + 2.5 * np.exp(6 * (cosine - 1))) * (1 - rng.uniform(0, 0.5) * alpha**2)
    row, column = np.unravel_index(int(np.argmax(cosine)), cosine.shape[:2])
    sunlight = float((1 - alpha[row, column, 0]) ** OPACITY)
    return Sky((clear * (1 - alpha) + cloud * alpha).astype(np.float32), lighting, sunlight)


def _noise(rng: np.random.Generator, up: Floats) -> Floats:
    """Fractal noise (H, 2H, 1), about 0 to 1, as on a plane above; `up` is the height of each direction."""
    towards = latlong_directions(HEIGHT)
    plane = towards[..., [0, 2]] / (np.maximum(up, 0.0) + rng.uniform(0.1, 0.4))
    total, weight = np.zeros(towards.shape[:2]), 0.0
    for octave in range(5):
        share = 0.55**octave
        total += share * _lattice(rng, plane * 2**octave)
        weight += share
    return np.asarray((total / weight)[..., None])


def _lattice(rng: np.random.Generator, plane: Floats) -> Floats:
    """Random values at whole coordinates, smoothly between them; repeats after 64."""
    values, start = rng.random((64, 64)), rng.uniform(0, 64, 2)
    cell = np.floor(plane + start).astype(int)
    part = plane + start - cell
    part = part * part * (3 - 2 * part)
    x, z = cell[..., 0] % 64, cell[..., 1] % 64
    x1, z1 = (x + 1) % 64, (z + 1) % 64
    near = values[x, z] * (1 - part[..., 0]) + values[x1, z] * part[..., 0]
    far = values[x, z1] * (1 - part[..., 0]) + values[x1, z1] * part[..., 0]
    return np.asarray(near * (1 - part[..., 1]) + far * part[..., 1])


# Which LLVM Mitsuba's `llvm` variants compile their kernels with; towns, tests and benchmarks all ask here.

OLDEST = 16  # LLVM 15 ends the process on AVX-512 processors: "LLVM ERROR: Cannot select ... fminimum"
VARIABLE = "DRJIT_LIBLLVM_PATH"  # read by Dr.Jit, which Mitsuba is built on

_VERSION = re.compile(r"LLVM(?:-|\.so\.)(\d+)")


def find_llvm(root: Path = Path("/usr/lib")) -> str:
    """The library that DRJIT_LIBLLVM_PATH names, or else the newest under `root`, which the variable then names.

    Raises DataError if Mitsuba is not installed, if there is no LLVM, or if its file name says that it is too old.
    """
    try:
        import mitsuba  # noqa: F401
    except ImportError as error:
        raise DataError("Places are rendered by Mitsuba 3: pip install mitsuba.") from error
    named = os.environ.get(VARIABLE)
    newest = Path(named) if named else max(root.glob("*/libLLVM*.so*"), key=_version, default=Path())
    if _version(newest) < OLDEST and not (named and not _version(newest)):
        raise DataError(f"Mitsuba needs LLVM {OLDEST} or newer: install libllvm19, or let {VARIABLE} name one.")
    os.environ[VARIABLE] = str(newest)
    return str(newest)


def _version(library: Path) -> int:
    """The major version in a library's file name; 0 if there is none."""
    found = _VERSION.search(library.name)
    return int(found[1]) if found else 0


# HDR panoramas of coloured quads under a sky, path traced by Mitsuba 3.

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
class _Photographed:
    """A photo of a rendered place, in its parts."""

    sky: NDArray[np.float32]  # (h, w, 3) linear, lit by the sky alone
    sun: NDArray[np.float32]  # (h, w, 3) what the sun adds, without its disc
    ground: NDArray[np.bool_]  # (h, w) where level ground is seen
    lit: NDArray[np.bool_]  # (h, w) where the sun reaches it


class RenderedTown:
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

    def photo(self, camera: Pinhole, seed: int) -> _Photographed:
        """What a camera at EYE sees, in its parts."""
        size, towards = (camera.height, camera.width), _through(camera)
        sky = self._trace(self.scene, SKY_SAMPLES, size, towards, seed)
        sun = np.zeros_like(sky)
        if not self.sky.is_overcast:
            sun = self._trace(self.sunny, SUN_SAMPLES, size, towards, seed + 1)
        return _Photographed(sky, sun, *self._ground(camera))

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
        return _despeckle(np.stack(mean, -1).reshape(height, width, 3).astype(np.float32))

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


def _despeckle(image: NDArray[np.float32]) -> NDArray[np.float32]:
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

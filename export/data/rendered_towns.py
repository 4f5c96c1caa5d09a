"""Rendered towns: random skies, Mitsuba 3 scenes of colored quads under them, and a folder of such panoramas.

The folder has the format of any other folder of panoramas, with exact labels.

Skies are clear, cloudy or overcast; the clear part and the sun are Hosek-Wilkie's. Sunlight and skylight are traced
separately: if sampled together, the sun would take most paths and the shade would be noisy.
"""

import os
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from export.data.labels import Label, read_labels, write_labels
from export.data.panoramas import RENDERED, DataError, Panorama, read_index, write_index
from export.data.procedural_towns import EYE, Mesh, random_town
from lighting.color import luminance
from lighting.envmap.render import render
from lighting.files.exr import write_exr
from lighting.geometry import Floats, Pinhole, camera_directions, direction, latlong_directions
from lighting.records import Lighting
from lighting.sky.clear_sky import SUN_SOLID_ANGLE, sun_radiance

TOWN_HEIGHT = 256  # rows of the map that lights a place
_EXPOSURE = 0.02  # of sky radiance; crops are exposed anew
_OVERCAST, _CLOUDY = 0.2, 0.4  # shares of the skies
_OPACITY = 4.0  # a cloud hides the sun more than it hides the sky


@dataclass(frozen=True)
class _Sky:
    """The light over a place, with the truth about it."""

    radiance: NDArray[np.float32]  # (TOWN_HEIGHT, 2 TOWN_HEIGHT, 3) without the sun, black below the horizon
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
        """The sun's disc alone, dimmed by the clouds: (height, 2 height, 3).

        Args:
            height: rows.
        """
        sun = render(self.lighting, height, sun=True) - render(self.lighting, height, sun=False)
        sun[height // 2 :] = 0.0
        return np.asarray(sun * self.sunlight, dtype=np.float32)


def random_sky(rng: np.random.Generator) -> _Sky:
    """A sky with any sun from 2 to 80 deg above the horizon and any turbidity from 1.8 to 9.

    Args:
        rng: draws the sun, the turbidity and the clouds.
    """
    lighting = Lighting(
        sun_azimuth=rng.uniform(-180, 180),
        sun_elevation=float(rng.triangular(2, 20, 80)),
        turbidity=float(np.exp(rng.uniform(np.log(1.8), np.log(9)))),
        exposure=_EXPOSURE,
    )
    draw = rng.random()
    if draw < _OVERCAST:
        return _Sky(_overcast_dome(lighting, rng), lighting, 0.0)
    clear = render(lighting, TOWN_HEIGHT, sun=False)
    clear[TOWN_HEIGHT // 2 :] = 0.0
    return _add_clouds(clear, lighting, rng) if draw < _OVERCAST + _CLOUDY else _Sky(clear, lighting, 1.0)


def _overcast_dome(lighting: Lighting, rng: np.random.Generator) -> NDArray[np.float32]:
    """The CIE overcast sky, at random brighter towards the hidden sun."""
    rays = latlong_directions(TOWN_HEIGHT)
    up = rays[..., 1:2]
    glow = rng.uniform(0, 0.4) * np.exp(4 * (rays @ lighting.sun_direction - 1))[..., None]
    waves = 1 + rng.uniform(0, 0.25) * (_noise(rng, up) - 0.5)
    dome = np.where(up > 0, ((1 + 2 * up) / 3 + glow) * waves, 0.0) * np.exp(rng.normal(0, (0.05, 0.02, 0.06)))
    return dome.astype(np.float32)


def _add_clouds(clear: NDArray[np.float32], lighting: Lighting, rng: np.random.Generator) -> _Sky:
    """White clouds before a clear sky, brighter towards the sun, gray where they are thick."""
    rays = latlong_directions(TOWN_HEIGHT)
    up, cosine = rays[..., 1:2], (rays @ lighting.sun_direction)[..., None]
    shape = _noise(rng, up)
    threshold = np.quantile(shape[: TOWN_HEIGHT // 2], 1 - rng.uniform(0.1, 0.7))
    alpha = np.clip((shape - threshold) / rng.uniform(0.04, 0.3), 0, 1) * (up > 0) * np.clip(up / 0.06, 0, 1)
    white = float(np.median(luminance(clear[: TOWN_HEIGHT // 2]))) * rng.uniform(1.2, 2.5)
    cloud = white * (1 + 2.5 * np.exp(6 * (cosine - 1))) * (1 - rng.uniform(0, 0.5) * alpha**2)
    row, column = np.unravel_index(int(np.argmax(cosine)), cosine.shape[:2])
    sunlight = float((1 - alpha[row, column, 0]) ** _OPACITY)
    return _Sky((clear * (1 - alpha) + cloud * alpha).astype(np.float32), lighting, sunlight)


def _noise(rng: np.random.Generator, up: Floats) -> Floats:
    """Fractal noise (H, 2H, 1), about 0 to 1, as on a plane above; `up` is the height of each direction."""
    rays = latlong_directions(TOWN_HEIGHT)
    plane = rays[..., [0, 2]] / (np.maximum(up, 0.0) + rng.uniform(0.1, 0.4))
    total, weight = np.zeros(rays.shape[:2]), 0.0
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

MIN_LLVM = 16  # LLVM 15 ends the process on AVX-512 processors: "LLVM ERROR: Cannot select ... fminimum"
VARIABLE = "DRJIT_LIBLLVM_PATH"  # read by Dr.Jit, which Mitsuba is built on

_VERSION = re.compile(r"LLVM(?:-|\.so\.)(\d+)")


def find_llvm(root: Path = Path("/usr/lib")) -> str:
    """The library that DRJIT_LIBLLVM_PATH names, or else the newest under `root`, which the variable then names.

    Args:
        root: folder of the system's libraries.

    Raises:
        DataError: if there is no LLVM, or if its file name says that it is too old.
    """
    named = os.environ.get(VARIABLE)
    newest = Path(named) if named else max(root.glob("*/libLLVM*.so*"), key=_version, default=Path())
    if _version(newest) < MIN_LLVM and not (named and not _version(newest)):
        raise DataError(f"Mitsuba needs LLVM {MIN_LLVM} or newer: install libllvm19, or let {VARIABLE} name one.")
    os.environ[VARIABLE] = str(newest)
    return str(newest)


def _version(library: Path) -> int:
    """The major version in a library's file name; 0 if there is none."""
    match = _VERSION.search(library.name)
    return int(match[1]) if match else 0


# Towns in Mitsuba.

_SKY_SAMPLES, _SUN_SAMPLES = 12, 4  # paths per pixel
_BOUNCES = 2
_MIN_LEVEL, _MAX_HEIGHT = 0.9, 0.5  # slope of a normal and height [m] of level ground
_ARM, _MAX_CROWDED = 1.2, 0.1  # m, and the share of the horizon that may be nearer than that

_PAINTED = {"type": "mesh_attribute", "name": "vertex_color"}
_MATTE = {"type": "diffuse", "reflectance": _PAINTED}
_SHINE = {"type": "roughconductor", "material": "none", "alpha": 0.08}
_LACQUER = {"type": "blendbsdf", "weight": 0.12, "paint": _MATTE, "shine": _SHINE}


Linear = NDArray[np.float32]  # (h, w, 3)
PixelRays = Callable[[Any, Any, int], Any]  # of pixels' x and y, and the picture's rows, to directions


@dataclass(frozen=True, eq=False)
class _TracedPhoto:
    """A photo of a rendered place, in its parts."""

    sky: NDArray[np.float32]  # (h, w, 3) linear, lit by the sky alone
    sun: NDArray[np.float32]  # (h, w, 3) what the sun adds, without its disc
    ground: NDArray[np.bool_]  # (h, w) where level ground is visible
    lit: NDArray[np.bool_]  # (h, w) where the sun reaches it


class RenderedTown:
    """A town under a sky, loaded into Mitsuba."""

    def __init__(self, matte: Mesh, glossy: Mesh, sky: _Sky) -> None:
        find_llvm()
        try:
            import mitsuba as mi
        except (ImportError, NameError) as error:  # the second is Dr.Jit's, where the system lacks a library
            raise DataError("Places need Mitsuba 3: pip install mitsuba; on Debian, apt install libatomic1.") from error

        mi.set_variant("llvm_ad_rgb")
        meshes = {"matte": _mesh(mi, matte, _MATTE), "glossy": _mesh(mi, glossy, _LACQUER)}
        rotation = mi.ScalarTransform4f().rotate([0, 1, 0], 180)
        light = {"type": "envmap", "bitmap": mi.Bitmap(sky.radiance), "to_world": rotation}
        beam = {
            "type": "directional",
            "direction": [float(-v) for v in sky.lighting.sun_direction],
            "irradiance": {"type": "rgb", "value": [float(v) for v in sky.sun_irradiance]},
        }
        self.sky = sky
        self.scene = mi.load_dict({"type": "scene", "light": light, **meshes})
        self.sun_scene = mi.load_dict({"type": "scene", "light": beam, **meshes})

    def panorama(self, height: int, seed: int) -> NDArray[np.float32]:
        """The panorama (height, 2 height, 3) from EYE, linear, in the sky's unit.

        Args:
            height: rows.
            seed: of the paths.
        """
        sky, sun = self._trace_lights((height, 2 * height), _panorama_rays, seed)
        has_disc = not self.sky.is_overcast and self.is_sun_visible()
        return sky + sun + self.sky.disc(height) if has_disc else sky + sun

    def photo(self, camera: Pinhole, seed: int) -> _TracedPhoto:
        """What a camera at EYE records, in its parts.

        Args:
            camera: its size and angles.
            seed: of the paths.
        """
        sky, sun = self._trace_lights((camera.height, camera.width), _camera_rays(camera), seed)
        return _TracedPhoto(sky, sun, *self._ground(camera))

    def _trace_lights(self, size: tuple[int, int], pixel_rays: PixelRays, seed: int) -> tuple[Linear, Linear]:
        """What the sky and what the sun adds to a picture (h, w, 3) of `size`, without the sun's disc."""
        sky = self._trace(self.scene, _SKY_SAMPLES, size, pixel_rays, seed)
        if self.sky.is_overcast:
            return sky, np.zeros_like(sky)
        return sky, self._trace(self.sun_scene, _SUN_SAMPLES, size, pixel_rays, seed + 1)

    def _ground(self, camera: Pinhole) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which pixels (h, w) of a camera show level ground, and which of these the sun reaches."""
        import mitsuba as mi

        rays = camera_directions(camera).reshape(-1, 3).T.astype(np.float32)
        hit = self.scene.ray_intersect(mi.Ray3f(mi.Point3f(0, EYE, 0), mi.Vector3f(*rays)))
        up = np.abs(np.array(hit.n.y)) > _MIN_LEVEL
        level = np.array(hit.is_valid()) & up & (np.array(hit.p.y) < _MAX_HEIGHT)
        sun = mi.Vector3f(*(float(v) for v in self.sky.lighting.sun_direction))
        hidden = np.array(self.scene.ray_test(mi.Ray3f(hit.p + mi.Vector3f(0, 1e-3, 0), sun)))
        shape = (camera.height, camera.width)
        return level.reshape(shape), (level & ~hidden).reshape(shape)

    def _trace(self, scene: Any, samples: int, size: tuple[int, int], pixel_rays: PixelRays, seed: int) -> Linear:
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
        rays = pixel_rays(pixel % width + jitter.x, pixel // width + jitter.y, height)
        ray = mi.RayDifferential3f(mi.Ray3f(mi.Point3f(0, EYE, 0), rays))
        integrator = mi.load_dict({"type": "path", "max_depth": _BOUNCES + 1})
        radiance, _, _ = integrator.sample(scene, sampler, ray)
        mean = [np.array(dr.block_sum(c, samples)) / samples for c in (radiance.x, radiance.y, radiance.z)]
        return _despeckle(np.stack(mean, -1).reshape(height, width, 3).astype(np.float32))

    def is_clear(self) -> bool:
        """Whether the camera stands free: under _MAX_CROWDED of its horizon is nearer than _ARM."""
        import drjit as dr
        import mitsuba as mi

        level = direction(np.linspace(-180, 180, 180, endpoint=False), np.zeros(180)).T.astype(np.float32)
        near = mi.Ray3f(mi.Ray3f(mi.Point3f(0, EYE, 0), mi.Vector3f(*level)), dr.auto.ad.Float(_ARM))
        return float(np.mean(np.array(self.scene.ray_test(near)))) < _MAX_CROWDED

    def is_sun_visible(self) -> bool:
        """Whether nothing stands between EYE and the sun."""
        return self.sunlit_share(np.array([[0.0, EYE, 0.0]])) == 1.0

    def sunlit_share(self, points: Floats) -> float:
        """Share of points that the sun reaches, 0 to 1.

        Args:
            points: (N, 3) m, the ground at y = 0.
        """
        import mitsuba as mi

        origin = mi.Point3f(*np.asarray(points.T, dtype=np.float32))
        sun = mi.Vector3f(*(float(v) for v in self.sky.lighting.sun_direction))
        hidden = self.scene.ray_test(mi.Ray3f(origin, sun))
        return 1.0 - float(np.mean(np.array(hidden)))


def _panorama_rays(x: Any, y: Any, height: int) -> Any:
    """Directions of continuous pixels of a panorama with `height` rows."""
    import drjit as dr
    import mitsuba as mi

    azimuth, elevation = (x / height - 1) * dr.pi, (0.5 - y / height) * dr.pi
    flat = dr.cos(elevation)
    return mi.Vector3f(dr.sin(azimuth) * flat, dr.sin(elevation), -dr.cos(azimuth) * flat)


def _camera_rays(camera: Pinhole) -> PixelRays:
    """Directions of a camera's continuous pixels."""

    def pixel_rays(x: Any, y: Any, _: int) -> Any:
        import drjit as dr
        import mitsuba as mi

        right, up, forward = (mi.Vector3f(*(float(v) for v in axis)) for axis in camera.axes)
        lateral, vertical = x - camera.width / 2, camera.height / 2 - y
        return dr.normalize(right * lateral + up * vertical + forward * camera.focal_length)

    return pixel_rays


def _despeckle(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Values (H, W, C) clamped between the third lowest and the third highest of their 3 x 3 neighbourhoods."""
    padded = np.pad(image, ((1, 1), (1, 1), (0, 0)), mode="edge")
    height, width = image.shape[:2]
    neighbors = np.stack([padded[y : y + height, x : x + width] for y in range(3) for x in range(3)])
    neighbors.partition((2, 6), axis=0)
    return np.clip(image, neighbors[2], neighbors[6])


def _mesh(mi: Any, mesh: Mesh, bsdf: dict[str, Any]) -> Any:
    """Quads as a Mitsuba mesh whose vertices carry the albedo."""
    count = len(mesh.corners)
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict({"type": "twosided", "bsdf": bsdf})
    quads = mi.Mesh("quads", 4 * count, 2 * count, props=properties)
    quads.add_attribute("vertex_color", 3, np.repeat(mesh.albedo, 4, axis=0).ravel().astype(np.float32))
    first = 4 * np.arange(count)[:, None]
    values = mi.traverse(quads)
    values["vertex_positions"] = mesh.corners.ravel().astype(np.float32)
    triangles = np.concatenate([first + np.array(half) for half in ((0, 1, 2), (0, 2, 3))])
    values["faces"] = triangles.ravel().astype(np.uint32)
    values.update()
    return quads


LABELS = "labels.csv"
_SAVE_EVERY = 20  # places
_ROUNDING = 1e-9  # so that five times 0.2 is one
_GROUND_RADIUS = 12.0  # m around the camera, where sunlight on the ground counts
_GROUND_POINTS = 400
_MIN_DIRECT, _MIN_PARTLY = 0.25, 0.03  # shares of the sunlight for direct light to be "yes" and "partly"
_MIN_SUNLIGHT = 0.5  # share of the sunlight for turbidity and exposure to be visible in the sky


@dataclass(frozen=True)
class _TownPanorama:
    """A panorama of a rendered place with the truth about it."""

    name: str
    radiance: Floats  # (H, 2H, 3) linear
    label: Label
    sun_visible: bool


def _render_town(number: int, height: int) -> _TownPanorama:
    """Town `number`; the same number gives the same town in every run."""
    rng = np.random.default_rng([8, number])
    sky = random_sky(rng)
    scene = RenderedTown(*random_town(rng), sky)
    while not scene.is_clear():
        scene = RenderedTown(*random_town(rng), sky)
    ground = rng.uniform(-1, 1, (_GROUND_POINTS, 3)) * [_GROUND_RADIUS, 0, _GROUND_RADIUS] + [0, 0.3, 0]
    lit = scene.sunlit_share(ground) * sky.sunlight
    visible = scene.is_sun_visible() and sky.sunlight > _MIN_SUNLIGHT
    name = f"town_{number:05d}"
    return _TownPanorama(name, scene.panorama(height, 2 * number), _make_label(name, sky, lit), visible)


def _make_label(name: str, sky: _Sky, lit: float) -> Label:
    label = Label(name, direct="yes" if lit > _MIN_DIRECT else "partly" if lit > _MIN_PARTLY else "no")
    light = sky.lighting
    if not sky.is_overcast:
        label = replace(label, sun_azimuth=light.sun_azimuth, sun_elevation=light.sun_elevation)
        label = replace(label, sun_uncertainty=1.0, sun_source="given")
    if sky.sunlight <= _MIN_SUNLIGHT:
        return label
    return replace(label, turbidity=light.turbidity, exposure=light.exposure, fit_residual=0.0, fit_ok=True)


def render_towns(folder: Path, count: int, height: int, val: float = 0.0) -> None:
    """Render towns until the folder holds `count`; continues where an earlier call stopped.

    Args:
        folder: to fill.
        count: towns in all.
        height: rows of each panorama.
        val: share of the towns that are of the split `val`, 0 to 1, evenly over their numbers.
    """
    root = folder.resolve()
    (root / "panoramas").mkdir(parents=True, exist_ok=True)
    labels = read_labels(root / LABELS) if (root / LABELS).exists() else []
    panoramas = read_index(root)[: len(labels)] if labels else []  # the index is written first: it may hold more
    for number in tqdm(range(len(labels), count), initial=len(labels), total=count, unit="place"):
        rendered = _render_town(number, height)
        panoramas.append(_index_row(rendered, root, _split_of(number, val)))
        labels.append(rendered.label)
        write_exr(panoramas[-1].path, rendered.radiance)
        if number + 1 == count or (number + 1) % _SAVE_EVERY == 0:
            write_index(panoramas, root)
            write_labels(labels, root / LABELS)


def _split_of(number: int, val: float) -> str:
    """The split of town `number`, the same however many towns there will be."""
    return "val" if int((number + 1) * val + _ROUNDING) > int(number * val + _ROUNDING) else "train"


def _index_row(rendered: _TownPanorama, root: Path, split: str) -> Panorama:
    label = rendered.label
    has_sun = label.sun_source != "none"
    path = root / "panoramas" / f"{rendered.name}.exr"
    sun = "none" if not has_sun else "visible" if rendered.sun_visible else "inferred"
    azimuth, elevation, std = (label.sun_azimuth, label.sun_elevation, 1.0) if has_sun else (None, None, None)
    name, more = rendered.name, (label.direct, *RENDERED)
    return Panorama(name, path, "hdr", name, split, sun, azimuth, elevation, std, *more)

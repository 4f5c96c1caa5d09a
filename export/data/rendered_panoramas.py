"""Small panoramas rendered in numpy: a Hosek-Wilkie or an overcast sky over lit ground, boxes and balls.

Their truth is exact: they check the labels, and they test training without a single photo.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from export.data.panoramas import COLUMNS_OF_INDEX, INDEX, write_table
from lighting.color import luminance, tone_map
from lighting.files import atomic_write
from lighting.geometry import (
    Floats,
    angle_between,
    angles,
    direction,
    latlong_directions,
    latlong_solid_angle,
    ray_sphere,
)
from lighting.records import GROUND_ALBEDO
from lighting.sky.clear_sky import SUN_SOLID_ANGLE, sky_radiance, sun_radiance

_MIN_DISTANCE = 1e-3  # m, that counts as a hit
_CAMERA_HEIGHT = 1.7  # m above the ground, the plane y = 0
_EYE = np.array([0.0, _CAMERA_HEIGHT, 0.0])
_GLARE = ((0.6, 0.97), (2.5, 0.03))  # the lens blurs the sun: width [deg] and share of its light
_HAZE = 120.0  # m at which half of a thing's color is the horizon's


# Boxes and balls: what takes points and rays (N, 3) to distances (N,) and normals (N, 3), and the albedo (3,).
_Things = list[tuple[Callable[[Floats, Floats], tuple[Floats, Floats]], Floats]]


def _scatter_things(rng: np.random.Generator, count: int) -> _Things:
    """`count` random things around the origin, half of them boxes."""
    boxes, balls = count - count // 2, count // 2
    azimuth, distance = rng.uniform(-180, 180, count), rng.uniform(9, 40, count)
    foot = direction(azimuth, np.zeros(count)) * distance[:, None]
    half = rng.uniform(1.5, 5.0, (boxes, 3)) * [1, 0, 1]
    roof = rng.uniform(3, 18, (boxes, 1)) * [0, 1, 0]
    radius = rng.uniform(1, 3, balls)
    center = foot[boxes:] + radius[:, None] * [0, 1.3, 0]
    walls = rng.uniform(0.15, 0.6, (boxes, 1)) * rng.uniform(0.8, 1.2, (boxes, 3))
    leaves = rng.uniform(0.5, 1.0, (balls, 1)) * [0.08, 0.14, 0.05]
    lows, highs = foot[:boxes] - half, foot[:boxes] + half + roof
    return [
        *((partial(_hit_box, low=low, high=high), wall) for low, high, wall in zip(lows, highs, walls, strict=True)),
        *((partial(_hit_ball, center=c, radius=r), leaf) for c, r, leaf in zip(center, radius, leaves, strict=True)),
    ]


def _blocked(origin: Floats, sun: Floats, things: _Things) -> NDArray[np.bool_]:
    """Whether a thing stands between each point (N, 3) and the sun."""
    return np.isfinite(_nearest(origin, np.broadcast_to(sun, origin.shape), things)[0])


def _nearest(origin: Floats, rays: Floats, things: _Things) -> tuple[Floats, Floats, Floats]:
    """Distance (N,), inf where nothing is met, normal (N, 3) and albedo (N, 3) of the nearest thing along each ray."""
    distance, normal, albedo = np.full(len(rays), np.inf), np.zeros(rays.shape), np.zeros(rays.shape)
    for hit, color in things:
        reach, facing = hit(origin, rays)
        closer = reach < distance
        distance = np.where(closer, reach, distance)
        normal[closer], albedo[closer] = facing[closer], color
    return distance, normal, albedo


def _hit_box(origin: Floats, rays: Floats, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    safe = np.where(np.abs(rays) < 1e-9, 1e-9, rays)
    one, other = (low - origin) / safe, (high - origin) / safe
    enter, leave = np.minimum(one, other), np.maximum(one, other).min(axis=1)
    axis = enter.argmax(axis=1)
    start = enter.max(axis=1)
    normal = -np.sign(rays) * (np.arange(3) == axis[:, None])
    return np.where((start < leave) & (start > _MIN_DISTANCE), start, np.inf), normal


def _hit_ball(origin: Floats, rays: Floats, center: Floats, radius: float) -> tuple[Floats, Floats]:
    distance = ray_sphere(origin, rays, center, radius)
    hit = distance > _MIN_DISTANCE
    reach = np.where(hit & np.isfinite(distance), distance, 0.0)
    return np.where(hit, distance, np.inf), (origin - center + rays * reach[:, None]) / radius


@dataclass(frozen=True)
class RenderedPanorama:
    """A rendered panorama and the truth about it."""

    linear: NDArray[np.float32]  # (H, 2H, 3) the picture's linear values, not clipped
    sun_azimuth: float | None  # deg; None under an overcast sky
    sun_elevation: float | None  # deg
    sun_visible: bool  # nothing stands between the camera and the sun
    turbidity: float | None
    exposure: float  # picture's linear values / sky radiance

    @property
    def picture(self) -> NDArray[np.uint8]:
        """The picture an ordinary camera gives: clipped, sRGB, 8 bits."""
        return tone_map(self.linear)


@dataclass(frozen=True)
class _Light:
    sun: Floats | None  # (3,) unit vector
    beam: Floats  # (3,) irradiance of the sun on a plane that faces it
    ambient: Floats  # (3,) irradiance of the sky on the ground
    horizon: Floats  # (3,) radiance that haze fades to


def render_panorama(
    seed: int, height: int = 128, *, overcast: bool = False, things: int = 8, turbidity: float | None = None
) -> RenderedPanorama:
    """A random scene; the same seed and height give the same pixels.

    Args:
        seed: of the scene, the sun and the sky.
        height: rows.
        overcast: whether the sky hides the sun.
        things: boxes and balls on the ground, 0 or more.
        turbidity: 1 to 10; None for a random one.
    """
    rng = np.random.default_rng(seed)
    haze = float(rng.uniform(1.5, 8.0)) if turbidity is None else turbidity
    sun = None if overcast else direction(rng.uniform(-180, 180), rng.uniform(8, 70))
    pixel_rays = latlong_directions(height)
    sky = _overcast_sky(pixel_rays, rng) if sun is None else sky_radiance(pixel_rays, sun, haze, GROUND_ALBEDO)
    scene, light = _scatter_things(rng, things), _measure_light(sky, sun, haze)
    visible = sun is not None and not _blocked(_EYE[None], sun, scene)[0]
    image = sky + _glare(pixel_rays, light) if visible else sky
    image = _draw(image, pixel_rays, scene, light, rng)
    exposure = float(rng.uniform(0.08, 0.25) / np.median(luminance(sky[: height // 2])))
    azimuth, elevation = (None, None) if sun is None else (float(a) for a in angles(sun))
    linear = (image * exposure).astype(np.float32)
    return RenderedPanorama(linear, azimuth, elevation, visible, None if sun is None else haze, exposure)


def render_folder(folder: str | Path, count: int, height: int = 64, seed: int = 0) -> None:
    """Write a folder of rendered panoramas, two to a place; every fourth is overcast and every third place is `val`.

    Args:
        folder: to write; it is made.
        count: of panoramas, 1 or more.
        height: rows of each.
        seed: of the first panorama; each later one has the next.
    """
    root = Path(folder).resolve()
    (root / "panoramas").mkdir(parents=True, exist_ok=True)
    rows = []
    for number in range(count):
        rendered = render_panorama(seed + number, height, overcast=number % 4 == 3)
        name, place = f"rendered_{number:04d}", number // 2
        with atomic_write(root / "panoramas" / f"{name}.webp") as temporary:
            Image.fromarray(rendered.picture).save(temporary, lossless=True)
        sun = "none" if rendered.sun_azimuth is None else "visible" if rendered.sun_visible else "inferred"
        angles_of_sun = rendered.sun_azimuth, rendered.sun_elevation, None if sun == "none" else 1.0
        direct = {"none": "no", "visible": "yes", "inferred": "partly"}[sun]
        listed = name, f"panoramas/{name}.webp", "ldr", f"place_{place:03d}", "val" if place % 3 == 2 else "train"
        texts = ("" if angle is None else f"{angle:.3f}" for angle in angles_of_sun)
        rows.append((*listed, sun, *texts, direct, "rendered", "rendered", "CC0", "", ""))  # scene, label and licence
    write_table(root / INDEX, COLUMNS_OF_INDEX, rows)


def _measure_light(sky: Floats, sun: Floats | None, turbidity: float) -> _Light:
    height = len(sky)
    up = latlong_directions(height)[: height // 2, :, 1:2]
    weight = latlong_solid_angle(height)[: height // 2, None, None] * up
    ambient = (sky[: height // 2] * weight).sum(axis=(0, 1))
    beam = np.zeros(3) if sun is None else sun_radiance(sun, turbidity) * SUN_SOLID_ANGLE
    return _Light(sun, beam, ambient, sky[height // 2 - 1].mean(axis=0))


def _overcast_sky(pixel_rays: Floats, rng: np.random.Generator) -> Floats:
    """The CIE overcast sky, three times as bright at the zenith as at the horizon, with soft clouds."""
    up = np.maximum(pixel_rays[..., 1], 0.0)
    waves = sum(np.sin(pixel_rays @ rng.normal(0, 6, 3) + rng.uniform(0, 6)) for _ in range(6))
    gray = 0.1 * (1 + 2 * up) / 3 * (1 + 0.04 * np.asarray(waves))
    return np.asarray(np.where(pixel_rays[..., 1] > 0, gray, 0.0)[..., None] * np.array([0.97, 1.0, 1.04]))


def _glare(pixel_rays: Floats, light: _Light) -> Floats:
    """The sun as a lens sees it: its irradiance distributed over narrow Gaussians around its direction."""
    assert light.sun is not None
    angle = angle_between(pixel_rays, light.sun)
    blur = np.zeros(angle.shape)
    solid_angle = np.repeat(latlong_solid_angle(len(pixel_rays))[:, None], pixel_rays.shape[1], axis=1)
    for width, share in _GLARE:
        blob = np.exp(-0.5 * (angle / width) ** 2)
        blur += share * blob / (blob * solid_angle).sum()
    return np.asarray(blur[..., None] * light.beam)


def _draw(sky: Floats, pixel_rays: Floats, things: _Things, light: _Light, rng: np.random.Generator) -> Floats:
    """The sky with the ground and the things in front of it."""
    rays = pixel_rays.reshape(-1, 3)
    distance, normal, albedo = _nearest(np.broadcast_to(_EYE, rays.shape), rays, things)
    ground = np.where(rays[:, 1] < -1e-6, -_CAMERA_HEIGHT / np.minimum(rays[:, 1], -1e-6), np.inf)
    on_ground = ground < distance
    distance, normal = np.minimum(distance, ground), np.where(on_ground[:, None], [0.0, 1.0, 0.0], normal)
    hit = np.isfinite(distance)
    point = _EYE + rays[hit] * distance[hit, None]
    albedo = np.where(on_ground[hit, None], _ground_albedo(point, rng), albedo[hit])
    radiance = albedo / np.pi * _irradiance(point, normal[hit], things, light)
    share = (0.5 ** (distance[hit] / _HAZE))[:, None]
    image = sky.reshape(-1, 3).copy()
    image[hit] = radiance * share + light.horizon * (1 - share)
    return image.reshape(sky.shape)


def _ground_albedo(point: Floats, rng: np.random.Generator) -> Floats:
    color, scale = rng.uniform(0.15, 0.35) * rng.uniform(0.8, 1.2, 3), rng.uniform(0.5, 2.0)
    tiles = (np.floor(point[:, 0] / scale) + np.floor(point[:, 2] / scale)) % 2
    return np.asarray(color * (0.8 + 0.4 * tiles[:, None]))


def _irradiance(point: Floats, normal: Floats, things: _Things, light: _Light) -> Floats:
    ambient = light.ambient * (0.5 + 0.5 * normal[:, 1:2])
    if light.sun is None:
        return np.asarray(ambient)
    lit = np.maximum(normal @ light.sun, 0.0) * ~_blocked(point + 0.01 * normal, light.sun, things)
    return np.asarray(ambient + lit[:, None] * light.beam)

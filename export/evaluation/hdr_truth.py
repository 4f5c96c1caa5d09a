"""The light of HDR panoramas (sun, sky, ground), and a scene that shows it: a bumpy diffuse sphere on a plane.

Light is linear, so one matrix takes any map to the picture. The sphere casts a shadow; light bounces once.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from export.crops.crops import Crop, pinhole_camera
from lighting import geometry
from lighting.color import luminance
from lighting.envmap.latlong import row_irradiance, shrink_envmap
from lighting.envmap.relighting import rotate_envmap
from lighting.geometry import Floats

HEIGHT = 64  # rows of the maps that light the scene
SIZE = 64  # pixels of the square picture
HALF_WIDTH = 2.2  # of the view, in radii of the sphere
VIEW_ELEVATION = -25.0  # deg: the scene is seen from above
SPHERE_ALBEDO, PLANE_ALBEDO = 0.8, 0.5
BUMPS = ((7.0, 2.0, 3.0), (-4.0, 6.0, 5.0), (3.0, -8.0, 6.0), (9.0, 5.0, -4.0))  # wave vectors, per radius
BUMP_HEIGHT = 0.018  # radii, of each wave


@lru_cache(maxsize=1)
def transfer_matrix() -> NDArray[np.float32]:
    """Matrix (SIZE², 2 HEIGHT²) from a map's pixels to the radiance that the camera sees."""
    points, normals, smooth, albedo = scene_points()
    rays = geometry.latlong_directions(HEIGHT).reshape(-1, 3)
    solid_angle = np.repeat(geometry.latlong_solid_angle(HEIGHT), 2 * HEIGHT)
    cosine = np.maximum(normals @ rays.T, 0) * (smooth @ rays.T > 0) * ~_shadowed(points, rays)
    return np.asarray(albedo[:, None] / np.pi * cosine * solid_angle, dtype=np.float32)


def scene_points() -> tuple[Floats, Floats, Floats, Floats]:
    """The point that each pixel shows: positions (P, 3), bumpy and smooth normals (P, 3), albedo (P,).

    The unit sphere at the origin stands on the plane y = -1.
    """
    forward = geometry.direction(0.0, VIEW_ELEVATION)
    right, up = np.array([1.0, 0.0, 0.0]), geometry.direction(0.0, VIEW_ELEVATION + 90)
    steps = ((np.arange(SIZE) + 0.5) / SIZE * 2 - 1) * HALF_WIDTH
    start = (steps[None, :, None] * right - steps[:, None, None] * up).reshape(-1, 3) - 10 * forward
    to_sphere = geometry.ray_sphere(start, forward, np.zeros(3))
    on_sphere = np.isfinite(to_sphere)
    distance = np.where(on_sphere, to_sphere, (-1 - start[:, 1]) / forward[1])
    points = start + distance[:, None] * forward
    smooth = np.where(on_sphere[:, None], points, [0.0, 1.0, 0.0])
    bumpy = np.where(on_sphere[:, None], _bumpy(points), smooth)
    return points, bumpy, smooth, np.where(on_sphere, SPHERE_ALBEDO, PLANE_ALBEDO)


def _bumpy(points: Floats) -> Floats:
    """Normals (P, 3) of the unit sphere with waves on it: the smooth ones minus the waves' tangential slope."""
    waves = np.array(BUMPS)
    slope = BUMP_HEIGHT * np.cos(points @ waves.T) @ waves
    normals = points - (slope - np.sum(slope * points, axis=1, keepdims=True) * points)
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def _shadowed(points: Floats, rays: Floats) -> NDArray[np.bool_]:
    """Which rays (R, 3) from points (P, 3) meet the sphere; one point at a time, for memory's sake."""
    return np.array([np.isfinite(geometry.ray_sphere(point, rays, np.zeros(3))) for point in points])


def relight_scene(light: Floats) -> Floats:
    """The scene (SIZE, SIZE, 3) under an environment map.

    Args:
        light: (H, 2H, 3) linear; HEIGHT divides H.
    """
    return np.asarray(transfer_matrix() @ pool_map(light).reshape(-1, 3).astype(np.float32)).reshape(SIZE, SIZE, 3)


def pool_map(light: Floats) -> Floats:
    """A map at HEIGHT rows; means by solid angle, so that the sun keeps its power.

    Args:
        light: (H, 2H, 3) linear; HEIGHT divides H.
    """
    factor = light.shape[0] // HEIGHT
    weight = geometry.latlong_solid_angle(light.shape[0])[:, None, None]
    blocks = (light * weight).reshape(HEIGHT, factor, 2 * HEIGHT, factor, 3).sum(axis=(1, 3))
    return np.asarray(blocks / (factor * weight.reshape(HEIGHT, factor, 1).sum(axis=1)[..., None]))


# What light is in an HDR panorama: its sun, its sky and its ground as a crop's exposure has them.

ROWS = 256  # of the maps in which suns are split off, at least: pixels are joined whole

_SEARCH = 6.0  # deg around the label's sun in which the brightest pixel counts as the sun
_REACH = 2.5  # deg around that pixel over which the sun's light is summed: lenses spread it
_RING = (3.0, 6.0)  # deg around it whose median is the sky before the sun


@dataclass(frozen=True, eq=False)
class TrueLight:
    """The light of one crop; maps have HEIGHT rows and the crop's azimuth 0 in the middle."""

    image: Floats  # (HEIGHT, 2 HEIGHT, 3)
    sun_direction: Floats | None  # (3,), None without direct sun
    sun_irradiance: Floats  # (3,) of a surface that faces the sun; 0 without direct sun
    sky_irradiance: Floats  # (3,) of a level surface from above, without the sun
    ground: Floats  # (3,) radiance, the mean that a level surface facing down receives


@dataclass(frozen=True, eq=False)
class _Split:
    """A panorama at ROWS rows or a few more with its sun split off, in the panorama's frame and units."""

    image: Floats  # (R, 2R, 3)
    sunless: Floats
    sun_azimuth: float  # deg, NaN without direct sun
    sun_elevation: float
    sun_irradiance: Floats  # (3,)


def split_sun(image: NDArray[np.float32], near: Floats | None) -> _Split:
    """A panorama with its sun split off.

    Args:
        image: (H, 2H, 3) linear.
        near: (3,) direction near which the sun is; None where no direct light reaches the camera.
    """
    small = shrink_envmap(image, len(image) // max(1, len(image) // ROWS))
    if near is None:
        return _Split(small, small, math.nan, math.nan, np.zeros(3))
    sunless, sun, power = _without_true_sun(small, near)
    azimuth, elevation = (float(angle) for angle in geometry.angles(sun))
    return _Split(small, sunless, azimuth, elevation, power)


def true_light(panorama: _Split, azimuth: float, gain: float) -> TrueLight:
    """The light of a camera in a panorama.

    Args:
        panorama: of `split_sun`.
        azimuth: deg of the panorama to which the camera looks.
        gain: factor of the camera's exposure.
    """
    image, sunless = (rotate_envmap(m.astype(np.float32), -azimuth) * gain for m in (panorama.image, panorama.sunless))
    sun = geometry.direction(panorama.sun_azimuth - azimuth, panorama.sun_elevation)
    above, below = level_irradiances(sunless)
    visible_sun = sun if math.isfinite(sun[0]) else None
    return TrueLight(pool_map(image), visible_sun, panorama.sun_irradiance * gain, above, below / math.pi)


def _without_true_sun(image: Floats, near: Floats) -> tuple[Floats, Floats, Floats]:
    """The map with the sky beside the sun in the sun's place, the sun's direction (3,), and its irradiance (3,)."""
    height = len(image)
    rays = geometry.latlong_directions(height)
    bright = np.where(geometry.angle_between(rays, near) < _SEARCH, luminance(image), -1.0)
    sun = rays[np.unravel_index(int(np.argmax(bright)), bright.shape)]
    away = geometry.angle_between(rays, sun)
    ring = (away > _RING[0]) & (away < _RING[1]) & (rays[..., 1] > 0)
    disc = (away <= _REACH) & (rays[..., 1] > 0)
    beside = np.median(image[ring], axis=0)
    weight = np.broadcast_to(geometry.latlong_solid_angle(height)[:, None], disc.shape)[disc]
    power = weight @ np.maximum(image[disc] - beside, 0.0)
    rest = np.array(image)
    rest[disc] = np.minimum(rest[disc], beside)
    return rest, sun, np.asarray(power)


def level_irradiances(image: Floats) -> tuple[Floats, Floats]:
    """Irradiance (3,) of level surfaces that face up and down.

    Args:
        image: (H, 2H, 3) linear, row 0 is the zenith.
    """
    rows = row_irradiance(len(image))[:, None] * image.mean(axis=1, dtype=np.float64)
    half = len(image) // 2
    return np.asarray(rows[:half].sum(axis=0)), np.asarray(rows[half:].sum(axis=0))


def mirror_photo(crop: Crop) -> Floats:
    """The map (HEIGHT, 2 HEIGHT, 3) of a picture that is mirrored at its edges until it fills the sphere.

    The picture's angles are those of its true camera; what is brighter than white is clipped, as in a photo.

    Args:
        crop: a picture and its camera.
    """
    height, width = crop.linear.shape[:2]
    camera = pinhole_camera(crop.camera, width, height)
    across = math.degrees(2 * math.atan(width / 2 / camera.focal_length))
    azimuth, elevation = geometry.latlong_angles(HEIGHT)
    tilt = crop.camera.elevation
    folded = tilt + _folded(elevation - tilt, camera.vertical_fov)
    inside = geometry.direction(_folded(azimuth, across)[None, :], folded[:, None])
    x, y = np.moveaxis(geometry.camera_pixel(inside, camera), -1, 0)
    column = np.clip(np.nan_to_num(x), 0, width - 1).astype(int)
    row = np.clip(np.nan_to_num(y), 0, height - 1).astype(int)
    return np.asarray(np.clip(crop.linear, 0, 1)[row, column])


def _folded(angle: Floats, span: float) -> Floats:
    """Angles [deg] folded like a fan into -span / 2 to span / 2."""
    shifted = np.mod(angle + span / 2, 2 * span)
    return np.asarray(np.where(shifted < span, shifted, 2 * span - shifted) - span / 2)


def mean_light_map(lights: Sequence[TrueLight]) -> Floats:
    """The mean of maps over panoramas and over azimuth (HEIGHT, 2 HEIGHT, 3).

    Args:
        lights: at least one.
    """
    mean = np.mean([light.image.mean(axis=1, keepdims=True) for light in lights], axis=0)
    return np.asarray(mean.repeat(2 * HEIGHT, axis=1))

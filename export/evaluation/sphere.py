"""A bumpy diffuse sphere on a plane under any environment map.

Light is linear, so one matrix takes any map to the picture. The sphere casts a shadow; light bounces once.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats, direction, latlong_directions, latlong_solid_angle, ray_sphere

HEIGHT = 64  # rows of the maps that light the scene
SIZE = 64  # pixels of the square picture
HALF_WIDTH = 2.2  # of the view, in radii of the sphere
VIEW_ELEVATION = -25.0  # deg: the scene is seen from above
SPHERE_ALBEDO, PLANE_ALBEDO = 0.8, 0.5
BUMPS = ((7.0, 2.0, 3.0), (-4.0, 6.0, 5.0), (3.0, -8.0, 6.0), (9.0, 5.0, -4.0))  # wave vectors, per radius
BUMP_HEIGHT = 0.018  # radii, of each wave


@lru_cache(maxsize=1)
def transfer() -> NDArray[np.float32]:
    """Matrix (SIZE², 2 HEIGHT²) from a map's pixels to the radiance that the camera sees."""
    points, normals, smooth, albedo = scene_points()
    rays = latlong_directions(HEIGHT).reshape(-1, 3)
    solid_angle = np.repeat(latlong_solid_angle(HEIGHT), 2 * HEIGHT)
    seen = np.maximum(normals @ rays.T, 0) * (smooth @ rays.T > 0) * ~_shadowed(points, rays)
    return np.asarray(albedo[:, None] / np.pi * seen * solid_angle, dtype=np.float32)


def scene_points() -> tuple[Floats, Floats, Floats, Floats]:
    """The point that each pixel shows: positions (P, 3), bumpy and smooth normals (P, 3), albedo (P,).

    The unit sphere at the origin stands on the plane y = -1.
    """
    forward = direction(0.0, VIEW_ELEVATION)
    right, up = np.array([1.0, 0.0, 0.0]), direction(0.0, VIEW_ELEVATION + 90)
    steps = ((np.arange(SIZE) + 0.5) / SIZE * 2 - 1) * HALF_WIDTH
    start = (steps[None, :, None] * right - steps[:, None, None] * up).reshape(-1, 3) - 10 * forward
    to_sphere = ray_sphere(start, forward, np.zeros(3))
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
    return np.array([np.isfinite(ray_sphere(point, rays, np.zeros(3))) for point in points])


def picture(light: Floats) -> Floats:
    """The scene (SIZE, SIZE, 3) under a map of any even height that HEIGHT divides or equals."""
    return np.asarray(transfer() @ pooled(light).reshape(-1, 3).astype(np.float32)).reshape(SIZE, SIZE, 3)


def pooled(light: Floats) -> Floats:
    """A map (H, 2H, 3) at HEIGHT rows; means by solid angle, so that the sun keeps its power."""
    factor = light.shape[0] // HEIGHT
    weight = latlong_solid_angle(light.shape[0])[:, None, None]
    blocks = (light * weight).reshape(HEIGHT, factor, 2 * HEIGHT, factor, 3).sum(axis=(1, 3))
    return np.asarray(blocks / (factor * weight.reshape(HEIGHT, factor, 1).sum(axis=1)[..., None]))

"""How near objects come to the truth when they are lit by an estimate.

The measures are those of Hold-Geoffroy et al. (CVPR 2017): RMSE, scale-invariant RMSE, and the angle between RGB
vectors.

A diffuse, a glossy and a mirror ball are as a distant camera at azimuth 0 sees them. A sphere casts its shadow on a
plane. Light is linear, so one matrix for each takes a map of HEIGHT rows to a picture.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats, direction, latlong_directions, latlong_solid_angle, ray_sphere

HEIGHT = 64  # rows of the maps that light the objects
BALLS = ("diffuse", "glossy", "mirror")
OBJECTS = (*BALLS, "plane")
PLANE_ALBEDO = 0.5
_SIZE = 64  # pixels of the square picture in which the plane is seen
_HALF_WIDTH = 2.2  # of the view, in radii of the sphere that stands on it
_VIEW_ELEVATION = -25.0  # deg: the plane is seen from above
_PLANE_STEP = 5  # of the plane's pixels, of which every so many is looked at
_GLOSSINESS = 60.0  # concentration of the glossy lobe, exp(_GLOSSINESS (cos - 1))
_MIRROR = 1500.0  # concentration of the mirror's lobe, about one pixel of the map
_ACROSS = 24  # pixels of a ball's picture


@lru_cache(maxsize=1)
def _plane_points() -> Floats:
    """Points (P, 3) of the plane y = -1 that pixels beside the unit sphere at the origin show."""
    forward = direction(0.0, _VIEW_ELEVATION)
    right, up = np.array([1.0, 0.0, 0.0]), direction(0.0, _VIEW_ELEVATION + 90)
    steps = ((np.arange(_SIZE) + 0.5) / _SIZE * 2 - 1) * _HALF_WIDTH
    start = (steps[None, :, None] * right - steps[:, None, None] * up).reshape(-1, 3) - 10 * forward
    start = start[~np.isfinite(ray_sphere(start, forward, np.zeros(3)))][::_PLANE_STEP]
    return np.asarray(start + ((-1 - start[:, 1]) / forward[1])[:, None] * forward)


def pool_map(light: Floats) -> Floats:
    """A map at HEIGHT rows; means by solid angle, so that the sun keeps its power.

    Args:
        light: (H, 2H, 3) linear; HEIGHT divides H.
    """
    factor = light.shape[0] // HEIGHT
    weight = latlong_solid_angle(light.shape[0])[:, None, None]
    blocks = (light * weight).reshape(HEIGHT, factor, 2 * HEIGHT, factor, 3).sum(axis=(1, 3))
    return np.asarray(blocks / (factor * weight.reshape(HEIGHT, factor, 1).sum(axis=1)[..., None]))


@lru_cache(maxsize=4)
def _matrix(kind: str) -> NDArray[np.float32]:
    """Matrix (P, 2 HEIGHT²) from a map's pixels to what is seen of one of OBJECTS; balls reflect all light."""
    rays = latlong_directions(HEIGHT).reshape(-1, 3)
    solid_angle = np.repeat(latlong_solid_angle(HEIGHT), 2 * HEIGHT)
    if kind == "plane":
        lit = PLANE_ALBEDO / np.pi * np.maximum(rays[:, 1], 0) * solid_angle
        reach = (ray_sphere(point, rays, np.zeros(3)) for point in _plane_points())  # in turn, for memory's sake
        return np.asarray(lit * [np.isinf(distance) for distance in reach], dtype=np.float32)
    normals = ball_normals(_ACROSS, 1.0)
    if kind == "diffuse":
        return np.asarray(np.maximum(normals @ rays.T, 0) * solid_angle / np.pi, dtype=np.float32)
    view = np.array([0.0, 0.0, -1.0])
    reflected = view - 2 * (normals @ view)[:, None] * normals
    sharpness = _GLOSSINESS if kind == "glossy" else _MIRROR
    weight = np.exp(sharpness * (reflected @ rays.T - 1)) * solid_angle
    return np.asarray(weight / weight.sum(axis=1, keepdims=True), dtype=np.float32)


def picture_plane(pixels: int) -> tuple[Floats, Floats]:
    """Where (S, S) the pixels of a square picture lie: x to the right and y up, -1 to 1.

    Args:
        pixels: S.
    """
    steps = (np.arange(pixels) + 0.5) / pixels * 2 - 1
    x, y = np.meshgrid(steps, -steps)
    return x, y


def ball_normals(pixels: int, rim: float | None = None) -> Floats:
    """Normals of the pixels of a ball that a distant camera looking along -Z sees: (P, 3), or of all pixels (S, S, 3).

    Args:
        pixels: S, along the side of the picture, which the ball fills.
        rim: squared radius, up to 1, within which pixels count; None for all, beside the ball too.
    """
    x, y = picture_plane(pixels)
    normals = np.stack([x, y, np.sqrt(np.maximum(1 - x**2 - y**2, 0))], axis=-1)
    return normals if rim is None else normals[x**2 + y**2 < rim]


def rgb_angle(a: Floats, b: Floats) -> Floats:
    """Angles (...) [deg] between RGB vectors; 90 where one is black.

    Args:
        a: (..., 3) linear.
        b: (..., 3) linear.
    """
    lengths = np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1)
    return np.asarray(np.degrees(np.arccos(np.clip(np.sum(a * b, axis=-1) / np.maximum(lengths, 1e-12), -1, 1))))


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def render_object(kind: str, maps: Floats) -> Floats:
    """What is seen (N, P, 3) of an object under maps.

    Args:
        kind: of OBJECTS.
        maps: (N, HEIGHT, 2 HEIGHT, 3) linear.
    """
    flat = maps.reshape(len(maps), -1, 3).astype(np.float32)
    return np.stack([flat[..., channel] @ _matrix(kind).T for channel in range(3)], axis=-1)


def object_errors(truth: Floats, guess: Floats) -> Floats:
    """RMSE, RMSE after the best scale, both by the truth's RMS, and mean RGB angle [deg]: (N, 3).

    Args:
        truth: (N, P, 3) pictures.
        guess: (N, P, 3) pictures.
    """
    errors = []
    for true, seen in zip(truth, guess, strict=True):
        size, scale = max(_rms(true), 1e-9), np.sum(true * seen) / max(float(np.sum(seen**2)), 1e-12)
        errors.append([_rms(true - seen) / size, _rms(true - scale * seen) / size, rgb_angle(true, seen).mean()])
    return np.array(errors, dtype=np.float64)

"""Four objects under any environment map, and how far two lights differ on each.

A diffuse, a glossy and a mirror ball as a distant camera at azimuth 0 sees them, and the plane with the shadow of
`sphere.py`. Light is linear, so one matrix for each takes a map of sphere.HEIGHT rows to a picture.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from export.evaluation.relight import errors
from export.evaluation.sphere import HEIGHT, scene_points, transfer
from lighting.geometry import Floats, latlong_directions, latlong_solid_angle

BALLS = ("diffuse", "glossy", "mirror")
OBJECTS = (*BALLS, "plane")
GLOSSINESS = 60.0  # concentration of the glossy lobe, exp(GLOSSINESS (cos - 1))

_PLANE_STEP = 5  # of the plane's pixels, of which every so many is looked at
_ACROSS = 24  # pixels of a ball's picture
_MIRROR = 1500.0  # concentration of the mirror's lobe, about one pixel of the map


@lru_cache(maxsize=4)
def matrix(kind: str) -> NDArray[np.float32]:
    """Matrix (P, 2 HEIGHT²) from a map's pixels to what is seen of an object of OBJECTS, reflecting all light."""
    if kind == "plane":
        off_the_ball = np.linalg.norm(scene_points()[0], axis=1) > 1 + 1e-6
        return np.asarray(transfer()[off_the_ball][::_PLANE_STEP], dtype=np.float32)
    normals = _normals()
    rays = latlong_directions(HEIGHT).reshape(-1, 3)
    solid_angle = np.repeat(latlong_solid_angle(HEIGHT), 2 * HEIGHT)
    if kind == "diffuse":
        return np.asarray(np.maximum(normals @ rays.T, 0) * solid_angle / np.pi, dtype=np.float32)
    view = np.array([0.0, 0.0, -1.0])
    reflected = view - 2 * (normals @ view)[:, None] * normals
    sharpness = GLOSSINESS if kind == "glossy" else _MIRROR
    weight = np.exp(sharpness * (reflected @ rays.T - 1)) * solid_angle
    return np.asarray(weight / weight.sum(axis=1, keepdims=True), dtype=np.float32)


def _normals() -> Floats:
    """Normals (P, 3) of the pixels of a ball that a camera looking along -Z sees."""
    steps = (np.arange(_ACROSS) + 0.5) / _ACROSS * 2 - 1
    x, y = (axis.ravel() for axis in np.meshgrid(steps, -steps))
    inside = x**2 + y**2 < 1
    x, y = x[inside], y[inside]
    return np.stack([x, y, np.sqrt(1 - x**2 - y**2)], axis=-1)


def pictures(kind: str, maps: Floats) -> Floats:
    """What is seen (N, P, 3) of an object under maps (N, HEIGHT, 2 HEIGHT, 3)."""
    flat = maps.reshape(len(maps), -1, 3).astype(np.float32)
    return np.stack([flat[..., channel] @ matrix(kind).T for channel in range(3)], axis=-1)


def differences(truth: Floats, guess: Floats) -> Floats:
    """RMSE, RMSE after the best scale, both by the truth's RMS, and mean RGB angle [deg]: (N, 3) of (N, P, 3)."""
    found = np.array([errors(t, g) for t, g in zip(truth, guess, strict=True)])
    size = np.maximum(np.sqrt(np.mean(truth**2, axis=(1, 2))), 1e-9)
    return np.asarray(found / np.stack([size, size, np.ones(len(size))], axis=-1))

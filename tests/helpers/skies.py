"""Skies for tests."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from export.data.rendered_panoramas import _SyntheticPanorama
from lighting.geometry import direction
from lighting.stereo.grid_search import Pose, camera_to_world
from lighting.stereo.light_vectors import Skies, illumination_matrices, sun_directions


def sun_of(scene: _SyntheticPanorama) -> np.ndarray:
    return np.asarray(direction(scene.sun_azimuth or 0.0, scene.sun_elevation or 0.0))


Image = NDArray[np.float32]

LATITUDE = 47.0
JUNE = np.datetime64("2024-06-21T00:00:00") + np.arange(9, 17) * np.timedelta64(1, "h")


def june_suns() -> NDArray[Any]:
    return sun_directions(JUNE, LATITUDE, 0.0)


def ball(side: int = 48) -> tuple[Image, NDArray[np.bool_], NDArray[Any]]:
    """Normals (H, W, 3), mask and height [pixels] of a ball that nearly fills the picture."""
    radius = 0.48 * side
    y, x = np.mgrid[:side, :side] - (side - 1) / 2
    inside = x * x + y * y < (0.97 * radius) ** 2
    z = np.sqrt(np.maximum(radius**2 - x * x - y * y, 0))
    normals = np.stack([x, -y, z], axis=-1) / radius
    return (normals * inside[..., None]).astype(np.float32), inside, z


def photos(normals: Image, mask: NDArray[np.bool_], skies: Skies, pose: Pose, noise: float = 0.01) -> Image:
    """Images (T, H, W, C) of a white thing, their brightest value 0.8."""
    world = camera_to_world(normals[mask], pose)
    values = np.maximum(np.einsum("ptjc,pj->ptc", illumination_matrices(skies, world), world), 0)
    values *= 0.8 / values.max()
    values += np.random.default_rng(3).normal(0, noise * 0.8, values.shape)
    images = np.zeros((values.shape[1], *mask.shape, values.shape[2]), dtype=np.float32)
    images[:, mask] = np.moveaxis(np.maximum(values, 0), 1, 0)
    return images


def angles(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """Angles [deg] between unit vectors."""
    return np.asarray(np.degrees(2 * np.arcsin(np.minimum(np.linalg.norm(a - b, axis=-1) / 2, 1))))

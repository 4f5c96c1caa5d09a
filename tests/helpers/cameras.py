"""Cameras with exact turns, and what they see of points and of a textured sphere."""

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats, Pinhole, angles, camera_directions, sample_latlong
from lighting.registration.features import Matches
from lighting.registration.rotations import camera_from_world, focal_from_fov, project_points

SIZE = (640, 480)
PIXEL = 2.0 / float(np.hypot(*SIZE))
Camera = tuple[float, float, float]  # azimuth, elevation, roll [deg]


def relative_rotation(a: Camera, b: Camera) -> Floats:
    """The rotation (3, 3) of directions in the first camera's frame to the second's."""
    return np.asarray(camera_from_world(*b) @ camera_from_world(*a).T)


def matches(
    a: Camera,
    b: Camera,
    fov: float,
    *,
    step: tuple[float, float, float] = (0.0, 0.0, 0.0),
    noise_std: float = 0.3,
    wrong: float = 0.0,
    near: float = 3.0,
    seed: int = 0,
) -> Matches:
    """Points between `near` and ten times that [m] that both cameras see, the second `step` [m] away.

    `noise` [pixels] is added, and a share of them is `wrong`.
    """
    rng = np.random.default_rng(seed)
    world = rng.normal(size=(20000, 3))
    world *= (near * 10 ** rng.uniform(0, 1, 20000) / np.linalg.norm(world, axis=1))[:, None]
    focal = focal_from_fov(fov, *SIZE)
    in_camera = [world @ camera_from_world(*a).T, (world - step) @ camera_from_world(*b).T]
    at = [project_points(v, focal) for v in in_camera]
    half = np.array(SIZE) / np.hypot(*SIZE)
    in_both = np.all(
        [(v[:, 2] < 0) & np.all(np.abs(p) < half, axis=1) for v, p in zip(in_camera, at, strict=True)], axis=0
    )
    first, second = (p[in_both][:400] + rng.normal(0, noise_std * PIXEL, (min(400, in_both.sum()), 2)) for p in at)
    count = round(wrong * len(first))
    second[:count] = rng.uniform(-half, half, (count, 2))
    order = rng.permutation(len(first))
    return Matches(first[order], second[order], PIXEL)


def texture(seed: int = 0) -> NDArray[np.float32]:
    """A lat-long picture (512, 1024, 3) of smooth noise of several sizes."""
    rng = np.random.default_rng(seed)
    total = np.zeros((512, 1024))
    for cells in (16, 64, 256):
        coarse = rng.random((cells, 2 * cells))
        total += np.kron(coarse, np.ones((512 // cells, 512 // cells)))
    return np.repeat((255 * total / total.max())[..., None], 3, axis=2).astype(np.float32)


def picture(sphere: NDArray[np.float32], camera: Camera, fov: float, gain: float = 1.0) -> NDArray[np.uint8]:
    """What a camera sees of the sphere: (480, 640, 3)."""
    rays = camera_directions(Pinhole(*SIZE, fov, *camera)).astype(np.float32)
    return np.asarray(np.clip(gain * sample_latlong(sphere, rays), 0, 255), dtype=np.uint8)


FINER = 3  # pixels drawn for each one along an axis


def poles(elevation: float, roll: float, fov: float, size: tuple[int, int] = (400, 300)) -> NDArray[np.uint8]:
    """What a camera sees among poles all around it, each 3 deg wide, in fog that thickens by the pole."""
    width, height = size
    camera = Pinhole(FINER * width, FINER * height, fov, 0.0, elevation, roll)
    azimuth, _ = angles(camera_directions(camera))
    shade = np.where(np.floor(azimuth / 3.0) % 2 == 0, 70.0, 160.0)
    grey = shade.reshape(height, FINER, width, FINER).mean(axis=(1, 3))
    return np.repeat(grey[..., None], 3, axis=2).round().astype(np.uint8)

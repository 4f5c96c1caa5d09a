"""The camera's pose: directions in its frame and in the world's.

Camera frame: +X right, +Y up in the picture, +Z towards the camera, so that visible normals have positive Z.
World axes are those of the maps: +Y up, true north at -Z, east at +X.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.geometry import Floats, camera_axes


@dataclass(frozen=True)
class Pose:
    """How a camera stands; the defaults look level to the north."""

    heading: float = 0.0
    """Deg clockwise from true north, where the camera looks."""
    pitch: float = 0.0
    """Deg, positive looks up."""
    roll: float = 0.0
    """Deg, positive turns the camera clockwise as its holder sees it."""


def _axes(pose: Pose) -> Floats:
    """The camera frame's X, Y and Z as rows (3, 3) in world axes."""
    right, up, forward = camera_axes(pose.heading, pose.pitch, pose.roll)
    return np.stack([right, up, -forward])


def camera_to_world(vectors: ArrayLike, pose: Pose) -> Floats:
    """Rotate vectors of the camera frame to world axes.

    Args:
        vectors: (..., 3) in the camera frame.
        pose: of the camera.
    """
    return np.asarray(np.asarray(vectors) @ _axes(pose))


def world_to_camera(vectors: ArrayLike, pose: Pose) -> Floats:
    """Rotate vectors in world axes to the camera frame.

    Args:
        vectors: (..., 3) in world axes.
        pose: of the camera.
    """
    return np.asarray(np.asarray(vectors) @ _axes(pose).T)


def sample_visible_normals(count: int) -> NDArray[np.float32]:
    """Spread unit vectors (N, 3) evenly over the camera frame's half with Z > 0, on a Fibonacci spiral.

    Args:
        count: N.
    """
    index = np.arange(count) + 0.5
    z = index / count
    angle = np.pi * (1 + 5**0.5) * index
    radius = np.sqrt(1 - z * z)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1).astype(np.float32)

"""The camera's frame of normals, and how it stands in the world.

Camera frame: +X right, +Y up in the picture, +Z towards the camera, so that what is seen has normals of positive Z.
World axes are those of the maps: +Y up, true north at -Z, east at +X.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.geometry import Floats, camera_axes


@dataclass(frozen=True)
class Pose:
    """How a camera stands; the defaults look level to the north."""

    heading: float = 0.0  # deg clockwise from true north, where the camera looks
    pitch: float = 0.0  # deg, positive looks up
    roll: float = 0.0  # deg, positive turns the camera clockwise as its holder sees it


def axes(pose: Pose) -> Floats:
    """The camera frame's X, Y and Z as rows (3, 3) in world axes."""
    right, up, forward = camera_axes(pose.heading, pose.pitch, pose.roll)
    return np.stack([right, up, -forward])


def to_world(vectors: ArrayLike, pose: Pose) -> Floats:
    """Vectors (..., 3) of the camera frame in world axes."""
    return np.asarray(np.asarray(vectors) @ axes(pose))


def to_camera(vectors: ArrayLike, pose: Pose) -> Floats:
    """Vectors (..., 3) in world axes in the camera frame."""
    return np.asarray(np.asarray(vectors) @ axes(pose).T)


def visible_normals(count: int) -> NDArray[np.float32]:
    """Unit vectors (N, 3) spread evenly over the camera frame's half with Z > 0, on a Fibonacci spiral."""
    index = np.arange(count) + 0.5
    z = index / count
    turn = np.pi * (1 + 5**0.5) * index
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=-1).astype(np.float32)

"""A camera's path of orientations: gravity, headings, gaps bridged, and what trembles smoothed.

Orientations are rotations (3, 3) from the frame of the shot's first camera (x right, y up, it looks along -z) to that
of a later one.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats, angles, camera_axes, direction

WINDOW = 5  # frames over which a parabola is fitted; tracking trembles from frame to frame, hands do more slowly


@dataclass(frozen=True, eq=False)
class Path:
    """How the camera pointed, frame by frame."""

    time: Floats  # (N,) s
    heading: Floats  # (N,) deg clockwise from the first frame's, continuous: it may pass 180
    elevation: Floats  # (N,) deg
    roll: Floats  # (N,) deg
    bridged: NDArray[np.bool_]  # (N,) where nothing could be followed and the neighbours tell


def up_in_camera(elevation: float, roll: float) -> Floats:
    """Where up is (3,) in the frame of a camera with these angles [deg]."""
    right, up, forward = camera_axes(0.0, elevation, roll)
    return np.array([right[1], up[1], -forward[1]])


def common_up(orientations: Floats, ups: Floats) -> Floats:
    """Up (3,) in the first camera's frame, of what each camera (K, 3, 3) takes for it (K, 3).

    The direction with the least sum of distances, by re-weighted means (Weiszfeld), so that a few far off count little.
    """
    there = np.einsum("kji,kj->ki", orientations, ups)
    mean = _unit(there.mean(axis=0))
    for _ in range(20):
        weight = 1.0 / np.maximum(np.linalg.norm(there - mean, axis=1), np.radians(0.5))
        mean = _unit(weight @ there)
    return mean


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / max(float(np.linalg.norm(vector)), 1e-12))


def level(up: Floats) -> Floats:
    """The rotation (3, 3) from the first camera's frame to the shot's: +Y up, azimuth 0 where that camera points."""
    ahead = np.array([0.0, 0.0, -1.0])
    ahead = np.array([0.0, 1.0, 0.0]) * np.sign(-up[2] or 1.0) if abs(up[2]) > 0.999 else ahead
    back = -_unit(ahead - (ahead @ up) * up)
    return np.stack([np.cross(up, back), up, back])


def angles_of(orientations: Floats, levelled: Floats) -> tuple[Floats, Floats, Floats]:
    """Headings, elevations and rolls (N,) [deg] of cameras (N, 3, 3) in the shot's frame."""
    axes = orientations @ levelled.T
    right, forward = axes[:, 0], -axes[:, 2]
    heading, elevation = angles(forward)
    level_right = direction(heading + 90.0, 0.0)
    level_up = np.cross(level_right, forward)
    cosine, sine = np.sum(right * level_right, axis=1), -np.sum(right * level_up, axis=1)
    return heading, elevation, np.asarray(np.degrees(np.arctan2(sine, cosine)))


def path_of(time: Floats, orientations: Floats, known: NDArray[np.bool_], levelled: Floats) -> Path:
    """The path of cameras (N, 3, 3) of which those `known` (N,), at least one, are believed."""
    heading, elevation, roll = angles_of(orientations, levelled)
    turned = np.empty_like(heading)
    turned[known] = np.degrees(np.unwrap(np.radians(heading[known])))
    rolled = np.empty_like(roll)
    rolled[known] = np.degrees(np.unwrap(np.radians(roll[known])))
    bridged = (np.interp(time, time[known], v[known]) for v in (turned, elevation, rolled))
    heading, elevation, roll = (smoothed(time, v) for v in bridged)
    return Path(time, heading, elevation, roll, ~known)


def smoothed(time: Floats, values: Floats, window: int = WINDOW) -> Floats:
    """Values (N,) at rising times (N,), each replaced by the parabola through its `window` neighbours."""
    count = len(time)
    if count < window:
        return values
    first = np.clip(np.arange(count) - window // 2, 0, count - window)
    near = first[:, None] + np.arange(window)
    apart = time[near] - time[:, None]
    scale = np.maximum(np.abs(apart).max(axis=1, keepdims=True), 1e-9)
    basis = np.stack([np.ones_like(apart), apart / scale, (apart / scale) ** 2], axis=-1)
    fitted = np.linalg.pinv(basis) @ values[near][..., None]
    return np.asarray(fitted[:, 0, 0])

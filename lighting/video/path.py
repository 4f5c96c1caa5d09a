"""A camera's path of orientations: its angles, gaps bridged, and what trembles smoothed.

Orientations are rotations (3, 3) from the frame of the shot's first camera (x right, y up, it looks along -z) to that
of a later one.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats
from lighting.turns import angles_of

WINDOW = 5  # frames over which a parabola is fitted; tracking trembles from frame to frame, hands do more slowly


@dataclass(frozen=True, eq=False)
class Path:
    """How the camera pointed, frame by frame."""

    time: Floats  # (N,) s
    heading: Floats  # (N,) deg clockwise from the first frame's, continuous: it may pass 180
    elevation: Floats  # (N,) deg
    roll: Floats  # (N,) deg
    bridged: NDArray[np.bool_]  # (N,) where nothing could be followed and the neighbours tell


def path_of(time: Floats, orientations: Floats, known: NDArray[np.bool_], levelled: Floats) -> Path:
    """The path of cameras (N, 3, 3) of which those `known` (N,), at least one, are believed."""
    heading, elevation, roll = angles_of(orientations, levelled)
    turned = np.empty_like(heading)
    turned[known] = np.degrees(np.unwrap(np.radians(heading[known])))
    rolled = np.empty_like(roll)
    rolled[known] = np.degrees(np.unwrap(np.radians(roll[known])))
    bridged = (np.interp(time, time[known], v[known]) for v in (turned, elevation, rolled))
    heading, elevation, roll = (smoothed(time, v) for v in bridged)
    return Path(time, heading, np.clip(elevation, -90.0, 90.0), roll, ~known)


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

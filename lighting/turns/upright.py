"""Up, and angles about it: what several cameras that are turned against each other say of the vertical together.

Orientations are rotations (3, 3) from one common frame (x right, y up, its camera looks along -z) to a camera's own.
"""

import numpy as np

from lighting.geometry import STEEP, Floats, angles, camera_axes, direction, wrap_azimuth

_STEEP = float(np.sin(np.radians(STEEP)))


def own_axes(azimuth: float, elevation: float, roll: float) -> Floats:
    """The matrix (3, 3) that takes directions in the world to a camera's own frame; its angles in deg."""
    return np.asarray(camera_axes(azimuth, elevation, roll) * np.array([[1.0], [1.0], [-1.0]]))


def own_up(elevation: float, roll: float) -> Floats:
    """Where up is (3,) in the own frame of a camera with these angles [deg]."""
    return own_axes(0.0, elevation, roll)[:, 1]


def common_up(orientations: Floats, ups: Floats, weights: Floats | float = 1.0) -> Floats:
    """Up (3,) in the common frame, of what each camera (K, 3, 3) takes for it (K, 3) with some weight (K,).

    The direction with the least sum of distances, by re-weighted means (Weiszfeld), so that a few far off count little.
    """
    there = np.einsum("kji,kj->ki", orientations, ups)
    own = np.broadcast_to(weights, len(there))
    mean = _unit(own @ there)
    for _ in range(20):
        weight = own / np.maximum(np.linalg.norm(there - mean, axis=1), np.radians(0.5))
        mean = _unit(weight @ there)
    return mean


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / max(float(np.linalg.norm(vector)), 1e-12))


def level(up: Floats) -> Floats:
    """The rotation (3, 3) from the common frame to a level one: +Y up, azimuth 0 where `angles_of` sees its camera."""
    up = _unit(up)
    if abs(up[2]) > _STEEP:
        right = _unit(np.array([1.0, 0.0, 0.0]) - up[0] * up)
        return np.stack([right, up, np.cross(right, up)])
    back = -_unit(np.array([0.0, 0.0, -1.0]) + up[2] * up)
    return np.stack([np.cross(up, back), up, back])


def angles_of(orientations: Floats, levelled: Floats) -> tuple[Floats, Floats, Floats]:
    """Headings, elevations and rolls (N,) [deg] of cameras (N, 3, 3) in a frame as `level` gives it.

    Within 5 deg of straight up and down the view axis has no steady heading: there it is that of a camera of roll 0
    whose picture's upper edge lies as this one's does, and the roll is 0.
    """
    axes = orientations @ levelled.T
    right, forward = axes[:, 0], -axes[:, 2]
    heading, elevation = angles(forward)
    across, _ = angles(right)
    heading = np.where(np.abs(forward[:, 1]) > _STEEP, wrap_azimuth(across - 90.0), heading)
    level_right = direction(heading + 90.0, 0.0)
    level_up = np.cross(level_right, forward)
    cosine, sine = np.sum(right * level_right, axis=1), -np.sum(right * level_up, axis=1)
    return heading, elevation, np.asarray(np.degrees(np.arctan2(sine, cosine)))

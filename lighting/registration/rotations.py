"""Camera geometry of photo sets: rays of pinhole cameras, rotations and their vectors, a common vertical.

A focal length here is in units of half the picture's diagonal, so that one lens has one number however it is held.

A camera's own frame has x right and y up; it looks along -z. Orientations are rotations (3, 3) from one such frame,
common to all, to a camera's own.
"""

import math

import numpy as np

from lighting.geometry import MIN_STEEP_ELEVATION, Floats, angles, camera_axes, direction, wrap_azimuth


def focal_from_fov(vertical_fov: float, width: float, height: float) -> float:
    """The focal length of a picture in half diagonals.

    Args:
        vertical_fov: deg.
        width: pixels, or any unit.
        height: the same unit.
    """
    return height / math.hypot(width, height) / math.tan(math.radians(vertical_fov) / 2.0)


def fov_from_focal(focal: float, width: float, height: float) -> float:
    """The vertical field of view of a picture in deg.

    Args:
        focal: focal length in half diagonals.
        width: pixels, or any unit.
        height: the same unit.
    """
    return math.degrees(2.0 * math.atan(height / math.hypot(width, height) / focal))


def rays_through(points: Floats, focal: float) -> Floats:
    """Unit vectors (N, 3) through points of a picture.

    Args:
        points: (N, 2) half diagonals from the center, x right, y up.
        focal: focal length in half diagonals.
    """
    x, y = points[:, 0], points[:, 1]
    length = np.sqrt(x * x + y * y + focal * focal)
    unit = np.empty((len(points), 3))
    unit[:, 0], unit[:, 1], unit[:, 2] = x / length, y / length, -focal / length
    return unit


def project_points(vectors: Floats, focal: float) -> Floats:
    """Points (N, 2) where vectors meet the picture, in half diagonals; far outside for those behind.

    Args:
        vectors: (N, 3) in the camera's own frame.
        focal: focal length in half diagonals.
    """
    ahead = np.maximum(-vectors[..., 2:], 1e-3)
    return np.asarray(focal * vectors[..., :2] / ahead)


def rotation_about(vector: Floats) -> Floats:
    """Rotations (..., 3, 3) about vectors, by the length of each (Rodrigues' formula).

    Args:
        vector: (..., 3) rad.
    """
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    cross = cross_matrix(vector)
    once, twice = np.sinc(angle / np.pi), 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    return np.asarray(np.eye(3) + once * cross + twice * (cross @ cross))


def cross_matrix(vector: Floats) -> Floats:
    """Matrices (..., 3, 3) that take w to the vector product of a vector and w.

    Args:
        vector: (..., 3).
    """
    x, y, z = (vector[..., axis] for axis in range(3))
    matrix = np.zeros((*x.shape, 3, 3))
    matrix[..., 0, 1], matrix[..., 0, 2], matrix[..., 1, 2] = -z, y, -x
    matrix[..., 1, 0], matrix[..., 2, 0], matrix[..., 2, 1] = z, -y, x
    return matrix


def rotation_vector(rotation: Floats) -> Floats:
    """The vector (3,) along a rotation's axis, as long as its angle in rad, 0 to pi.

    Args:
        rotation: (3, 3).
    """
    x, y, z = rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]
    skew = 0.5 * np.array([x, y, z])
    sine, cosine = float(np.linalg.norm(skew)), 0.5 * (float(np.trace(rotation)) - 1.0)
    if cosine > -0.999:
        return np.asarray(skew * (math.atan2(sine, cosine) / sine if sine > 1e-12 else 1.0))
    values, vectors = np.linalg.eigh(0.5 * (rotation + rotation.T))
    axis = vectors[:, int(np.argmax(values))]
    return np.asarray(axis * math.atan2(sine, cosine) * (1.0 if axis @ skew >= 0.0 else -1.0))


def nearest_rotation(matrix: Floats) -> Floats:
    """The rotations (..., 3, 3) nearest to matrices.

    Args:
        matrix: (..., 3, 3).
    """
    u, _, v = np.linalg.svd(matrix)
    u[..., :, 2] *= np.sign(np.linalg.det(u @ v))[..., None]
    return np.asarray(u @ v)


# Up, and angles about it: what several cameras that are turned against each other say of the vertical together.

_STEEP = float(np.sin(np.radians(MIN_STEEP_ELEVATION)))


def camera_from_world(azimuth: float, elevation: float, roll: float) -> Floats:
    """The matrix (3, 3) that takes directions in the world to a camera's own frame.

    Args:
        azimuth: deg, positive to the right.
        elevation: deg, positive looks up.
        roll: deg.
    """
    return np.asarray(camera_axes(azimuth, elevation, roll) * np.array([[1.0], [1.0], [-1.0]]))


def camera_up(elevation: float, roll: float) -> Floats:
    """Where up is (3,) in a camera's own frame.

    Args:
        elevation: deg, positive looks up.
        roll: deg.
    """
    return camera_from_world(0.0, elevation, roll)[:, 1]


def consensus_up(orientations: Floats, ups: Floats, weights: Floats | float = 1.0) -> Floats:
    """Up (3,) in the common frame, by what each camera takes for it.

    The direction with the least sum of distances, by re-weighted means (Weiszfeld), so that a few far off count little.

    Args:
        orientations: (K, 3, 3) of the cameras.
        ups: (K, 3) in each camera's own frame.
        weights: (K,) or one for all.
    """
    in_common = np.einsum("kji,kj->ki", orientations, ups)
    weights = np.broadcast_to(weights, len(in_common))
    mean = _unit(weights @ in_common)
    for _ in range(20):
        weight = weights / np.maximum(np.linalg.norm(in_common - mean, axis=1), np.radians(0.5))
        mean = _unit(weight @ in_common)
    return mean


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / max(float(np.linalg.norm(vector)), 1e-12))


def leveling_rotation(up: Floats) -> Floats:
    """The rotation (3, 3) from the common frame to a level one: +Y up, azimuth 0 where its camera looks.

    Args:
        up: (3,) in the common frame.
    """
    up = _unit(up)
    if abs(up[2]) > _STEEP:
        right = _unit(np.array([1.0, 0.0, 0.0]) - up[0] * up)
        return np.stack([right, up, np.cross(right, up)])
    backward = -_unit(np.array([0.0, 0.0, -1.0]) + up[2] * up)
    return np.stack([np.cross(up, backward), up, backward])


def heading_elevation_roll(orientations: Floats, leveled: Floats) -> tuple[Floats, Floats, Floats]:
    """Headings, elevations and rolls (N,) of cameras in a level frame, in deg.

    Within 5 deg of straight up and down the view axis has no steady heading. The heading is then that of a camera of
    roll 0 whose picture's upper edge lies as this one's does. The roll is then 0.

    Args:
        orientations: (N, 3, 3) of the cameras.
        leveled: (3, 3) from the common frame to the level one, by `leveling_rotation`.
    """
    axes = orientations @ leveled.T
    right, forward = axes[:, 0], -axes[:, 2]
    heading, elevation = angles(forward)
    across, _ = angles(right)
    heading = np.where(np.abs(forward[:, 1]) > _STEEP, wrap_azimuth(across - 90.0), heading)
    level_right = direction(heading + 90.0, 0.0)
    level_up = np.cross(level_right, forward)
    cosine, sine = np.sum(right * level_right, axis=1), -np.sum(right * level_up, axis=1)
    return heading, elevation, np.asarray(np.degrees(np.arctan2(sine, cosine)))

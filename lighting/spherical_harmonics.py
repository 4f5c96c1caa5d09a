"""Real spherical harmonics of order 2 around a scene: radiance from all directions as nine colors.

The nine functions of a unit vector (x, y, z) are, in this order, 1, y, z, x, xy, yz, 3z² - 1, xz and x² - y². Each has
the factor that makes the integral of its square 1, and no sign of Condon and Shortley. WebXR and three.js have them so.

References:
    [1] Ramamoorthi and Hanrahan, An Efficient Representation for Irradiance Environment Maps, SIGGRAPH 2001.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.geometry import Floats, latlong_angles, latlong_solid_angle

COUNT = 9  # of functions
_BANDS = np.array([0, 1, 1, 1, 2, 2, 2, 2, 2])  # of the functions
BASIS_FACTORS = np.sqrt(
    np.array([1 / 4, 3 / 4, 3 / 4, 3 / 4, 15 / 4, 15 / 4, 5 / 16, 15 / 4, 15 / 16]) / math.pi
)  # of the functions' polynomials
CONDON_SHORTLEY = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0])  # signs that some add
COSINE_FACTORS = np.array([math.pi, 2 * math.pi / 3, math.pi / 4])[_BANDS]  # irradiance over radiance [1], by function


def harmonics_basis(direction: ArrayLike) -> Floats:
    """Return the nine functions (..., 9) of directions.

    Args:
        direction: (..., 3), unit vectors.
    """
    x, y, z = np.moveaxis(np.asarray(direction, dtype=np.float64), -1, 0)
    polynomials = [np.ones_like(x), y, z, x, x * y, y * z, 3 * z**2 - 1, x * z, x**2 - y**2]
    return np.asarray(np.stack(polynomials, axis=-1) * BASIS_FACTORS)


def project_latlong(image: NDArray[np.floating]) -> Floats:
    """Return the coefficients (9, 3) of a map: the integrals of its radiance times each function.

    Args:
        image: (H, 2H, 3), linear radiance, in the pixels of `geometry`.
    """
    height = len(image)
    azimuth, elevation = (np.radians(angle) for angle in latlong_angles(height))
    turns = np.stack(
        [np.ones_like(azimuth), np.sin(azimuth), -np.cos(azimuth), np.sin(2 * azimuth), np.cos(2 * azimuth)]
    )
    by_row = np.einsum("tc,rck->rtk", turns.astype(np.float32), image, optimize=True).astype(np.float64)
    mean, x, z, xz, cos2 = np.moveaxis(by_row * latlong_solid_angle(height)[:, None, None], 1, 0)  # (H, 3) each
    level, up = np.cos(elevation)[:, None], np.sin(elevation)[:, None]
    level2 = level**2
    # with x = level sin a and z = -level cos a: x z = -level² sin 2a / 2, z² = level² (1 + cos 2a) / 2
    polynomials = [
        mean,
        up * mean,
        level * z,
        level * x,
        level * up * x,
        level * up * z,
        1.5 * level2 * (mean + cos2) - mean,
        -0.5 * level2 * xz,
        0.5 * level2 * (mean - cos2) - up**2 * mean,
    ]
    return np.stack([terms.sum(axis=0) for terms in polynomials]) * BASIS_FACTORS[:, None]


def irradiance_from_harmonics(coefficients: ArrayLike, normals: ArrayLike) -> Floats:
    """Return the irradiance (..., 3) of surfaces by coefficients of radiance [1].

    Args:
        coefficients: (9, 3), of radiance.
        normals: (..., 3), unit vectors.
    """
    return np.asarray(harmonics_basis(normals) @ (COSINE_FACTORS[:, None] * np.asarray(coefficients)))


def rotate_harmonics(coefficients: ArrayLike, yaw: float) -> Floats:
    """Return the coefficients (9, 3) of a scene that was turned about the vertical: azimuth a becomes a + yaw.

    Args:
        coefficients: (9, 3).
        yaw: deg, positive to the right.
    """
    one, y, z, x, xy, yz, z2, xz, x2 = np.asarray(coefficients, dtype=np.float64)
    (c, s), (c2, s2) = ((math.cos(turn), math.sin(turn)) for turn in (math.radians(yaw), math.radians(2 * yaw)))
    # 3z² - 1 and x² - y² are mixtures of 3y² - 1, which stays, and z² - x², which turns with xz
    upright, level = -0.5 * z2 - math.sqrt(0.75) * x2, math.sqrt(0.75) * z2 - 0.5 * x2
    level, xz = c2 * level + s2 * xz, c2 * xz - s2 * level
    z2, x2 = -0.5 * upright + math.sqrt(0.75) * level, -math.sqrt(0.75) * upright - 0.5 * level
    return np.stack([one, y, c * z + s * x, c * x - s * z, c * xy - s * yz, c * yz + s * xy, z2, xz, x2])

"""A map as glTF's EXT_lights_image_based wants it: blurred cube maps for gloss, harmonics for diffuse light.

The layout is what Babylon.js, which the extension comes from, shows rightly in its usual left-handed scenes; the
specification leaves it open. Faces are in the order +X, -X, +Y, -Y, +Z, -Z of a cube whose +X is glTF's -X, stored
bottom row first, as PNG in RGBD: colour = rgb^2.2 / alpha. Level k of n shows what a surface of roughness k / (n - 1)
reflects when looked at along its normal, the usual split-sum filter with a GGX lobe (Karis 2013).
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.files import encode_png
from lighting.geometry import latlong_directions, latlong_solid_angle, sample_latlong
from lighting.prefilter import shrink

Floats = NDArray[np.floating[Any]]

SIZE = 128  # of the sharpest faces, pixels
LEVELS = 4  # each half the size of the one before; the last one shows roughness 1

_SOURCE_ROWS = 64  # of the map that is blurred
_GAMMA = 2.2
_BAND = np.repeat([np.pi, 2 * np.pi / 3, np.pi / 4], [1, 3, 5])  # clamped cosine in spherical harmonics
_PHASE = np.array([1, -1, 1, -1, 1, -1, 1, -1, 1])  # the Condon-Shortley sign of odd orders
_CHUNK = 64  # directions blurred at once, few enough for the processor's cache


def levels(environment: NDArray[np.float32]) -> Iterator[list[bytes]]:
    """Six PNG files a level, sharpest first, of a map (H, 2H, 3)."""
    mirrored = environment[:, ::-1]
    small = shrink(mirrored, _SOURCE_ROWS)
    for level in range(LEVELS):
        faces = face_directions(SIZE >> level)
        roughness = level / (LEVELS - 1)
        radiance = _blurred(small, faces, roughness) if level else sample_latlong(mirrored, faces)
        yield [_rgbd(face[::-1]) for face in radiance]


def harmonics(environment: NDArray[np.float32]) -> list[list[float]]:
    """Irradiance (9, 3) in real spherical harmonics up to order 2 (Ramamoorthi and Hanrahan 2001)."""
    rows = irradiance_harmonics(shrink(environment[:, ::-1], _SOURCE_ROWS)) * _PHASE[:, None]
    return [[round(float(v), 6) for v in row] for row in rows]


def _basis(d: Floats) -> Floats:
    """Real spherical harmonics (..., 9) up to order 2 of unit vectors (..., 3)."""
    x, y, z = np.moveaxis(d, -1, 0)
    terms = [
        np.full_like(x, 0.282095), 0.488603 * y, 0.488603 * z, 0.488603 * x,
        1.092548 * x * y, 1.092548 * y * z, 0.315392 * (3 * z * z - 1), 1.092548 * x * z, 0.546274 * (x * x - y * y),
    ]  # fmt: skip
    return np.stack(terms, axis=-1)


def irradiance_harmonics(image: NDArray[np.float32]) -> Floats:
    """Harmonics (9, 3) of the irradiance under a map."""
    height = len(image)
    weighted = image * latlong_solid_angle(height)[:, None, None]
    radiance = _basis(latlong_directions(height)).reshape(-1, 9).T @ weighted.reshape(-1, 3)
    return np.asarray(radiance * _BAND[:, None])


def face_directions(size: int) -> Floats:
    """Unit vectors (6, size, size, 3) through the pixels of a cube's faces."""
    axis = (np.arange(size) + 0.5) / size * 2 - 1
    s, t = np.meshgrid(axis, axis)
    one = np.ones_like(s)
    faces = [(one, -t, -s), (-one, -t, s), (s, one, t), (s, -one, -t), (s, -t, one), (-s, -t, -one)]
    directions = np.stack([np.stack(face, axis=-1) for face in faces])
    return np.asarray(directions / np.linalg.norm(directions, axis=-1, keepdims=True))


def _blurred(source: NDArray[np.float32], directions: Floats, roughness: float) -> Floats:
    """Radiance of directions (..., 3), averaged over the GGX lobe of a roughness in (0, 1]."""
    towards = latlong_directions(len(source)).reshape(-1, 3).astype(np.float32)
    solid_angle = np.repeat(latlong_solid_angle(len(source)), 2 * len(source)).astype(np.float32)
    normals = directions.reshape(-1, 3).astype(np.float32)
    parts = np.array_split(normals, -(-len(normals) // _CHUNK))
    blurred = [_averaged(source, _lobe(part @ towards.T, roughness) * solid_angle) for part in parts]
    return np.concatenate(blurred).reshape(directions.shape)


def _lobe(cosine: NDArray[np.float32], roughness: float) -> NDArray[np.float32]:
    """Relative weight of light at an angle from the normal, which is also the viewing direction."""
    squared = np.float32(roughness**4)
    half = cosine * ((squared - 1) / 2)  # (1 + cos) / 2 is the squared cosine of half the angle
    half += (squared + 1) / 2
    weight = np.maximum(cosine, 0)
    weight /= half
    weight /= half
    return weight


def _averaged(source: NDArray[np.float32], weight: NDArray[np.float32]) -> Floats:
    return np.asarray(weight @ source.reshape(-1, 3) / weight.sum(axis=1, keepdims=True))


def _rgbd(radiance: Floats) -> bytes:
    brightest = np.maximum(radiance.max(axis=-1, keepdims=True), 1.0)
    divisor = np.clip(np.floor(255.0 / brightest), 1, 255)
    colour = np.clip(radiance * divisor / 255.0, 0, 1) ** (1 / _GAMMA) * 255.0
    pixels = np.rint(np.concatenate([colour, divisor], axis=-1)).astype(np.uint8)
    return encode_png(pixels)

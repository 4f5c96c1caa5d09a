"""Cubemaps of environment maps, and their mirror images at several roughnesses (GGX).

Faces are in the order +X, -X, +Y, -Y, +Z, -Z, with the rows and columns of OpenGL's cubemaps: seen from outside, as
all graphics interfaces have them.

References:
    [1] Khronos, OpenGL 4.6, section 8.13, table 8.19.
    [2] Karis, Real Shading in Unreal Engine 4, SIGGRAPH 2013 course notes: the view is along the normal.
"""

from collections.abc import Sequence

import numpy as np

from lighting.envmap.latlong import Image, convolve_envmap, shrink_envmap
from lighting.geometry import Floats, sample_latlong

FACES = ("+X", "-X", "+Y", "-Y", "+Z", "-Z")
_AXES = np.array(  # of each face: its middle, the way of its columns, the way of its rows [1]
    [
        [[1, 0, 0], [0, 0, -1], [0, -1, 0]],
        [[-1, 0, 0], [0, 0, 1], [0, -1, 0]],
        [[0, 1, 0], [1, 0, 0], [0, 0, 1]],
        [[0, -1, 0], [1, 0, 0], [0, 0, -1]],
        [[0, 0, 1], [1, 0, 0], [0, -1, 0]],
        [[0, 0, -1], [-1, 0, 0], [0, -1, 0]],
    ],
    dtype=np.float64,
)
_MIN_FACE = 16  # pixels
_BLUR_ROWS = 96  # of the map that is convolved; the least lobe is several of its pixels wide
_MIN_ROUGHNESS = 0.1  # a lobe of which is narrower than those pixels


def face_size(image: Image) -> int:
    """Return the pixels of a face that holds a map's detail: half its rows, down to a power of two, 32 at least.

    Args:
        image: (H, 2H, 3).
    """
    return max(2 * _MIN_FACE, 1 << (len(image) // 2).bit_length() - 1)


def level_count(size: int) -> int:
    """Return how many levels there are down to faces of 16 pixels, which hold the roughest mirror's image.

    Args:
        size: of the first level's faces, pixels.
    """
    return size.bit_length() - _MIN_FACE.bit_length() + 1


def cubemap_directions(size: int) -> Floats:
    """Return the unit vectors (6, size, size, 3) of a cubemap's pixels.

    Args:
        size: of a face, pixels.
    """
    steps = (np.arange(size) + 0.5) * (2 / size) - 1
    middle, column, row = np.moveaxis(_AXES, 1, 0)[:, :, None, None, :]
    vectors = middle + steps[:, None] * column + steps[:, None, None] * row
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def to_cubemap(image: Image, size: int) -> Image:
    """Return the faces (6, size, size, 3) of a map.

    Args:
        image: (H, 2H, 3), linear radiance.
        size: of a face, pixels.
    """
    alike = shrink_envmap(image, 2 * size)  # to pixels of that size
    return np.asarray(sample_latlong(alike, cubemap_directions(size)), dtype=np.float32)


def prefilter_cubemap(image: Image, size: int, roughnesses: Sequence[float]) -> list[Image]:
    """Return what mirrors of several roughnesses show: the first of `size`, each further one of half the size [2].

    Args:
        image: (H, 2H, 3), linear radiance, without the sun's disc.
        size: of a face of the first, pixels; a power of two.
        roughnesses: one a level, 0 to 1; that of GGX is its square.
    """
    coarse = shrink_envmap(image, _BLUR_ROWS)
    levels = []
    for level, roughness in enumerate(roughnesses):
        sharp = roughness < _MIN_ROUGHNESS
        levels.append(to_cubemap(image if sharp else _blur_ggx(coarse, roughness**2), size >> level))
    return levels


def _blur_ggx(image: Image, alpha: float) -> Image:
    """The map as a rough mirror shows it whose normal looks along each direction, and along which one looks."""

    def lobe(cosine: Image) -> Image:
        half2 = (1 + cosine) / 2  # squared cosine of half the angle, that of the microfacet
        density = (half2 * np.float32(alpha**2 - 1) + 1) ** -2  # of GGX, at any scale
        return np.asarray(density * np.maximum(cosine, 0), dtype=np.float32)

    return convolve_envmap(image, lobe)

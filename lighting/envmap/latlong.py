"""Lat-long images: row weights, irradiance, resize, blur, remove sun; and their cubemaps.

Faces of a cubemap are in the order +X, -X, +Y, -Y, +Z, -Z, with the rows and columns of OpenGL's: seen from outside, as
all graphics interfaces have them. Mirror images at several roughnesses are those of GGX.

References:
    [1] Khronos, OpenGL 4.6, section 8.13, table 8.19.
    [2] Karis, Real Shading in Unreal Engine 4, SIGGRAPH 2013 course notes: the view is along the normal.
"""

import math
from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import SUN_RADIUS, Floats, angle_between, latlong_directions, latlong_solid_angle, sample_latlong

Image = NDArray[np.float32]

MAX_RADIANCE = 65280.0  # of what is painted: 255 x 256, the largest value of RGBE up to 65504, where half floats end
_BAND_PIXELS = 32  # rows or columns between few cells, that are interpolated at once
_BLOCK_PIXELS = 1 << 19  # of a map that are worked on at once, where much is computed of each
_MIN_WEIGHT = 1e-20  # of a cell in a blur: sums of floats do not show less
_BLOCK_STEP = 64  # columns of which blocks are multiples, so that products of matrices keep their bits

EPSILON_IRRADIANCE = 1e-12  # irradiance, radiance or exposure that stands for none in a divisor


@lru_cache(maxsize=16)
def row_irradiance(height: int) -> Floats:
    """Irradiance (H,) of level ground, facing up or down, by radiance 1 in each row of a map, to be read alone.

    Args:
        height: rows of the map.
    """
    edges = np.sin(np.linspace(-math.pi / 2, math.pi / 2, height + 1)) ** 2
    irradiance = np.abs(np.diff(edges)) * math.pi
    irradiance.setflags(write=False)
    return irradiance


def column_blocks(height: int, rows: int | None = None) -> list[slice]:
    """The columns of a map in blocks, so that what is computed of each takes little memory.

    Args:
        height: rows of the map.
        rows: of a strip of the map; None: all.
    """
    width = 2 * height
    most = min(_BLOCK_PIXELS // (rows or height), width)
    step = width if most == width else max(most // _BLOCK_STEP, 1) * _BLOCK_STEP
    return [slice(start, min(start + step, width)) for start in range(0, width, step)]


def irradiance_from_rows(levels: Floats, rows: Image) -> Floats:
    """Irradiance (3,) of level ground by some rows of a map.

    Args:
        levels: (R,) the `row_irradiance` of these rows.
        rows: (R, W, 3) linear radiance.
    """
    columns = np.einsum("r,rx->x", np.asarray(levels, dtype=np.float32), rows.reshape(len(rows), -1))
    return np.asarray(columns.reshape(-1, 3).mean(axis=0, dtype=np.float64))


def envmap_irradiance(image: Image, normals: Floats) -> Floats:
    """Irradiance (..., 3) under a map on surfaces of any orientation.

    Args:
        image: (H, 2H, 3) linear radiance.
        normals: (..., 3) unit vectors.
    """
    cosine = np.maximum(normals @ latlong_directions(len(image)).reshape(-1, 3).T, 0)
    weight = cosine * np.repeat(latlong_solid_angle(len(image)), 2 * len(image))
    return np.asarray(weight @ image.reshape(-1, 3) * np.pi / weight.sum(axis=-1, keepdims=True))


def remove_sun(envmap: Image, sun: Floats) -> tuple[Image, Floats]:
    """The map with the sky beside the sun painted over its disc, and the disc's irradiance (3,).

    With no pixel near it above the horizon, the map is returned as it is and the irradiance is 0.

    Args:
        envmap: (H, 2H, 3) linear radiance.
        sun: (3,) unit vector towards the sun.
    """
    height = len(envmap)
    row = int((0.5 - np.degrees(np.arcsin(sun[1])) / 180.0) * height)
    reach = SUN_RADIUS + 3 * 180.0 / height
    rows = slice(max(0, row - int(reach / 180 * height) - 2), row + int(reach / 180 * height) + 3)
    above = latlong_directions(height)[rows]
    distance = np.where(above[..., 1] > 0, angle_between(above, sun), 180.0)
    disc, ring = distance < reach - 180.0 / height, (distance >= reach - 180.0 / height) & (distance < 2 * reach)
    if not (disc.any() and ring.any()):
        return envmap, np.zeros(3)
    sky = envmap.copy()
    background = np.median(sky[rows][ring], axis=0)
    weight = np.broadcast_to(latlong_solid_angle(height)[rows, None], distance.shape)[disc]
    power = weight @ np.maximum(sky[rows][disc] - background, 0.0)
    sky[rows][disc] = background
    return sky, np.asarray(power, dtype=np.float64)


def shrink_envmap(image: Image, rows: int) -> Image:
    """A map reduced by area averages; unchanged if it has no more rows.

    Args:
        image: (H, 2H, C).
        rows: of the result.
    """
    return image if rows >= len(image) else shrink_axis(shrink_axis(image, 0, rows), 1, 2 * rows)


def shrink_axis(image: Image, axis: int, pixels: int) -> Image:
    """An image reduced by area averages along one of its axes.

    Args:
        image: (R, W, C).
        axis: 0 of rows, 1 of columns.
        pixels: of the result along it, up to those of the image.
    """
    size = image.shape[axis]
    blocks = math.gcd(pixels, size)  # that are reduced alike, and each by itself
    shares = _area_shares(pixels // blocks, size // blocks)
    before, after = image.shape[:axis], image.shape[axis + 1 :]
    parts = image.reshape(*before, blocks, size // blocks, -1)
    return np.asarray(shares @ parts).reshape(*before, pixels, *after)


@lru_cache(maxsize=16)
def _area_shares(fewer: int, pixels: int) -> Image:
    """How much (fewer, pixels) of each of the larger pixels each of the smaller ones fills; rows sum to 1."""
    edges = np.arange(fewer + 1) * (pixels / fewer)
    low, high = edges[:-1, None], edges[1:, None]
    start = np.arange(pixels)
    filled = np.clip(np.minimum(high, start + 1) - np.maximum(low, start), 0.0, None)
    shares = np.asarray(filled * (fewer / pixels), dtype=np.float32)
    shares.setflags(write=False)  # since others get them as well
    return shares


def blur_envmap(image: Image, concentration: float) -> Image:
    """The map (H, 2H, 3) as a lobe exp(concentration (cos - 1)) averages it in each direction.

    Args:
        image: (H, 2H, 3) linear radiance.
        concentration: over 0; the larger, the less blur.
    """
    return _convolve_envmap(image, lambda cosine: np.exp(np.float32(concentration) * (cosine - 1)))


def blur_cells(cells: Image, deg: float) -> Image:
    """Cells (R, 2R, C) of a map, blurred along both axes; columns wrap and rows end.

    Args:
        cells: (R, 2R, C).
        deg: standard deviation.
    """
    return np.moveaxis(blur_channels(np.moveaxis(cells, 2, 0), deg), 0, 2)


def blur_channels(channels: Image, deg: float, down_deg: float | None = None) -> Image:
    """Channels (C, r, 2R) of some rows of a map's cells, as `blur_cells`: each is two products of matrices.

    Args:
        channels: (C, r, 2R).
        deg: standard deviation along the rows.
        down_deg: along the columns; None: the same.
    """
    rows, columns = channels.shape[1:]
    down = _blur_matrix(rows, columns // 2, deg if down_deg is None else down_deg, False)
    across = _blur_matrix(columns, columns // 2, deg, True)
    used = channels.any(axis=(0, 1))  # columns: a photo's edges lie in a few
    part = np.ascontiguousarray(channels if used.all() else channels[..., used], dtype=np.float32)
    return np.asarray((down @ part) @ across[:, used].T, dtype=np.float32)


@lru_cache(maxsize=32)
def _blur_matrix(count: int, map_rows: int, deg: float, wraps: bool) -> Image:
    """Weights (count, count) of a normal distribution between cells; rows sum to 1."""
    index = np.arange(count)
    distance = np.abs(index[:, None] - index)
    distance = np.minimum(distance, count - distance) if wraps else distance
    weight = np.exp(-0.5 * (distance * (180.0 / map_rows) / deg) ** 2)
    weight[weight < _MIN_WEIGHT] = 0  # processors take thirty times as long with floats under 1e-38
    return np.asarray(weight / weight.sum(axis=1, keepdims=True), dtype=np.float32)


def _convolve_envmap(image: Image, lobe: Callable[[Image], Image]) -> Image:
    """The map (H, 2H, 3) as a lobe averages it in each direction.

    Args:
        image: (H, 2H, 3) linear radiance.
        lobe: weights of directions by the cosine of their angle to the lobe's middle, at any scale.
    """
    height = len(image)
    directions = latlong_directions(height).astype(np.float32)
    cosine = np.einsum("ri,kji->rkj", directions[:, 0], directions)  # of each row's first pixel with all
    weight = lobe(cosine) * latlong_solid_angle(height)[:, None].astype(np.float32)
    weight /= weight.sum(axis=(1, 2), keepdims=True)
    # all pixels of a row see the others alike, so that the mean is a convolution along the rows
    seen, shares = np.fft.rfft(image, axis=1), np.fft.rfft(weight, axis=2)
    blurred = np.fft.irfft(np.einsum("rkf,kfc->rfc", shares, seen), n=2 * height, axis=1)
    return np.asarray(blurred, dtype=np.float32)


def scale_colors(image: Image, gain: Floats, columns: slice | None = None) -> None:
    """Multiply an image by a color in place.

    Whole rows are multiplied, since numpy takes ten times as long with an innermost axis of 3.

    Args:
        image: (R, W, 3), contiguous in memory.
        gain: (3,).
        columns: of the image; None: all.
    """
    rows = image.reshape(len(image), -1)
    if columns is not None:
        rows = rows[:, 3 * columns.start : 3 * columns.stop]
    rows *= np.tile(np.asarray(gain, dtype=np.float32), rows.shape[1] // 3)


def multiply_cells(image: Image, cells: Image, first: int = 0) -> None:
    """Multiply rows of a map (R, 2H, 3), contiguous in memory, by cells (r, 2r, 3), linear between their centers.

    Columns wrap and rows end, at the horizon too. A few rows at once lie between few rows of cells, and only those
    count for them.

    Args:
        image: changed in place.
        cells: factors on a grid of the map's directions.
        first: of the map's rows that the image has.
    """
    rows, width = image.shape[:2]
    half, flat = width // 4, image.reshape(rows, -1)
    for start, part in zip((0, half), np.split(cells, 2), strict=True):
        top, bottom = max(first, start), min(first + rows, start + half)
        if top < bottom:
            wide, strip = widen_cells(part, width, slice(0, width)), flat[top - first : bottom - first]
            for band, near, shares in _interpolation_bands(half, len(part), False, top - start, bottom - start):
                strip[band] *= shares @ wide[near]


def widen_cells(cells: Image, width: int, columns: slice) -> Image:
    """Rows of cells (R, C, 3) in some columns of a map: (R, 3 c), linear between the cells' centers.

    Args:
        cells: on a grid of the map's directions, or of some of its rows.
        width: of the map, pixels.
        columns: of the map.
    """
    wide = np.empty((len(cells), columns.stop - columns.start, 3), np.float32)
    for band, near, shares in _interpolation_bands(width, cells.shape[1], True, columns.start, columns.stop):
        np.matmul(shares, cells[:, near], out=wide[:, band])
    return wide.reshape(len(cells), -1)


def cell_bands(
    height: int, rows: int, first: int = 0, count: int | None = None
) -> list[tuple[slice, slice, NDArray[np.float32]]]:
    """Bands of few rows of a map, none on both sides of its horizon, that lie between few rows of cells.

    Each has its rows, the rows of cells that count for it, and their shares (band, cells) in its rows.

    Args:
        height: rows of the map.
        rows: of the cells.
        first: of the map's rows that count, a multiple of a band's rows from the horizon or the top.
        count: of these rows; None: all.
    """
    middle, end = height // 2, height if count is None else first + count
    halves = ((max(first, start), min(end, stop)) for start, stop in ((0, middle), (middle, height)))
    return [
        (slice(band.start + start, band.stop + start), near, shares)
        for start, stop in halves
        if start < stop
        for band, near, shares in _interpolation_bands(height, rows, False, start, stop)
    ]


@lru_cache(maxsize=64)
def _interpolation_bands(
    pixels: int, cells: int, wraps: bool, start: int, stop: int
) -> list[tuple[slice, slice, NDArray[np.float32]]]:
    """Some rows or columns in bands: where each is, which cells count for it, and their shares in its pixels.

    Pixels lie between the cells on either side of them; beyond the ends these wrap or end.

    Args:
        pixels: rows or columns of the map.
        cells: rows or columns of cells.
        wraps: True of columns.
        start: of the pixels; bands are counted from it.
        stop: of the pixels.
    """
    position = (np.arange(start, stop) + 0.5) * cells / pixels - 0.5
    low, weights = np.floor(position).astype(np.intp), np.zeros((stop - start, cells), np.float32)
    for cell, share in ((low, 1 - (position - low)), (low + 1, position - low)):
        inside = cell % cells if wraps else np.clip(cell, 0, cells - 1)
        weights[np.arange(len(low)), inside] += np.asarray(share, dtype=np.float32)
    weights.setflags(write=False)  # since others get them as well
    starts = np.arange(0, len(weights), _BAND_PIXELS)
    counts = np.add.reduceat(weights, starts, axis=0) > 0  # which cells (bands, cells) do
    first, end = counts.argmax(axis=1).tolist(), (cells - counts[:, ::-1].argmax(axis=1)).tolist()
    bands = [slice(start, min(start + _BAND_PIXELS, len(weights))) for start in starts.tolist()]
    return [(band, slice(a, b), weights[band, a:b]) for band, a, b in zip(bands, first, end, strict=True)]


# Cubemaps.

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


def to_cubemap(image: Image, size: int) -> Image:
    """Return the faces (6, size, size, 3) of a map.

    Args:
        image: (H, 2H, 3), linear radiance.
        size: of a face, pixels.
    """
    alike, steps = shrink_envmap(image, 2 * size), (np.arange(size) + 0.5) * (2 / size) - 1  # to pixels of that size
    middle, column, row = np.moveaxis(_AXES, 1, 0)[:, :, None, None, :]
    vectors = middle + steps[:, None] * column + steps[:, None, None] * row
    directions = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(sample_latlong(alike, directions), dtype=np.float32)


def prefilter_cubemap(image: Image, size: int, roughnesses: Sequence[float]) -> list[Image]:
    """Return what mirrors of several roughnesses show: the first of `size`, each further one of half the size [2].

    Args:
        image: (H, 2H, 3), linear radiance, without the sun's disc.
        size: of a face of the first, pixels; a power of two.
        roughnesses: one a level, 0 to 1; that of GGX is its square.
    """
    coarse = shrink_envmap(image, _BLUR_ROWS)
    seen = (image if roughness < _MIN_ROUGHNESS else _blur_ggx(coarse, roughness**2) for roughness in roughnesses)
    return [to_cubemap(shown, size >> level) for level, shown in enumerate(seen)]


def _blur_ggx(image: Image, alpha: float) -> Image:
    """The map as a rough mirror shows it whose normal looks along each direction, and along which one looks."""

    def lobe(cosine: Image) -> Image:
        half2 = (1 + cosine) / 2  # squared cosine of half the angle, that of the microfacet
        density = (half2 * np.float32(alpha**2 - 1) + 1) ** -2  # of GGX, at any scale
        return np.asarray(density * np.maximum(cosine, 0), dtype=np.float32)

    return _convolve_envmap(image, lobe)

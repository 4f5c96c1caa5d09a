"""A probe's picture as a lat-long map, with as much light in every direction as the picture has.

The sun may be smaller than a pixel: pictures finer than the map are averaged before, and each pixel of the map is the
mean of several samples, so that the sum of radiance x solid angle survives.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats, direction
from lighting.probe.lens import Lens, lens_pixels, pixels_per_degree
from lighting.probe.regions import Mask

_MOST_SAMPLES, _MOST_SAMPLES_OF_SMALL = 4, 6  # per side of a pixel, of maps from and under
_SMALL = 256  # rows
_FINER = 1.5  # times finer than the map a picture stays at least
_TOUCHED = 1e-3  # of a map's pixel covered by clipped pixels: even the smallest sun in the largest pixel is more
_ROWS = 16  # mapped at once


def to_latlong(
    radiance: NDArray[np.float32], clipped: Mask, lens: Lens, rotation: Floats, height: int
) -> tuple[NDArray[np.float32], Mask]:
    """Map (H, 2H, 3) and its clipped pixels (H, 2H) of a picture (h, w, 3) and its clipped pixels (h, w).

    `rotation` (3, 3) takes directions of the camera to directions of the world. What the lens does not show is 0.
    """
    picture = np.concatenate([radiance, clipped[..., None].astype(np.float32)], axis=-1)
    picture, lens = _averaged(picture, lens, height)
    most = _MOST_SAMPLES_OF_SMALL if height < _SMALL else _MOST_SAMPLES
    samples = int(np.clip(np.ceil(2 * pixels_per_degree(lens) * 180.0 / height), 2, most))
    result = np.empty((height, 2 * height, 4), dtype=np.float32)
    for start in range(0, height, _ROWS):
        rows = np.arange(start, min(start + _ROWS, height))
        result[rows] = _mapped_rows(picture, lens, rotation, height, samples, rows)
    return result[..., :3], result[..., 3] >= _TOUCHED


def _mapped_rows(
    picture: Floats, lens: Lens, rotation: Floats, height: int, samples: int, rows: NDArray[np.intp]
) -> Floats:
    """Some rows (R, 2H, C) of a map, the mean of `samples` samples each way of every pixel of a picture (h, w, C)."""
    within = (np.arange(samples) + 0.5) / samples
    elevation = 90.0 - (rows[:, None] + within).reshape(-1) * 180.0 / height
    azimuth = ((np.arange(2 * height)[:, None] + within).reshape(-1) / height - 1) * 180.0
    towards = direction(azimuth[None, :], elevation[:, None])
    values = bilinear(picture, lens_pixels(lens, towards @ rotation), wrap=lens.kind == "latlong")
    return np.asarray(values.reshape(len(rows), samples, 2 * height, samples, -1).mean(axis=(1, 3)))


def bilinear(picture: Floats, pixels: Floats, *, wrap: bool = False) -> Floats:
    """Samples (..., C) of a picture (h, w, C) at continuous coordinates (..., 2) as (x, y); 0 where they are NaN.

    Beyond the outermost centres the edge goes on, or with `wrap` the other side begins.
    """
    height, width = picture.shape[:2]
    seen = np.asarray(np.isfinite(pixels).all(axis=-1))
    if not seen.any():
        return np.zeros((*pixels.shape[:-1], picture.shape[-1]), dtype=np.float32)
    at = np.where(seen[..., None], pixels, 0.0) - 0.5
    corner = np.floor(at)
    share = (at - corner).astype(np.float32)
    x0, y0 = corner[..., 0].astype(np.intp), corner[..., 1].astype(np.intp)
    total = np.zeros((*pixels.shape[:-1], picture.shape[-1]), dtype=np.float32)
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        column = np.mod(x0 + dx, width) if wrap else np.clip(x0 + dx, 0, width - 1)
        weight = np.abs(1 - dx - share[..., 0]) * np.abs(1 - dy - share[..., 1])
        total += weight[..., None] * picture[np.clip(y0 + dy, 0, height - 1), column]
    return np.where(seen[..., None], total, 0)


def _averaged(picture: Floats, lens: Lens, height: int) -> tuple[Floats, Lens]:
    """The picture and its lens, averaged over whole squares of pixels until it is not much finer than the map."""
    factor = int(pixels_per_degree(lens) * 180.0 / height / _FINER)
    if lens.kind == "latlong":
        factor = next((f for f in range(factor, 1, -1) if lens.height % f == 0), 1)
    if factor < 2:
        return picture, lens
    rows, columns = (-(-size // factor) for size in picture.shape[:2])
    padding = [(0, rows * factor - lens.height), (0, columns * factor - lens.width), (0, 0)]
    blocks = np.pad(picture, padding).reshape(rows, factor, columns, factor, -1)
    centre = (lens.centre[0] / factor, lens.centre[1] / factor)
    small = replace(lens, width=columns, height=rows, centre=centre, radius=lens.radius / factor)
    return blocks.mean(axis=(1, 3)), small

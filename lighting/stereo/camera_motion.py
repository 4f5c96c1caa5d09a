"""Whether the camera moved between photos of a day, by phase correlation of their edges."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lighting.errors import PhotoError
from lighting.geometry import Floats

Pixels = NDArray[np.float32]
_Spectrum = NDArray[np.complexfloating]

_COMPARED_SIDE = 256  # pixels, of the pictures compared
_MAX_SHIFT = 0.012  # of the picture's longer side, from where on the camera counts as moved
_MIN_PEAK_RATIO = 2.0  # times as high as at no shift, what the best shift must correlate


def check_static_camera(images: Pixels, names: Sequence[str]) -> None:
    """PhotoError where a photo of several (T, H, W) fits the one before it better when shifted.

    Edges are compared by phase correlation (Kuglin and Hines, 1975); only a shift that fits far better counts, since
    shadows move too.

    Args:
        images: (T, H, W), linear.
        names: of the photos.
    """
    spectra = [_edge_spectrum(_shrink_image(image)) for image in images]
    for name, pair in zip(names[1:], pairwise(spectra), strict=True):
        if (shift := _measure_shift(*pair)) > _MAX_SHIFT:
            raise PhotoError(f"{name} is shifted by {100 * shift:.1f} % of its size; the camera must not move.")


_TILES = 4  # each way, that are compared by themselves
_TILE_REACH = 12  # pixels that a tile is looked for, at most a quarter of it
_MIN_TILE = 24  # pixels, of a tile's side
_MIN_TILE_PEAK = 0.1  # of the correlation of a tile with itself, for a shift that counts
_MIN_TILES = 4  # that must show a clear shift
_MIN_AGREEMENT = 0.7  # of these, that show the same one
_MIN_SHIFT = 0.7  # pixels, from where on a small move is told


def moved_names(images: Pixels, names: Sequence[str]) -> list[str]:
    """Names of photos that are shifted by a pixel or more against the one before them.

    Args:
        images: (T, H, W), linear.
        names: of the photos.
    """
    moved = []
    tiles = [[_edge_spectrum(tile) for tile in _cut_tiles(image)] for image in images]
    for name, (before, after) in zip(names[1:], pairwise(tiles), strict=True):
        found = (_tile_shift(*pair) for pair in zip(after, before, strict=True))
        shifts = np.array([shift for shift in found if shift is not None])
        if len(shifts) < _MIN_TILES:
            continue
        middle = np.median(shifts, axis=0)
        agree = np.mean(np.hypot(*(shifts - middle).T) <= 1)
        if np.hypot(*middle) >= _MIN_SHIFT and agree >= _MIN_AGREEMENT:
            moved.append(name)
    return moved


def _cut_tiles(image: Pixels) -> list[Pixels]:
    """The tiles (h, w) of a picture (H, W); none where they would be too small."""
    rows, columns = (side // _TILES for side in image.shape)
    if min(rows, columns) < _MIN_TILE:
        return []
    corners = [(row * rows, column * columns) for row in range(_TILES) for column in range(_TILES)]
    return [image[top : top + rows, left : left + columns] for top, left in corners]


def _tile_shift(a: _Spectrum, b: _Spectrum) -> tuple[int, int] | None:
    """How far [pixels, down and right] the first of two tiles is shifted, by their spectra; None where unclear."""
    peak = _correlate_phase(a, b)
    reach = min(_TILE_REACH, min(peak.shape) // 4)
    near = np.roll(peak, (reach, reach), axis=(0, 1))[: 2 * reach + 1, : 2 * reach + 1]
    row, column = np.unravel_index(int(near.argmax()), near.shape)
    return (int(row) - reach, int(column) - reach) if near[row, column] > _MIN_TILE_PEAK else None


def _correlate_phase(a: _Spectrum, b: _Spectrum) -> Floats:
    """Phase correlation (H, W), 1 at most, of two pictures by the spectra of their edges."""
    cross = a * np.conj(b)
    return np.asarray(np.fft.ifft2(cross / np.maximum(np.abs(cross), 1e-12)).real)


def _shrink_image(image: Pixels) -> Pixels:
    factor = max(1, max(image.shape) // _COMPARED_SIDE)
    height, width = (side // factor for side in image.shape)
    blocks = image[: height * factor, : width * factor].reshape(height, factor, width, factor)
    return np.asarray(blocks.mean(axis=(1, 3)))


def _edge_spectrum(image: Pixels) -> _Spectrum:
    """The spectrum of a picture's edges, whatever their sense, faded out towards the border."""
    edges = np.hypot(*np.gradient(np.log(image + 0.01 * image.mean() + 1e-6)))
    edges = np.minimum(edges, np.quantile(edges, 0.98))
    window = np.hanning(edges.shape[0])[:, None] * np.hanning(edges.shape[1])[None, :]
    return np.asarray(np.fft.fft2((edges - edges.mean()) * window))


def _measure_shift(a: _Spectrum, b: _Spectrum) -> float:
    """How far the second picture is shifted against the first, by their spectra; 0 where unclear.

    As a share of the longer side.
    """
    peak = _correlate_phase(a, b)
    row, column = np.unravel_index(int(peak.argmax()), peak.shape)
    height, width = peak.shape
    down, right = min(row, height - row), min(column, width - column)
    unshifted = max(peak[0, 0], peak[0, 1], peak[1, 0], peak[0, -1], peak[-1, 0])
    is_clear = peak[row, column] > _MIN_PEAK_RATIO * max(unshifted, 0.02)
    return float(np.hypot(down, right) / max(height, width)) if is_clear else 0.0

"""Whether a camera stood still, from its photos alone."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.errors import PhotoError

Image = NDArray[np.float32]

_SIDE = 256  # pixels, of the pictures compared
_MOVED = 0.012  # of the picture's longer side, from where on the camera counts as moved
_CLEARER = 2.0  # times as high as at no shift, what the best shift must correlate


def check_still(images: Image, names: list[str]) -> None:
    """PhotoError where a photo of several (T, H, W) fits the one before it better when shifted by _MOVED or more.

    Edges are compared by phase correlation (Kuglin and Hines, 1975); only a shift that fits far better counts, since
    shadows move too.
    """
    spectra = [_edges(_small(image)) for image in images]
    for index in range(1, len(spectra)):
        shift = _shift(spectra[index - 1], spectra[index])
        if shift > _MOVED:
            percent = 100 * shift
            raise PhotoError(f"{names[index]} is shifted by {percent:.1f} % of its size; the camera must not move.")


def _small(image: Image) -> Image:
    factor = max(1, max(image.shape) // _SIDE)
    height, width = (side // factor for side in image.shape)
    cut = image[: height * factor, : width * factor]
    return np.asarray(cut.reshape(height, factor, width, factor).mean(axis=(1, 3)))


def _edges(image: Image) -> NDArray[Any]:
    """The spectrum of a picture's edges, whatever their sense, faded out towards the border."""
    level = np.log(image + 0.01 * image.mean() + 1e-6)
    down, right = np.gradient(level)
    edges = np.hypot(down, right)
    edges = np.minimum(edges, np.quantile(edges, 0.98))
    window = np.hanning(edges.shape[0])[:, None] * np.hanning(edges.shape[1])[None, :]
    return np.asarray(np.fft.fft2((edges - edges.mean()) * window))


def _shift(a: NDArray[Any], b: NDArray[Any]) -> float:
    """How far the second picture is shifted against the first, as a share of the longer side; 0 where unclear."""
    cross = a * np.conj(b)
    peak = np.fft.ifft2(cross / np.maximum(np.abs(cross), 1e-12)).real
    row, column = np.unravel_index(int(peak.argmax()), peak.shape)
    height, width = peak.shape
    down, right = min(row, height - row), min(column, width - column)
    here = max(peak[0, 0], peak[0, 1], peak[1, 0], peak[0, -1], peak[-1, 0])
    clear = peak[row, column] > _CLEARER * max(here, 0.02)
    return float(np.hypot(down, right) / max(height, width)) if clear else 0.0

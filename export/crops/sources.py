"""Panoramas in memory, from which crops are taken, and how often each is drawn."""

import math
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from export.crops.stretch import NOT_STRETCHED, Stretch
from export.data import Label, Panorama, labels_of, read_picture
from lighting.geometry import Floats, angles, direction

FEWEST_ROWS = 192  # of the smallest level


@dataclass(frozen=True)
class Source:
    """A panorama with its label, at several resolutions, so that wide crops do not alias."""

    panorama: Panorama
    levels: tuple[NDArray[Any], ...]  # (H, 2H, 3), (H/2, H, 3), ...; uint8 sRGB or float32 linear
    label: Label
    stretch: Stretch = NOT_STRETCHED  # of the world that the crops show


def load_sources(panoramas: Sequence[Panorama], labels: str | Path) -> list[Source]:
    """Panoramas with their labels, which are read from a file; DataError if a label is missing."""
    known = labels_of(panoramas, labels)
    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(load_source, panoramas, known))


def load_source(panorama: Panorama, label: Label) -> Source:
    """Read a panorama and halve it repeatedly, down to FEWEST_ROWS or a little more."""
    levels = [read_picture(panorama)]
    while levels[-1].shape[0] >= 2 * FEWEST_ROWS:
        levels.append(_halve(levels[-1]))
    return Source(panorama, tuple(levels), label)


def stretched(source: Source, stretch: Stretch) -> Source:
    """A panorama whose world is stretched, and its sun with it; the sky fitted around its own sun is unknown."""
    if stretch == NOT_STRETCHED:
        return source
    label = replace(source.label, fit_ok=False)
    if math.isfinite(label.sun_azimuth):
        azimuth, elevation = angles(stretch.applied(direction(label.sun_azimuth, label.sun_elevation)))
        label = replace(label, sun_azimuth=float(azimuth), sun_elevation=float(elevation))
    return replace(source, label=label, stretch=stretch)


def _halve(image: NDArray[Any]) -> NDArray[Any]:
    height, width = image.shape[0] // 2, image.shape[1] // 2
    mean = image[: 2 * height, : 2 * width].reshape(height, 2, width, 2, 3).mean(axis=(1, 3), dtype=np.float32)
    return np.asarray(np.round(mean).astype(np.uint8) if image.dtype == np.uint8 else mean)


def sampling_weights(sources: Sequence[Source]) -> Floats:
    """Chances (N,) of drawing each panorama: places count by the root of their size, rare sun elevations more."""
    places = Counter(s.panorama.place for s in sources)
    size = np.array([places[s.panorama.place] for s in sources], dtype=np.float64)
    elevation = np.array([s.label.sun_elevation for s in sources])
    bins = np.where(np.isfinite(elevation), np.nan_to_num(np.maximum(elevation, 0)) // 15, -1)
    crowd = np.array([np.count_nonzero(bins == b) for b in bins], dtype=np.float64)
    weight = size**-0.5 * crowd**-0.75
    return np.asarray(weight / max(weight.sum(), 1e-12))

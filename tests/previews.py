"""A grey photo and its light, to be drawn."""

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.drawing import SUN
from lighting.envmap import render
from lighting.geometry import Floats
from lighting.records import Estimate, Lighting, SunDistribution

Bytes = NDArray[np.uint8]

GRID = "fibonacci:256"
GREY = 110


def outdoors(azimuth: float = 150.0, elevation: float = 40.0, **others: Any) -> Lighting:
    return Lighting(azimuth, elevation, 3.0, 5.0, **others)


def photo(width: int, height: int) -> Bytes:
    return np.full((height, width, 3), GREY, dtype=np.uint8)


def distribution(probability: Floats | None = None, grid: str = GRID) -> SunDistribution:
    """A probability on a grid, by default an even one."""
    even = np.full(256, 1 / 256)
    return SunDistribution(grid, np.asarray(even if probability is None else probability, dtype=np.float32))


def estimate(lighting: Lighting, probability: Floats | None = None) -> Estimate:
    return Estimate(lighting, distribution(probability))


@lru_cache
def small_map(lighting: Lighting) -> NDArray[np.float32]:
    return render(lighting, 64)


def amber(panel: NDArray[np.int64]) -> NDArray[np.intp]:
    """Rows and columns of the pixels in the sun's colour."""
    return np.argwhere(np.abs(panel - np.array(SUN)).max(axis=-1) < 8)

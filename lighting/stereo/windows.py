"""Windows of a day and what they are worth for given orientations."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats
from lighting.stereo.days import DAY, Day
from lighting.stereo.gain import angular_spread, gain_of, window_inverses

START_STEP = 15.0  # min between the starts of windows
SHORTEST = 30.0  # min
_CHUNK = 1 << 16  # matrices held at once: what of them is summed stays in a processor's cache


@dataclass(frozen=True)
class Windows:
    """W windows of a day, each with the same number of photos."""

    start: Floats  # (W,) min since midnight
    end: Floats  # (W,)
    moments: NDArray[np.intp]  # (K, W, shots), the photos' moments in the day's light, under each draw of the clouds

    def __len__(self) -> int:
        return len(self.start)


@dataclass(frozen=True)
class Worth:
    """Medians (W,) over orientations and draws of the clouds, per unit of the skies' radiance; inf where hopeless."""

    spread: Floats  # of `angular_spread`: expected turn of the normal [rad] per unit of noise
    gain: Floats  # of lambda_max


def windows_of(day: Day, hours: float, shots: int) -> Windows:
    """The windows of one length that start on quarters of an hour and lie in light."""
    start = np.arange(0.0, DAY - 60 * hours + 1e-6, START_STEP)
    return _in_light(day, start, start + 60 * hours, shots)


def all_windows(day: Day, shots: int, step: float) -> Windows:
    """The windows that start and end on multiples of `step` minutes, SHORTEST or longer, and lie in light."""
    grid = np.arange(0.0, DAY + 1e-6, step)
    start, end = (side.ravel() for side in np.meshgrid(grid, grid, indexing="ij"))
    long = end - start >= SHORTEST
    return _in_light(day, start[long], end[long], shots)


def worth(windows: Windows, light: Floats, normals: Floats) -> Worth:
    """What windows are worth for normals (N, 3) with a day's mean light vectors (N, moments, 3)."""
    draws, count = len(windows.moments), len(normals)
    step = max(1, _CHUNK // (draws * count))
    parts = [_worth(windows.moments[:, i : i + step], light, normals) for i in range(0, len(windows), step)]
    empty = np.empty(0)
    return Worth(*(np.concatenate([empty, *(getattr(part, name) for part in parts)]) for name in ("spread", "gain")))


def _worth(moments: NDArray[np.intp], light: Floats, normals: Floats) -> Worth:
    inverses = window_inverses(light, moments)
    spread, gain = angular_spread(inverses, normals[:, None, None]), gain_of(inverses).max(axis=-1)
    return Worth(np.median(spread, axis=(0, 1)), np.median(gain, axis=(0, 1)))


def _in_light(day: Day, start: Floats, end: Floats, shots: int) -> Windows:
    moments, reached = day.moments(start, end, shots)
    return Windows(start[reached], end[reached], moments[:, reached])

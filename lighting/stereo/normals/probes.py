"""Measured skies at the moments of photos."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.errors import EnvironmentMapError
from lighting.stereo.mean_light import Skies
from lighting.stereo.probes import LONGEST_GAP, files_of, read_skies


def nearest_skies(folder: Path, times: NDArray[np.datetime64], utc_offset: float) -> Skies:
    """The probes nearest to times (T,) in UTC; folders without a time in their maps are named `utc_offset` [h] from it.

    Raises EnvironmentMapError where a photo has none within half of LONGEST_GAP.
    """
    local = times + np.timedelta64(round(3600 * utc_offset), "s")
    return read_skies([_nearest(folder, time, utc_offset) for time in local])


def _nearest(folder: Path, time: Any, utc_offset: float) -> Path:
    day = time.astype("datetime64[D]")
    minutes = float((time - day) / np.timedelta64(1, "m"))
    files = files_of(folder, day.item(), utc_offset)
    moment = min(files, key=lambda filed: abs(filed - minutes), default=None)
    if moment is None or abs(moment - minutes) > LONGEST_GAP / 2:
        raise EnvironmentMapError(f"{folder} holds no sky probe within {LONGEST_GAP / 2:g} minutes of {time.item()}.")
    return files[moment]

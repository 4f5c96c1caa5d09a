"""A sky model as a contributor writes one: brighter to the east of the camera than to the west."""

import numpy as np
from numpy.typing import ArrayLike

from lighting.geometry import Floats
from lighting.sky import SkyModel, Weather


def eastern_luminance(direction: ArrayLike, _sun_direction: ArrayLike, weather: Weather) -> Floats:
    """Luminance (...) along unit vectors (..., 3); 0 below the horizon."""
    x, y, _ = np.moveaxis(np.asarray(direction, dtype=float), -1, 0)
    return np.where(y > 0, weather.turbidity + x, 0.0)


EASTERN = SkyModel(eastern_luminance)

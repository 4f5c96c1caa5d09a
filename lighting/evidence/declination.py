"""Magnetic declination: how far a compass needle points from true north, by the World Magnetic Model."""

import threading
from datetime import datetime
from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pygeomag import GeoMag

TYPICAL_DECLINATION = 17.0  # deg, root mean square over the latitudes up to 65 deg in 2022

_EPOCHS = (2010, 2015, 2020, 2025)  # each model holds for five years
_CALCULATING = threading.Lock()  # a model stores intermediate values in itself, so threads must take turns
_WEAK = 6000.0  # nT of horizontal field, under which the model's authors call compasses unreliable


def magnetic_declination(latitude: float, longitude: float, time: datetime) -> float | None:
    """Declination [deg, positive east] at sea level; None before 2010, from 2030 on, and near the magnetic poles."""
    epoch = time.year - time.year % 5
    if epoch not in _EPOCHS:
        return None
    year = time.year + (time.timetuple().tm_yday - 1) / 366
    with _CALCULATING:
        field = _model(epoch).calculate(glat=latitude, glon=longitude, alt=0.0, time=year)
    return float(field.d) if field.h >= _WEAK else None


@lru_cache(maxsize=len(_EPOCHS))
def _model(epoch: int) -> "GeoMag":
    from pygeomag import GeoMag

    return GeoMag(base_year=epoch)

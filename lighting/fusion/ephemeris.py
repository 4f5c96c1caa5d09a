"""The sun at a photo's place at the instants at which it may have been taken."""

from collections.abc import Sequence

import numpy as np

from lighting.fusion.instants import Instant
from lighting.geometry import SUN_RADIUS
from lighting.solar_position import ASTRONOMICAL_TWILIGHT, CIVIL_TWILIGHT, NAUTICAL_TWILIGHT, sun_position

Location = tuple[float, float]  # latitude and longitude, deg, positive north and east


def sun_candidates(instants: Sequence[Instant], location: Location | None) -> tuple[tuple[float, float], ...]:
    """Elevations and compass azimuths [deg] of the sun, one for each instant.

    Args:
        instants: at which the photo may have been taken.
        location: where; without it there are no candidates.
    """
    if location is None or not instants:
        return ()
    azimuth, elevation = sun_position(_utc_times(instants), *location)
    return tuple(zip(elevation.tolist(), azimuth.tolist(), strict=True))


def _utc_times(instants: Sequence[Instant]) -> "np.ndarray[tuple[int], np.dtype[np.datetime64]]":
    return np.array([instant.utc_time.replace(tzinfo=None) for instant in instants], dtype="datetime64[us]")


def format_below_horizon(instants: Sequence[Instant], location: Location | None, elevation: float) -> str:
    """Write the beginning of an error about a sun below the horizon.

    Args:
        instants: at which the photo may have been taken.
        location: where.
        elevation: deg, the highest possible of the sun, negative.
    """
    phase = _phase(elevation, _is_polar_night(instants, location))
    return (
        f"At that time and place the sun is {-elevation:.1f}° below the horizon ({phase}; civil twilight ends at 6°): "
    )


def format_low_sun(elevation: float) -> str:
    """Write the beginning of a warning about a sun below the horizon.

    Args:
        elevation: deg, of the sun, negative.
    """
    return f"The sun is {-elevation:.1f}° below the horizon ({_phase(elevation, polar=False)})"


def _phase(elevation: float, polar: bool) -> str:
    if elevation < ASTRONOMICAL_TWILIGHT:
        return "polar night" if polar else "night"
    kind = "civil" if elevation >= CIVIL_TWILIGHT else "nautical" if elevation >= NAUTICAL_TWILIGHT else "astronomical"
    return f"{kind} twilight of the polar night" if polar else f"{kind} twilight"


def _is_polar_night(instants: Sequence[Instant], location: Location | None) -> bool:
    if location is None or not instants:
        return False
    day = _utc_times(instants)[:1] + np.arange(-12, 13).astype("timedelta64[h]")
    return bool(np.max(sun_position(day, *location)[1]) < -SUN_RADIUS)

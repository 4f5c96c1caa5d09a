"""The sun's position by a photo's time and place, and words for a sun below the horizon."""

from datetime import timedelta

import numpy as np
from numpy.typing import NDArray

from lighting.evidence.ephemeris import ASTRONOMICAL_TWILIGHT, CIVIL_TWILIGHT, NAUTICAL_TWILIGHT, sun_position
from lighting.evidence.facts import location_of, zones
from lighting.geometry import SUN_RADIUS
from lighting.photo import PhotoFacts


def suns(facts: PhotoFacts) -> tuple[tuple[float, float], ...]:
    """Elevations and compass azimuths [deg]: one for a time in UTC, one per possible zone for a local time."""
    if (place := location_of(facts)) is None:
        return ()
    azimuth, elevation = sun_position(_times(facts, place), *place)
    return tuple(zip(elevation.tolist(), azimuth.tolist(), strict=True))


def _times(facts: PhotoFacts, place: tuple[float, float]) -> NDArray[np.datetime64]:
    """The moments (N,) in UTC at which the photo may have been taken, in the order of the zones."""
    if facts.utc_time is not None:
        return np.array([facts.utc_time.replace(tzinfo=None)], dtype="datetime64[us]")
    if facts.local_time is None:
        return np.array([], dtype="datetime64[us]")
    return np.array([facts.local_time - timedelta(hours=zone) for zone in zones(*place)], dtype="datetime64[us]")


def below_horizon(facts: PhotoFacts, highest: float) -> str:
    """The beginning of a sentence about a sun whose highest possible elevation [deg] is negative."""
    return (
        f"At that time and place the sun is {-highest:.1f}° below the horizon ({_phase(highest, facts)}; civil "
        "twilight ends at 6°, nautical at 12°, astronomical at 18°): "
    )


def _phase(elevation: float, facts: PhotoFacts) -> str:
    polar = _is_polar_night(facts)
    if elevation < ASTRONOMICAL_TWILIGHT:
        return "polar night" if polar else "night"
    kind = "civil" if elevation >= CIVIL_TWILIGHT else "nautical" if elevation >= NAUTICAL_TWILIGHT else "astronomical"
    return f"{kind} twilight of the polar night" if polar else f"{kind} twilight"


def _is_polar_night(facts: PhotoFacts) -> bool:
    if (place := location_of(facts)) is None:
        return False
    around = _times(facts, place)[:1] + np.arange(-12, 13).astype("timedelta64[h]")
    return bool(np.max(sun_position(around, *place)[1]) < -SUN_RADIUS)

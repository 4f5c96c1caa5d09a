"""Days to photograph: a place, a date, the hours, the sky and how the camera stands."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats
from lighting.stereo.mean_light import Skies
from lighting.stereo.normals.frame import Pose
from lighting.stereo.skies import TURBIDITY, clear_skies, suns_at

HELD_OUT_LATITUDES = ((33.0, 37.0), (45.0, 49.0))  # deg; training days are elsewhere
IMAGES = 8

_LOWEST_SUN = 5.0  # deg, of the images that training draws
_SOUTHERNMOST, _NORTHERNMOST = -60.0, 62.0  # deg


@dataclass(frozen=True)
class Day:
    """When, where and under what a thing is photographed."""

    times: NDArray[np.datetime64]  # (T,), UTC
    latitude: float  # deg
    longitude: float = 0.0  # deg
    turbidity: float = TURBIDITY
    ground_albedo: float = 0.3
    pose: Pose = field(default_factory=Pose)

    def suns(self) -> Floats:
        """Unit vectors (T, 3) to the sun in world axes."""
        return suns_at(self.times, self.latitude, self.longitude)

    def skies(self, height: int = 64) -> Skies:
        """Its clear skies."""
        return clear_skies(self.suns(), self.turbidity, self.ground_albedo, height)


def hours_of(date: str, hours: Floats) -> NDArray[np.datetime64]:
    """UTC times (T,) of hours (T,) of a date such as 2024-03-21."""
    seconds = np.round(np.asarray(hours, dtype=np.float64) * 3600).astype("timedelta64[s]")
    return np.datetime64(date, "s") + seconds


def random_day(rng: np.random.Generator) -> Day:
    """A training day of 3 to 8 images over some hours, all with the sun well above the horizon."""
    while True:
        day = _draw(rng)
        elevation = np.degrees(np.arcsin(day.suns()[:, 1]))
        if elevation.min() > _LOWEST_SUN:
            return day


def _draw(rng: np.random.Generator) -> Day:
    count = IMAGES if rng.random() < 0.7 else int(rng.integers(3, IMAGES + 1))
    hours = np.linspace(rng.uniform(7.5, 10.5), rng.uniform(13.5, 16.5), count) + rng.normal(0, 0.1, count)
    date = np.datetime64("2024-01-01") + rng.integers(366).astype("timedelta64[D]")
    latitude = rng.uniform(_SOUTHERNMOST, _NORTHERNMOST)
    while any(low <= abs(latitude) <= high for low, high in HELD_OUT_LATITUDES):
        latitude = rng.uniform(_SOUTHERNMOST, _NORTHERNMOST)
    sunny = 0.0 if latitude > 0 else 180.0  # the camera that sees the lit side looks to the pole
    heading = sunny + rng.normal(0, 40) if rng.random() < 0.6 else rng.uniform(0, 360)
    pose = Pose(heading, rng.normal(0, 10) if rng.random() < 0.5 else 0.0)
    turbidity, ground = rng.uniform(2, 7), rng.uniform(0.1, 0.4)
    return Day(hours_of(str(date), hours), latitude, turbidity=turbidity, ground_albedo=ground, pose=pose)


def believed(day: Day, rng: np.random.Generator) -> Day:
    """What who photographs knows of a day: at times all of it, at times a wrong heading, clock, haze or ground."""
    if rng.random() < 0.4:
        return day
    heading = day.pose.heading + rng.normal(0, 1.5)
    late = np.round(rng.normal(0, 120)).astype("timedelta64[s]")
    turbidity = float(np.clip(day.turbidity + rng.normal(0, 0.8), 1.5, 9))
    pose = replace(day.pose, heading=heading)
    return replace(day, times=day.times + late, turbidity=turbidity, ground_albedo=0.3, pose=pose)

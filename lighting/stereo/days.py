"""The light of one day as a plan reads it: moments, and mean light vectors of any normal at each of them."""

from dataclasses import dataclass
from datetime import date
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from lighting.colour import LUMINANCE_WEIGHTS
from lighting.errors import ParameterError
from lighting.stereo.mean_light import Skies, illumination
from lighting.stereo.skies import broken_skies, clear_skies, draw_sunshine, overcast_skies, suns_at

Floats = NDArray[np.floating[Any]]
Weather = Literal["clear", "overcast", "mixed"]

DRAWS = 8  # of the clouds of a mixed day
DAY = 24 * 60  # min


@dataclass(frozen=True)
class Place:
    latitude: float  # deg, positive north
    longitude: float  # deg, positive east
    utc_offset: float  # h, of the clock that days and times are told by


@dataclass(frozen=True)
class Day:
    """Skies of one day at T moments in one channel, and which of them each of K draws of its clouds sees."""

    date: date
    minutes: Floats  # (T,) since midnight by the clock of the place, ascending
    tolerance: float  # min by which a photo's moment may miss the time wanted
    skies: tuple[Skies, ...]  # variants of every moment
    variant: NDArray[np.intp]  # (K, T), which of the variants it is

    def light(self, normals: Floats) -> Floats:
        """Mean light vectors (K, N, T, 3) of unit normals (N, 3)."""
        variants = np.stack([illumination(skies, normals)[..., 0] for skies in self.skies])
        moments = np.arange(len(self.minutes))
        return np.stack([variants[row, :, moments].swapaxes(0, 1) for row in self.variant])

    def moments(self, start: Floats, end: Floats, shots: int) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
        """Indices (W, shots) of photos spread evenly from start (W,) to end (W,) [min], both ends in; whether (W,)
        every photo finds light within the day's tolerance."""
        wanted = start[:, None] + (end - start)[:, None] * np.linspace(0.0, 1.0, shots)
        after = np.clip(np.searchsorted(self.minutes, wanted), 1, len(self.minutes) - 1)
        late = self.minutes[after] - wanted < wanted - self.minutes[after - 1]
        index = np.where(late, after, after - 1)
        reached = np.abs(self.minutes[index] - wanted) <= self.tolerance
        return index, np.asarray(reached.all(axis=1))


def modelled_day(place: Place, day: date, weather: Weather, step: float) -> Day:
    """The day from midnight to midnight every `step` minutes that the sun is up; all of a polar day.

    Raises ParameterError where the sun does not rise.
    """
    minutes = np.arange(0.0, DAY, step)
    suns = suns_at(_utc(place, day, minutes), place.latitude, place.longitude)
    up = suns[:, 1] > 0
    if up.sum() < 2:
        raise ParameterError(
            f"The sun does not rise at {abs(place.latitude):g}° {'N' if place.latitude >= 0 else 'S'} on {day}: "
            f"it is night all day."
        )
    minutes, suns = minutes[up], suns[up]
    skies, variant = _weather(suns, minutes, weather, day)
    return Day(day, minutes, step / 2, tuple(in_grey(sky) for sky in skies), variant)


def _weather(suns: Floats, minutes: Floats, weather: Weather, day: date) -> tuple[list[Skies], NDArray[np.intp]]:
    alone = np.zeros((1, len(suns)), dtype=np.intp)
    if weather == "clear":
        return [clear_skies(suns)], alone
    if weather == "overcast":
        return [overcast_skies(suns)], alone
    draws = [draw_sunshine(minutes, seed=day.toordinal() * DRAWS + i) for i in range(DRAWS)]
    both = [broken_skies(suns, np.full(len(suns), shines)) for shines in (False, True)]
    return both, np.stack(draws).astype(np.intp)


def _utc(place: Place, day: date, minutes: Floats) -> NDArray[np.datetime64]:
    midnight = np.datetime64(day.isoformat(), "s")
    seconds = np.rint(60 * (minutes - 60 * place.utc_offset)).astype("timedelta64[s]")
    return np.asarray(midnight + seconds)


def in_grey(skies: Skies) -> Skies:
    """The same in one channel, luminance."""
    radiance = (skies.radiance @ LUMINANCE_WEIGHTS)[..., None]
    return Skies(radiance, skies.sun_direction, (skies.sun_irradiance @ LUMINANCE_WEIGHTS)[:, None])

"""The light of one day as a plan reads it: moments, and mean light vectors of any normal at each of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lighting.colour import LUMINANCE_WEIGHTS
from lighting.errors import ErrorCode, ParameterError
from lighting.geometry import Floats
from lighting.stereo.mean_light import Skies, illumination
from lighting.stereo.skies import HEIGHT, SPELL, broken_skies, clear_skies, draw_sunshine, overcast_skies, suns_at

Weather = Literal["clear", "overcast", "mixed"]

DRAWS = 32  # of the clouds of a mixed day
DAY = 24 * 60  # min
SPELLS = int(DAY / SPELL)
ONE_SKY = np.zeros((1, SPELLS), dtype=np.intp)  # the clouds of a day that has one variant
STEP, COARSE_STEP = 5.0, 10.0  # min between modelled moments


@dataclass(frozen=True)
class Place:
    latitude: float  # deg, positive north
    longitude: float  # deg, positive east
    utc_offset: float  # h, of the clock that days and times are told by


@dataclass(frozen=True)
class Day:
    """Skies of one day at T moments in one channel, in one variant or in several between which clouds choose."""

    date: date
    minutes: Floats  # (T,) since midnight by the clock of the place, ascending
    tolerance: float  # min by which a photo's moment may miss the time wanted
    skies: Skies  # of V x T moments: all of the first variant, then all of the next
    clouds: NDArray[np.intp]  # (K, spells of a day), which variant each draw of the clouds shows in each spell

    def light(self, normals: Floats) -> Floats:
        """Mean light vectors (N, V x T, 3) of unit normals (N, 3)."""
        return np.asarray(illumination(self.skies, normals)[..., 0])

    def moments(self, start: Floats, end: Floats, shots: int) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
        """Indices (K, W, shots) of the moments of photos spread evenly from start (W,) to end (W,) [min], both ends in;
        and whether (W,) every photo finds light within the day's tolerance.

        Spells of clouds are counted from the start of each window, so that all windows meet the same clouds.
        """
        wanted = start[:, None] + (end - start)[:, None] * np.linspace(0.0, 1.0, shots)
        after = np.clip(np.searchsorted(self.minutes, wanted), 1, len(self.minutes) - 1)
        late = self.minutes[after] - wanted < wanted - self.minutes[after - 1]
        index = np.where(late, after, after - 1)
        reached = np.abs(self.minutes[index] - wanted) <= self.tolerance
        spell = ((wanted - start[:, None]) / SPELL).astype(np.intp) % self.clouds.shape[1]
        return index + len(self.minutes) * self.clouds[:, spell], np.asarray(reached.all(axis=1))


def modelled_day(place: Place, day: date, weather: Weather, *, coarse: bool = False) -> Day:
    """The moments of the day, midnight to midnight, that the sun is up: all of a polar day.

    Coarse has half as many moments, in maps of half the size. Raises ParameterError where the sun does not rise.
    """
    step, height = (COARSE_STEP, HEIGHT // 2) if coarse else (STEP, HEIGHT)
    minutes = np.arange(0.0, DAY, step)
    suns = suns_at(_utc(place, day, minutes), place.latitude, place.longitude)
    up = suns[:, 1] > 0
    if up.sum() < 2:
        raise ParameterError(_night(place, day, day), "first", ErrorCode.NIGHT)
    minutes, suns = minutes[up], suns[up]
    clear = in_grey(clear_skies(suns, height=height))
    return Day(day, minutes, step / 2, *_weather(clear, weather))


def _weather(clear: Skies, weather: Weather) -> tuple[Skies, NDArray[np.intp]]:
    """The variants of all moments, and which of them each draw of the clouds shows."""
    if weather == "mixed":
        hidden, shining = (broken_skies(clear, np.full(len(clear), shines)) for shines in (False, True))
        return _joined(hidden, shining), draw_sunshine(DRAWS, SPELLS, seed=0).astype(np.intp)
    return clear if weather == "clear" else overcast_skies(clear), ONE_SKY


def _joined(a: Skies, b: Skies) -> Skies:
    return Skies(
        np.concatenate([a.radiance, b.radiance]),
        np.concatenate([a.sun_direction, b.sun_direction]),
        np.concatenate([a.sun_irradiance, b.sun_irradiance]),
    )


def _utc(place: Place, day: date, minutes: Floats) -> NDArray[np.datetime64]:
    midnight = np.datetime64(day.isoformat(), "s")
    seconds = np.rint(60 * (minutes - 60 * place.utc_offset)).astype("timedelta64[s]")
    return np.asarray(midnight + seconds)


def clear_brightness(place: Place, days: Sequence[date]) -> float:
    """The length of the brightest mean light vector under clear skies of these days: of a patch that faces
    the sun at its highest.

    Raises ParameterError where the sun does not rise on any.
    """
    minutes = np.arange(0.0, DAY, 15.0)
    times = np.stack([_utc(place, day, minutes) for day in days]).ravel()
    suns = suns_at(times, place.latitude, place.longitude)
    highest = suns[np.argmax(suns[:, 1])][None]
    if highest[0, 1] <= 0:
        raise ParameterError(_night(place, days[0], days[-1]), "first", ErrorCode.NIGHT)
    light = illumination(in_grey(clear_skies(highest)), highest)
    return float(np.linalg.norm(light))


def _night(place: Place, first: date, last: date) -> str:
    where = f"{abs(place.latitude):g}° {'N' if place.latitude >= 0 else 'S'}"
    when = f"on {first}" if first == last else f"from {first} to {last}"
    return f"The sun does not rise at {where} {when}; it is night all day."


def in_grey(skies: Skies) -> Skies:
    """The same in one channel, luminance."""
    radiance = (skies.radiance @ LUMINANCE_WEIGHTS)[..., None]
    return Skies(radiance, skies.sun_direction, (skies.sun_irradiance @ LUMINANCE_WEIGHTS)[:, None])

"""Mean light vectors of measured and modeled skies, and the skies of a day.

A patch of unit normal n and albedo rho is under radiance L. Its brightness is b = rho / pi x the integral of L(w)
<w, n> over the hemisphere above the patch. So b = <l, x>, with x = rho n and the mean light vector l(n). The term is of
Hold-Geoffroy et al., What Is a Good Day for Outdoor Photometric Stereo?, ICCP 2015. This l(n) is 1 / pi x the integral
of L(w) w over that hemisphere. It depends on n: patches of other orientation see other light. Brightnesses at several
times stack to b = M x, M the illumination matrix with one mean light vector a row.

Directions are in the world axes of a map: +Y up, true north at -Z (the center column of a lat-long map), east at +X.
Brightness is in the units of the maps: a white patch (rho = 1) under a uniform sky of radiance 1 that fills its
hemisphere has brightness 1.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.color import LUMINANCE_WEIGHTS
from lighting.envmap.latlong import row_irradiance
from lighting.errors import EnvironmentMapError, ErrorCode, ParameterError
from lighting.geometry import SUN_RADIUS, Floats, direction, latlong_directions, latlong_solid_angle
from lighting.records import GROUND_ALBEDO
from lighting.sky.clear_sky import sky_radiance, sun_disc_points, sun_disc_radiance
from lighting.sky.perez import overcast_luminance
from lighting.solar_position import sun_position

Weather = Literal["clear", "overcast", "mixed"]

_CHUNK_WEIGHTS = 1 << 22  # weights of pixels held at once

SKY_HEIGHT = 64  # rows of a modeled map
CLEAR_TURBIDITY = 3.0  # of a clear day in the country
_OVERCAST_SHARE = 0.25  # of the clear sky's irradiance under full cloud (Kasten and Czeplak, Solar Energy 24, 1980)
_BROKEN_COVER = 0.5  # share of the sky under broken cloud
_DISC_POINTS = (8, 24)  # rings and spokes of points that the disc's irradiance is summed over, good to 1e-3
_CLOUD_SPELL = 15.0  # min that a cloud or a gap between clouds stands before the sun
CLOUD_DRAWS = 32  # of the clouds of a mixed day
DAY_MINUTES = 24 * 60  # min
SPELLS = int(DAY_MINUTES / _CLOUD_SPELL)
ONE_SKY = np.zeros((1, SPELLS), dtype=np.intp)  # the clouds of a day that has one variant
FINE_STEP, COARSE_STEP = 5.0, 10.0  # min between modeled moments


@dataclass(frozen=True)
class Skies:
    """The light from far away at T moments, in C channels, the sun's disc apart from the rest."""

    radiance: NDArray[np.float32]
    """(T, H, 2H, C), lat-long maps without the disc: row 0 zenith, center column north."""
    sun_direction: Floats
    """(T, 3), unit vectors towards the disc's center; any where there is no sun."""
    sun_irradiance: Floats
    """(T, C), of the disc on a plane that faces it; 0 where there is none."""

    def __post_init__(self) -> None:
        shape = self.radiance.shape
        if len(shape) != 4 or shape[2] != 2 * shape[1] or not self.radiance.size:
            raise EnvironmentMapError(f"Environment maps of several moments have the shape (T, H, 2H, C), not {shape}.")
        if self.sun_direction.shape != (shape[0], 3) or self.sun_irradiance.shape != (shape[0], shape[3]):
            raise EnvironmentMapError("Each moment needs the direction (3,) and the irradiance (C,) of its sun.")

    def __len__(self) -> int:
        return len(self.radiance)

    def at(self, moments: NDArray[np.intp]) -> "Skies":
        """Return the skies of some moments alone.

        Args:
            moments: (M,) indices, in the order that is wanted.
        """
        return Skies(self.radiance[moments], self.sun_direction[moments], self.sun_irradiance[moments])

    @classmethod
    def join(cls, parts: Sequence["Skies"]) -> "Skies":
        """Return the moments of several skies of one size, one after another.

        Args:
            parts: one or more.
        """
        names = ("radiance", "sun_direction", "sun_irradiance")
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def illumination_matrices(skies: Skies, normals: ArrayLike) -> Floats:
    """Return the illumination matrices of patches, their rows mean light vectors.

    A patch's brightness at each moment is `illumination_matrices(...)[..., t, :, c] @ (albedo * normal)`, in the unit
    of the skies' radiance. It is the brightness's derivative by x = albedo x normal too, for what the hemisphere's edge
    lets in or out adds nothing. Covariances of estimates follow from it at any normal.

    Args:
        skies: of T moments and C channels.
        normals: (..., 3) unit vectors.

    Returns:
        Matrices (..., T, 3, C).

    References:
        [1] Hold-Geoffroy et al., What Is a Good Day for Outdoor Photometric Stereo?, ICCP 2015.
    """
    directions = np.asarray(normals, dtype=np.float64)
    flat = directions.reshape(-1, 3)
    by_sun = sun_light_vectors(skies.sun_direction, skies.sun_irradiance, flat)
    result = sky_light_vectors(skies.radiance, flat) + by_sun
    return result.reshape(*directions.shape[:-1], *result.shape[1:])


def sky_light_vectors(radiance: NDArray[np.floating], normals: Floats) -> Floats:
    """Return the mean light vectors (N, T, 3, C) of maps, summed over pixels.

    A pixel that a patch's plane cuts counts by about the part of it above the plane.

    Args:
        radiance: (T, H, 2H, C) lat-long maps without the sun's disc.
        normals: (N, 3) unit vectors.
    """
    moments, height, width, channels = radiance.shape
    d = latlong_directions(height).reshape(-1, 3).astype(np.float32)
    weight = np.repeat(latlong_solid_angle(height) / np.pi, width).astype(np.float32)
    flux = radiance.reshape(moments, -1, channels).transpose(1, 0, 2) * weight[:, None, None]
    by_pixel = (d[:, None, :, None] * flux[:, :, None, :]).reshape(len(d), -1).astype(np.float32)
    result = np.empty((len(normals), moments, 3, channels))
    rows = max(1, _CHUNK_WEIGHTS // len(d))
    for start in range(0, len(normals), rows):
        cosine = normals[start : start + rows].astype(np.float32) @ d.T
        share = np.clip(cosine * np.float32(height / np.pi) + np.float32(0.5), 0, 1)
        result[start : start + rows] = (share @ by_pixel).reshape(-1, moments, 3, channels)
    return result


def sun_light_vectors(sun_direction: Floats, sun_irradiance: Floats, normals: Floats) -> Floats:
    """Return the mean light vectors (N, T, 3, C) of suns' discs alone.

    The integral is over a uniform disc of SUN_RADIUS, of which the patch's plane cuts off a segment. It has two parts:
    the share of the disc above the plane times the disc's direction, and the segment's first moment along the normal.

    Args:
        sun_direction: (T, 3) unit vectors.
        sun_irradiance: (T, C) on planes that face the suns.
        normals: (N, 3) unit vectors.
    """
    radius = np.radians(SUN_RADIUS)
    cosine = np.clip(normals @ sun_direction.T, -1, 1)
    height = np.clip(np.arcsin(cosine) / radius, -1, 1)  # of the disc's center above the plane, in radii
    half_width = np.sqrt(1 - height**2)
    share = 0.5 + (height * half_width + np.arcsin(height)) / np.pi
    moment = 2 / (3 * np.pi) * half_width**3 * radius
    tangent = normals[:, None] - cosine[..., None] * sun_direction
    tangent /= np.maximum(np.sqrt(1 - cosine**2), 1e-9)[..., None]
    vector = share[..., None] * sun_direction + moment[..., None] * tangent
    return np.asarray(vector[..., None] * sun_irradiance[:, None, :] / np.pi)


# Modeled skies.


def sun_directions(times: ArrayLike, latitude: float, longitude: float) -> Floats:
    """Return unit vectors (T, 3) to the sun, also below the horizon.

    Args:
        times: (T,) UTC, as numpy's datetime64.
        latitude: deg, positive north.
        longitude: deg, positive east.
    """
    azimuth, elevation = sun_position(np.asarray(times, dtype="datetime64[us]"), latitude, longitude)
    return direction(azimuth, elevation)


def clear_skies(
    suns: ArrayLike, turbidity: float = CLEAR_TURBIDITY, ground_albedo: float = GROUND_ALBEDO, height: int = SKY_HEIGHT
) -> Skies:
    """Model Hosek-Wilkie skies of three channels over ground that they light.

    Args:
        suns: (T, 3) unit vectors, above the horizon.
        turbidity: 1 to 10.
        ground_albedo: 0 to 1.
        height: H, rows of the maps, even.

    Raises:
        ParameterError: a sun is below the horizon, or the turbidity out of range.
    """
    directions = np.asarray(suns, dtype=np.float64)
    if (directions[:, 1] < 0).any():
        raise ParameterError("The sun is below the horizon; there is no light to model.", code=ErrorCode.NIGHT)
    above = latlong_directions(height)[: height // 2].astype(np.float32)
    sky = np.stack([sky_radiance(above, sun, turbidity, ground_albedo) for sun in directions])
    disc = np.stack([_disc_irradiance(sun, turbidity) for sun in directions])
    level = _horizontal_irradiance(sky) + disc * directions[:, 1:2]
    return Skies(_add_ground(sky, level, ground_albedo), directions, disc)


def _overcast_skies(clear: Skies) -> Skies:
    """Model CIE standard overcast skies at the moments of clear ones, in their channels.

    Args:
        clear: skies whose irradiance of level ground is reduced to _OVERCAST_SHARE.

    References:
        [1] Kasten and Czeplak, Solar Energy 24, 1980.
    """
    height = clear.radiance.shape[1]
    by_sun = clear.sun_irradiance * np.maximum(clear.sun_direction[:, 1:2], 0)
    level = _OVERCAST_SHARE * (_horizontal_irradiance(clear.radiance[:, : height // 2]) + by_sun)
    relative = overcast_luminance(latlong_directions(height)[: height // 2])[..., None]
    sky = relative * (level / _horizontal_irradiance(relative))[:, None, None]
    return Skies(_add_ground(sky, level, GROUND_ALBEDO), clear.sun_direction, np.zeros_like(clear.sun_irradiance))


def _broken_skies(clear: Skies, shines: ArrayLike) -> Skies:
    """Model broken cloud at the moments of clear skies; a simple model, not a measured one.

    The sky is the mean of the clear and the overcast one, weighted by _BROKEN_COVER; the ground is lit by sky and disc.

    Args:
        clear: skies of T moments.
        shines: (T,), whether the disc is whole (see `draw_sunshine`) or hidden.
    """
    half = clear.radiance.shape[1] // 2
    sky = (1 - _BROKEN_COVER) * clear.radiance[:, :half] + _BROKEN_COVER * _overcast_skies(clear).radiance[:, :half]
    disc = clear.sun_irradiance * np.asarray(shines, dtype=bool)[:, None]
    level = _horizontal_irradiance(sky) + disc * np.maximum(clear.sun_direction[:, 1:2], 0)
    return Skies(_add_ground(sky, level, GROUND_ALBEDO), clear.sun_direction, disc)


def draw_sunshine(draws: int, spells: int, seed: int, cover: float = _BROKEN_COVER) -> NDArray[np.bool_]:
    """Draw whether the sun shines in spells of broken cloud, each _CLOUD_SPELL minutes long and independent.

    Args:
        draws: D.
        spells: S.
        seed: of the random numbers.
        cover: share of the spells, 0 to 1, in which a cloud hides the sun.

    Returns:
        (D, S), True where it shines.
    """
    return np.asarray(np.random.default_rng(seed).random((draws, spells)) >= cover)


def _horizontal_irradiance(sky: NDArray[np.floating]) -> Floats:
    """Irradiance (..., C) of level ground by the upper half (..., H / 2, 2H, C) of a map."""
    rows = sky.shape[-3]
    by_row = np.moveaxis(sky.mean(axis=-2, dtype=np.float64), -1, -2)
    return np.asarray(by_row @ row_irradiance(2 * rows)[:rows])


def _disc_irradiance(sun: Floats, turbidity: float) -> Floats:
    """Irradiance (3,) of the part of the disc above the horizon on a plane that faces it."""
    points, weight = sun_disc_points(sun, *_DISC_POINTS)
    return np.asarray(weight @ sun_disc_radiance(points, sun, turbidity))


def _add_ground(sky: Floats, level: Floats, albedo: float) -> NDArray[np.float32]:
    """Whole maps (T, H, 2H, C) of skies (T, H / 2, 2H, C) over ground with irradiance (T, C)."""
    ground = np.broadcast_to(albedo / np.pi * level[:, None, None], sky.shape)
    return np.concatenate([sky, ground], axis=1).astype(np.float32)


@dataclass(frozen=True)
class ClockLocation:
    """A location, and the clock by which its days and times are stated."""

    latitude: float
    """Deg, positive north."""
    longitude: float
    """Deg, positive east."""
    utc_offset: float
    """Hours, of the clock that days and times are told by."""


@dataclass(frozen=True)
class SkyDay:
    """Skies of one day at T moments in one channel, in one variant or in several between which clouds choose."""

    date: date
    """Date, the day."""
    minutes: Floats
    """(T,) since midnight by the clock of the place, ascending."""
    tolerance: float
    """Min by which a photo's moment may miss the time wanted."""
    skies: Skies
    """Of V x T moments: all of the first variant, then all of the next."""
    clouds: NDArray[np.intp]
    """(K, spells of a day), which variant each draw of the clouds shows in each spell."""

    def light(self, normals: Floats) -> Floats:
        """Return the mean light vectors (N, V x T, 3) of normals.

        Args:
            normals: (N, 3) unit vectors.
        """
        return np.asarray(illumination_matrices(self.skies, normals)[..., 0])

    def moments(self, start: Floats, end: Floats, shots: int) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
        """Find the moments of photos spread evenly over windows, both ends in.

        Spells of clouds are counted from the start of each window, so that all windows meet the same clouds.

        Args:
            start: (W,) min since midnight.
            end: (W,) min since midnight.
            shots: photos of each window.

        Returns:
            Indices (K, W, shots), and whether (W,) every photo finds light within the day's tolerance.
        """
        times = start[:, None] + (end - start)[:, None] * np.linspace(0.0, 1.0, shots)
        next_index = np.clip(np.searchsorted(self.minutes, times), 1, len(self.minutes) - 1)
        is_next = self.minutes[next_index] - times < times - self.minutes[next_index - 1]
        index = np.where(is_next, next_index, next_index - 1)
        in_light = np.abs(self.minutes[index] - times) <= self.tolerance
        spell = ((times - start[:, None]) / _CLOUD_SPELL).astype(np.intp) % self.clouds.shape[1]
        return index + len(self.minutes) * self.clouds[:, spell], np.asarray(in_light.all(axis=1))


def modelled_day(location: ClockLocation, day: date, weather: Weather, *, coarse: bool = False) -> SkyDay:
    """Model the moments of a day, midnight to midnight, that the sun is up: all of a polar day.

    Args:
        location: where, and by which clock.
        day: by that clock.
        weather: the kind of sky.
        coarse: half as many moments, in maps of half the size.

    Raises:
        ParameterError: the sun does not rise.
    """
    step, height = (COARSE_STEP, SKY_HEIGHT // 2) if coarse else (FINE_STEP, SKY_HEIGHT)
    minutes = np.arange(0.0, DAY_MINUTES, step)
    suns = _sun_path(location, [day], minutes)
    up = suns[:, 1] > 0
    if up.sum() < 2:
        raise ParameterError(_night_sentence(location, day, day), "first", ErrorCode.NIGHT)
    minutes, suns = minutes[up], suns[up]
    clear = gray_skies(clear_skies(suns, height=height))
    if weather != "mixed":
        return SkyDay(day, minutes, step / 2, clear if weather == "clear" else _overcast_skies(clear), ONE_SKY)
    variants = Skies.join([_broken_skies(clear, np.full(len(clear), shines)) for shines in (False, True)])
    return SkyDay(day, minutes, step / 2, variants, draw_sunshine(CLOUD_DRAWS, SPELLS, seed=0).astype(np.intp))


def _sun_path(location: ClockLocation, days: Sequence[date], minutes: Floats) -> Floats:
    """Unit vectors (days x T, 3) to the sun at minutes (T,) since midnight of each day."""
    midnights = np.array([day.isoformat() for day in days], dtype="datetime64[s]")
    seconds = np.rint(60 * (minutes - 60 * location.utc_offset)).astype("timedelta64[s]")
    return sun_directions((midnights[:, None] + seconds).ravel(), location.latitude, location.longitude)


def clear_brightness(location: ClockLocation, days: Sequence[date]) -> float:
    """Return the length of the brightest mean light vector under clear skies: of a patch that faces the highest sun.

    Args:
        location: where, and by which clock.
        days: that are compared.

    Raises:
        ParameterError: the sun does not rise on any.
    """
    suns = _sun_path(location, days, np.arange(0.0, DAY_MINUTES, 15.0))
    highest = suns[np.argmax(suns[:, 1])][None]
    if highest[0, 1] <= 0:
        raise ParameterError(_night_sentence(location, days[0], days[-1]), "first", ErrorCode.NIGHT)
    light = illumination_matrices(gray_skies(clear_skies(highest)), highest)
    return float(np.linalg.norm(light))


def _night_sentence(location: ClockLocation, first: date, last: date) -> str:
    where = f"{abs(location.latitude):g}° {'N' if location.latitude >= 0 else 'S'}"
    when = f"on {first}" if first == last else f"from {first} to {last}"
    return f"The sun does not rise at {where} {when}; it is night all day."


def gray_skies(skies: Skies) -> Skies:
    """Return skies in one channel, luminance.

    Args:
        skies: in linear Rec.709.
    """
    radiance = (skies.radiance @ LUMINANCE_WEIGHTS)[..., None]
    return Skies(radiance, skies.sun_direction, (skies.sun_irradiance @ LUMINANCE_WEIGHTS)[:, None])

"""Modelled skies of a place at given times, in world axes: north at -Z, east at +X, up +Y."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.envmap import row_levels
from lighting.errors import ErrorCode, ParameterError
from lighting.evidence import sun_position
from lighting.geometry import Floats, direction, latlong_directions
from lighting.records import GROUND_ALBEDO
from lighting.sky.cie import overcast_luminance
from lighting.sky.hosek_wilkie import sky_radiance, sun_disc_points, sun_disc_radiance
from lighting.stereo.mean_light import Skies

HEIGHT = 64  # rows of a modelled map
TURBIDITY = 3.0  # of a clear day in the country
OVERCAST_SHARE = 0.25  # of the clear sky's irradiance under full cloud (Kasten and Czeplak, Solar Energy 24, 1980)
COVER = 0.5  # share of the sky under broken cloud
_DISC = (8, 24)  # rings and spokes of points that the disc's irradiance is summed over, good to 1e-3

SPELL = 15.0  # min that a cloud or a gap between clouds stands before the sun


def suns_at(times: ArrayLike, latitude: float, longitude: float) -> Floats:
    """Unit vectors (T, 3) to the sun at UTC times (T,) as numpy's datetime64; below the horizon too."""
    azimuth, elevation = sun_position(np.asarray(times, dtype="datetime64[us]"), latitude, longitude)
    return direction(azimuth, elevation)


def clear_skies(
    suns: ArrayLike, turbidity: float = TURBIDITY, ground_albedo: float = GROUND_ALBEDO, height: int = HEIGHT
) -> Skies:
    """Hosek-Wilkie skies of three channels with the sun at unit vectors (T, 3), over ground that they light.

    Raises ParameterError where a sun is below the horizon and for a turbidity outside 1 to 10.
    """
    directions = np.asarray(suns, dtype=np.float64)
    if (directions[:, 1] < 0).any():
        raise ParameterError("The sun is below the horizon; there is no light to model.", code=ErrorCode.NIGHT)
    sky = np.stack([_clear_sky(sun, turbidity, ground_albedo, height) for sun in directions])
    disc = np.stack([_disc(sun, turbidity) for sun in directions])
    level = horizontal_irradiance(sky) + disc * directions[:, 1:2]
    return Skies(_over_ground(sky, level, ground_albedo), directions, disc)


def overcast_skies(clear: Skies) -> Skies:
    """CIE standard overcast skies at the moments of clear ones, in their channels.

    Their irradiance of level ground is OVERCAST_SHARE of the clear skies'.
    """
    level = OVERCAST_SHARE * _level_irradiance(clear)
    height = clear.radiance.shape[1]
    relative = overcast_luminance(latlong_directions(height)[: height // 2])[..., None]
    sky = relative * (level / horizontal_irradiance(relative))[:, None, None]
    return Skies(_over_ground(sky, level, GROUND_ALBEDO), clear.sun_direction, np.zeros_like(clear.sun_irradiance))


def broken_skies(clear: Skies, shines: ArrayLike) -> Skies:
    """Skies with broken cloud at the moments of clear ones, in their channels: a simple model, not a measured one.

    The sky is the mean of the clear and the overcast one, weighted by COVER. The disc is whole where
    `shines` (T,), see `draw_sunshine`, and hidden elsewhere; the ground is lit by both.
    """
    half = clear.radiance.shape[1] // 2
    sky = (1 - COVER) * clear.radiance[:, :half] + COVER * overcast_skies(clear).radiance[:, :half]
    disc = clear.sun_irradiance * np.asarray(shines, dtype=bool)[:, None]
    level = horizontal_irradiance(sky) + disc * np.maximum(clear.sun_direction[:, 1:2], 0)
    return Skies(_over_ground(sky, level, GROUND_ALBEDO), clear.sun_direction, disc)


def draw_sunshine(draws: int, spells: int, seed: int, cover: float = COVER) -> NDArray[np.bool_]:
    """Whether the sun shines (draws, spells) in spells of broken cloud, each SPELL minutes long and drawn by itself.

    In a share `cover` of the spells a cloud hides it.
    """
    return np.asarray(np.random.default_rng(seed).random((draws, spells)) >= cover)


def horizontal_irradiance(sky: NDArray[np.floating[Any]]) -> Floats:
    """Irradiance (..., C) of level ground by the upper half (..., H / 2, 2H, C) of a map."""
    rows = sky.shape[-3]
    by_row = np.moveaxis(sky.mean(axis=-2, dtype=np.float64), -1, -2)
    return np.asarray(by_row @ row_levels(2 * rows)[:rows])


def _clear_sky(sun: Floats, turbidity: float, ground_albedo: float, height: int) -> NDArray[np.floating[Any]]:
    """The upper half (H / 2, 2H, 3) of a map without the disc."""
    above = latlong_directions(height)[: height // 2].astype(np.float32)
    return sky_radiance(above, sun, turbidity, ground_albedo)


def _disc(sun: Floats, turbidity: float) -> Floats:
    """Irradiance (3,) of the part of the disc above the horizon on a plane that faces it."""
    points, weight = sun_disc_points(sun, *_DISC)
    return np.asarray(weight @ sun_disc_radiance(points, sun, turbidity))


def _over_ground(sky: Floats, level: Floats, albedo: float) -> NDArray[np.float32]:
    """Whole maps (T, H, 2H, C) of skies (T, H / 2, 2H, C) over ground with irradiance (T, C)."""
    ground = np.broadcast_to(albedo / np.pi * level[:, None, None], sky.shape)
    return np.concatenate([sky, ground], axis=1).astype(np.float32)


def _level_irradiance(skies: Skies) -> Floats:
    """Irradiance (T, C) of level ground, the sun included."""
    sky = horizontal_irradiance(skies.radiance[:, : skies.radiance.shape[1] // 2])
    return np.asarray(sky + skies.sun_irradiance * np.maximum(skies.sun_direction[:, 1:2], 0))

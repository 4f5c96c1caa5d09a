"""Modelled skies of a place at given times, in world axes: north at -Z, east at +X, up +Y."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.ephemeris import sun_position
from lighting.errors import ParameterError
from lighting.geometry import direction, latlong_directions
from lighting.parameters import GROUND_ALBEDO
from lighting.sky import sky_radiance, sun_disc_points, sun_disc_radiance
from lighting.stereo.mean_light import Skies

Floats = NDArray[np.floating[Any]]

HEIGHT = 64  # rows of a modelled map
TURBIDITY = 3.0  # of a clear day in the country


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
        raise ParameterError("The sun is below the horizon; there is no light to model.")
    maps = [_clear_map(sun, turbidity, ground_albedo, height) for sun in directions]
    return Skies(np.stack([sky for sky, _ in maps]), directions, np.stack([power for _, power in maps]))


def _clear_map(sun: Floats, turbidity: float, ground_albedo: float, height: int) -> tuple[NDArray[np.float32], Floats]:
    """One map (H, 2H, 3) without its disc, and the disc's irradiance (3,)."""
    points, weight = sun_disc_points(sun)
    disc = sun_disc_radiance(points, sun, turbidity)
    d = latlong_directions(height)[: height // 2].astype(np.float32)
    image = np.empty((height, 2 * height, 3), dtype=np.float32)
    image[: height // 2] = sky_radiance(d, sun, turbidity, ground_albedo)
    level = horizontal_irradiance(image[: height // 2]) + (weight * points[:, 1]) @ disc
    image[height // 2 :] = ground_albedo / np.pi * level
    return image, np.asarray(weight @ disc)


def horizontal_irradiance(sky: NDArray[np.floating[Any]]) -> Floats:
    """Irradiance (..., C) of level ground by the upper half (..., H / 2, 2H, C) of a map."""
    edges = np.sin(np.linspace(np.pi / 2, 0, sky.shape[-3] + 1)) ** 2
    return np.asarray(np.moveaxis(sky.mean(axis=-2, dtype=np.float64), -1, -2) @ (edges[:-1] - edges[1:])) * np.pi

"""The sun's disc in a map, which is smaller than most pixels: painted by the solid angle that it covers."""

import math

import numpy as np
from numpy.typing import NDArray

from lighting.envmap.latlong import Image
from lighting.geometry import SUN_RADIUS, Floats, angles, direction, latlong_solid_angle
from lighting.records import Lighting
from lighting.sky.hosek_wilkie import sun_disc_points, sun_disc_radiance

_FINE_HEIGHT = 8192  # rows of the grid that samples the disc: 24 across it
_FINE_PER_PIXEL = 4  # least number of grid rows per row of pixels


def splat_sun_disc(image: Image, lighting: Lighting, power: Floats) -> None:
    """Add the disc: the mean over each pixel of its radiance on a finer grid, scaled to the disc's exact power.

    Args:
        image: (H, 2H, 3) linear radiance, changed in place.
        lighting: with the sun's direction and color.
        power: (3,) radiance x solid angle of the disc.
    """
    height, width = image.shape[:2]
    row, column, directions = _fine_grid(lighting, height)
    disc = _model_disc if lighting.sun_irradiance is None else _gray_disc
    radiance = disc(directions, lighting)
    share = radiance * np.hypot(directions[..., 0], directions[..., 2])[..., None]  # x the cell's relative solid angle
    lit = radiance.any(axis=-1)
    pixels, inverse = np.unique((row[:, None] * width + column % width)[lit], return_inverse=True)
    sums = np.stack([np.bincount(inverse, share[lit][:, channel], len(pixels)) for channel in range(3)], axis=-1)
    scale = power / np.maximum(sums.sum(axis=0), np.finfo(np.float64).tiny)
    added = sums * scale / latlong_solid_angle(height)[pixels // width, None]
    image.reshape(-1, 3)[pixels] += np.asarray(added, dtype=np.float32)


def _gray_disc(directions: Floats, lighting: Lighting) -> Floats:
    """The disc at any scale in one color: through haze, that of a setting sun lacks channels or is black."""
    clearest = sun_disc_radiance(directions, lighting.sun_direction, 1.0)
    return np.repeat(clearest.mean(axis=-1, keepdims=True), 3, axis=-1)


def _model_disc(directions: Floats, lighting: Lighting) -> Floats:
    """Radiance (..., 3) of the model's disc along unit vectors (..., 3), in the photo's linear values."""
    return sun_disc_radiance(directions, lighting.sun_direction, lighting.turbidity) * lighting.exposure


def disc_power(lighting: Lighting) -> tuple[Floats, Floats]:
    """Radiance x solid angle (3,) of the part of the disc above the horizon, and the irradiance (3,) of the ground.

    Both are 0 of a sun below the horizon.

    Args:
        lighting: whose exposure, turbidity and sun the model takes.
    """
    if lighting.sun_elevation < 0:
        return np.zeros(3), np.zeros(3)
    points, weight = sun_disc_points(lighting.sun_direction)
    radiance = _model_disc(points, lighting)
    return np.asarray(weight @ radiance), np.asarray((weight * points[:, 1]) @ radiance)


def sun_irradiance(lighting: Lighting) -> Floats:
    """Irradiance (3,) on a surface that faces the sun: as stated, else the disc's power; 0 from below the horizon.

    Args:
        lighting: of the sun, painted or not.
    """
    if lighting.sun_elevation < 0:
        return np.zeros(3)
    return disc_power(lighting)[0] if lighting.sun_irradiance is None else np.array(lighting.sun_irradiance)


def _fine_grid(lighting: Lighting, height: int) -> tuple[NDArray[np.intp], NDArray[np.intp], Floats]:
    """A grid over the visible disc, finer than a map's pixels.

    The map's row (R,) and column (C,) of each of its rows and columns, and its directions (R, C, 3); columns may run
    over the seam.
    """
    azimuth, elevation = map(float, angles(lighting.sun_direction))
    widest = math.cos(math.radians(max(elevation - SUN_RADIUS, 0.0)))
    split = max(_FINE_PER_PIXEL, -(-_FINE_HEIGHT // height))
    across = math.ceil(split * widest)
    if elevation + SUN_RADIUS >= 90.0:
        columns = np.arange(2 * height * across)
    else:
        reach = math.degrees(math.asin(math.sin(math.radians(SUN_RADIUS)) / math.cos(math.radians(elevation))))
        columns = _cells_between(azimuth + 180.0 - reach, azimuth + 180.0 + reach, height * across / 180.0)
    rows = _cells_between(90.0 - elevation - SUN_RADIUS, 90.0 - elevation + SUN_RADIUS, height * split / 180.0)
    rows = rows[rows >= 0]
    fine_azimuth = (columns + 0.5) * (180.0 / (height * across)) - 180.0
    fine_elevation = 90.0 - (rows + 0.5) * (180.0 / (height * split))
    return rows // split, columns // across, direction(fine_azimuth, fine_elevation[:, None])


def _cells_between(start: float, end: float, per_degree: float) -> NDArray[np.intp]:
    """Indices of the cells between two angles [deg]."""
    return np.arange(math.floor(start * per_degree), math.ceil(end * per_degree))

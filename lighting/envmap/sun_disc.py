"""The sun's disc in a map, which is smaller than most pixels: painted by the solid angle that it covers.

Where its radiance would be more than half floats hold, its power is spread evenly over as wide a disc as it needs.
"""

import math

import numpy as np
from numpy.typing import NDArray

from lighting.envmap.latlong import MAX_RADIANCE, Image, too_bright
from lighting.geometry import SUN_RADIUS, Floats, angle_between, angles, direction, latlong_solid_angle
from lighting.records import Lighting
from lighting.sky.hosek_wilkie import sun_disc_points, sun_disc_radiance

_FINE_HEIGHT = 8192  # rows of the grid that samples the disc: 24 across it
_FINE_PER_PIXEL = 4  # least number of grid rows per row of pixels

# A sun that is spread.
_MAX_RADIUS = 90.0  # deg
_FITS = 1 - 1e-6  # of MAX_RADIANCE that float32 surely keeps below it
_MIN_GROWTH, _MAX_GROWTH = 1.03, 1.5  # of its radius between attempts
_FLATTEST = 3.0  # how much smaller than the radius half its height may be
_MAX_SLOPE = 0.9  # by which its radiance may differ from above to below


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
    flat = image.reshape(-1, 3)
    if (flat[pixels] + added).max(initial=0.0) > MAX_RADIANCE:
        pixels, added = _spread_power(image, pixels, added)
    flat[pixels] += np.asarray(added, dtype=np.float32)


def _spread_power(image: Image, pixels: NDArray[np.intp], added: Floats) -> tuple[NDArray[np.intp], Floats]:
    """Pixels (M,) and radiance (M, 3) of a wider sun, which gives a surface that faces it and level ground the same.

    Args:
        image: (H, 2H, 3) to which it is to be added.
        pixels: (N,) indices of the pixels of the sun.
        added: (N, 3) its radiance there.
    """
    height = len(image)
    weighted = added * latlong_solid_angle(height)[pixels // (2 * height), None]
    vectors = weighted.T @ _pixel_directions(pixels, height)  # (channels, 3)
    total = vectors.sum(axis=0)
    sun = total / np.linalg.norm(total)
    facing = vectors @ sun
    shrink = 1 - min(facing.max() / MAX_RADIANCE / math.pi / 2, 1.0)
    radius = max(math.degrees(math.acos(shrink)), SUN_RADIUS)
    while radius <= _MAX_RADIUS:
        wider, share = _even_disc(sun, radius, height)
        share = _at_height(share, wider, height, sun)
        weight = latlong_solid_angle(height)[wider // (2 * height)] * share
        spread = share[:, None] * (facing / (weight @ (_pixel_directions(wider, height) @ sun)))
        if (over := float((image.reshape(-1, 3)[wider] + spread).max()) / MAX_RADIANCE) <= _FITS:
            return wider, spread
        radius *= min(max(math.sqrt(over), _MIN_GROWTH), _MAX_GROWTH)
    raise too_bright()


def _even_disc(sun: Floats, radius: float, height: int) -> tuple[NDArray[np.intp], Floats]:
    """Pixels (M,) above the horizon of a map and their shares (M,) of a disc [deg] around a direction (3,).

    A disc that would reach below the horizon is as flat and wide as keeps its height, up to a ratio.
    """
    pixel, elevation = 180.0 / height, float(angles(sun)[1])
    vertical = max(min(radius, max(elevation, pixel / 2)), radius / _FLATTEST)
    horizontal = radius**2 / vertical
    rows = np.arange(max(0, math.floor((90.0 - elevation - vertical) / pixel - 1)), height // 2)
    rows = rows[: max(1, math.ceil((90.0 - elevation + vertical) / pixel + 1) - rows[0])]
    pixels = (rows[:, None] * 2 * height + np.arange(2 * height)).ravel()
    directions = _pixel_directions(pixels, height)
    up = np.degrees(np.arcsin(directions[:, 1])) - elevation
    beside2 = np.maximum(np.square(angle_between(directions, sun)) - np.square(up), 0.0)
    outward = np.sqrt(np.square(up / vertical) + beside2 / horizontal**2)
    share = np.clip((1 - outward) * min(vertical, horizontal) / pixel + 0.5, 0.0, 1.0)
    return pixels[share > 0], share[share > 0]


def _at_height(share: Floats, pixels: NDArray[np.intp], height: int, sun: Floats) -> Floats:
    """Shares (M,) of a disc, more above or below, so that level ground gets as much of it as from a direction (3,)."""
    directions = _pixel_directions(pixels, height)
    weight = share * latlong_solid_angle(height)[pixels // (2 * height)]
    up, facing = directions[:, 1], directions @ sun
    off = up - weight @ up / weight.sum()
    missing = sun[1] * (weight @ facing) - weight @ up
    gained = (weight * off) @ up - sun[1] * ((weight * off) @ facing)
    if gained <= 0 or not off.any():
        return share
    slope = np.clip(missing / gained, *(np.array([-1, 1]) * _MAX_SLOPE / np.abs(off).max()))
    return np.asarray(share * (1 + slope * off))


def _pixel_directions(pixels: NDArray[np.intp], height: int) -> Floats:
    """Unit vectors (N, 3) of a map's pixels by their indices."""
    row, column = np.divmod(pixels, 2 * height)
    return direction((column + 0.5) * (180.0 / height) - 180.0, 90.0 - (row + 0.5) * (180.0 / height))


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

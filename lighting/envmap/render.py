"""Lighting -> lat-long map: clear, cloudy and overcast sky, ground.

An environment map is a lat-long image (H, 2H, 3), float32, linear Rec.709, in the pixel layout of geometry.py. Its
values are the photo's own linear values. A lighting that has `sky_irradiance` and `sun_irradiance` gets a map whose
integrals equal them; else they follow from `exposure` x the sky model's radiance.

Clear skies by Hosek and Wilkie and by the Prague model are painted with tables by the angles from zenith and sun.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache
from numbers import Integral

import numpy as np

from lighting.color import luminance
from lighting.envmap.latlong import (
    EPSILON_IRRADIANCE,
    MAX_RADIANCE,
    Image,
    cap_radiance,
    irradiance_from_rows,
    row_irradiance,
    scale_colors,
    too_bright,
)
from lighting.envmap.sun_disc import disc_power, splat_sun_disc, sun_irradiance
from lighting.errors import ErrorCode, ParameterError
from lighting.geometry import Floats, direction, latlong_angles, latlong_directions, latlong_solid_angle
from lighting.records import GROUND_REFLECTANCE, MAX_HEIGHT, MIN_HEIGHT, Lighting, check_lighting
from lighting.sky import PAINTED_SKY, SKY_MODEL, SKY_MODELS, Weather, sky_shape
from lighting.sky.hosek_wilkie import CIE_Y_INTEGRAL, sky_gradation, sky_lobe, sky_parameters

_LOBE_STEPS = 1 << 16  # of the table by the angle to the sun; taking the nearest entry errs by less than 4e-4
_TABLE_STEPS = 512  # of a row's table by that angle; values between its entries are interpolated
_CHUNK_PIXELS = 1 << 17  # painted at once, few enough for the processor's cache
_GLOW_STEPS, _PEAK_SHARE = 200, 0.9  # attempts to flatten a sun's glow, and what each leaves of its peak
_MAX_PEAK = 500.0  # radiance of the brightest part of any sky over the irradiance of the ground
_IRRADIANCE_ROWS = 128  # of the sky that is integrated to light the ground; accurate to 2e-4
_LUX = 683.0 * CIE_Y_INTEGRAL  # lm m^-2 of irradiance 1 in the units of Hosek and Wilkie's sky
_EFFICACY = 120.0  # lm / W of skylight


def render(lighting: Lighting, height: int = 512, *, sun: bool | None = None, disc: bool = True) -> Image:
    """Environment map (H, 2H, 3) of a lighting: float32, linear Rec.709, in the photo's linear values.

    The sum of the disc's radiance x solid angle is the same at every height. The ground is lit by what is painted.
    No value is over 65,504, the largest half float: a sun that would be is a wider one of the same irradiances.
    ParameterError where a light is too bright for that.

    Args:
        lighting: else ParameterError.
        height: rows, even, 16 to 4096, else ParameterError.
        sun: whether the sun is in the map; None: by `Lighting.sun_painted`.
        disc: False leaves the disc for a light of its own; the sun still lights the ground.
    """
    check_lighting(lighting)
    check_height(height)
    painted = lighting.sun_painted if sun is None else sun
    image = np.empty((height, 2 * height, 3), dtype=np.float32)
    upper, lower = image[: height // 2], image[height // 2 :]
    by_model = lighting.sky_irradiance is None and lighting.map_sky == SKY_MODEL  # others have no unit of their own
    level = sky_irradiance(lighting)
    if by_model:
        _render_clear_sky(upper, lighting)
    else:
        _render_mixed_sky(upper, lighting, level)
    if painted:
        level = level + (disc_power(lighting)[1] if by_model else _level_sun_irradiance(lighting))
    lower[0] = ground_reflectance(lighting) / math.pi * level
    lower[1:] = lower[0]  # copying whole rows is fastest
    cap_map(image, lighting)
    if painted and disc:
        add_sun(image, lighting)
    return image


def add_sun(image: Image, lighting: Lighting) -> None:
    """Add the sun to a map that lacks it; one below the horizon adds nothing.

    Args:
        image: (H, 2H, 3), changed in place.
        lighting: of the map.
    """
    power, glow = sun_irradiance(lighting), SKY_MODELS[lighting.map_sky].sun_glow
    if lighting.sun_elevation < 0:
        return
    if glow is None:
        splat_sun_disc(image, lighting, power)
    else:
        upper = image[: len(image) // 2]
        _add_sun_glow(upper, glow(latlong_directions(len(image))[: len(upper)], lighting.sun_direction), power)


def cap_map(image: Image, lighting: Lighting) -> None:
    """Bring a map to at most MAX_RADIANCE in place; the irradiances of level ground by both halves stay.

    Args:
        image: (H, 2H, 3), without the sun's disc.
        lighting: of the map, by which nearly all maps need no look.

    Raises:
        ParameterError: so much light does not fit.
    """
    if level_irradiance(lighting).max() * _MAX_PEAK <= MAX_RADIANCE:
        return
    half, levels = len(image) // 2, row_irradiance(len(image))
    for rows in (slice(0, half), slice(half, None)):
        cap_radiance(levels[rows], image[rows])


def sky_irradiance(lighting: Lighting) -> Floats:
    """Irradiance (3,) of open level ground by the sky, without the sun's disc.

    Args:
        lighting: stated, or by the sky model.
    """
    return clear_irradiance(lighting) if lighting.sky_irradiance is None else np.array(lighting.sky_irradiance)


def level_irradiance(lighting: Lighting) -> Floats:
    """Irradiance (3,) of open level ground by sky and sun.

    Args:
        lighting: whose sun counts, painted or not.
    """
    return sky_irradiance(lighting) + _level_sun_irradiance(lighting)


def _level_sun_irradiance(lighting: Lighting) -> Floats:
    return sun_irradiance(lighting) * max(float(lighting.sun_direction[1]), 0.0)


def ground_reflectance(lighting: Lighting) -> Floats:
    """Reflectance (3,) of the ground, 0 to 1: its color; else `ground_albedo`, or 0.12 where irradiances are stated.

    Args:
        lighting: with a color of the ground or none.
    """
    if lighting.ground_color is not None:
        return np.array(lighting.ground_color)
    return np.full(3, lighting.ground_albedo if lighting.sky_irradiance is None else GROUND_REFLECTANCE)


def with_irradiance(lighting: Lighting) -> Lighting:
    """The same light with its irradiances stated; a sun that is not painted has none.

    Args:
        lighting: returned as it is where it states them.
    """
    if lighting.sky_irradiance is not None:
        return lighting
    sun = sun_irradiance(lighting) if lighting.sun_painted else np.zeros(3)
    sky = sky_irradiance(lighting)
    red, green, blue = ground_reflectance(lighting).tolist()
    return replace(
        lighting,
        sun_irradiance=(float(sun[0]), float(sun[1]), float(sun[2])),
        sky_irradiance=(float(sky[0]), float(sky[1]), float(sky[2])),
        ground_color=(red, green, blue),
    )


def check_height(height: int) -> None:
    """Raise ParameterError for what is no number of rows of a map.

    Args:
        height: even, 16 to 4096.
    """
    whole = isinstance(height, Integral) and not isinstance(height, bool)
    if not whole or height % 2 or not MIN_HEIGHT <= height <= MAX_HEIGHT:
        predicate = f"is {height!r}; it must be an even number from {MIN_HEIGHT} to {MAX_HEIGHT}."
        raise ParameterError.about("height", predicate, ErrorCode.OUT_OF_RANGE if whole else ErrorCode.WRONG_TYPE)


def _render_mixed_sky(upper: Image, lighting: Lighting, irradiance: Floats) -> None:
    """Fill the upper half (H / 2, 2H, 3) of a map whose horizontal irradiance is then (3,), without the sun's disc.

    The clear sky and the overcast sky of the CIE contribute shares 1 - cover and cover of it, in each channel.
    """
    cover = lighting.sky_cover or 0.0
    if cover >= 1:
        upper[:] = _overcast_rows(len(upper)) * np.asarray(irradiance, dtype=np.float32)
        return
    _render_sky_shape(upper, lighting)
    level = irradiance_from_rows(row_irradiance(2 * len(upper))[: len(upper)], upper)
    scale_colors(upper, (1 - cover) * irradiance / np.maximum(level, EPSILON_IRRADIANCE))
    if cover > 0:
        flat, color = upper.reshape(len(upper), -1), np.asarray(cover * irradiance, dtype=np.float32)
        added = np.tile(color, upper.shape[1])  # to whole rows, as in `scale_colors`
        for row, radiance in zip(flat, _overcast_rows(len(upper))[:, 0], strict=True):
            row += radiance * added


def _add_sun_glow(upper: Image, glow: Floats, power: Floats) -> None:
    """Add a glow (H / 2, 2H) to the upper half (H / 2, 2H, 3) of a map so that its radiance x solid angle is (3,).

    Where that would be over MAX_RADIANCE, its peak is flattened as far as it must be.
    """
    weight = latlong_solid_angle(2 * len(upper))[: len(upper)]
    for _ in range(_GLOW_STEPS):
        total = max(float(weight @ glow.sum(axis=1)), EPSILON_IRRADIANCE)
        peak = glow >= _PEAK_SHARE * glow.max()
        if (upper[peak] + glow[peak][:, None] * (power / total)).max() <= MAX_RADIANCE:
            upper += np.asarray(glow[..., None] * (power / total), dtype=np.float32)
            return
        glow = np.minimum(glow, _PEAK_SHARE * glow.max())
    raise too_bright()


def _overcast_rows(rows: int) -> Image:
    """Radiance (rows, 1, 1) of the overcast sky of irradiance 1, row by row from the zenith."""
    up = np.sin(np.radians(latlong_angles(2 * rows)[1][:rows]))
    radiance = (1 + 2 * up) / 3
    return np.asarray(radiance / (row_irradiance(2 * rows)[:rows] @ radiance), dtype=np.float32)[:, None, None]


def _render_sky_shape(upper: Image, lighting: Lighting) -> None:
    """Fill the upper half with the model's radiance at any scale."""
    if lighting.map_sky == SKY_MODEL:
        _render_clear_sky(upper, lighting)
        return
    if (by_angles := SKY_MODELS[lighting.map_sky].by_angles) is not None:
        _render_by_angles(upper, lighting, by_angles)
        return
    azimuth, elevation = latlong_angles(2 * len(upper))
    rows, weather = max(1, _CHUNK_PIXELS // upper.shape[1]), _weather(lighting)
    for start in range(0, len(upper), rows):
        part = slice(start, min(start + rows, len(upper)))
        directions = direction(azimuth, elevation[part, None])
        upper[part] = sky_shape(lighting.map_sky, directions, lighting.sun_direction, weather)


def _weather(lighting: Lighting) -> Weather:
    """What shapes the sky. The strength of sun and sky is as stated, else as Hosek and Wilkie's models have it."""
    clear = clear_irradiance(lighting) / lighting.exposure
    sun = sun_irradiance(lighting)
    sky = clear * lighting.exposure if lighting.sky_irradiance is None else np.array(lighting.sky_irradiance)
    beam = float(luminance(sun)) / max(float(luminance(sky)), EPSILON_IRRADIANCE)
    diffuse = float(luminance(clear)) * _LUX / _EFFICACY
    return Weather(lighting.turbidity, lighting.ground_albedo, beam, diffuse)


@lru_cache(maxsize=1)  # a photo's sky is compared before it is painted
def _lobe_table(sun_elevation: float, turbidity: float, ground_albedo: float) -> Image:
    """`sky_lobe` of each channel (3, steps + 1) at the angles to the sun that `_render_clear_sky` looks up."""
    angle, chord2 = _lobe_angles()
    coefficients, _ = sky_parameters(sun_elevation, turbidity, ground_albedo)
    table = np.stack([sky_lobe(row, chord2, angle) for row in coefficients])
    table.setflags(write=False)  # since others get it as well
    return table


@lru_cache(maxsize=1)
def _lobe_angles() -> tuple[Image, Image]:
    """The table's angles to the sun [rad] (steps + 1,), and their squared chords."""
    share = np.linspace(0.0, 1.0, _LOBE_STEPS + 1)
    angle = np.asarray(2 * np.arctan2(share, 1 - share), dtype=np.float32)
    return angle, np.square(2 * np.sin(angle / 2))


def _render_clear_sky(image: Image, lighting: Lighting) -> None:
    """Fill the upper half (H / 2, 2H, 3) of a map: a factor and an offset per row, a look-up of the lobe per pixel."""
    lobe = _lobe_table(lighting.sun_elevation, lighting.turbidity, lighting.ground_albedo)
    factor, offset = _row_terms(lighting, 2 * len(image))
    for part, share in _sun_shares(image, lighting):
        index = (share * np.float32(_LOBE_STEPS) + np.float32(0.5)).astype(np.intp)
        for channel in range(3):
            value = lobe[channel].take(index)
            value += offset[channel, part, None]
            value *= factor[channel, part, None]
            image[part, :, channel] = np.clip(value, 0, np.inf, out=value)


def _render_by_angles(image: Image, lighting: Lighting, by_angles: Callable[..., Floats]) -> None:
    """Fill the upper half (H / 2, 2H, 3) of a map: a look-up in its row's table per pixel, between entries linear."""
    zenith = 90.0 - latlong_angles(2 * len(image))[1][: len(image)]
    steps = np.linspace(0.0, 1.0, _TABLE_STEPS + 1)
    sun_angle = np.degrees(2 * np.arctan2(steps, 1 - steps))
    table = np.asarray(by_angles(zenith, sun_angle, lighting.sun_elevation, _weather(lighting)), dtype=np.float32)
    step = np.diff(table, axis=2, append=table[..., -1:])
    for part, share in _sun_shares(image, lighting):
        share *= np.float32(_TABLE_STEPS)
        low = share.astype(np.intp)
        share -= low
        low += np.arange(len(low))[:, None] * (_TABLE_STEPS + 1)
        for channel in range(3):
            value = step[channel, part].take(low)
            value *= share
            value += table[channel, part].take(low)
            image[part, :, channel] = value


def _sun_shares(image: Image, lighting: Lighting) -> Iterator[tuple[slice, Image]]:
    """Some rows at a time of the upper half (H / 2, 2H, 3) of a map, and their pixels' angles from the sun.

    The angle g between two directions follows from sin^2(g / 2) = sin^2(de / 2) + cos e cos e' sin^2(da / 2). The row
    gives all but the last factor, and the column that one. This keeps its precision next to the sun. The angle is told
    by sin(g / 2) / (sin(g / 2) + cos(g / 2)), 0 to 1, which is as fine at both ends and needs no arcsine.
    """
    azimuth, elevation = latlong_angles(2 * len(image))
    sun = math.radians(lighting.sun_elevation)
    vertical = np.asarray(np.sin((np.radians(elevation) - sun) / 2) ** 2, dtype=np.float32)
    horizontal = np.asarray(np.cos(np.radians(elevation)) * math.cos(sun), dtype=np.float32)
    column = np.asarray(np.sin(np.radians(azimuth - lighting.sun_azimuth) / 2) ** 2, dtype=np.float32)
    rows = max(1, _CHUNK_PIXELS // image.shape[1])
    for start in range(0, len(image), rows):
        part = slice(start, min(start + rows, len(image)))
        # numpy clips at two ends in a third of the time that it takes at one
        sine2 = np.clip(vertical[part, None] + horizontal[part, None] * column, 0, 1)
        sine, cosine = np.sqrt(sine2), np.sqrt(1 - sine2)
        yield part, sine / (sine + cosine)


def _row_terms(lighting: Lighting, height: int) -> tuple[Image, Image]:
    """Factor and offset (3, H / 2) of the rows above the horizon, exposure and mean radiance in the factor."""
    up = np.sin(np.radians(latlong_angles(height)[1][: height // 2]))
    coefficients, radiance = sky_parameters(lighting.sun_elevation, lighting.turbidity, lighting.ground_albedo)
    factors, offsets = zip(*map(sky_gradation, coefficients, (up, up, up)), strict=True)
    factor = np.stack(factors) * radiance[:, None] * lighting.exposure
    return np.asarray(factor, dtype=np.float32), np.asarray(np.stack(offsets), dtype=np.float32)


def clear_irradiance(lighting: Lighting) -> Floats:
    """Irradiance (3,) of a horizontal surface by the model's clear sky without the disc.

    That of a sun below the horizon is the one of a sun on it, times how much less the Prague sky then gives.

    Args:
        lighting: whose sun, turbidity, ground albedo and exposure count.
    """
    if lighting.sun_elevation < 0:
        horizon = replace(lighting, sun_elevation=0.0)
        fading = _painted_irradiance(lighting) / _painted_irradiance(horizon)
        return np.asarray(clear_irradiance(horizon) * fading)
    sky = np.empty((_IRRADIANCE_ROWS // 2, 2 * _IRRADIANCE_ROWS, 3), dtype=np.float32)
    _render_clear_sky(sky, lighting)
    return _level_irradiance(sky)


def _painted_irradiance(lighting: Lighting) -> Floats:
    """Irradiance (3,) of a horizontal surface by PAINTED_SKY, in its own unit."""
    model, directions = SKY_MODELS[PAINTED_SKY], latlong_directions(_IRRADIANCE_ROWS)[: _IRRADIANCE_ROWS // 2]
    weather = Weather(lighting.turbidity, lighting.ground_albedo, 0.0, 0.0)
    return _level_irradiance(np.asarray(model.shape(directions, lighting.sun_direction, weather), dtype=np.float32))


def _level_irradiance(sky: Image) -> Floats:
    """Irradiance (3,) of a horizontal surface by the upper half (R, 4R, 3) of a map."""
    return np.asarray(row_irradiance(2 * len(sky))[: len(sky)] @ sky.mean(axis=1, dtype=np.float64))

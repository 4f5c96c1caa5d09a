"""Skies between clear and overcast, scaled to a given irradiance: any model shapes the clear part."""

import numpy as np

from lighting.colour import luminance
from lighting.envmap.clear import clear_irradiance, lobe_table, paint_clear
from lighting.envmap.disc import sun_irradiance
from lighting.envmap.maps import Image, f32, irradiance_of, row_levels, scale
from lighting.geometry import Floats, latlong_angles, latlong_directions, latlong_solid_angle
from lighting.records import Lighting
from lighting.sky import SKY_MODEL, Weather, sky_shape
from lighting.sky.hosek_wilkie import CIE_Y_INTEGRAL

_LUX = 683.0 * CIE_Y_INTEGRAL  # lm m^-2 of irradiance 1 in the units of Hosek and Wilkie's sky
_EFFICACY = 120.0  # lm / W of skylight
_LEAST = 1e-12  # irradiance that stands for none


def paint_mixture(upper: Image, lighting: Lighting, irradiance: Floats) -> None:
    """Fill the upper half (H / 2, 2H, 3) of a map whose horizontal irradiance is then (3,), the sun's disc apart.

    The clear sky and the overcast sky of the CIE contribute shares 1 - cover and cover of it, in each channel.
    """
    cover = lighting.sky_cover or 0.0
    if cover >= 1:
        upper[:] = _overcast_rows(len(upper)) * f32(irradiance)
        return
    _paint_shape(upper, lighting)
    level = irradiance_of(row_levels(2 * len(upper))[: len(upper)], upper)
    scale(upper, (1 - cover) * irradiance / np.maximum(level, _LEAST))
    if cover > 0:
        _add_rows(upper, _overcast_rows(len(upper)), cover * irradiance)


def add_sun_glow(upper: Image, glow: Floats, power: Floats) -> None:
    """Add a glow (H / 2, 2H) to the upper half (H / 2, 2H, 3) of a map so that its radiance x solid angle is (3,)."""
    weight = latlong_solid_angle(2 * len(upper))[: len(upper)]
    total = max(float(weight @ glow.sum(axis=1)), _LEAST)
    upper += f32(glow[..., None] * (power / total))


def _overcast_rows(rows: int) -> Image:
    """Radiance (rows, 1, 1) of the overcast sky of irradiance 1, row by row from the zenith."""
    up = np.sin(np.radians(latlong_angles(2 * rows)[1][:rows]))
    radiance = (1 + 2 * up) / 3
    return f32(radiance / (row_levels(2 * rows)[:rows] @ radiance))[:, None, None]


def _add_rows(upper: Image, rows: Image, colour: Floats) -> None:
    """Add rows (rows, 1, 1) of a colour (3,) to a map, by whole rows as `scale` multiplies."""
    flat = upper.reshape(len(upper), -1)
    flat += rows[:, 0] * np.tile(f32(colour), upper.shape[1])


def _paint_shape(upper: Image, lighting: Lighting) -> None:
    """Fill the upper half with the model's radiance at any scale."""
    if lighting.sky_model == SKY_MODEL:
        paint_clear(upper, lighting, lobe_table(lighting))
        return
    directions = latlong_directions(2 * len(upper))[: len(upper)]
    upper[:] = sky_shape(lighting.sky_model, directions, lighting.sun_direction, _weather(lighting))


def _weather(lighting: Lighting) -> Weather:
    """What shapes the sky. The strength of sun and sky is as given, else as Hosek and Wilkie's models have it."""
    clear = clear_irradiance(lighting, lobe_table(lighting)) / lighting.exposure
    sun = sun_irradiance(lighting)
    sky = clear * lighting.exposure if lighting.sky_irradiance is None else np.array(lighting.sky_irradiance)
    beam = float(luminance(sun)) / max(float(luminance(sky)), _LEAST)
    diffuse = float(luminance(clear)) * _LUX / _EFFICACY
    return Weather(lighting.turbidity, lighting.ground_albedo, beam, diffuse)

"""Models of the sky's radiance, as functions of arrays; a sky has no ground and, unless said, no disc of the sun."""

from lighting.sky.cie import general_luminance, overcast_luminance
from lighting.sky.hosek_wilkie import (
    SUN_SOLID_ANGLE,
    sky_coefficients,
    sky_gradation,
    sky_lobe,
    sky_parameters,
    sky_radiance,
    sun_disc_points,
    sun_disc_radiance,
    sun_radiance,
)
from lighting.sky.perez import perez_luminance, sky_brightness, sky_clearness

__all__ = [
    "SUN_SOLID_ANGLE",
    "general_luminance",
    "overcast_luminance",
    "perez_luminance",
    "sky_brightness",
    "sky_clearness",
    "sky_coefficients",
    "sky_gradation",
    "sky_lobe",
    "sky_parameters",
    "sky_radiance",
    "sun_disc_points",
    "sun_disc_radiance",
    "sun_radiance",
]

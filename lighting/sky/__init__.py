"""Models of the sky's radiance, as functions of arrays; a sky has no ground and, unless said, no disc of the sun."""

from lighting.sky.cie import general_luminance, overcast_luminance
from lighting.sky.hosek_wilkie import (
    CIE_Y_INTEGRAL,
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
from lighting.sky.lalonde_matthews import lalonde_matthews_sky, lalonde_matthews_sun
from lighting.sky.models import MODELS, Model, Weather, sky_shape
from lighting.sky.perez import perez_luminance, sky_brightness, sky_clearness
from lighting.sky.preetham import preetham_luminance, preetham_radiance

__all__ = [
    "CIE_Y_INTEGRAL",
    "MODELS",
    "SUN_SOLID_ANGLE",
    "Model",
    "Weather",
    "general_luminance",
    "lalonde_matthews_sky",
    "lalonde_matthews_sun",
    "overcast_luminance",
    "perez_luminance",
    "preetham_luminance",
    "preetham_radiance",
    "sky_brightness",
    "sky_clearness",
    "sky_coefficients",
    "sky_gradation",
    "sky_lobe",
    "sky_parameters",
    "sky_radiance",
    "sky_shape",
    "sun_disc_points",
    "sun_disc_radiance",
    "sun_radiance",
]

"""Environment maps of a Lighting: the sky, a sun of the right power, and the ground that they light.

An environment map is a lat-long image (H, 2H, 3), float32, linear Rec.709, in the pixel layout of geometry.py. Its
values are the photo's own linear values. A lighting that has `sky_irradiance` and `sun_irradiance` gets a map whose
integrals equal them; else they follow from `exposure` x the sky model's radiance.
"""

import math
from dataclasses import replace
from numbers import Integral

import numpy as np

from lighting.envmap.clear import clear_irradiance, lobe_table, paint_clear
from lighting.envmap.disc import disc_power, paint_disc, sun_irradiance
from lighting.envmap.maps import Image
from lighting.envmap.mixture import add_sun_glow, paint_mixture
from lighting.errors import ErrorCode, ParameterError
from lighting.geometry import Floats, latlong_directions
from lighting.records import GROUND_REFLECTANCE, MAX_HEIGHT, MIN_HEIGHT, Lighting, check_lighting
from lighting.sky import SKY_MODEL, SKY_MODELS


def render(lighting: Lighting, height: int = 512, *, sun: bool | None = None, disc: bool = True) -> Image:
    """Environment map (H, 2H, 3) of a lighting; `height` is even, 16 to 4096.

    `sun` says whether the sun is in it; None leaves that to `Lighting.sun_painted`. The sum of the disc's radiance x
    solid angle is the same at every height, and the ground is lit by what is painted. Without `disc` the sun lights the
    ground and is left for a light of its own. Raises ParameterError for another height, and for what is no Lighting.
    """
    check_lighting(lighting)
    check_height(height)
    painted = lighting.sun_painted if sun is None else sun
    image = np.empty((height, 2 * height, 3), dtype=np.float32)
    if lighting.sky_irradiance is None and lighting.sky_model == SKY_MODEL:
        level = _paint_clear_sky(image[: height // 2], lighting, painted)
    else:
        level = _paint_given_sky(image[: height // 2], lighting, painted)
    _paint_ground(image[height // 2 :], ground_reflectance(lighting) / math.pi * level)
    if painted and disc:
        add_sun(image, lighting)
    return image


def add_sun(image: Image, lighting: Lighting) -> None:
    """Add the sun to a map (H, 2H, 3) of that light which lacks it."""
    power, glow = sun_irradiance(lighting), SKY_MODELS[lighting.sky_model].sun_glow
    if glow is None:
        paint_disc(image, lighting, power)
    else:
        upper = image[: len(image) // 2]
        add_sun_glow(upper, glow(latlong_directions(len(image))[: len(upper)], lighting.sun_direction), power)


def sky_irradiance(lighting: Lighting) -> Floats:
    """Irradiance (3,) of open level ground by the sky, without the sun's disc."""
    if lighting.sky_irradiance is not None:
        return np.array(lighting.sky_irradiance)
    return clear_irradiance(lighting, lobe_table(lighting))


def level_irradiance(lighting: Lighting) -> Floats:
    """Irradiance (3,) of open level ground by sky and sun, whether or not the sun is painted."""
    return sky_irradiance(lighting) + sun_irradiance(lighting) * max(float(lighting.sun_direction[1]), 0.0)


def ground_reflectance(lighting: Lighting) -> Floats:
    """Reflectance (3,) of the ground: its colour; else `ground_albedo`, or 0.12 where irradiances are given."""
    if lighting.ground_color is not None:
        return np.array(lighting.ground_color)
    return np.full(3, lighting.ground_albedo if lighting.sky_irradiance is None else GROUND_REFLECTANCE)


def with_irradiance(lighting: Lighting) -> Lighting:
    """The same light with its irradiances stated; a sun that is not painted has none."""
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
    """Raise ParameterError for what is no number of rows of a map."""
    if (
        isinstance(height, bool)
        or not isinstance(height, Integral)
        or height % 2
        or not MIN_HEIGHT <= height <= MAX_HEIGHT
    ):
        predicate = f"is {height!r}; it must be an even number from {MIN_HEIGHT} to {MAX_HEIGHT}."
        raise ParameterError.about("height", predicate, ErrorCode.OUT_OF_RANGE)


def _paint_clear_sky(upper: Image, lighting: Lighting, painted: bool) -> Floats:
    """Fill the upper half (H / 2, 2H, 3) by the model alone; the irradiance (3,) of the ground."""
    lobe = lobe_table(lighting)
    direct = disc_power(lighting)[1] if painted else np.zeros(3)
    paint_clear(upper, lighting, lobe)
    return np.asarray(direct + clear_irradiance(lighting, lobe))


def _paint_given_sky(upper: Image, lighting: Lighting, painted: bool) -> Floats:
    """The same for a sky whose irradiance is given, or whose model has no unit of its own."""
    power = sun_irradiance(lighting) if painted else np.zeros(3)
    sky = sky_irradiance(lighting)
    paint_mixture(upper, lighting, sky)
    return np.asarray(sky + power * max(float(lighting.sun_direction[1]), 0.0))


def _paint_ground(image: Image, radiance: Floats) -> None:
    """Fill the lower half (H / 2, 2H, 3) with one colour (3,); copying whole rows is fastest."""
    image[0] = radiance
    image[1:] = image[0]

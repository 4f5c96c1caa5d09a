"""The strength and the colour of the light that the network states, set right where it is known to err."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from lighting.colour import luminance
from lighting.geometry import Floats, direction
from lighting.records import Colour, Light, Lighting, clipped_colour, significant
from lighting.sky.hosek_wilkie import sun_radiance

_SURE = 0.8  # visibility from which the sun has its full irradiance
_FADING = 5.0  # power of the fall below it, by panoramas of `train` that the networks asked about them never saw
_SHY = 0.18  # stops by which a sun that shines is understated; `python -m export fit sun-power` fitted it on `train`
_HIDDEN_SKY = 0.7  # stops by which an overcast sky is understated, by the overcast HDR panoramas of `train`
_USUAL = 0.4  # power to which a sun goes to the clear sun's colour, of `python -m export fit sun-color` on `train`
_CLEAR = 3.0  # turbidity of those suns
_WHITE = 60.0  # deg of elevation of the clear sun that cameras show as white
_LOW = (3.0, 12.0)  # deg of elevation between which the sun's colour follows its known elevation
_TINT = 0.5  # power of the ratio of clear suns' colours; fitted to the HDR panoramas of `train`
_DARKEST = 1e-6  # irradiance that stands for none where logarithms are averaged


@dataclass(frozen=True)
class Strength:
    """How strong a light is; the fields are those of a Lighting."""

    sun_irradiance: Colour
    sky_irradiance: Colour
    sky_cover: float
    suitable: float


def strength_of(light: Light, visibility: float) -> Strength:
    """How strong a light is of which the network says this, of a sun with this visibility (0 to 1).

    Of a sun that shines the network states a little less than such suns give, for it keeps to the middle. Under cloud
    it states too weak a sky, for most such skies that it learnt from are clipped pictures.
    """
    cover = float(np.clip(light.cover, 0.0, 1.0))
    return Strength(
        sun_irradiance=clipped_colour(light.sun_irradiance * 2.0**_SHY * fading(visibility), "sun_irradiance"),
        sky_irradiance=clipped_colour(light.sky_irradiance * 2.0 ** (_HIDDEN_SKY * cover), "sky_irradiance"),
        sky_cover=significant(cover),
        suitable=significant(float(np.clip(light.suitable, 0.0, 1.0))),
    )


def fading(visibility: float) -> float:
    """The share of its irradiance that the sun keeps, by the probability that its light reaches the scene.

    The network states the power of a sun that may be covered as something between none and that of a clear sky. Where
    it doubts that the sun shines, a sun painted at that power casts a shadow that is not in the photo.
    """
    return float(np.clip(visibility / _SURE, 0.0, 1.0) ** _FADING)


def tinted(irradiance: Colour, said: float, known: float) -> Colour:
    """The sun's irradiance, as bright as before, where its elevation [deg] is `known` and the pixels `said` another.

    The network learnt most suns' colours from 8-bit panoramas, in whose blue skies there is too little red, and gives
    them to the sun: the colour is drawn to that of a clear sun as high as said. And it states the colour of a sun where
    it has it, and puts low suns too high: their light is too white. One that is higher than said, or above 12 deg, is
    not turned to what is known.
    """
    stated = np.array(irradiance)
    if float(luminance(stated)) == 0.0:
        return irradiance
    return clipped_colour(
        as_bright(toward_clear(stated, said, _USUAL) * _turned(said, known), stated), "sun_irradiance"
    )


def toward_clear(irradiance: Floats, elevation: float, power: float) -> Floats:
    """A sun's irradiance (3,), as bright as before, with its colour drawn to a clear sun's at an elevation [deg]."""
    usual = _clear_sun(max(elevation, _LOW[0])) / _clear_sun(_WHITE)
    return as_bright(irradiance ** (1 - power) * as_bright(usual, irradiance) ** power, irradiance)


def as_bright(values: Floats, other: Floats) -> Floats:
    """Values (3,) with the luminance of others."""
    return values * (float(luminance(other)) / float(luminance(values)))


def _turned(said: float, known: float) -> Floats:
    """Factors (3,) by which clear suns differ at a known elevation and at that which the pixels said [deg]."""
    there, here = (float(np.clip(e, *_LOW)) for e in (min(known, said), said))
    return np.ones(3) if there == here else (_clear_sun(there) / _clear_sun(here)) ** _TINT


@lru_cache(maxsize=64)
def _clear_sun(elevation: float) -> Floats:
    """The radiance (3,) of a clear sun, which is nobody's to change."""
    radiance = sun_radiance(direction(0.0, elevation), _CLEAR)
    radiance.flags.writeable = False
    return radiance


def with_ground(lighting: Lighting, reflectance: Floats | None) -> Lighting:
    """The lighting over ground of a reflectance (3,), or as it is where none is known."""
    return (
        lighting if reflectance is None else replace(lighting, ground_color=clipped_colour(reflectance, "ground_color"))
    )


def light_numbers(light: Light) -> Floats:
    """What of a Light may be averaged over pictures (8,): logarithms of the irradiances, and the two shares."""
    irradiance = np.concatenate([light.sun_irradiance, light.sky_irradiance])
    return np.concatenate([np.log(np.maximum(irradiance, _DARKEST)), [light.cover, light.suitable]])


def light_of_numbers(numbers: Floats) -> Light:
    """The Light of `light_numbers` (8,), without what lies around."""
    irradiance = np.exp(numbers[:6])
    return Light(irradiance[:3], irradiance[3:], float(numbers[6]), float(numbers[7]))

"""Network output -> sun direction, credible radii, irradiances."""

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.circular import MODE_SMOOTHING, MODE_WIDTH, circular_mode
from lighting.color import luminance
from lighting.geometry import Floats, angles, direction, wrap_azimuth
from lighting.records import (
    Color,
    EvidenceKind,
    Light,
    Lighting,
    Prediction,
    SunEstimate,
    clip_color,
    clip_to_range,
    round_significant,
)
from lighting.sky.hosek_wilkie import sun_radiance
from lighting.sun_grid import credible_radii, grid_directions

# The strength and the colour of the light that the network states, set right where it is known to err.

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
class _Strength:
    """How strong a light is; the fields are those of a Lighting."""

    sun_irradiance: Color
    sky_irradiance: Color
    sky_cover: float
    suitable: float


def _irradiance_from_network(light: Light, visibility: float) -> _Strength:
    """How strong a light is of which the network says this, of a sun with this visibility (0 to 1).

    Of a sun that shines the network states a little less than such suns give, for it keeps to the middle. Under cloud
    it states too weak a sky, for most such skies that it learnt from are clipped pictures.
    """
    cover = float(np.clip(light.cover, 0.0, 1.0))
    return _Strength(
        sun_irradiance=clip_color(
            light.sun_irradiance * 2.0**_SHY * _visibility_attenuation(visibility), "sun_irradiance"
        ),
        sky_irradiance=clip_color(light.sky_irradiance * 2.0 ** (_HIDDEN_SKY * cover), "sky_irradiance"),
        sky_cover=round_significant(cover),
        suitable=round_significant(float(np.clip(light.suitable, 0.0, 1.0))),
    )


def _visibility_attenuation(visibility: float) -> float:
    """The share of its irradiance that the sun keeps, by the probability that its light reaches the scene.

    The network states the power of a sun that may be covered as something between none and that of a clear sky. Where
    it doubts that the sun shines, a sun painted at that power casts a shadow that is not in the photo.
    """
    return float(np.clip(visibility / _SURE, 0.0, 1.0) ** _FADING)


def correct_sun_color(irradiance: Color, said: float, known: float) -> Color:
    """The sun's irradiance, as bright as before, where its elevation [deg] is `known` and the pixels `said` another.

    The network learnt most suns' colours from 8-bit panoramas, in whose blue skies there is too little red, and gives
    them to the sun: the colour is drawn to that of a clear sun as high as said. And it states the colour of a sun where
    it has it, and puts low suns too high: their light is too white. One that is higher than said, or above 12 deg, is
    not turned to what is known.
    """
    stated = np.array(irradiance)
    if float(luminance(stated)) == 0.0:
        return irradiance
    return clip_color(
        _match_luminance(blend_to_clear_sun(stated, said, _USUAL) * _turned(said, known), stated), "sun_irradiance"
    )


def blend_to_clear_sun(irradiance: Floats, elevation: float, power: float) -> Floats:
    """A sun's irradiance (3,), as bright as before, with its colour drawn to a clear sun's at an elevation [deg]."""
    usual = _clear_sun(max(elevation, _LOW[0])) / _clear_sun(_WHITE)
    return _match_luminance(irradiance ** (1 - power) * _match_luminance(usual, irradiance) ** power, irradiance)


def _match_luminance(values: Floats, other: Floats) -> Floats:
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


def with_ground_color(lighting: Lighting, reflectance: Floats | None) -> Lighting:
    """The lighting over ground of a reflectance (3,), or as it is where none is known."""
    return lighting if reflectance is None else replace(lighting, ground_color=clip_color(reflectance, "ground_color"))


def light_to_vector(light: Light) -> Floats:
    """What of a Light may be averaged over pictures (8,): logarithms of the irradiances, and the two shares."""
    irradiance = np.concatenate([light.sun_irradiance, light.sky_irradiance])
    return np.concatenate([np.log(np.maximum(irradiance, _DARKEST)), [light.cover, light.suitable]])


def light_from_vector(numbers: Floats) -> Light:
    """The Light of `light_numbers` (8,), without what lies around."""
    irradiance = np.exp(numbers[:6])
    return Light(irradiance[:3], irradiance[3:], float(numbers[6]), float(numbers[7]))


# Decode the network's answer: one direction with radii from a distribution, and a Lighting from a prediction.

_LIKELIEST = 64  # the likeliest cells; only they may be the answer, so that it never lies between two modes
_LIKELY = 0.05  # least probability of such a cell, as a share of the likeliest cell's
_WRONG = 60.0  # deg; larger errors count as this one. 45 gave the same accuracy on unseen places
_REFINED = 25.0  # deg around the best cell over which the answer is averaged
_TARGET = 4.0  # deg, spread of the lobes around true suns that networks are trained to say


def sun_from_prediction(prediction: Prediction) -> SunEstimate:
    """The sun's direction and radii by the network's distribution alone."""
    grid = prediction.spec.sun_grid
    sun = bayes_direction(prediction.sun_probability, grid)
    azimuth, elevation = angles(sun)
    radius_50, radius_90 = credible_radii(prediction.sun_probability, grid_directions(grid), sun)
    return SunEstimate(float(azimuth), float(elevation), radius_50, radius_90)


def predicted_sun_elevation(prediction: Prediction) -> float:
    """The sun's elevation [deg] by the pixels alone."""
    return float(angles(bayes_direction(prediction.sun_probability, prediction.spec.sun_grid))[1])


def lighting_from_prediction(prediction: Prediction, sun: SunEstimate | None = None) -> Lighting:
    """The Lighting of a prediction, with every value clipped to its range.

    `sun` is the sun's direction by all evidence; without it, the direction is that of the network's distribution.
    """
    where = sun or sun_from_prediction(prediction)
    strength = _irradiance_from_network(prediction.light, prediction.sun_visibility) if prediction.light else None
    return Lighting(
        sun_azimuth=clip_to_range("sun_azimuth", where.azimuth),
        sun_elevation=clip_to_range("sun_elevation", where.elevation),
        sun_visibility=clip_to_range("sun_visibility", prediction.sun_visibility),
        radius_50=clip_to_range("radius_50", where.radius_50),
        radius_90=clip_to_range("radius_90", where.radius_90),
        turbidity=clip_to_range("turbidity", prediction.turbidity),
        exposure=clip_to_range("exposure", prediction.exposure),
        camera_elevation=clip_to_range("camera_elevation", prediction.camera_elevation),
        camera_roll=clip_to_range("camera_roll", prediction.camera_roll),
        vertical_fov=clip_to_range("vertical_fov", prediction.vertical_fov),
        sun_irradiance=strength.sun_irradiance if strength else None,
        sky_irradiance=strength.sky_irradiance if strength else None,
        sky_cover=strength.sky_cover if strength else None,
        suitable=strength.suitable if strength else None,
        model_name=prediction.spec.name,
        model_version=prediction.spec.version,
        evidence=(EvidenceKind.PIXELS,),
    )


def bayes_direction(probability: ArrayLike, layout: str) -> Floats:
    """The sun's direction (3,) for probabilities (N,) of a layout's cells.

    Of the likeliest cells it takes the one with the least expected error. Errors over 60 deg count as 60 deg, because
    an unbounded error would pull the answer between two modes, where no sun is likely. The weighted mean of the cells
    within 25 deg of that cell then removes the error of the grid. Near the horizon that mean stands too high.
    """
    p = np.asarray(probability, dtype=np.float64)
    cells = grid_directions(layout)
    likely = np.argpartition(p, -min(_LIKELIEST, len(p)))[-_LIKELIEST:]
    likely = likely[p[likely] >= _LIKELY * p.max()]
    centre = cells[likely[int(np.argmin(_bounded_errors(layout)[likely] @ p.astype(np.float32)))]]
    near = p * (cells @ centre >= np.cos(np.radians(_REFINED)))
    azimuth, elevation = angles(near @ cells)
    return direction(azimuth, np.interp(elevation, *_lifted()))


@lru_cache(maxsize=1)
def _lifted() -> tuple[Floats, Floats]:
    """Mean elevations [deg] of the lobes that networks are trained to say, and the elevations of their suns.

    The horizon cuts the lobes off: the mean of a normal distribution that is cut off so, for a sun on the horizon 3.2.
    """
    sun = np.append(np.arange(0.0, 5.0, 0.25) * _TARGET, 90.0)
    kept = [0.5 * (1.0 + math.erf(math.sqrt(0.5) * e / _TARGET)) for e in sun]
    density = np.exp(-0.5 * (sun / _TARGET) ** 2) / math.sqrt(2.0 * math.pi)
    return sun + _TARGET * density / np.array(kept), sun


@lru_cache(maxsize=8)
def _bounded_errors(layout: str) -> NDArray[np.float32]:
    """Angles [deg] (N, N) between cells, at most _WRONG."""
    cells = grid_directions(layout).astype(np.float32)
    cosine = np.clip(cells @ cells.T, np.float32(-1), np.float32(1))
    return np.asarray(np.minimum(np.degrees(np.arccos(cosine)), np.float32(_WRONG)))


def sun_from_rings(directions: Floats, probability: Floats) -> SunEstimate:
    """The sun's direction and radii by probabilities (N,) of unit vectors (N, 3) that lie on few rings of elevation.

    Azimuth and elevation are averaged separately, because the mean vector of a ring lies above the ring.
    """
    azimuth, elevation = angles(directions)
    best = circular_mode(azimuth, probability)
    near = probability * (np.abs(wrap_azimuth(azimuth - best)) <= MODE_WIDTH)
    near = near * (np.abs(elevation - _likeliest_ring(elevation, near)) <= MODE_WIDTH)
    centre_elevation = float(near @ elevation / near.sum())
    centre = direction(best, centre_elevation)
    radius_50, radius_90 = credible_radii(probability, directions, centre)
    return SunEstimate(best, centre_elevation, radius_50, radius_90)


def _likeliest_ring(elevation: Floats, probability: Floats) -> float:
    """The elevation [deg], one of those given (N,), around which most of the probability (N,) lies."""
    rings, member = np.unique(np.round(elevation, 6), return_inverse=True)
    kernel = np.exp(-0.5 * ((rings[:, None] - rings) / MODE_SMOOTHING) ** 2)
    return float(rings[np.argmax(kernel @ np.bincount(member, probability))])

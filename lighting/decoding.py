"""Network output -> a light: the sun with credible radii, irradiances, colors."""

import math
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from lighting.color import LUMINANCE_WEIGHTS
from lighting.fields import clip_color, clip_to_range, round_significant
from lighting.geometry import Floats, angles, direction, wrap_azimuth
from lighting.prediction import Light, Prediction, SunDistribution, SunEstimate
from lighting.records import Color, EvidenceKind, Lighting, SunCandidate, visibility_attenuation
from lighting.sky import PAINTED_SKY
from lighting.sky.clear_sky import sun_radiance
from lighting.sun_grid import MODE_SMOOTHING, MODE_WIDTH, circular_mode, credible_radii, grid_directions, likeliest_suns

_DAPPLED_VISIBILITY = (0.25, 0.8)  # in which the network doubts that the sun shines
_LEAST_DAPPLED = 0.5  # visibility of a sun that reaches a part of the ground, as 25 of 29 photos of `train` show it
_MIN_DAPPLED_ELEVATION = 5.0  # deg, of a sun whose patches on the ground say how strong it is
_MIN_DAPPLED_SUN = 0.05  # irradiance of level ground by such a sun as the network sees it, over that by the sky
_MAX_SUN_OVER_SKY = 8.0  # irradiance of a surface that faces a clear sun, over that of level ground by the sky
_SUN_STOPS = 0.6  # by which a shining sun is understated; `python -m export fit sun-power` fitted it on `train`
_OVERCAST_STOPS = 0.7  # by which an overcast sky is understated, by the overcast HDR panoramas of `train`
_CLEAR_SUN_EXPONENT = 0.5  # of a sun's way to the clear sun's color, by `python -m export fit sun-color` on `train`
_CLEAR_TURBIDITY = 3.0  # of those suns
_WHITE_SUN = np.array([21908.559615977054, 18350.301859756382, 14137.675617182045])  # such a sun, 60 deg high: white
_LOW_ELEVATIONS = (3.0, 12.0)  # deg between which the sun's color follows its known elevation
_ELEVATION_EXPONENT = 0.5  # of the ratio of clear suns' colors; fitted to the HDR panoramas of `train`
_CLIPPED_PARAMETERS = ("sun_visibility", "turbidity", "exposure", "camera_elevation", "camera_roll", "vertical_fov")
_EPSILON_IRRADIANCE = 1e-6  # stands for none where logarithms are averaged


# The sun's direction with credible radii, from a distribution.


def sun_from_prediction(prediction: Prediction) -> SunEstimate:
    """The sun's direction and radii by the network's distribution alone.

    Args:
        prediction: of the network.
    """
    sun, cells = prediction.sun_direction, grid_directions(prediction.spec.sun_grid)
    radius_50, radius_90 = credible_radii(prediction.sun_probability, cells, sun)
    azimuth, elevation = angles(sun)
    return SunEstimate(float(azimuth), float(elevation), radius_50, radius_90)


def sun_from_rings(directions: Floats, probability: Floats) -> SunEstimate:
    """The sun's direction and radii by a distribution over few rings of elevation.

    Azimuth and elevation are averaged separately, because the mean vector of a ring lies above the ring.

    Args:
        directions: (N, 3) unit vectors.
        probability: (N,) of each.
    """
    azimuth, elevation = angles(directions)
    best = circular_mode(azimuth, probability)
    near = probability * (np.abs(wrap_azimuth(azimuth - best)) <= MODE_WIDTH)
    near = near * (np.abs(elevation - _likeliest_ring(elevation, near)) <= MODE_WIDTH)
    best_elevation = float(near @ elevation / near.sum())
    radius_50, radius_90 = credible_radii(probability, directions, direction(best, best_elevation))
    return SunEstimate(best, best_elevation, radius_50, radius_90)


def candidate_suns(lighting: Lighting, directions: Floats, distribution: SunDistribution) -> tuple[SunCandidate, ...]:
    """Return the suns that a person may choose from; the first is the answer's own.

    Args:
        lighting: the answer.
        directions: (M, 3) unit vectors that a sun may have: the grid's cells, or rings of known elevation.
        distribution: by all evidence.
    """
    suns, shares = likeliest_suns(lighting.sun_direction, distribution.probability, directions, distribution.grid)
    azimuth, elevation = np.round(angles(suns), 2)
    first = (lighting.sun_azimuth, lighting.sun_elevation)
    each = [first, *zip(azimuth[1:].tolist(), elevation[1:].tolist(), strict=True)]
    return tuple(SunCandidate(*sun, round(float(share), 3)) for sun, share in zip(each, shares, strict=True))


def _likeliest_ring(elevation: Floats, probability: Floats) -> float:
    """The elevation [deg], one of those of the rings (N,), near which most of the probability (N,) lies."""
    rings, member = np.unique(np.round(elevation, 6), return_inverse=True)
    kernel = np.exp(-0.5 * ((rings[:, None] - rings) / MODE_SMOOTHING) ** 2)
    return float(rings[np.argmax(kernel @ np.bincount(member, probability))])


# A Lighting from a prediction.


def lighting_from_prediction(prediction: Prediction, sun: SunEstimate | None = None) -> Lighting:
    """The Lighting of a prediction, with every value clipped to its range.

    Args:
        prediction: of the network, or fused with what else is known.
        sun: by all evidence; None: by the network's distribution.
    """
    sun, spec = sun or sun_from_prediction(prediction), prediction.spec
    raw = {"sun_azimuth": sun.azimuth, "sun_elevation": sun.elevation}
    raw |= {name: getattr(sun, name) for name in ("radius_50", "radius_90")}
    raw |= {name: getattr(prediction, name) for name in _CLIPPED_PARAMETERS}
    light = prediction.light
    values: Any = {} if light is None else _stated_light(light, prediction.sun_visibility)
    values |= zip(raw, map(clip_to_range, raw, raw.values()), strict=True)
    return Lighting(
        **values,
        model_name=spec.name,
        model_version=spec.version,
        evidence=(EvidenceKind.PIXELS,),
        sky_painted=PAINTED_SKY,
    )


def _stated_light(light: Light, visibility: float) -> dict[str, Color | float]:
    """The fields of a Lighting that a predicted light states, of a sun with this visibility (0 to 1).

    Of a sun that shines the network predicts a little less than such suns give, for it keeps to the middle. Under cloud
    it predicts too weak a sky, for most such skies that it learned from are clipped pictures.
    """
    cover, suitable = (float(np.clip(share, 0.0, 1.0)) for share in (light.cover, light.suitable))
    sun = light.sun_irradiance * 2.0**_SUN_STOPS * visibility_attenuation(visibility)
    sky = light.sky_irradiance * 2.0 ** (_OVERCAST_STOPS * cover)
    return {
        "sun_irradiance": clip_color(sun, "sun_irradiance"),
        "sky_irradiance": clip_color(sky, "sky_irradiance"),
        "sky_cover": round_significant(cover),
        "suitable": round_significant(suitable),
    }


def doubts_sun(lighting: Lighting) -> bool:
    """Whether the network doubts that the sun shines, where patches of it on the ground would tell how strong it is.

    It does not where it is sure of sun or shade, or where it sees next to no sun.

    Args:
        lighting: with irradiances, else it tells nothing.
    """
    if lighting.sun_irradiance is None or lighting.sky_irradiance is None:
        return False
    low, high = _DAPPLED_VISIBILITY
    if not low <= lighting.sun_visibility < high or lighting.sun_elevation < _MIN_DAPPLED_ELEVATION:
        return False
    sun, sky = (
        float(color @ LUMINANCE_WEIGHTS) for color in np.array([lighting.sun_irradiance, lighting.sky_irradiance])
    )
    level = sun / visibility_attenuation(lighting.sun_visibility) * math.sin(math.radians(lighting.sun_elevation))
    return bool(sun > 0 and level >= _MIN_DAPPLED_SUN * sky)


def with_dappled_sun(lighting: Lighting, share: float, step: float) -> Lighting:
    """The lighting with as much sun as its ground has in patches. Its visibility is then 0.5 at least.

    Args:
        lighting: whose sun is in doubt, by `doubts_sun`.
        share: of the ground that the sun reaches, 0 to 1.
        step: stops between sun and shade there, which say how strong the sun is beside the sky.
    """
    sun, sky = np.array(lighting.sun_irradiance), float(np.array(lighting.sky_irradiance) @ LUMINANCE_WEIGHTS)
    own, height = float(sun @ LUMINANCE_WEIGHTS), math.sin(math.radians(lighting.sun_elevation))
    strength = share * min((2.0**step - 1) * sky / height, _MAX_SUN_OVER_SKY * sky)
    reached = replace(lighting, sun_visibility=max(lighting.sun_visibility, _LEAST_DAPPLED))
    if strength <= own:
        return reached
    return replace(reached, sun_irradiance=clip_color(sun * strength / own, "sun_irradiance"))


def with_ground_color(lighting: Lighting, reflectance: Floats | None) -> Lighting:
    """The lighting over ground of a reflectance.

    Args:
        lighting: to change.
        reflectance: (3,) linear Rec.709, 0 to 1; None leaves the lighting as it is.
    """
    return lighting if reflectance is None else replace(lighting, ground_color=clip_color(reflectance, "ground_color"))


def light_to_vector(light: Light) -> Floats:
    """What of a Light may be averaged over pictures (8,): logarithms of the irradiances, and the two shares.

    Args:
        light: of the network.
    """
    irradiance = np.concatenate([light.sun_irradiance, light.sky_irradiance])
    return np.concatenate([np.log(np.maximum(irradiance, _EPSILON_IRRADIANCE)), [light.cover, light.suitable]])


def light_from_vector(vector: Floats) -> Light:
    """The Light of a vector, without its surroundings.

    Args:
        vector: (8,), as `light_to_vector` returns it.
    """
    irradiance = np.exp(vector[:6])
    return Light(irradiance[:3], irradiance[3:], float(vector[6]), float(vector[7]))


# The sun's color, set right where the network is known to err.


def correct_sun_color(irradiance: Color, predicted_elevation: float, known_elevation: float) -> Color:
    """The sun's irradiance, as bright as before, in the color of its known elevation.

    The network learned most suns' colors from 8-bit panoramas. Their blue skies have too little red, and the network
    gives it to the sun. So the color is drawn to that of a clear sun at the predicted elevation. The network also puts
    low suns too high, and their light is too white. A sun that is higher than predicted, or above 12 deg, keeps its
    color otherwise.

    Args:
        irradiance: linear Rec.709, of the network.
        predicted_elevation: deg, of the sun by the pixels.
        known_elevation: deg, of the sun by all evidence.
    """
    predicted = np.array(irradiance)
    if float(predicted @ LUMINANCE_WEIGHTS) == 0.0:
        return irradiance
    blended = blend_to_clear_sun(predicted, predicted_elevation, _CLEAR_SUN_EXPONENT)
    corrected = blended * _elevation_factors(predicted_elevation, known_elevation)
    return clip_color(_match_luminance(corrected, predicted), "sun_irradiance")


def blend_to_clear_sun(irradiance: Floats, elevation: float, exponent: float) -> Floats:
    """A sun's irradiance (3,), as bright as before, with its color drawn to a clear sun's.

    Args:
        irradiance: (3,) linear Rec.709, above 0.
        elevation: deg, of the clear sun.
        exponent: 0 keeps the color, 1 is the clear sun's.
    """
    clear = _clear_sun(max(elevation, _LOW_ELEVATIONS[0])) / _WHITE_SUN
    return _match_luminance(irradiance ** (1 - exponent) * _match_luminance(clear, irradiance) ** exponent, irradiance)


def _match_luminance(values: Floats, other: Floats) -> Floats:
    """Values (3,) with the luminance of others."""
    return values * (float(other @ LUMINANCE_WEIGHTS) / float(values @ LUMINANCE_WEIGHTS))


def _elevation_factors(predicted: float, fused: float) -> Floats:
    """Factors (3,) by which clear suns differ at the fused elevation and at the predicted one [deg]."""
    after, before = (float(np.clip(e, *_LOW_ELEVATIONS)) for e in (min(fused, predicted), predicted))
    return np.ones(3) if after == before else (_clear_sun(after) / _clear_sun(before)) ** _ELEVATION_EXPONENT


@lru_cache(maxsize=64)
def _clear_sun(elevation: float) -> Floats:
    """The radiance (3,) of a clear sun; read-only."""
    radiance = sun_radiance(direction(0.0, elevation), _CLEAR_TURBIDITY)
    radiance.flags.writeable = False
    return radiance

"""The light of a scene for engines and phones: a light probe, and a main light beside it.

The probe is the radiance from all directions but the sun, as nine coefficients of spherical harmonics a channel. The
main light is the sun. Both are in the frame of geometry.py and in the photo's linear units, in which a white diffuse
surface under irradiance pi shows as 1. Each engine has its own order, signs and scale: LIGHT_PROBE_FORMATS.

The nine functions of a unit vector (x, y, z) are, in this order, 1, y, z, x, xy, yz, 3z² - 1, xz and x² - y². Each has
the factor that makes the integral of its square 1, and no sign of Condon and Shortley. WebXR and three.js have them so.

References:
    [1] Ramamoorthi and Hanrahan, An Efficient Representation for Irradiance Environment Maps, SIGGRAPH 2001.
"""

import json
import math
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.color import color_and_intensity, color_temperature, luminance, srgb_encode
from lighting.envmap.relighting import rotate_lighting, scale_exposure
from lighting.envmap.render import level_irradiance, render, sun_light
from lighting.envmap.surroundings import COARSE_ROWS, PhotoContext, render_coarse
from lighting.errors import ErrorCode, ParameterError
from lighting.fields import Json, round_all, round_significant
from lighting.geometry import Floats, direction, latlong_angles, latlong_solid_angle
from lighting.records import Lighting, LightProbe, MainLight, check_lighting
from lighting.sky.clear_sky import LUX, sun_disc_points, sun_disc_radiance

_BANDS = np.array([0, 1, 1, 1, 2, 2, 2, 2, 2])  # of the functions
_BASIS_FACTORS = np.sqrt(
    np.array([1 / 4, 3 / 4, 3 / 4, 3 / 4, 15 / 4, 15 / 4, 5 / 16, 15 / 4, 15 / 16]) / math.pi
)  # of the functions' polynomials
CONDON_SHORTLEY = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0])  # signs that some add
COSINE_FACTORS = np.array([math.pi, 2 * math.pi / 3, math.pi / 4])[_BANDS]  # irradiance over radiance [1], by function


def _harmonics_basis(direction: ArrayLike) -> Floats:
    """Return the nine functions (..., 9) of directions.

    Args:
        direction: (..., 3), unit vectors.
    """
    x, y, z = np.moveaxis(np.asarray(direction, dtype=np.float64), -1, 0)
    polynomials = [np.ones_like(x), y, z, x, x * y, y * z, 3 * z**2 - 1, x * z, x**2 - y**2]
    return np.asarray(np.stack(polynomials, axis=-1) * _BASIS_FACTORS)


def project_latlong(image: NDArray[np.floating]) -> Floats:
    """Return the coefficients (9, 3) of a map: the integrals of its radiance times each function.

    Args:
        image: (H, 2H, 3), linear radiance, in the pixels of `geometry`.
    """
    height = len(image)
    azimuth, elevation = (np.radians(angle) for angle in latlong_angles(height))
    turns = np.stack(
        [np.ones_like(azimuth), np.sin(azimuth), -np.cos(azimuth), np.sin(2 * azimuth), np.cos(2 * azimuth)]
    )
    by_row = np.einsum("tc,rck->rtk", turns.astype(np.float32), image, optimize=True).astype(np.float64)
    mean, x, z, xz, cos2 = np.moveaxis(by_row * latlong_solid_angle(height)[:, None, None], 1, 0)  # (H, 3) each
    level, up = np.cos(elevation)[:, None], np.sin(elevation)[:, None]
    level2 = level**2
    # with x = level sin a and z = -level cos a: x z = -level² sin 2a / 2, z² = level² (1 + cos 2a) / 2
    polynomials = [
        mean,
        up * mean,
        level * z,
        level * x,
        level * up * x,
        level * up * z,
        1.5 * level2 * (mean + cos2) - mean,
        -0.5 * level2 * xz,
        0.5 * level2 * (mean - cos2) - up**2 * mean,
    ]
    return np.asarray(np.stack(polynomials).sum(axis=1) * _BASIS_FACTORS[:, None])


def irradiance_from_harmonics(coefficients: ArrayLike, normals: ArrayLike) -> Floats:
    """Return the irradiance (..., 3) of surfaces by coefficients of radiance [1].

    Args:
        coefficients: (9, 3), of radiance.
        normals: (..., 3), unit vectors.
    """
    return np.asarray(_harmonics_basis(normals) @ (COSINE_FACTORS[:, None] * np.asarray(coefficients)))


def rotate_harmonics(coefficients: ArrayLike, yaw: float) -> Floats:
    """Return the coefficients (9, 3) of a scene that was turned about the vertical: azimuth a becomes a + yaw.

    Args:
        coefficients: (9, 3).
        yaw: deg, positive to the right.
    """
    one, y, z, x, xy, yz, z2, xz, x2 = np.asarray(coefficients, dtype=np.float64)
    (c, s), (c2, s2) = ((math.cos(turn), math.sin(turn)) for turn in (math.radians(yaw), math.radians(2 * yaw)))
    # 3z² - 1 and x² - y² are mixtures of 3y² - 1, which stays, and z² - x², which turns with xz
    upright, level = -0.5 * z2 - math.sqrt(0.75) * x2, math.sqrt(0.75) * z2 - 0.5 * x2
    level, xz = c2 * level + s2 * xz, c2 * xz - s2 * level
    z2, x2 = -0.5 * upright + math.sqrt(0.75) * level, -math.sqrt(0.75) * upright - 0.5 * level
    return np.stack([one, y, c * z + s * x, c * x - s * z, c * xy - s * yz, c * yz + s * xy, z2, xz, x2])


_MAX_LEVEL = 100.0  # irradiance of level ground that any map holds
_CLEAREST_AIR = 1.0  # turbidity
_NEUTRAL_LUMENS = 1000.0  # of ARKit: white faces it and shows as 1
_MIRRORED = np.array([1, 1, -1, 1, 1, -1, 1, -1, 1])[:, None]  # signs of the functions where +Z becomes -Z


def compute_light_probe(
    lighting: Lighting,
    context: PhotoContext | None = None,
    *,
    sun: bool | None = None,
    yaw: float = 0.0,
) -> LightProbe:
    """Return the light probe of the map that `render_view` makes of the same arguments, but for the map's detail.

    Detail leaves the light of level ground, but gives walls that face the photo some per cent more.

    Args:
        lighting: else ParameterError.
        context: the photo and its surroundings; None: bare sky and ground.
        sun: whether the sun shines; None: by `Lighting.sun_painted`.
        yaw: deg by which the map is rotated to the right.
    """
    check_lighting(lighting)
    level = float(level_irradiance(lighting).max())
    gain = min(_MAX_LEVEL / level, 1.0) if level > 0 else 1.0  # maps end at what half floats hold; probes do not
    dimmed = lighting
    if gain < 1.0:
        dimmed = scale_exposure(lighting, np.full(3, gain))
    if context is None:
        image = render(dimmed, COARSE_ROWS, sun=sun, disc=False)
    else:
        image = render_coarse(dimmed, context, sun=sun)
    coefficients = project_latlong(image) / gain
    if yaw:
        lighting, coefficients = rotate_lighting(lighting, yaw), rotate_harmonics(coefficients, yaw)
    return LightProbe(coefficients, main_light(lighting, sun=sun))


def main_light(lighting: Lighting, *, sun: bool | None = None) -> MainLight:
    """Return the sun of a lighting as a directional light.

    Its lux follow from the record's exposure, which is good to a factor of two, and are never more than the clearest
    air lets through.

    Args:
        lighting: any.
        sun: whether the sun shines; None: by `Lighting.sun_painted`.
    """
    shines = lighting.sun_painted if sun is None else sun
    irradiance = sun_light(lighting)[0] if shines else np.zeros(3)
    lux = 0.0
    if irradiance.any():
        lux = min(float(luminance(irradiance)) / lighting.exposure, _clearest_sun(lighting.sun_elevation)) * LUX
    return MainLight(lighting.sun_direction, irradiance, lux, color_temperature(irradiance))


@lru_cache(maxsize=1)  # the sun stands as high in all frames of a clip
def _clearest_sun(elevation: float) -> float:
    """The luminance of a surface that faces a sun, 0 deg or higher, through the clearest air, by the sky model."""
    sun = direction(0.0, elevation)
    points, weight = sun_disc_points(sun)
    return float(luminance(weight @ sun_disc_radiance(points, sun, _CLEAREST_AIR)))


def encode_light_probe(probe: LightProbe, format: str) -> str:
    """Return a probe as an engine takes it, as JSON.

    Args:
        probe: made by `compute_light_probe`.
        format: one of LIGHT_PROBE_FORMATS, else ParameterError.
    """
    if format not in LIGHT_PROBE_FORMATS:
        predicate = f"is {format!r}; it must be one of {', '.join(LIGHT_PROBE_FORMATS)}."
        raise ParameterError.about("format", predicate, ErrorCode.UNKNOWN)
    return json.dumps(LIGHT_PROBE_FORMATS[format](probe), indent=2)


def shader_harmonics(coefficients: Floats) -> Floats:
    """Return the factors (9, 3) of the plain polynomials 1, y, z, x, xy, yz, 3z² - 1, xz, x² - y² of a normal.

    With them the polynomials sum to irradiance / pi, by which a shader multiplies an albedo. Filament and Unity take
    them so.

    Args:
        coefficients: (9, 3), of radiance.
    """
    return np.asarray((_BASIS_FACTORS * COSINE_FACTORS / math.pi)[:, None] * coefficients)


def _webxr(probe: LightProbe) -> Json:
    """The attributes of an XRLightEstimate; where no sun shines, what WebXR has for no estimate."""
    light = probe.main_light
    toward = light.direction if light.irradiance.any() else np.array([0.0, 1.0, 0.0])
    return {
        "sphericalHarmonicsCoefficients": round_all(probe.coefficients),
        "primaryLightDirection": _point(toward, 0.0),
        "primaryLightIntensity": _point(light.irradiance, 1.0),
    }


def _point(values: Floats, w: float) -> Json:
    return dict(zip("xyzw", round_all([*values, w]), strict=True))


def _lamp(probe: LightProbe, scale: float = 1.0) -> tuple[Floats, float]:
    """Color (3,) and rounded intensity of the main light, whose irradiance is a scale times the intensity."""
    color, intensity = color_and_intensity(probe.main_light.irradiance / scale)
    return color, round_significant(intensity)


def _threejs(probe: LightProbe) -> Json:
    """What LightProbe.sh.fromArray takes, and a DirectionalLight's position, linear color and intensity."""
    color, intensity = _lamp(probe)
    position = round_all(probe.main_light.direction)
    return {
        "lightProbe": {"sh": round_all(probe.coefficients)},
        "directionalLight": {"position": position, "color": round_all(color), "intensity": intensity},
    }


def _arcore(probe: LightProbe) -> Json:
    """The three answers of a LightEstimate in mode ENVIRONMENTAL_HDR; the seventh number is that of 3z² - 1."""
    return {
        "environmentalHdrAmbientSphericalHarmonics": round_all(probe.coefficients),
        "environmentalHdrMainLightDirection": round_all(probe.main_light.direction),
        "environmentalHdrMainLightIntensity": round_all(probe.main_light.irradiance),
    }


def _arkit(probe: LightProbe) -> Json:
    """The properties of an ARDirectionalLightEstimate: all red, then all green, then all blue coefficients."""
    light = probe.main_light
    level = irradiance_from_harmonics(probe.coefficients, [0.0, 1.0, 0.0])
    level = level + light.irradiance * max(float(light.direction[1]), 0.0)
    return {
        "sphericalHarmonicsCoefficients": round_all(probe.coefficients.T),
        "primaryLightDirection": round_all(-light.direction),
        "primaryLightIntensity": _lumens(light.irradiance),
        "ambientIntensity": _lumens(level),
        "ambientColorTemperature": round(color_temperature(level) or 6500.0),
    }


def _lumens(irradiance: Floats) -> float:
    return round_significant(_NEUTRAL_LUMENS * float(luminance(irradiance)) / math.pi)


def _unity(probe: LightProbe) -> Json:
    """Numbers of a SphericalHarmonicsL2, by channel, and a Light's, in Unity's left-handed frame: +Z looks ahead."""
    light, stated = probe.main_light, probe.main_light.to_dict()
    color, intensity = _lamp(probe, math.pi)
    return {
        "sphericalHarmonicsL2": [round_all(row) for row in (shader_harmonics(probe.coefficients) * _MIRRORED).T],
        "light": {
            "forward": round_all(light.direction * [-1, -1, 1]),
            "color": round_all(color),
            "intensity": intensity,
            "lux": stated["lux"],
            "colorTemperature": stated["kelvin"],
        },
    }


def _filament(probe: LightProbe) -> Json:
    """What IndirectLight.Builder.irradiance(3, sh) takes, as in cmgen's sh.txt, and a sun for exposure 1."""
    color, intensity = _lamp(probe)
    lux, direction = round_significant(probe.main_light.lux), round_all(-probe.main_light.direction)
    return {
        "indirectLight": {"irradiance": round_all(shader_harmonics(probe.coefficients)), "intensity": 1.0},
        "sun": {"direction": direction, "color": round_all(color), "intensity": intensity, "lux": lux},
    }


def _babylon(probe: LightProbe) -> Json:
    """Radiance for SphericalHarmonics.FromArray, in a scene with useRightHandedSystem, and a DirectionalLight."""
    color, intensity = _lamp(probe)
    direction = round_all(-probe.main_light.direction)
    return {
        "sphericalHarmonics": [round_all(row) for row in CONDON_SHORTLEY[:, None] * probe.coefficients],
        "directionalLight": {"direction": direction, "diffuse": round_all(color), "intensity": intensity},
    }


def _godot(probe: LightProbe) -> Json:
    """Colors of a LightmapGIData probe, the mean as an Environment's ambient light, and a DirectionalLight3D."""
    stated, (color, intensity) = probe.main_light.to_dict(), _lamp(probe, math.pi)
    ambient, energy = color_and_intensity(np.maximum(probe.coefficients[0] * _BASIS_FACTORS[0], 0.0))
    return {
        "probe_sh": [round_all(row) for row in probe.coefficients / math.pi],
        "environment": {
            "ambient_light_color": round_all(srgb_encode(ambient)),
            "ambient_light_energy": round_significant(energy),
        },
        "directional_light": {
            "direction": round_all(-probe.main_light.direction),
            "light_color": round_all(srgb_encode(color)),
            "light_energy": intensity,
            "light_intensity_lux": stated["lux"],
            "light_temperature": stated["kelvin"],
        },
    }


LIGHT_PROBE_FORMATS: dict[str, Callable[[LightProbe], Json]] = {
    "record": LightProbe.to_dict,
    "webxr": _webxr,
    "threejs": _threejs,
    "arcore": _arcore,
    "arkit": _arkit,
    "unity": _unity,
    "filament": _filament,
    "babylon": _babylon,
    "godot": _godot,
}

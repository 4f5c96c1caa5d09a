"""Edited lighting: sun moved, map rotated, exposure gain."""

import math
import reprlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from lighting.color import luminance
from lighting.envmap.latlong import EPSILON_IRRADIANCE, Image
from lighting.envmap.render import clear_irradiance, sky_irradiance, sun_light, with_irradiance
from lighting.errors import ErrorCode, ParameterError
from lighting.fields import RANGES, clip_color, round_significant
from lighting.geometry import Floats, Pinhole, angles, direction, wrap_azimuth
from lighting.map_options import Adjustments, MapOptions
from lighting.records import MIN_SPOT_DESCENT, Color, Lighting, check_lighting
from lighting.sky import SKY_MODEL

_WHOLE_PIXEL = 1e-6  # pixels; a yaw this close to a whole number of pixels counts as one
_ANGLE_DIGITS = 6  # behind the point, of rotated angles in degrees; records of estimates have fewer

_MIN_ELEVATION = 5.0  # deg; the model's suns below it have hardly any green and no blue, and photos' suns have
_HIGH_ELEVATION = 30.0  # deg, of a sun at full strength
_MIN_CHANNEL_SHARE = 0.05  # of that sun's channels, which the model's has at least: in haze a low one has none
_SUNNY_COVER = 0.5  # largest cover of a sky whose sun is turned on by hand
_WHITE_ELEVATION = 60.0  # deg, of a sun for which cameras' white is set
_MAX_SKY_GAIN = 2.0  # by which a sun that is moved brightens a sky: the photo stays exposed for its own


def rotate_envmap(image: Image, yaw: float) -> Image:
    """The map rotated about the vertical: what was at azimuth a is at a + yaw. Exact for a whole number of pixels.

    Otherwise neighboring pixels are interpolated linearly, also across the seam.

    Args:
        image: (H, 2H, 3).
        yaw: deg, any finite number, else ParameterError.
    """
    _check_yaw(yaw)
    shift = yaw % 360.0 / 360.0 * image.shape[1]
    whole = math.floor(shift + _WHOLE_PIXEL)
    share = np.float32(shift - whole)
    rotated = np.roll(image, whole, axis=1)
    if share <= _WHOLE_PIXEL:
        return rotated
    return np.asarray(rotated * (1 - share) + np.roll(rotated, 1, axis=1) * share)


def rotate_lighting(lighting: Lighting, yaw: float) -> Lighting:
    """The record of a rotated map; its azimuth 0 lies `yaw` to the left of where the camera points.

    Args:
        lighting: of the map before, else ParameterError.
        yaw: deg, as in `rotate_envmap`.
    """
    check_lighting(lighting)
    _check_yaw(yaw)
    azimuth = round(float(wrap_azimuth(lighting.sun_azimuth + yaw)), _ANGLE_DIGITS)
    relative = None if lighting.relative_heading is None else _heading(lighting.relative_heading - yaw)
    candidates = tuple(
        replace(sun, azimuth=round(float(wrap_azimuth(sun.azimuth + yaw)), _ANGLE_DIGITS))
        for sun in lighting.sun_candidates
    )
    rotated = replace(lighting, sun_azimuth=azimuth, sun_candidates=candidates, relative_heading=relative)
    if lighting.spot_direction is not None:
        spot_azimuth, spot_elevation = angles(lighting.spot_direction)
        rotated = replace(rotated, spot_direction=_to_unit(direction(spot_azimuth + yaw, spot_elevation)))
    if lighting.camera_heading is None:
        return rotated
    degrees, probability = np.arange(360.0), lighting.camera_heading_probability
    shifted = np.interp(degrees + yaw, degrees, probability, period=360.0) if probability else np.array([])
    heading = _heading(lighting.camera_heading - yaw)
    return replace(rotated, camera_heading=heading, camera_heading_probability=tuple(shifted.tolist()))


def scale_exposure(lighting: Lighting, gain: Floats) -> Lighting:
    """The light of a picture whose linear values are those of the record's, times a gain.

    Args:
        lighting: of the picture before.
        gain: (3,) over 0, of linear red, green and blue.
    """
    exposure = float(np.clip(lighting.exposure * float(luminance(gain)), *RANGES["exposure"]))
    scaled: Any = {"exposure": round_significant(exposure)}
    for name in ("sun_irradiance", "sky_irradiance"):
        if (irradiance := getattr(lighting, name)) is not None:
            scaled[name] = clip_color(np.array(irradiance) * gain, name)
    return replace(lighting, **scaled)


def radiance_gain(lighting: Lighting, gain: Floats) -> Floats | float:
    """By what `scale_exposure` multiplies the radiance of a map: (3,) where irradiances tell its color, else a number.

    Args:
        lighting: of the picture, before or after.
        gain: (3,) over 0, of linear red, green and blue.
    """
    return gain if lighting.sky_irradiance is not None else float(luminance(gain))


def _check_yaw(yaw: float) -> None:
    try:
        fits = math.isfinite(yaw)
    except (TypeError, OverflowError):
        fits = False
    if not fits:
        predicate = f"must be a finite number, not {reprlib.repr(yaw)}."
        code = ErrorCode.OUT_OF_RANGE if isinstance(yaw, int | float) else ErrorCode.WRONG_TYPE
        raise ParameterError.about("yaw", predicate, code)


def _heading(degrees: float) -> float:
    return round(degrees % 360.0, _ANGLE_DIGITS) % 360.0


def edit_lighting(lighting: Lighting, changes: Mapping[str, float | Color]) -> Lighting:
    """The light with another sun, turbidity, exposure or ground, as a user sets them by hand.

    Where irradiances are stated, their ratios to the model's stay as they were, channel by channel. A sun under 5 deg
    is to the model as one of 5 deg. One that is set below the horizon does not shine: visibility and irradiance are 0.

    Args:
        lighting: before, else ParameterError.
        changes: values by the fields of Lighting. Those of the camera move no light. An irradiance or a `sky_cover`
            counts as it is; the sky's power follows the cover. ParameterError for one out of range.
    """
    check_lighting(lighting)
    values: Any = dict(changes)
    if not changes.keys().isdisjoint(("sun_azimuth", "sun_elevation")):
        values.setdefault("sun_candidates", ())
    changed = _keep_spot_pixel(lighting, replace(lighting, **values))
    if lighting.sun_irradiance is None or lighting.sky_irradiance is None:
        return _darken_set_sun(changed, changes)
    models = {"sun_irradiance": _model_sun_irradiance, "sky_irradiance": _model_sky_irradiance}
    rescaled: Any = {}
    for name, by_model in models.items():
        if name not in changes:
            before, after = np.maximum(by_model(lighting), EPSILON_IRRADIANCE), by_model(changed)
            rescaled[name] = clip_color(np.array(getattr(lighting, name)) * after / before, name)
    return _darken_set_sun(replace(changed, **rescaled), changes)


def edit_photo_light(lighting: Lighting, changes: Mapping[str, float | Color]) -> Lighting:
    """`edit_lighting` of a photo's light, whose photo keeps its exposure.

    A sun that is raised makes the stated sky twice as bright at most, and sun and sky then dim alike.

    Args:
        lighting: as there.
        changes: as there.
    """
    edited = edit_lighting(lighting, changes)
    sun, sky, before = edited.sun_irradiance, edited.sky_irradiance, lighting.sky_irradiance
    if sun is None or sky is None or before is None or "sun_elevation" not in changes or "sky_irradiance" in changes:
        return edited
    exposed = float(luminance(np.array(before))) * edited.exposure / max(lighting.exposure, EPSILON_IRRADIANCE)
    gain = _MAX_SKY_GAIN * exposed / max(float(luminance(np.array(sky))), EPSILON_IRRADIANCE)
    if gain >= 1:
        return edited
    dimmed = scale_exposure(edited, np.full(3, gain))
    kept = edited.sun_irradiance if "sun_irradiance" in changes else dimmed.sun_irradiance
    return replace(edited, sun_irradiance=kept, sky_irradiance=dimmed.sky_irradiance)


def _darken_set_sun(lighting: Lighting, changes: Mapping[str, float | Color]) -> Lighting:
    """The changed light without direct sunlight, apart from what is stated, if its sun was set below the horizon."""
    if lighting.sun_elevation >= 0 or "sun_elevation" not in changes:
        return lighting
    irradiance = None if lighting.sun_irradiance is None else (0.0, 0.0, 0.0)
    values: Any = {"sun_visibility": 0.0, "sun_irradiance": irradiance, **changes}
    return replace(lighting, **{name: values[name] for name in ("sun_visibility", "sun_irradiance")})


def _keep_spot_pixel(before: Lighting, now: Lighting) -> Lighting:
    """The light with the spot where a changed camera sees its pixel; without one where that is above the horizon."""
    if before.spot_direction is None or now.spot_direction != before.spot_direction:
        return now
    old, new = (
        Pinhole(1, 1, light.vertical_fov, 0.0, light.camera_elevation, light.camera_roll) for light in (before, now)
    )
    if old == new:
        return now
    right, up, ahead = old.axes @ np.array(before.spot_direction)
    spot = _to_unit([right, up, ahead * new.focal_length / old.focal_length] @ new.axes)
    if spot[1] > -MIN_SPOT_DESCENT:
        return replace(now, spot_pixel=None, spot_direction=None)
    return replace(now, spot_direction=spot)


def _to_unit(vector: Floats) -> Color:
    """A vector (3,) at length 1."""
    x, y, z = map(float, vector / np.linalg.norm(vector))
    return x, y, z


def _model_sun_irradiance(lighting: Lighting) -> Floats:
    """Irradiance (3,) by the model, or what stands for it where the model's would vanish."""
    elevations = (max(lighting.sun_elevation, _MIN_ELEVATION), _HIGH_ELEVATION)
    model = replace(lighting, sun_irradiance=None, sky_irradiance=None, sky_cover=None)
    power, high_power = (sun_light(replace(model, sun_elevation=elevation))[0] for elevation in elevations)
    return np.asarray(np.maximum(power, _MIN_CHANNEL_SHARE * high_power))


def _model_sky_irradiance(lighting: Lighting) -> Floats:
    """Irradiance (3,) by the model, the share of its overcast part gray."""
    clear, cover = clear_irradiance(lighting), lighting.sky_cover or 0.0
    return np.asarray((1 - cover) * clear + cover * float(luminance(clear)))


def light_of_map(lighting: Lighting, options: MapOptions) -> Lighting:
    """The light that a map shows, before it is turned: adjusted by hand, under the sky that was chosen.

    A sun that is turned on shines, as `adjust_lighting` has it of one that is moved.

    Args:
        lighting: before, else ParameterError.
        options: of the map.
    """
    light = adjust_lighting(lighting, options.adjustments)
    if options.sun and not light.sun_shines and light.sun_elevation >= 0:
        light = _with_shining_sun(light)
    return light if options.sky is None else replace(light, sky_model=SKY_MODEL, sky_painted=options.sky)


def adjust_lighting(lighting: Lighting, adjustments: Adjustments) -> Lighting:
    """The light as a user adjusts it: another sun, haze, a covered sky, and last a gain.

    Powers follow as in `edit_photo_light`. The radii around a sun that was set by hand are 0, and it shines. Where the
    light had none, it is as strong against the sky as the model's is, and at least half of the sky is clear.

    Args:
        lighting: before, else ParameterError.
        adjustments: what changes.

    Raises:
        ParameterError: the sun that is picked is none of the light's.
    """
    check_lighting(lighting)
    changes: dict[str, float | Color] = {}
    sun = adjustments.sun if adjustments.pick is None else _picked_sun(lighting, adjustments.pick)
    if sun is not None:
        azimuth, elevation = sun
        changes = {"sun_azimuth": float(wrap_azimuth(azimuth)), "sun_elevation": float(elevation)}
        changes |= {"radius_50": 0.0, "radius_90": 0.0}
        lighting = lighting if lighting.sun_shines or elevation < 0 else _with_shining_sun(lighting)
    if adjustments.haze is not None:
        changes["turbidity"] = float(adjustments.haze)
    adjusted = edit_photo_light(lighting, changes) if changes else lighting
    if adjustments.overcast:
        adjusted = _cover_sky(adjusted)
    return scale_exposure(adjusted, np.full(3, 2.0**adjustments.exposure)) if adjustments.exposure else adjusted


def _picked_sun(lighting: Lighting, number: int) -> tuple[float, float]:
    """Azimuth and elevation [deg] of the candidate of a number, from 1; ParameterError where there is none."""
    candidates = lighting.sun_candidates
    if number > len(candidates):
        listed = "no suns" if not candidates else f"{len(candidates)} sun{'s' * (len(candidates) > 1)}"
        predicate = f"is {number}, and the answer lists {listed}."
        raise ParameterError.about("pick", predicate, ErrorCode.OUT_OF_RANGE)
    return candidates[number - 1].azimuth, candidates[number - 1].elevation


def _with_shining_sun(lighting: Lighting) -> Lighting:
    """The light with direct sunlight, where it has none, under a sky that lets it through."""
    shining = replace(lighting, sun_visibility=1.0)
    if lighting.sun_irradiance is None or lighting.sky_irradiance is None:
        return shining
    level, model_level = (float(luminance(sky)) for sky in (sky_irradiance(lighting), clear_irradiance(lighting)))
    white = _model_sun_irradiance(replace(lighting, sun_elevation=_WHITE_ELEVATION))
    color = _model_sun_irradiance(lighting) / white * float(luminance(white))
    sun = clip_color(color * level / max(model_level, EPSILON_IRRADIANCE), "sun_irradiance")
    return replace(shining, sun_irradiance=sun, sky_cover=min(lighting.sky_cover or 0.0, _SUNNY_COVER))


def _cover_sky(lighting: Lighting) -> Lighting:
    """The light under an overcast sky, at the same exposure; the sky is gray as far as it was clear.

    References:
        Kasten and Czeplak, Solar and terrestrial radiation dependent on the amount and type of cloud, 1980.
    """
    lighting = with_irradiance(lighting)
    cover, level = lighting.sky_cover or 0.0, sky_irradiance(lighting)
    gray = cover * level + (1 - cover) * float(luminance(level))
    gain = _diffuse_share(1.0) / _diffuse_share(cover)
    sky = clip_color(gain * gray, "sky_irradiance")
    return replace(lighting, sun_visibility=0.0, sun_irradiance=(0.0, 0.0, 0.0), sky_irradiance=sky, sky_cover=1.0)


def _diffuse_share(cover: float) -> float:
    """Skylight on level ground over all light of a clear sky, by the cover, 0 to 1."""
    return float((1 - 0.75 * cover**3.4) * (0.3 + 0.7 * cover**2))

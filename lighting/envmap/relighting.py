"""Edited lighting: sun moved, map rotated, exposure gain."""

import math
import reprlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from lighting.color import luminance
from lighting.envmap.latlong import EPSILON_IRRADIANCE, Image
from lighting.envmap.render import clear_irradiance
from lighting.envmap.sun_disc import disc_power
from lighting.errors import ErrorCode, ParameterError
from lighting.geometry import Floats, Pinhole, angles, direction, wrap_azimuth
from lighting.records import MIN_SPOT_DESCENT, Color, Lighting, check_lighting
from lighting.validation import RANGES, clip_color, round_significant

_WHOLE_PIXEL = 1e-6  # pixels; a yaw this close to a whole number of pixels counts as one
_ANGLE_DIGITS = 6  # behind the point, of rotated angles in degrees; records of estimates have fewer

_MIN_ELEVATION = 5.0  # deg; the model's suns below it have hardly any green and no blue, and photos' suns have
_HIGH_ELEVATION = 30.0  # deg, of a sun at full strength
_MIN_CHANNEL_SHARE = 0.05  # of that sun's channels, which the model's has at least: in haze a low one has none


def rotate_envmap(image: Image, yaw: float) -> Image:
    """The map rotated about the vertical: what was at azimuth a is at a + yaw. Exact for a whole number of pixels.

    Otherwise neighbouring pixels are interpolated linearly, also across the seam.

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
    rotated = replace(lighting, sun_azimuth=azimuth, relative_heading=relative)
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
    sun = _scale_irradiance("sun_irradiance", lighting.sun_irradiance, gain)
    sky = _scale_irradiance("sky_irradiance", lighting.sky_irradiance, gain)
    return replace(lighting, exposure=round_significant(exposure), sun_irradiance=sun, sky_irradiance=sky)


def _check_yaw(yaw: float) -> None:
    try:
        fits = math.isfinite(yaw)
    except (TypeError, OverflowError):
        fits = False
    if not fits:
        predicate = f"must be a finite number, not {reprlib.repr(yaw)}."
        raise ParameterError.about("yaw", predicate, ErrorCode.WRONG_TYPE)


def _heading(degrees: float) -> float:
    return round(degrees % 360.0, _ANGLE_DIGITS) % 360.0


def _scale_irradiance(name: str, irradiance: Color | None, gain: Floats) -> Color | None:
    return None if irradiance is None else clip_color(np.array(irradiance) * gain, name)


def edit_lighting(lighting: Lighting, changes: Mapping[str, float | Color]) -> Lighting:
    """The light with another sun, turbidity, exposure or ground, as a user sets them by hand.

    Where irradiances are stated, their ratios to the model's stay as they were, channel by channel. A sun under 5 deg
    is to the model as one of 5 deg.

    Args:
        lighting: before, else ParameterError.
        changes: values by the fields of Lighting. Those of the camera move no light. An irradiance or a `sky_cover`
            counts as it is; the sky's power follows the cover. ParameterError for one out of range.
    """
    check_lighting(lighting)
    values: Any = dict(changes)
    changed = _keep_spot_pixel(lighting, replace(lighting, **values))
    if lighting.sun_irradiance is None or lighting.sky_irradiance is None:
        return changed
    models = {"sun_irradiance": _model_sun_irradiance, "sky_irradiance": _model_sky_irradiance}
    rescaled: Any = {}
    for name, by_model in models.items():
        if name not in changes:
            before, after = np.maximum(by_model(lighting), EPSILON_IRRADIANCE), by_model(changed)
            rescaled[name] = clip_color(np.array(getattr(lighting, name)) * after / before, name)
    return replace(changed, **rescaled)


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
    power, high_power = (disc_power(replace(lighting, sun_elevation=elevation))[0] for elevation in elevations)
    return np.asarray(np.maximum(power, _MIN_CHANNEL_SHARE * high_power))


def _model_sky_irradiance(lighting: Lighting) -> Floats:
    """Irradiance (3,) by the model, the share of its overcast part gray."""
    clear, cover = clear_irradiance(lighting), lighting.sky_cover or 0.0
    return np.asarray((1 - cover) * clear + cover * float(luminance(clear)))

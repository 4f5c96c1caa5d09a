"""Edited lighting: sun moved, map rotated, exposure gain."""

import math
import reprlib
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from lighting.color import luminance
from lighting.envmap.latlong import Image
from lighting.envmap.render import clear_irradiance, lobe_table
from lighting.envmap.sun_disc import disc_power
from lighting.errors import ErrorCode, ParameterError
from lighting.geometry import Floats, wrap_azimuth
from lighting.records import Colour, Lighting, check_lighting, clipped_colour, significant
from lighting.validation import RANGES

# Turned and brightened maps, and the records that describe them.

_WHOLE_PIXEL = 1e-6  # pixels; a yaw this close to a whole number of pixels counts as one
_ANGLE_DIGITS = 6  # behind the point, of turned angles in degrees; records' own have fewer


def rotate_envmap(image: Image, yaw: float) -> Image:
    """The map turned by `yaw` [deg]: what was at azimuth a is at a + yaw. Exact for a whole number of pixels.

    Otherwise neighbouring pixels are interpolated linearly, also across the seam. Raises ParameterError unless finite.
    """
    _check_yaw(yaw)
    shift = yaw % 360.0 / 360.0 * image.shape[1]
    whole = math.floor(shift + _WHOLE_PIXEL)
    share = np.float32(shift - whole)
    turned = np.roll(image, whole, axis=1)
    if share <= _WHOLE_PIXEL:
        return turned
    return np.asarray(turned * (1 - share) + np.roll(turned, 1, axis=1) * share)


def rotate_lighting(lighting: Lighting, yaw: float) -> Lighting:
    """The record of a map turned by `yaw` [deg]; its azimuth 0 lies `yaw` to the left of where the camera points.

    Raises ParameterError for what is no Lighting, and unless the yaw is finite.
    """
    check_lighting(lighting)
    _check_yaw(yaw)
    turned = replace(
        lighting,
        sun_azimuth=round(float(wrap_azimuth(lighting.sun_azimuth + yaw)), _ANGLE_DIGITS),
        relative_heading=None if lighting.relative_heading is None else _heading(lighting.relative_heading - yaw),
    )
    if lighting.camera_heading is None:
        return turned
    degrees, probability = np.arange(360.0), lighting.camera_heading_probability
    shifted = np.interp(degrees + yaw, degrees, probability, period=360.0) if probability else np.array([])
    return replace(
        turned,
        camera_heading=_heading(lighting.camera_heading - yaw),
        camera_heading_probability=tuple(shifted.tolist()),
    )


def scale_exposure(lighting: Lighting, gain: Floats) -> Lighting:
    """The light of a picture whose linear red, green and blue are `gain` (3,) times those of the record's."""
    exposure = float(np.clip(lighting.exposure * float(luminance(gain)), *RANGES["exposure"]))
    return replace(
        lighting,
        exposure=significant(exposure),
        sun_irradiance=_scale_irradiance("sun_irradiance", lighting.sun_irradiance, gain),
        sky_irradiance=_scale_irradiance("sky_irradiance", lighting.sky_irradiance, gain),
    )


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


def _scale_irradiance(name: str, irradiance: Colour | None, gain: Floats) -> Colour | None:
    return None if irradiance is None else clipped_colour(np.array(irradiance) * gain, name)


# A light with another sun, turbidity, exposure or power, as a user sets them by hand.

_EPSILON = 1e-9  # irradiance that stands for none
_MIN_ELEVATION = 5.0  # deg; the model's suns below it have hardly any green and no blue, and photos' suns have
_HIGH_ELEVATION = 30.0  # deg, of a sun at full strength
_MIN_CHANNEL_SHARE = (
    0.05  # of that sun's channels, which the model's is taken to have at least: in haze a low one has none
)


def edit_lighting(lighting: Lighting, changes: Mapping[str, float | Colour]) -> Lighting:
    """The light with other values of `sun_azimuth`, `sun_elevation`, `turbidity`, `exposure` or `ground_color`.

    Those of the camera, `camera_elevation`, `camera_roll` and `vertical_fov`, move no light.
    Where irradiances are stated, their ratios to the model's, channel by channel, stay as they were; a sun under 5 deg
    is to the model as one of 5 deg. A `sun_irradiance`, `sky_irradiance` or `sky_cover` among the changes counts as it
    is; the sky's power follows the cover. Raises ParameterError for a value out of range, and for what is no
    Lighting.
    """
    check_lighting(lighting)
    values: dict[str, Any] = dict(changes)
    changed = replace(lighting, **values)
    if lighting.sun_irradiance is None or lighting.sky_irradiance is None:
        return changed
    followed = changed
    if "sun_irradiance" not in changes:
        sun = _rescale_irradiance(
            lighting.sun_irradiance, _model_sun_irradiance(lighting), _model_sun_irradiance(changed)
        )
        followed = replace(followed, sun_irradiance=clipped_colour(sun, "sun_irradiance"))
    if "sky_irradiance" not in changes:
        sky = _rescale_irradiance(
            lighting.sky_irradiance, _model_sky_irradiance(lighting), _model_sky_irradiance(changed)
        )
        followed = replace(followed, sky_irradiance=clipped_colour(sky, "sky_irradiance"))
    return followed


def _model_sun_irradiance(lighting: Lighting) -> Floats:
    """Irradiance (3,) by the model, or what stands for it where the model's would vanish."""
    there, high = (
        disc_power(replace(lighting, sun_elevation=elevation))[0]
        for elevation in (max(lighting.sun_elevation, _MIN_ELEVATION), _HIGH_ELEVATION)
    )
    return np.asarray(np.maximum(there, _MIN_CHANNEL_SHARE * high))


def _model_sky_irradiance(lighting: Lighting) -> Floats:
    """Irradiance (3,) by the model, the share of its overcast part grey."""
    clear = clear_irradiance(lighting, lobe_table(lighting))
    cover = lighting.sky_cover or 0.0
    return np.asarray((1 - cover) * clear + cover * float(luminance(clear)))


def _rescale_irradiance(stated: Colour, before: Floats, after: Floats) -> Floats:
    """The stated irradiance (3,) times what the model's has changed by."""
    return np.asarray(np.array(stated) * after / np.maximum(before, _EPSILON))

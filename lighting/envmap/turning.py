"""Turned and brightened maps, and the records that describe them."""

import math
import reprlib
from dataclasses import replace

import numpy as np

from lighting.colour import luminance
from lighting.envmap.maps import Image
from lighting.errors import ErrorCode, ParameterError
from lighting.geometry import Floats, wrap_azimuth
from lighting.ranges import RANGES
from lighting.records import Colour, Lighting, check_lighting, clipped_colour, significant

_WHOLE_PIXEL = 1e-6  # pixels; a yaw this close to a whole number of pixels counts as one
_DIGITS = 6  # behind the point, of turned angles in degrees; records' own have fewer


def rotate(image: Image, yaw: float) -> Image:
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


def turn(lighting: Lighting, yaw: float) -> Lighting:
    """The record of a map turned by `yaw` [deg]; its azimuth 0 lies `yaw` to the left of where the camera points.

    Raises ParameterError for what is no Lighting, and unless the yaw is finite.
    """
    check_lighting(lighting)
    _check_yaw(yaw)
    turned = replace(
        lighting,
        sun_azimuth=round(float(wrap_azimuth(lighting.sun_azimuth + yaw)), _DIGITS),
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


def brighten(lighting: Lighting, gain: Floats) -> Lighting:
    """The light of a picture whose linear red, green and blue are `gain` (3,) times those of the record's."""
    exposure = float(np.clip(lighting.exposure * float(luminance(gain)), *RANGES["exposure"]))
    return replace(
        lighting,
        exposure=significant(exposure),
        sun_irradiance=_times("sun_irradiance", lighting.sun_irradiance, gain),
        sky_irradiance=_times("sky_irradiance", lighting.sky_irradiance, gain),
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
    return round(degrees % 360.0, _DIGITS) % 360.0


def _times(name: str, irradiance: Colour | None, gain: Floats) -> Colour | None:
    return None if irradiance is None else clipped_colour(np.array(irradiance) * gain, name)

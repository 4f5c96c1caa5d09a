"""Any of the sky models by its name, as a shape: relative radiance that a caller scales to an irradiance."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from lighting.errors import ParameterError
from lighting.geometry import Floats, angles
from lighting.sky.cie import general_luminance, overcast_luminance
from lighting.sky.hosek_wilkie import sky_radiance
from lighting.sky.lalonde_matthews import lalonde_matthews_sky
from lighting.sky.perez import BRIGHTNESS_RANGE, perez_luminance, sky_brightness, sky_clearness
from lighting.sky.preetham import TURBIDITY, preetham_radiance

Model = Literal[
    "hosek-wilkie", "preetham", "perez", "lalonde-matthews", "cie-overcast",
    "cie-1", "cie-2", "cie-3", "cie-4", "cie-5", "cie-6", "cie-7", "cie-8",
    "cie-9", "cie-10", "cie-11", "cie-12", "cie-13", "cie-14", "cie-15",
]  # fmt: skip
MODELS: tuple[str, ...] = get_args(Model)


@dataclass(frozen=True)
class Weather:
    """What shapes a sky; each model takes what it knows."""

    turbidity: float
    ground_albedo: float
    beam: float  # irradiance of a surface that faces the sun / that of level ground by the sky
    diffuse: float  # W m^-2, irradiance of level ground by the sky


def sky_shape(model: str, direction: ArrayLike, sun_direction: ArrayLike, weather: Weather) -> Floats:
    """Radiance (..., 3) of one of MODELS at any scale along unit vectors (..., 3); 0 below the horizon.

    Models of luminance alone are grey. Raises ParameterError for another model and for a sun below the horizon.
    """
    if model == "hosek-wilkie":
        return sky_radiance(direction, sun_direction, weather.turbidity, weather.ground_albedo)
    if model == "preetham":
        return preetham_radiance(direction, sun_direction, float(np.clip(weather.turbidity, *TURBIDITY)))
    grey = _luminance(model, direction, sun_direction, weather)
    return np.repeat(grey[..., None], 3, axis=-1)


def _luminance(model: str, direction: ArrayLike, sun_direction: ArrayLike, weather: Weather) -> Floats:
    if model == "lalonde-matthews":
        return lalonde_matthews_sky(direction, sun_direction, weather.turbidity)
    if model == "perez":
        clearness, brightness = perez_weather(weather, sun_direction)
        return perez_luminance(direction, sun_direction, clearness, brightness)
    if model == "cie-overcast":
        return overcast_luminance(direction)
    if model in MODELS:
        return general_luminance(direction, sun_direction, int(model.removeprefix("cie-")))
    raise ParameterError(f"The sky model {model!r} is not known; it must be one of {', '.join(MODELS)}.")


def perez_weather(weather: Weather, sun_direction: ArrayLike) -> tuple[float, float]:
    """The clearness and brightness that the all-weather model takes, within its range."""
    zenith = np.radians(90.0 - max(float(angles(sun_direction)[1]), 0.0))
    clearness = float(sky_clearness(1.0, weather.beam, zenith))
    brightness = float(np.clip(sky_brightness(weather.diffuse, zenith), *BRIGHTNESS_RANGE))
    return clearness, brightness

"""Models of the sky's radiance: an entry of SKY_MODELS and functions of arrays in a module each.

A sky has no ground and no disc of the sun. The command line, the service and the records read the entries.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from lighting.errors import ErrorCode, ParameterError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from lighting.geometry import Floats


@dataclass(frozen=True)
class Weather:
    """What shapes a sky; each model takes what it knows."""

    turbidity: float
    """Linke, 1 to 10."""
    ground_albedo: float
    """Ground albedo, 0 to 1."""
    beam: float
    """Irradiance of a surface that faces the sun / that of level ground by the sky, 0 or more."""
    diffuse: float
    """W m^-2, irradiance of level ground by the sky."""


@dataclass(frozen=True)
class SkyModel:
    """A shape of the sky, which callers scale to an irradiance.

    `shape` takes unit vectors (..., 3), the sun's (3,) and the weather. Its radiance is (..., 3), or (...) of a model
    of luminance alone, at any scale and 0 below the horizon. Those that need a sun above it raise ParameterError.
    """

    shape: Callable[["ArrayLike", "ArrayLike", Weather], "Floats"]
    """Of unit vectors, the sun's direction and the weather: radiance."""
    sun_glow: Callable[["ArrayLike", "ArrayLike"], "Floats"] | None = None
    """(...) at any scale; None: a disc."""
    # (3, R, N) by R angles [deg] from the zenith, N from the sun, the sun's elevation [deg] and the turbidity
    by_angles: Callable[["Floats", "Floats", float, float], "Floats"] | None = None
    """The same by angles, which is faster. None: it has none."""
    advanced: bool = False
    """Help names its kind as a range."""


def _hosek_wilkie(direction: "ArrayLike", sun_direction: "ArrayLike", weather: Weather) -> "Floats":
    from lighting.sky.clear_sky import sky_radiance

    return sky_radiance(direction, sun_direction, weather.turbidity, weather.ground_albedo)


def _prague(direction: "ArrayLike", sun_direction: "ArrayLike", weather: Weather) -> "Floats":
    from lighting.sky.clear_sky import prague_radiance

    return prague_radiance(direction, sun_direction, weather.turbidity)


def _prague_by_angles(zenith: "Floats", sun: "Floats", sun_elevation: float, turbidity: float) -> "Floats":
    from lighting.sky.clear_sky import prague_by_angles

    return prague_by_angles(zenith, sun, sun_elevation, turbidity)


def _preetham(direction: "ArrayLike", sun_direction: "ArrayLike", weather: Weather) -> "Floats":
    from lighting.sky.perez import TURBIDITIES, preetham_radiance

    low, high = TURBIDITIES
    return preetham_radiance(direction, sun_direction, min(max(weather.turbidity, low), high))


def _perez(direction: "ArrayLike", sun_direction: "ArrayLike", weather: Weather) -> "Floats":
    from lighting.sky.perez import perez_luminance, perez_weather

    clearness, brightness = perez_weather(weather, sun_direction)
    return perez_luminance(direction, sun_direction, clearness, brightness)


def _lalonde_matthews(direction: "ArrayLike", sun_direction: "ArrayLike", weather: Weather) -> "Floats":
    from lighting.sky.perez import lalonde_matthews_sky

    return lalonde_matthews_sky(direction, sun_direction, weather.turbidity)


def _lalonde_matthews_sun(direction: "ArrayLike", sun_direction: "ArrayLike") -> "Floats":
    from lighting.sky.perez import lalonde_matthews_sun

    return lalonde_matthews_sun(direction, sun_direction)


def _cie_overcast(direction: "ArrayLike", _sun_direction: "ArrayLike", _weather: Weather) -> "Floats":
    from lighting.sky.perez import overcast_luminance

    return overcast_luminance(direction)


def _cie_general(number: int, direction: "ArrayLike", sun_direction: "ArrayLike", _weather: Weather) -> "Floats":
    from lighting.sky.perez import general_luminance

    return general_luminance(direction, sun_direction, number)


SKY_MODEL = "hosek-wilkie"  # of records that name none; `exposure` is in its unit
PAINTED_SKY = "prague"  # what paints the maps of new estimates, whose record's model stays SKY_MODEL

SKY_MODELS: dict[str, SkyModel] = {
    SKY_MODEL: SkyModel(_hosek_wilkie),
    PAINTED_SKY: SkyModel(_prague, by_angles=_prague_by_angles),
    "preetham": SkyModel(_preetham),
    "perez": SkyModel(_perez),
    "lalonde-matthews": SkyModel(_lalonde_matthews, sun_glow=_lalonde_matthews_sun),
    "cie-overcast": SkyModel(_cie_overcast),
    **{f"cie-{number}": SkyModel(partial(_cie_general, number), advanced=True) for number in range(1, 16)},
}


def sky_shape(model: str, direction: "ArrayLike", sun_direction: "ArrayLike", weather: Weather) -> "Floats":
    """Radiance (..., 3) of one of SKY_MODELS at any scale; 0 below the horizon, gray by models of luminance alone.

    Args:
        model: a key of SKY_MODELS, else ParameterError.
        direction: (..., 3) unit vectors.
        sun_direction: (3,) unit vector, not below the horizon, else ParameterError.
        weather: of which each model takes what it knows.
    """
    import numpy as np

    if model not in SKY_MODELS:
        raise ParameterError(
            f"The sky model {model!r} is not known; it must be one of {', '.join(SKY_MODELS)}.",
            "sky_model",
            ErrorCode.UNKNOWN,
        )
    radiance = SKY_MODELS[model].shape(direction, sun_direction, weather)
    if radiance.ndim == np.ndim(direction):
        return radiance
    return np.repeat(radiance[..., None], 3, axis=-1)


def format_sky_models(last: str = ", ") -> str:
    """The names as a list for people: the advanced ones as a range.

    Args:
        last: what stands before the range.
    """
    advanced = [name for name, model in SKY_MODELS.items() if model.advanced]
    plain = [name for name in SKY_MODELS if name not in advanced]
    return f"{', '.join(plain)}{last}{advanced[0]} to {advanced[-1]}"

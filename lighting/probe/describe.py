"""What a measured map says of its sky: the sun, the model that fits, and how much of the sky it does not explain."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.colour import luminance
from lighting.errors import ErrorCode, ProbeError
from lighting.geometry import Floats, angle_between, direction, latlong_angles, latlong_directions, wrap_azimuth
from lighting.prefilter import shrink
from lighting.probe.regions import HEIGHT, solid_angle
from lighting.probe.sky_fit import SUN_CLEARANCE, SkyFit, fit_sky
from lighting.probe.sun_finder import find_sun
from lighting.probe.sun_spot import find_spot
from lighting.records import GROUND_ALBEDO
from lighting.sky.hosek_wilkie import sky_radiance

LOWEST = 10.0  # deg, below which hills, trees and haze hide the sky
LEAST_ROWS = 16  # of a map; in fewer the sun's glow leaves too little sky
CLEAR = 0.35  # of |log(measured / model)| of the luminance, up to which a direction counts as clear


@dataclass(frozen=True)
class SkyState:
    """A sky in numbers; angles in deg, azimuth from the map's centre column, clockwise positive, -180 to 180."""

    sun_azimuth: float
    sun_elevation: float
    sun_source: str  # "found" in the map or "given"
    turbidity: float
    exposure: float  # map's values / sky radiance
    residual: float  # robust spread of log(map / model) over the clear sky
    trusted: bool  # whether the fit may be
    cover: float  # share of the sky above LOWEST that the model of the clear sky does not explain, 0 to 1

    def to_dict(self) -> dict[str, Any]:
        """As JSON, with no more digits than the sky tells."""
        return {
            "sun_azimuth": round(self.sun_azimuth, 2),
            "sun_elevation": round(self.sun_elevation, 2),
            "sun_source": self.sun_source,
            "turbidity": round(self.turbidity, 2),
            "exposure": float(f"{self.exposure:.5g}"),
            "residual": round(self.residual, 4),
            "trusted": self.trusted,
            "cover": round(self.cover, 4),
        }


def describe(image: NDArray[np.float32], sun: tuple[float, float] | None = None) -> SkyState:
    """The state of a map's (H, 2H, 3) sky, its sun found or given as azimuth and elevation [deg].

    Raises ProbeError for a map that is too small, black or negative, where no sun is found, where it is given below the
    horizon, and where no clear sky is seen.
    """
    _check_sky(image)
    azimuth, elevation = sun or _found(image)
    if elevation < 0:
        raise ProbeError(
            f"The sun is {-elevation:.0f} deg below the horizon: there is no daylight sky to fit.", code=ErrorCode.NIGHT
        )
    fit = fit_sky(image, direction(azimuth, elevation))
    if fit is None:
        raise ProbeError("Too little clear sky is seen to fit a model to: the sky is overcast or hidden.")
    cover = _cover(image, direction(azimuth, elevation), fit)
    source = "given" if sun else "found"
    side = float(wrap_azimuth(azimuth))
    return SkyState(side, elevation, source, fit.turbidity, fit.exposure, fit.residual, fit.ok, cover)


def _check_sky(image: NDArray[np.float32]) -> None:
    """Raise ProbeError for a map (H, 2H, 3) that is too small, black or negative."""
    if len(image) < LEAST_ROWS:
        rows = "1 row" if len(image) == 1 else f"{len(image)} rows"
        raise ProbeError(f"The map has {rows}; a sky needs {LEAST_ROWS} or more to be fitted.")
    light = luminance(image[: len(image) // 2])
    if (light > 0).sum() <= (light < 0).sum():  # a few values under 0 are the ringing of a filter
        raise ProbeError("The sky in the map is black or negative.")


def _found(image: NDArray[np.float32]) -> tuple[float, float]:
    """Azimuth and elevation [deg] of the sun that a map (H, 2H, 3) shows; ProbeError where none is found."""
    spot = find_spot(image, np.zeros(image.shape[:2], dtype=bool)) or find_sun(image)
    if spot is None:
        raise ProbeError("No sun is found in the map; give its azimuth and elevation.")
    return spot.azimuth, spot.elevation


def _cover(image: NDArray[np.float32], sun: Floats, fit: SkyFit) -> float:
    """`SkyState.cover` of a map (H, 2H, 3) whose sun stands in a direction (3,), by the model fitted to it."""
    small = shrink(image, HEIGHT)
    towards = latlong_directions(len(small))
    high = np.broadcast_to(latlong_angles(len(small))[1][:, None] > LOWEST, small.shape[:2])
    counted = high & (angle_between(towards, sun) > SUN_CLEARANCE)
    model = luminance(sky_radiance(towards[counted], sun, fit.turbidity, GROUND_ALBEDO)) * fit.exposure
    error = np.abs(np.log(np.maximum(luminance(small[counted]), 1e-12) / np.maximum(model, 1e-12)))
    area = solid_angle(len(small))[counted]
    return float(area[error > CLEAR].sum() / area.sum())

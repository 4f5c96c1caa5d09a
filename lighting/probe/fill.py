"""A sun that no exposure could measure, taken from the model of the sky around it."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lighting.envmap import render, sun_irradiance
from lighting.errors import ProbeError
from lighting.geometry import angle_between, latlong_directions
from lighting.probe.regions import Mask
from lighting.probe.sky_fit import SkyFit, fit_sky
from lighting.probe.sun_spot import SunSpot
from lighting.records import Lighting


def fill_sun(image: NDArray[np.float32], clipped: Mask, spot: SunSpot) -> tuple[NDArray[np.float32], SunSpot, SkyFit]:
    """The map (H, 2H, 3) with the model's disc in place of the clipped sun, the sun it gives, and the sky fitted.

    Turbidity and exposure are fitted to the clear sky that is seen; the clipped pixels become what is beside them.
    Raises ProbeError where too little clear sky is seen.
    """
    fit = fit_sky(image, spot.direction)
    if fit is None:
        raise ProbeError("The sun cannot be filled in: too little clear sky is seen to fit the model to.")
    lighting = lighting_of(spot, fit)
    filled = _without_clipped(image, clipped, spot)
    upper = len(image) // 2
    with_disc, without = (render(lighting, len(image), sun=shines)[:upper] for shines in (True, False))
    filled[:upper] += with_disc - without
    return filled, replace(spot, irradiance=sun_irradiance(lighting)), fit


def lighting_of(spot: SunSpot, fit: SkyFit) -> Lighting:
    """The model's sky of a fit, as a record that can be rendered."""
    return Lighting(
        sun_azimuth=spot.azimuth,
        sun_elevation=max(spot.elevation, 0.0),
        turbidity=fit.turbidity,
        exposure=fit.exposure,
    )


def _without_clipped(image: NDArray[np.float32], clipped: Mask, spot: SunSpot) -> NDArray[np.float32]:
    """A copy whose clipped pixels around the sun have the median colour of the ring beside them."""
    away = angle_between(latlong_directions(len(image)), spot.direction)
    reach = max(spot.radius, 1.5 * 180.0 / len(image)) + 1.0
    region = (away < reach) & (clipped | (away < 0.6 * reach))
    ring = (away >= reach) & (away < 2 * reach) & ~clipped
    filled = image.copy()
    if ring.any():
        filled[region] = np.median(image[ring], axis=0)
    return filled

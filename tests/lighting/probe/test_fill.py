"""A sun cut off a rendered sky and filled in again."""

import numpy as np
import pytest

from lighting.envmap import render, sun_irradiance
from lighting.errors import ProbeError
from lighting.geometry import latlong_directions
from lighting.probe.fill import fill_sun
from lighting.probe.sun_spot import find_spot
from lighting.records import Lighting

LIGHTING = Lighting(sun_azimuth=20.0, sun_elevation=35.0, turbidity=3.0, exposure=0.05)


def test_the_model_gives_the_light_back_that_was_clipped() -> None:
    whole = render(LIGHTING, 128, sun=True)
    cut = np.minimum(whole, 5.0)
    clipped = whole.max(axis=-1) > 5.0
    spot = find_spot(cut, clipped)
    assert spot is not None
    filled, sun, fit = fill_sun(cut, clipped, spot)
    assert fit.turbidity == pytest.approx(3.0, abs=0.1)
    assert sun.irradiance == pytest.approx(sun_irradiance(LIGHTING), rel=0.05)
    found = find_spot(filled, np.zeros_like(clipped))
    assert found is not None
    assert found.irradiance == pytest.approx(sun_irradiance(LIGHTING), rel=0.05)
    far = latlong_directions(128) @ LIGHTING.sun_direction < 0.99
    assert filled[far] == pytest.approx(cut[far])


def test_a_sky_without_blue_cannot_tell() -> None:
    grey = np.where(latlong_directions(64)[..., 1:2] > 0, 0.5, 0.1).astype(np.float32).repeat(3, axis=-1)
    clipped = np.zeros((64, 128), bool)
    clipped[20:22, 60:62] = True
    grey[clipped] = 1000.0
    spot = find_spot(grey, clipped)
    assert spot is not None
    with pytest.raises(ProbeError, match="too little clear sky"):
        fill_sun(grey, clipped, spot)

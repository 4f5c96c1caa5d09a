"""A light changed by hand: stated irradiances follow the model."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lighting.envmap import change, sky_irradiance, sun_irradiance
from lighting.errors import ParameterError
from lighting.records import Lighting

PLAIN = Lighting(sun_azimuth=30.0, sun_elevation=40.0, turbidity=3.0, exposure=4.0)
STATED = replace(PLAIN, sun_irradiance=(6.0, 4.0, 2.0), sky_irradiance=(1.0, 2.0, 3.0), sky_cover=0.25)
CHANGES = {"sun_elevation": 8.0, "turbidity": 6.0, "exposure": 9.0}


def test_a_light_without_irradiances_is_only_replaced() -> None:
    assert change(PLAIN, CHANGES) == replace(PLAIN, sun_elevation=8.0, turbidity=6.0, exposure=9.0)


@pytest.mark.parametrize("changes", [{}, {"sun_azimuth": 31.0}, {"camera_elevation": 5.0}])
def test_what_moves_no_power_leaves_every_digit(changes: dict[str, float]) -> None:
    light = replace(STATED, sun_irradiance=(9.60513, 10.5285, 9.32128), sky_irradiance=(0.760374, 1.24752, 1.99918))
    assert change(light, changes) == replace(light, **changes)  # type: ignore[arg-type]


def test_exposure_scales_both() -> None:
    twice = change(STATED, {"exposure": 8.0})
    np.testing.assert_allclose(sun_irradiance(twice), (12, 8, 4), rtol=1e-5)
    np.testing.assert_allclose(sky_irradiance(twice), (2, 4, 6), rtol=1e-5)


def test_the_sun_keeps_its_ratio_to_the_models() -> None:
    changed, model = change(STATED, CHANGES), change(PLAIN, CHANGES)
    before = sun_irradiance(STATED) / sun_irradiance(PLAIN)
    np.testing.assert_allclose(sun_irradiance(changed) / sun_irradiance(model), before, rtol=1e-5)


@pytest.mark.parametrize(("cover", "spread"), [(0.0, 0.0), (1.0, 1.0)])
def test_an_overcast_sky_changes_in_grey_alone(cover: float, spread: float) -> None:
    """A clear sky's colour follows the model; the ratio of an overcast one's channels stays."""
    stated = replace(STATED, sky_cover=cover)
    gain = sky_irradiance(change(stated, CHANGES)) / sky_irradiance(stated)
    model = sky_irradiance(change(PLAIN, CHANGES)) / sky_irradiance(PLAIN)
    np.testing.assert_allclose(np.ptp(gain) / np.ptp(model), 1 - spread, atol=1e-5)


def test_what_is_stated_anew_counts_as_it_is() -> None:
    power: dict[str, Any] = {"sun_irradiance": (3.9, 4.3, 3.4), "sky_irradiance": (0.3, 0.6, 1.1)}
    light: dict[str, Any] = {**CHANGES, **power, "sky_cover": 0.5, "ground_color": (0.1, 0.2, 0.3)}
    assert change(STATED, light) == replace(STATED, **light)
    assert change(PLAIN, power) == replace(PLAIN, **power)


def test_a_value_out_of_range_is_refused() -> None:
    with pytest.raises(ParameterError, match="turbidity"):
        change(STATED, {"turbidity": 30.0})


@pytest.mark.parametrize("turbidity", [2.0, 6.0, 10.0])
def test_a_low_sun_that_is_raised_becomes_an_ordinary_one(turbidity: float) -> None:
    """The model's sun at 1° has no blue and little green; what is stated of it must not be multiplied by thousands."""
    low = replace(STATED, sun_elevation=1.0, turbidity=turbidity, sun_irradiance=(15.0, 10.0, 1.5))
    high = change(low, {"sun_elevation": 35.0})
    gain = sun_irradiance(high) / sun_irradiance(low)
    assert 1.0 < gain.min() <= gain.max() < 25.0
    np.testing.assert_allclose(sun_irradiance(change(high, {"sun_elevation": 1.0})), (15.0, 10.0, 1.5), rtol=1e-6)

"""One sun of many frames' estimates."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lighting.fusion.single_view import Observations
from lighting.geometry import direction
from lighting.records import Light, Prediction
from lighting.sun_grid import soft_label
from lighting.video.observation import FrameObservation, ShotLight
from lighting.video.tracking import FrameEstimate
from tests.conftest import TINY

SPEC = replace(TINY, sun_grid="fibonacci:1024")
NOTHING = Observations()


def look(azimuth: float, heading: float, evidence: Observations = NOTHING, **other: float) -> FrameObservation:
    """A camera at `heading` that believes in a sun at `azimuth` of the shot, 40 deg high."""
    p = soft_label(direction(azimuth - heading, 40.0), 12.0, SPEC.sun_grid).astype(np.float32)
    values: dict[str, Any] = {"sun_visibility": 0.9, "turbidity": 3.0, "exposure": 0.1, **other}
    prediction = Prediction(SPEC, p, camera_elevation=0.0, camera_roll=0.0, vertical_fov=45.0, **values)
    return FrameObservation(FrameEstimate(prediction), heading, 45.0, observations=evidence)


def sun_of(*looks: FrameObservation, evidence: Observations = NOTHING) -> tuple[float, float, float]:
    light = ShotLight()
    for one in looks:
        light.add(one)
    sun = light.answer(evidence).sun
    return sun.azimuth, sun.elevation, sun.radius_50


def test_the_same_view_again_and_again_is_no_news() -> None:
    once = sun_of(look(50.0, 0.0))
    often = sun_of(*[look(50.0, 0.0)] * 40)
    assert often == pytest.approx(once, abs=0.5)


def test_views_all_around_agree_on_one_sun_and_are_surer() -> None:
    once = sun_of(look(50.0, 0.0))
    around = sun_of(*(look(50.0, h) for h in range(0, 360, 60)))
    assert around[0] == pytest.approx(50.0, abs=2.0)
    assert around[1] == pytest.approx(40.0, abs=2.0)
    assert around[2] < 0.75 * once[2]


def test_one_view_that_errs_is_outvoted() -> None:
    azimuth, _, _ = sun_of(*(look(50.0 if h else 150.0, h) for h in range(0, 360, 45)))
    assert azimuth == pytest.approx(50.0, abs=12.0)  # where the eight lobes add up to is 8 deg off


def test_with_time_and_place_the_sun_tells_north() -> None:
    """The sun stands at 120 deg, and is seen 50 deg right of azimuth 0: that points to 70 deg."""
    when = Observations(candidates=((40.0, 120.0),))
    light = ShotLight()
    for heading in (0.0, 60.0, 120.0):
        light.add(look(50.0, heading, when))
    fused = light.answer(when)
    assert fused.camera_heading is not None
    assert fused.camera_heading.best == pytest.approx(70.0, abs=2.0)
    assert fused.used == ("pixels", "time+place", "turns", "other photos")


def test_exposures_are_those_of_the_first_frame() -> None:
    light = ShotLight()
    light.add(look(50.0, 0.0, exposure=0.1))
    light.add(replace(look(50.0, 90.0, exposure=0.4), gain=4.0))
    assert light.answer(NOTHING).prediction.exposure == pytest.approx(0.1)


def test_no_look_no_answer() -> None:
    light = ShotLight()
    with pytest.raises(ValueError, match="no look"):
        light.answer(NOTHING)


def test_the_strength_of_the_light_is_averaged_in_the_first_frames_exposure() -> None:
    light = ShotLight()
    for gain in (1.0, 2.0):
        one = look(50.0, 0.0)
        strength = Light(np.full(3, 1.0 * gain), np.full(3, 0.5 * gain), 0.2 * gain, 0.9)
        light.add(replace(one, estimate=FrameEstimate(replace(one.estimate.prediction, light=strength)), gain=gain))
    said = light.answer(NOTHING).prediction.light
    assert said is not None
    assert said.sun_irradiance == pytest.approx([1.0] * 3)
    assert said.sky_irradiance == pytest.approx([0.5] * 3)
    assert (said.cover, said.suitable) == pytest.approx((0.3, 0.9))
    assert look(0.0, 0.0).estimate.prediction.light is None


def test_the_ground_is_the_mean_of_the_directions_that_show_it() -> None:
    light = ShotLight()
    light.add(look(50.0, 0.0))
    assert light.ground is None
    for heading, reflectance in ((60.0, 0.1), (60.0, 0.1), (120.0, 0.4)):
        one = look(50.0, heading)
        light.add(replace(one, estimate=replace(one.estimate, ground=np.array([1.0, 0.5, 0.25]) * reflectance)))
    assert light.ground == pytest.approx([0.2, 0.1, 0.05])

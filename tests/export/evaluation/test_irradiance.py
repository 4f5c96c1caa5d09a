"""The true light of HDR panoramas, and the tables of what is estimated."""

import numpy as np
import pytest

from export.evaluation.irradiance import (
    TrueLight,
    _Guess,
    _objects_table,
    _strengths_table,
    mean_light_map,
    split_sun,
    true_light,
)
from export.evaluation.relighting import HEIGHT
from lighting.envmap.latlong import irradiance_from_rows, row_irradiance
from lighting.envmap.render import render
from lighting.geometry import Floats, angle_between, direction
from lighting.records import Lighting
from tests.helpers.panoramas import GROUND_COLOR, HDR_LIGHT, HDR_PANORAMA, SKY_IRRADIANCE, SUN_IRRADIANCE


def level_light(image: Floats) -> Floats:
    """Irradiance (3,) of a level surface from above."""
    half = len(image) // 2
    return irradiance_from_rows(row_irradiance(len(image))[:half], image[:half])


def test_sun_sky_and_ground_are_told_apart_in_the_crops_frame_and_exposure() -> None:
    light = true_light(split_sun(HDR_PANORAMA, direction(71.0, 41.0)), 30.0, 2.0)
    assert light.sun_direction is not None
    assert angle_between(light.sun_direction, direction(40.0, 40.0)) < 0.6
    assert light.sun_irradiance == pytest.approx(2 * np.array(SUN_IRRADIANCE), rel=0.03)
    assert light.sky_irradiance == pytest.approx(2 * np.array(SKY_IRRADIANCE), rel=0.03)
    level = np.array(SKY_IRRADIANCE) + np.sin(np.radians(40.0)) * np.array(SUN_IRRADIANCE)
    assert light.ground == pytest.approx(2 * np.array(GROUND_COLOR) / np.pi * level, rel=1e-3)
    assert level_light(light.image) == pytest.approx(2 * level, rel=0.02)


def test_without_direct_light_the_whole_sky_is_sky() -> None:
    light = true_light(split_sun(HDR_PANORAMA, None), 0.0, 1.0)
    assert light.sun_direction is None
    assert not light.sun_irradiance.any()
    assert light.sky_irradiance == pytest.approx(
        np.array(SKY_IRRADIANCE) + np.sin(np.radians(40.0)) * np.array(SUN_IRRADIANCE), rel=0.01
    )


def test_the_mean_map_knows_no_azimuth() -> None:
    ramp = np.broadcast_to(np.linspace(0, 1, 2 * HEIGHT)[None, :, None], (HEIGHT, 2 * HEIGHT, 3))
    light = TrueLight(ramp, None, np.zeros(3), np.ones(3), np.ones(3))
    assert mean_light_map([light, light]) == pytest.approx(0.5)


TRUTH = [true_light(split_sun(HDR_PANORAMA, HDR_LIGHT.sun_direction), 0.0, 1.0)] * 3


def guess(light: Lighting) -> _Guess:
    return _Guess(np.stack([render(light, HEIGHT)] * 3), (light,) * 3)


def cells(table: str, row: int) -> list[str]:
    return [cell.strip() for cell in table.splitlines()[row + 2].strip("|").split("|")]


def test_a_light_half_as_strong_is_one_stop_too_dark() -> None:
    half = Lighting(
        70.0, 40.0, 3.0, 1.0, sun_irradiance=(10.0, 7.5, 4.5), sky_irradiance=(0.4, 0.5, 0.8),
        ground_color=(0.06, 0.055, 0.05),
    )  # fmt: skip
    table = _strengths_table(TRUTH, {"ours": guess(half), "map": _Guess(guess(HDR_LIGHT).maps)})
    ours, other = cells(table, 0), cells(table, 1)
    assert ours[0] == "ours"
    assert float(ours[3]) == pytest.approx(0.0, abs=0.06)  # sky
    assert float(ours[4]) == pytest.approx(-1.0, abs=0.06)  # sun
    assert float(ours[5]) == pytest.approx(-1.0, abs=0.1)  # sun / sky
    assert ours[6] == "100 %"
    assert other[3:7] == ["-"] * 4
    assert float(other[1]) == pytest.approx(0.0, abs=0.03)
    assert float(other[7]) == pytest.approx(0.0, abs=0.03)


@pytest.mark.slow
def test_the_true_light_differs_from_itself_by_nothing() -> None:
    row = cells(_objects_table(TRUTH, {"truth": _Guess(np.stack([t.image for t in TRUTH]))}), 0)
    assert row[0] == "truth"
    assert [float(value) for value in row[1:]] == pytest.approx([0.0] * 12, abs=0.1)

"""Tables of methods whose errors are known."""

import numpy as np
import pytest

from export.evaluation.hdr_truth import HEIGHT, split_sun, true_light
from export.evaluation.irradiance import ORACLES, _Guess, _objects_table, _strengths_table
from lighting.envmap.render import render
from lighting.records import Lighting
from tests.helpers.panoramas import HDR_LIGHT, HDR_PANORAMA

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


def test_the_last_oracle_is_nearly_the_truth() -> None:
    wrong = Lighting(0.0, 20.0, 3.0, 1.0, sun_irradiance=(1.0, 1.0, 1.0), sky_irradiance=(1.0, 1.0, 1.0))
    told = ORACLES["and true ground"](wrong, TRUTH[0])
    assert told.sun_elevation == pytest.approx(40.0, abs=0.6)
    assert told.ground_color == pytest.approx((0.12, 0.11, 0.1), rel=0.05)
    assert ORACLES["true direction"](wrong, TRUTH[0]).sun_irradiance == (1.0, 1.0, 1.0)
    assert ORACLES["true power and colour"](wrong, TRUTH[0]).sun_azimuth == 0.0


@pytest.mark.slow
def test_the_true_light_differs_from_itself_by_nothing() -> None:
    row = cells(_objects_table(TRUTH, {"truth": _Guess(np.stack([t.image for t in TRUTH]))}), 0)
    assert row[0] == "truth"
    assert [float(value) for value in row[1:]] == pytest.approx([0.0] * 12, abs=0.1)

"""Rendered walks: what is nearer moves more, and a lower sun is redder."""

import numpy as np
import pytest

from export.reports.registration import Standpoint, WalkableTown, _Daylight
from lighting.records import Lighting
from lighting.sky.hosek_wilkie import sun_radiance

pytest.importorskip("mitsuba")


@pytest.fixture(scope="module")
def walk() -> WalkableTown:
    return WalkableTown(0)


def test_a_standpoint_gives_the_same_photo_again_and_a_step_another(walk: WalkableTown) -> None:
    at = Standpoint((0.0, 0.0), 20.0, 2.0, 0.0, 50.0)
    first, again, aside = (walk.photo(s, 64, 48) for s in (at, at, Standpoint((2.0, 0.0), 20.0, 2.0, 0.0, 50.0)))
    assert first.shape == (48, 64, 3)
    assert (first == again).all()
    assert np.mean(np.abs(first.astype(int) - aside)) > 2.0


def test_a_lower_sun_throws_redder_light() -> None:
    low, high = (_Daylight.of(Lighting(0.0, e, turbidity=3.0, exposure=0.02)) for e in (8.0, 60.0))
    assert low.beam[0] / low.beam[2] > 1.5 * high.beam[0] / high.beam[2]
    assert (high.ambient > 0).all()
    expected = sun_radiance(Lighting(0.0, 60.0, turbidity=3.0, exposure=0.02).sun_direction, 3.0)
    assert high.beam / high.beam[0] == pytest.approx(np.asarray(expected) / expected[0])

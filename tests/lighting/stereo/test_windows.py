"""Windows of a day."""

from datetime import date

import numpy as np
import pytest

from lighting.geometry import direction
from lighting.stereo.days import ONE_SKY, Day
from lighting.stereo.gain import largest_gain
from lighting.stereo.mean_light import Skies
from lighting.stereo.windows import SHORTEST, all_windows, windows_of, worth


def sun_alone(hours: float) -> Day:
    """A sun of irradiance pi that rises and turns 15 deg an hour under a dark sky."""
    minutes = np.arange(480.0, 480.0 + 60 * hours + 1, 5.0)
    suns = direction((minutes - 480) / 4, (minutes - 480) / 12)
    dark = np.zeros((len(minutes), 4, 8, 1), dtype=np.float32)
    return Day(date(2026, 6, 21), minutes, 2.5, Skies(dark, suns, np.full((len(minutes), 1), np.pi)), ONE_SKY)


def test_windows_start_on_quarters_of_an_hour_and_lie_in_light() -> None:
    windows = windows_of(sun_alone(3.0), 2.0, 5)
    assert windows.start.tolist() == [480, 495, 510, 525, 540]
    assert (windows.end - windows.start == 120).all()
    assert windows.moments.shape == (1, 5, 5)
    assert len(windows_of(sun_alone(3.0), 6.0, 5)) == 0


def test_all_windows_are_long_enough() -> None:
    windows = all_windows(sun_alone(2.0), 4, 15.0)
    assert (windows.end - windows.start).min() == SHORTEST
    assert windows.end.max() == 600


def test_a_window_is_worth_the_gain_of_its_photos() -> None:
    day, normal = sun_alone(3.0), direction(20.0, 60.0)[None]
    windows, light = windows_of(day, 3.0, 6), day.light(normal)
    found = worth(windows, light, normal)
    assert found.gain[0] == pytest.approx(float(largest_gain(light[0, windows.moments[0, 0]])))
    assert found.spread[0] > 0

"""The moments of a day and the photos of its windows."""

from datetime import date

import numpy as np
import pytest

from lighting.stereo.days import ONE_SKY, Day, Place, clear_brightness, in_grey, modelled_day
from lighting.stereo.skies import clear_skies

BREGENZ = Place(47.5, 9.75, 1.0)
JUNE = date(2026, 6, 21)


def test_a_modelled_day_holds_the_moments_with_the_sun_up() -> None:
    day = modelled_day(BREGENZ, JUNE, "clear", coarse=True)
    assert (day.skies.sun_direction[:, 1] > 0).all()
    assert 15 < (day.minutes[-1] - day.minutes[0]) / 60 < 16.5  # the longest day at 47.5 deg
    assert day.clouds is ONE_SKY


def test_photos_are_spread_evenly_and_moments_without_light_are_out_of_reach() -> None:
    minutes = np.arange(600.0, 720.0, 10.0)
    skies = in_grey(clear_skies(np.tile([[0.0, 0.6, 0.8]], (12, 1)), height=4))
    day = Day(JUNE, minutes, 5.0, skies, ONE_SKY)
    moments, reached = day.moments(np.array([600.0, 680.0]), np.array([660.0, 740.0]), 3)
    np.testing.assert_array_equal(minutes[moments[0, 0]], [600, 630, 660])
    assert reached.tolist() == [True, False]


def test_clouds_choose_between_the_variants_of_a_moment() -> None:
    minutes = np.arange(600.0, 660.0, 15.0)
    skies = in_grey(clear_skies(np.tile([[0.0, 0.6, 0.8]], (8, 1)), height=4))
    day = Day(JUNE, minutes, 7.5, skies, np.array([[1, 0, 0, 0]]))
    moments, _ = day.moments(np.array([600.0]), np.array([630.0]), 3)
    assert moments[0, 0].tolist() == [4, 1, 2]  # the first spell shows the second variant


def test_the_brightest_light_is_of_the_day_with_the_highest_sun() -> None:
    both = clear_brightness(BREGENZ, [date(2026, 12, 21), JUNE])
    assert both == pytest.approx(clear_brightness(BREGENZ, [JUNE]))
    assert both > clear_brightness(BREGENZ, [date(2026, 12, 21)])

"""Colours and words of a plan's picture."""

import numpy as np

from lighting.stereo.plan_figure import MAX_GAIN, MIN_GAIN, _gain_colors, format_angle_error


def test_less_gain_is_brighter_and_the_ends_of_the_scale_hold() -> None:
    colours = _gain_colors(np.array([0.1, MIN_GAIN, 10.0, 100.0, MAX_GAIN, np.inf])).astype(int)
    assert (np.diff(colours.sum(axis=1)) <= 0).all()
    np.testing.assert_array_equal(colours[0], colours[1])
    np.testing.assert_array_equal(colours[-1], colours[-2])


def test_errors_that_say_nothing_are_not_told_as_numbers() -> None:
    assert format_angle_error(7.25) == "7.2°"
    assert format_angle_error(60.0) == ">45°"

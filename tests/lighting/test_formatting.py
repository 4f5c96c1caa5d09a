"""Angles in words."""

import pytest

from lighting.formatting import format_azimuth, format_side, format_sun_elevation, format_tilt


@pytest.mark.parametrize(
    ("azimuth", "digits", "words"),
    [
        (-41.2, 0, "41° left"),
        (33.04, 1, "33.0° right"),
        (0.3, 0, "straight ahead"),
        (0.3, 1, "0.3° right"),
        (-0.04, 1, "straight ahead"),
        (179.8, 0, "straight behind"),
        (-179.8, 1, "179.8° left (behind)"),
        (90.0, 0, "90° right"),
        (120.0, 0, "120° right (behind)"),
    ],
)
def test_an_azimuth_is_told_by_its_side(azimuth: float, digits: int, words: str) -> None:
    assert format_azimuth(azimuth, digits) == words


def test_the_side_of_anything_is_told_without_what_lies_behind() -> None:
    assert (format_side(-170.0), format_side(0.0, 1)) == ("170° left", "0.0° right")


@pytest.mark.parametrize(
    ("elevation", "digits", "words"),
    [(-7.31, 1, "7.3° down"), (-0.04, 1, "0.0° up"), (-0.4, 0, "0° up"), (4.1, 0, "4° up")],
)
def test_a_tilt_is_told_by_its_direction(elevation: float, digits: int, words: str) -> None:
    assert format_tilt(elevation, digits) == words


def test_a_sun_stands_high_or_below_the_horizon() -> None:
    assert format_sun_elevation(33.4) == "33° high"
    assert format_sun_elevation(-0.04, 1) == "0.0° high"
    assert format_sun_elevation(-3.14, 1) == "3.1° below the horizon"

"""Simulated sessions."""

from typing import Any

import numpy as np

from export.stereo.days import Day, hours_of
from export.stereo.objects import Subject
from export.stereo.surfaces import of_height, turned
from export.stereo.trials import SEASONS, Trial, angle, session


def test_a_session_of_two_shapes_in_june_meets_the_target_of_the_search() -> None:
    y, x = np.mgrid[:40, :40] - 19.5
    inside = x * x + y * y < 17**2
    ball = of_height(np.sqrt(np.maximum(19.0**2 - x * x - y * y, 1)).astype(np.float32), inside)
    day = Day(hours_of("2024-06-21", np.arange(9.0, 17.0)), 47.0)
    found: list[Any] = session([Subject("a", "b", ball), Subject("c", "b", turned(ball, 1))], Trial(day), None)
    assert [shape.subject.name for shape in found] == ["a", "c"]
    for shape in found:
        search, both = shape.errors()
        assert np.median(search) < 4  # issue: at most 4 in June
        np.testing.assert_array_equal(search, both)


def test_a_photographer_is_told_wrong_what_a_trial_says() -> None:
    day = SEASONS["47° N, June"]
    told = Trial(day, heading_error=2.0, clock_error=5.0, turbidity_error=-1.0).told()
    assert told.pose.heading == day.pose.heading + 2
    assert (told.times - day.times == np.timedelta64(300, "s")).all()
    assert told.turbidity == day.turbidity - 1
    assert told.latitude == day.latitude


def test_angles_are_between_unit_vectors() -> None:
    a, b = np.array([[1.0, 0, 0], [0, 0, 1]]), np.array([[0, 1.0, 0], [0, 0, 1]])
    np.testing.assert_allclose(angle(a, b), [90, 0], atol=1e-5)

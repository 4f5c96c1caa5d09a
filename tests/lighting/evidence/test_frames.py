"""Which photos share a frame."""

from typing import Any

import numpy as np
import pytest

from lighting.errors import ParameterError
from lighting.evidence.frames import TURN_NOISE, check_headings, frames
from lighting.evidence.fusion import Evidence
from lighting.turns import Placed

NOTHING = [Evidence()] * 3
COMPASS = [Evidence(heading=h) for h in (350.0, 20.0, 90.0)]


def placed(*groups: int) -> list[Placed]:
    return [Placed(g, 10.0 * i, 0.3, 0.0, 0.0, 50.0) for i, g in enumerate(groups)]


def test_headings_win_over_everything() -> None:
    found = frames(COMPASS, [1.0, 2.0, 3.0], placed(0, 0, 0))
    assert found.turn.tolist() == [1.0, 2.0, 3.0]
    assert not found.noise.any()
    assert found.source is None


def test_matches_win_over_the_compass_where_they_connect_all() -> None:
    found = frames(COMPASS, None, placed(0, 0, 0))
    assert found.turn.tolist() == [0.0, 10.0, 20.0]
    assert found.source == "turns"


def test_the_compass_joins_groups_that_matches_leave_apart() -> None:
    found = frames(COMPASS, None, placed(0, 0, 1))
    assert not found.group.any()
    assert found.turn - found.turn[0] == pytest.approx([0.0, 10.0, 90.0], abs=10.0)
    assert found.turn[1] - found.turn[0] == pytest.approx(10.0)
    assert found.noise[2] == pytest.approx(np.hypot(0.3, TURN_NOISE))
    assert found.noise[:2] == pytest.approx([np.hypot(0.3, TURN_NOISE / np.sqrt(2))] * 2)


def test_without_any_each_photo_is_alone() -> None:
    for found in (frames(NOTHING, None), frames(NOTHING, None, placed(0, 1, 2))):
        assert found.group.tolist() == [0, 1, 2]
        assert found.heading_of_first(1) is None


def test_headings_must_be_as_many_as_photos() -> None:
    with pytest.raises(ParameterError, match="3 photos need 3 headings, not 2"):
        frames(NOTHING, [0.0, 1.0])


@pytest.mark.parametrize("headings", [90.0, 0, {0.0, 90.0}])
def test_what_is_no_list_of_headings_is_refused(headings: Any) -> None:
    with pytest.raises(ParameterError, match=r"^headings are a list of degrees, not .*\.$"):
        check_headings(2, headings)


@pytest.mark.parametrize("heading", [float("nan"), np.float32("inf"), None, "90"])
def test_a_heading_that_is_no_number_is_named(heading: Any) -> None:
    with pytest.raises(ParameterError, match=r"A heading must be a finite number, not .*\."):
        frames(NOTHING, [0.0, heading, 90.0])

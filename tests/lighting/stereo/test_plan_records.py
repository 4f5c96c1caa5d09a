"""What is asked of a plan, and its answer as JSON."""

import numpy as np
import pytest

from lighting.errors import ParameterError
from lighting.stereo.plan_records import PlanRequest, SurfaceOrientation, format_clock


@pytest.mark.parametrize(
    "wrong", [{"shots": 2}, {"noise": 0.0}, {"noise": 101.0}, {"facing": 361.0}, {"facing": float("nan")}]
)
def test_questions_are_checked(wrong: dict[str, float]) -> None:
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        PlanRequest(**wrong)  # type: ignore[arg-type]


def test_what_the_light_does_not_resolve_is_null() -> None:
    found = SurfaceOrientation("level", 0.0, 90.0, 90.0, np.inf, (0.123456, np.inf, 1.0)).to_dict()
    assert found["gain"] is None
    assert found["interval_95"] == [0.1235, None, 1.0]


def test_times_are_written_as_a_clock_shows_them() -> None:
    assert format_clock(645.0) == "10:45"
    assert format_clock(59.6) == "01:00"

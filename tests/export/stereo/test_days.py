"""Days to photograph, as they are and as their photographer believes them to be."""

import numpy as np

from export.stereo.days import HELD_OUT_LATITUDES, Day, believed, hours_of, random_day


def test_training_days_keep_off_the_latitudes_that_are_held_out() -> None:
    rng = np.random.default_rng(0)
    for day in (random_day(rng) for _ in range(60)):
        assert not any(low <= abs(day.latitude) <= high for low, high in HELD_OUT_LATITUDES)
        assert 3 <= len(day.times) <= 8
        assert np.degrees(np.arcsin(day.suns()[:, 1])).min() > 5
    day = Day(hours_of("2024-03-21", np.array([9.0, 12.0])), 47.0)
    assert day.times[1] - day.times[0] == np.timedelta64(3, "h")
    assert believed(day, rng).latitude == 47.0

"""Tests of dataset."""

import numpy as np

from export.stereo.dataset import (
    CROP,
    HELD_OUT_LATITUDES,
    CaptureDay,
    _believed,
    _random_day,
    generate_samples,
    utc_times,
)


def test_training_days_keep_off_the_latitudes_that_are_held_out() -> None:
    rng = np.random.default_rng(0)
    for day in (_random_day(rng) for _ in range(60)):
        assert not any(low <= abs(day.latitude) <= high for low, high in HELD_OUT_LATITUDES)
        assert 3 <= len(day.times) <= 8
        assert np.degrees(np.arcsin(day.suns()[:, 1])).min() > 5
    day = CaptureDay(utc_times("2024-03-21", np.array([9.0, 12.0])), 47.0)
    assert day.times[1] - day.times[0] == np.timedelta64(3, "h")
    assert _believed(day, rng).latitude == 47.0


def test_samples_are_the_same_for_the_same_seed() -> None:
    first, second = (next(generate_samples([], seed=5)) for _ in range(2))
    assert first.truth.shape == (3, CROP, CROP)
    np.testing.assert_array_equal(first.by_image, second.by_image)
    inside = first.shared[-1] > 0
    np.testing.assert_allclose(np.linalg.norm(first.truth[:, inside].astype(float), axis=0), 1, atol=2e-3)

"""Noise as simulated values have it."""

import numpy as np
import pytest

from lighting.probe.noise import noise_variance, smooth_below


@pytest.mark.parametrize("value", [0.1, 0.5])
@pytest.mark.parametrize("step", [1e-6, 1 / 255])
def test_the_variance_is_that_of_rounded_values_of_20000_electrons(value: float, step: float) -> None:
    random = np.random.default_rng(0)
    light = value + random.uniform(0, step, 200_000)  # all phases of a step
    read = random.normal(random.poisson(light * 20_000) / 20_000, 2e-4)
    assert np.var(step * np.rint(read / step) - light) == pytest.approx(noise_variance(value, step), rel=0.05)


def test_noise_is_half_a_step_at_the_value_told() -> None:
    step = 1 / 255
    assert noise_variance(smooth_below(step), 0.0) == pytest.approx(step**2 / 4)
    assert smooth_below(1 / 4095) < 0

"""What light resolves of a normal."""

import numpy as np
import pytest

from lighting.geometry import Floats
from lighting.stereo.noise_gain import (
    angular_error,
    angular_std,
    gain_from_inverse,
    interval_95,
    rotation_free_gain,
    window_gram_inverses,
)
from tests.helpers.noise_study import gram_inverses, largest_gain, triplet

RNG = np.random.default_rng(0)


def turn(seed: int) -> Floats:
    """A random rotation."""
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return np.asarray(q * np.sign(np.diag(r)))


def test_three_orthogonal_unit_lights_gain_one_whichever_way_they_are_turned() -> None:
    for seed in range(5):
        assert largest_gain(turn(seed)) == pytest.approx(1.0)
        assert rotation_free_gain(turn(seed)) == pytest.approx(1.0)


@pytest.mark.parametrize("lift", [15, 20, 30, 45, 60, 90])
def test_an_hour_with_a_light_lifted_fifteen_degrees_gains_less_than_six(lift: float) -> None:
    assert largest_gain(triplet(15, lift)) < 6
    assert largest_gain(triplet(15, 10)) > 6


def test_known_triplets() -> None:
    assert largest_gain(triplet(15, 15)) == pytest.approx(5.4, abs=0.05)
    assert largest_gain(triplet(30, 20)) < 4
    assert largest_gain(triplet(90, 90)) == pytest.approx(1.0)


@pytest.mark.parametrize("lift", [75, 90])
def test_an_hour_costs_five_to_seven_times_a_full_arc(lift: float) -> None:
    """With the third light nearly square to the solar plane, as broken cloud moves it; a lower one costs less."""
    assert 5 < largest_gain(triplet(15, lift)) / largest_gain(triplet(90, lift)) < 7


def test_the_inverse_is_numpys() -> None:
    matrices = RNG.normal(size=(50, 6, 3))
    expected = np.linalg.inv(np.swapaxes(matrices, 1, 2) @ matrices)
    np.testing.assert_allclose(gram_inverses(matrices), expected, rtol=1e-9)


def test_an_ill_conditioned_inverse_keeps_its_digits() -> None:
    lights = np.array([[0, 1, 0], [1e-2, 1, 0], [0, 1, 1e-2]])  # a noise gain of about 140
    np.testing.assert_allclose(gram_inverses(lights), np.linalg.inv(lights.T @ lights), rtol=1e-5)


def test_what_no_light_resolves_has_an_infinite_gain() -> None:
    plane = np.array([[1.0, 0, 0], [0, 1, 0], [1, 1, 0]])
    assert np.isinf(gain_from_inverse(gram_inverses(plane))).all()
    assert np.isinf(largest_gain(np.ones((2, 3))))
    assert np.isinf(rotation_free_gain(np.ones((2, 3))))
    assert angular_error(angular_std(gram_inverses(plane), [0, 1, 0]), 0.01) == 90


def test_the_rotation_free_gain_bounds_the_gain_of_every_axis() -> None:
    lights = RNG.normal(size=(4, 3))
    gains = [float(largest_gain(lights @ turn(seed))) for seed in range(200)]
    free = float(rotation_free_gain(lights))
    assert max(gains) <= free * (1 + 1e-9)
    assert max(gains) > 0.95 * free
    assert np.ptp([float(rotation_free_gain(lights @ turn(seed))) for seed in range(20)]) < 1e-9 * free


def test_more_photos_and_more_light_gain_less() -> None:
    lights = RNG.normal(size=(5, 3))
    assert largest_gain(np.tile(lights, (4, 1))) == pytest.approx(largest_gain(lights) / 2)
    assert largest_gain(2 * lights) == pytest.approx(largest_gain(lights) / 2)


def test_noisy_pixels_scatter_as_predicted() -> None:
    """20,000 patches: their standard deviation is known to 0.5 %, their root mean square turn to less than 1 %."""
    lights, albedo, noise = RNG.normal(size=(8, 3)), 0.6, 0.01
    normal = np.array([0.6, 0.8, 0.0])
    pixels = lights @ (albedo * normal) + noise * RNG.standard_normal((20_000, 8))
    found = np.linalg.lstsq(lights, pixels.T, rcond=None)[0].T
    np.testing.assert_allclose(found.std(axis=0), noise * gain_from_inverse(gram_inverses(lights)), rtol=0.02)
    inside = np.abs(found / albedo - normal) <= interval_95(gain_from_inverse(gram_inverses(lights)), noise, albedo)
    np.testing.assert_allclose(inside.mean(axis=0), 0.95, atol=0.006)
    unit = found / np.linalg.norm(found, axis=1, keepdims=True)
    turned = np.degrees(np.arccos(np.clip(unit @ normal, -1, 1)))
    expected = angular_error(angular_std(gram_inverses(lights), normal), noise, albedo)
    assert np.sqrt(np.mean(turned**2)) == pytest.approx(expected, rel=0.02)


def test_windows_gain_what_their_photos_gain() -> None:
    lights = RNG.normal(size=(3, 20, 3))
    moments = np.array([[0, 4, 8, 12], [5, 5, 6, 7]])
    gains = gain_from_inverse(window_gram_inverses(lights, moments)).max(axis=-1)
    for row, index in enumerate(moments):
        np.testing.assert_allclose(gains[:, row], largest_gain(lights[:, index]), rtol=1e-9)

"""Rounded skies against what was rounded."""

import numpy as np
import pytest
from numpy.typing import NDArray

from lighting.photo.linear import LinearPhoto
from lighting.probe.exposures import Bracket
from lighting.probe.merge import merge
from lighting.probe.rounding import unrounded, within_rounding

STEP = 1 / 255
REACH = 6.0  # pixels
Y, X = np.mgrid[:90, :120]
SKY = STEP * (1.6 + 15 * ((X - 50) / 90.0) ** 2 + 10 * ((Y - 30) / 90.0) ** 2)  # from 1.6 to 15 steps


def rounded(values: NDArray[np.floating], step: float = STEP) -> NDArray[np.float32]:
    return np.asarray(step * np.rint(values / step), dtype=np.float32)


def filled(recorded: NDArray[np.float32]) -> NDArray[np.float32]:
    half = np.where(recorded > 0, STEP / 2, 0).astype(np.float32)
    return within_rounding(recorded, recorded, half, REACH)


def bracket(values: NDArray[np.floating], step: float) -> Bracket:
    """Two exposures, of a fifth and of the whole."""
    three = np.repeat(values[..., None], 3, axis=-1)
    photos = [LinearPhoto(rounded(three * time, step), 0.98, step, time) for time in (0.2, 1.0)]
    return Bracket((photos[0], photos[1]), ("short", "long"))


def test_a_sky_of_a_few_steps_comes_back() -> None:
    recorded = rounded(SKY)
    before, after = (np.sqrt(np.mean((values / SKY - 1) ** 2)) for values in (recorded, filled(recorded)))
    assert before > 0.05
    assert after < 0.5 * before


def test_no_value_leaves_the_interval_that_rounding_allows() -> None:
    recorded = rounded(SKY + np.random.default_rng(0).normal(0, 0.4 * STEP, SKY.shape))
    assert np.abs(filled(recorded) - recorded).max() <= STEP / 2 * 1.001


def test_an_edge_stays() -> None:
    recorded = np.full((60, 80), 3 * STEP, dtype=np.float32)
    recorded[:, 40:] = 6 * STEP
    recorded[30:, :20] = 0
    np.testing.assert_allclose(filled(recorded), recorded, rtol=1e-5)


def test_both_sides_of_an_edge_are_smoothed_apart() -> None:
    roof = STEP * (7 + X / 40)
    sky, house = SKY[:, :60], roof[:, 60:]
    together = filled(rounded(np.hstack([sky, house])))
    np.testing.assert_allclose(together[:, :60], filled(rounded(sky)), rtol=1e-4)
    np.testing.assert_allclose(together[:, 60:], filled(rounded(house)), rtol=1e-4)


def test_the_dark_of_a_bracket_comes_nearer_and_its_well_exposed_values_do_not_change() -> None:
    values = SKY.copy()
    values[:, 90:] = 0.3 + 0.002 * X[:, 90:]
    shots = bracket(values, STEP)
    merged = merge(shots, np.array([0.2, 1.0]))
    found = unrounded(merged, shots, np.array([0.2, 1.0]), REACH)
    np.testing.assert_array_equal(found.radiance[:, 90:], merged.radiance[:, 90:])
    dark = np.s_[:, :90, 0]
    before, after = (np.abs(picture.radiance[dark] / values[:, :90] - 1).mean() for picture in (merged, found))
    assert after < 0.5 * before


@pytest.mark.parametrize("bits", [12, 14])
def test_fine_bits_are_left_alone(bits: int) -> None:
    shots = bracket(SKY, 1 / (2**bits - 1))
    merged = merge(shots, np.array([0.2, 1.0]))
    assert unrounded(merged, shots, np.array([0.2, 1.0]), REACH) is merged

"""Exposures merged to radiance, and what rounding hides."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lighting.errors import ProbeError
from lighting.photo.linear import LinearPhoto
from lighting.probe.bracket import Bracket, make_bracket
from lighting.probe.merging import _smooth_within_rounding, dequantize, merge_exposures

TIMES = np.array([0.001, 0.01, 0.1, 1.0])


def bracket(radiance: NDArray[np.floating[Any]], electrons: float = 1e12, full: int = 2**14 - 1) -> Bracket:
    """Exposures with the noise of light, so many electrons at full scale."""
    rng = np.random.default_rng(2)
    photos = []
    for time in TIMES:
        value = rng.normal(radiance * time, np.sqrt(radiance * time / electrons))
        counts = np.clip(np.rint(value * full), 0, full)
        photos.append(LinearPhoto((counts / full).astype(np.float32), 0.98, 1 / full, time))
    return make_bracket(photos)


def test_radiance_over_six_decades_comes_back() -> None:
    radiance = np.repeat(np.geomspace(1e-3, 900, 400).reshape(20, 20, 1), 3, axis=-1)
    merged = merge_exposures(bracket(radiance), TIMES)
    assert merged.radiance == pytest.approx(radiance, rel=0.03)  # rounding at the darkest end
    assert merged.radiance[10:] == pytest.approx(radiance[10:], rel=0.005)
    assert not merged.clipped.any()


def test_what_is_clipped_in_every_exposure_stays_the_brightest_and_is_marked() -> None:
    radiance = np.full((9, 9, 3), 100.0)
    radiance[4, 3], radiance[4, 4] = 900.0, 10_000.0  # the weights of cv2.MergeDebevec put this one below its neighbour
    merged = merge_exposures(bracket(radiance), TIMES)
    assert merged.clipped.sum() == 1
    assert merged.clipped[4, 4]
    assert merged.radiance[4, 4].min() >= 0.98 / TIMES[0]
    assert merged.radiance[4, 3] == pytest.approx(900, rel=0.01)


def test_a_channel_alone_may_clip() -> None:
    radiance = np.full((9, 9, 3), 0.5)
    radiance[4, 4] = (0.5, 0.5, 5000.0)
    merged = merge_exposures(bracket(radiance), TIMES)
    assert merged.clipped[4, 4]
    # The other channels of such a pixel count in the shortest exposure alone, for demosaicing shares their errors.
    assert merged.radiance[4, 4, 0] == pytest.approx(0.5, rel=0.05)


def test_noise_is_less_than_in_the_best_exposure_alone() -> None:
    radiance = np.full((100, 100, 3), 0.3)
    photos = bracket(radiance, electrons=20_000)
    assert merge_exposures(photos, TIMES).radiance.std() < 0.97 * photos.photos[-1].pixels.std()
    assert merge_exposures(photos, TIMES).radiance.mean() == pytest.approx(0.3, rel=0.002)


def test_nothing_to_measure_is_said() -> None:
    with pytest.raises(ProbeError, match="clipped in the shortest"):
        merge_exposures(bracket(np.full((9, 9, 3), 1e5)), TIMES)
    with pytest.raises(ProbeError, match="black"):
        merge_exposures(bracket(np.zeros((9, 9, 3))), TIMES)


STEP = 1 / 255
REACH = 6.0  # pixels
Y, X = np.mgrid[:90, :120]
SKY = STEP * (1.6 + 15 * ((X - 50) / 90.0) ** 2 + 10 * ((Y - 30) / 90.0) ** 2)  # from 1.6 to 15 steps


def rounded(values: NDArray[np.floating], step: float = STEP) -> NDArray[np.float32]:
    return np.asarray(step * np.rint(values / step), dtype=np.float32)


def filled(recorded: NDArray[np.float32]) -> NDArray[np.float32]:
    half = np.where(recorded > 0, STEP / 2, 0).astype(np.float32)
    return _smooth_within_rounding(recorded, recorded, half, REACH)


def coarse_bracket(values: NDArray[np.floating], step: float) -> Bracket:
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
    shots = coarse_bracket(values, STEP)
    merged = merge_exposures(shots, np.array([0.2, 1.0]))
    found = dequantize(merged, shots, np.array([0.2, 1.0]), REACH)
    np.testing.assert_array_equal(found.radiance[:, 90:], merged.radiance[:, 90:])
    dark = np.s_[:, :90, 0]
    before, after = (np.abs(picture.radiance[dark] / values[:, :90] - 1).mean() for picture in (merged, found))
    assert after < 0.5 * before


@pytest.mark.parametrize("bits", [12, 14])
def test_fine_bits_are_left_alone(bits: int) -> None:
    shots = coarse_bracket(SKY, 1 / (2**bits - 1))
    merged = merge_exposures(shots, np.array([0.2, 1.0]))
    assert dequantize(merged, shots, np.array([0.2, 1.0]), REACH) is merged

"""Ratios of a bracket's exposures, and what they are merged to."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lighting.color import srgb_encode
from lighting.errors import ProbeError
from lighting.photo.linear import LinearPhoto
from lighting.probe.bracket import Bracket, make_bracket
from lighting.probe.merging import (
    ExposureRatio,
    _smooth_within_rounding,
    dequantize,
    dilate,
    max_terraced_value,
    measure_ratios,
    merge_exposures,
    noise_variance,
)


@pytest.mark.parametrize("value", [0.1, 0.5])
@pytest.mark.parametrize("step", [1e-6, 1 / 255])
def test_the_variance_is_that_of_rounded_values_of_20000_electrons(value: float, step: float) -> None:
    random = np.random.default_rng(0)
    light = value + random.uniform(0, step, 200_000)  # all phases of a step
    read = random.normal(random.poisson(light * 20_000) / 20_000, 2e-4)
    assert np.var(step * np.rint(read / step) - light) == pytest.approx(noise_variance(value, step), rel=0.05)


def test_noise_is_half_a_step_at_the_value_told() -> None:
    step = 1 / 255
    assert noise_variance(max_terraced_value(step), 0.0) == pytest.approx(step**2 / 4)
    assert max_terraced_value(1 / 4095) < 0


RANDOM = np.random.default_rng(11)
SCENE = np.exp(RANDOM.normal(-2.0, 1.0, (120, 120, 3)))


def exposed(
    scene: NDArray[np.floating[Any]], length: float, bits: int = 14, black: float = 0.0, told: bool = False
) -> LinearPhoto:
    full = 2**bits - 1
    value = np.random.default_rng(round(1000 * length)).normal(scene * length + black, 0.002)
    counts = np.clip(np.rint(value * full), 0, full) / full
    return LinearPhoto(counts.astype(np.float32), 0.98, 1 / full, length if told else None)


def ratio_of(short: LinearPhoto, long: LinearPhoto) -> ExposureRatio | None:
    """What pixels alone tell of two exposures, whatever EXIF says."""
    bracket = make_bracket([replace(photo, exposure=None) for photo in (short, long)])
    try:
        return measure_ratios(bracket).ratios[0]
    except ProbeError:  # the pixels tell nothing either
        return None


@pytest.mark.parametrize(("bits", "tolerance"), [(8, 0.01), (12, 0.005), (14, 0.005)])
@pytest.mark.parametrize("ratio", [2.0, 8.0])
def test_ratios_are_measured_from_the_pixels(ratio: float, bits: int, tolerance: float) -> None:
    got = ratio_of(exposed(SCENE, 1 / ratio, bits), exposed(SCENE, 1.0, bits))
    assert got is not None
    assert got.value == pytest.approx(ratio, rel=tolerance)
    assert got.error < 0.01


def test_black_that_is_not_zero_does_not_change_the_ratio() -> None:
    got = ratio_of(exposed(SCENE, 0.25, black=0.01), exposed(SCENE, 1.0, black=0.01))
    assert got is not None
    assert got.value == pytest.approx(4, rel=0.01)


def test_what_moves_is_outweighed() -> None:
    moved = SCENE.copy()
    moved[:30] = RANDOM.permutation(moved[:30])  # a quarter of the picture
    got = ratio_of(exposed(moved, 0.25), exposed(SCENE, 1.0))
    assert got is not None
    assert got.value == pytest.approx(4, rel=0.02)


def test_without_exif_the_longest_exposure_is_one() -> None:
    lengths = measure_ratios(make_bracket([exposed(SCENE, length) for length in (0.1, 0.4, 1.0)]))
    assert lengths.relative == pytest.approx([0.1, 0.4, 1.0], rel=0.01)


def test_exif_is_believed_and_its_contradiction_said() -> None:
    right = measure_ratios(make_bracket([exposed(SCENE, length, told=True) for length in (0.1, 0.5)]))
    assert right.relative == pytest.approx([0.1, 0.5])
    assert not right.warnings
    liar = LinearPhoto(exposed(SCENE, 0.1).pixels, 0.98, 2**-14, 0.08)
    wrong = measure_ratios(make_bracket([liar, exposed(SCENE, 0.5, told=True)]))
    assert "the pixels say 5" in wrong.warnings[0]


def test_pixels_coded_by_a_curve_are_refused() -> None:
    coded = [
        LinearPhoto(srgb_encode(exposed(SCENE, length).pixels).astype(np.float32), 0.98, 1 / 255, length)
        for length in (0.02, 0.1, 0.5)
    ]
    with pytest.raises(ProbeError, match=r"coded by a curve.*--curve srgb"):
        measure_ratios(make_bracket(coded))


def test_exposures_that_share_nothing_are_refused() -> None:
    with pytest.raises(ProbeError, match="share too few pixels"):
        measure_ratios(make_bracket([exposed(SCENE * 0, 0.1), exposed(SCENE * 0 + 5, 1.0)]))


def test_a_mask_grows_by_one_pixel_each_way() -> None:
    mask = np.zeros((5, 5), bool)
    mask[2, 2] = True
    assert dilate(mask).sum() == 9
    mask[:] = False
    mask[0, 0] = True
    assert dilate(mask).sum() == 4


@pytest.mark.parametrize("bits", [12, 14])
def test_values_that_hardly_differ_tell_the_ratio_of_their_means(bits: int) -> None:
    random = np.random.default_rng(3)
    even = random.uniform(0.05, 0.053, (60, 60, 3))  # the noise of such values is as large as their spread
    even[0, 0] = 0.9
    full = 2**bits - 1

    def shot(length: float) -> LinearPhoto:
        electrons = random.normal(even * length * 20_000, np.sqrt(even * length * 20_000))
        return LinearPhoto((np.rint(electrons / 20_000 * full) / full).astype(np.float32), 0.98, 1 / full, length)

    got = ratio_of(shot(0.2), shot(1.0))
    assert got is not None
    assert got.value == pytest.approx(5, rel=0.03)


@pytest.mark.parametrize(("level", "told"), [(0.3, True), (10 / 255, False)])
def test_values_that_are_all_the_same_tell_a_ratio_where_they_are_many_steps(level: float, told: bool) -> None:
    even = np.full((40, 40, 3), level, dtype=np.float32)
    even[0, 0] = 0.9
    got = ratio_of(LinearPhoto(even * np.float32(0.2), 0.98, 1 / 255), LinearPhoto(even, 0.98, 1 / 255))
    assert (got is not None) == told
    assert got is None or got.value == pytest.approx(5)


def test_a_ratio_of_few_or_scattered_values_is_not_sure() -> None:
    assert ExposureRatio(4.0, 0.01, 2000).is_sure
    assert not ExposureRatio(4.0, 0.01, 200).is_sure
    assert not ExposureRatio(7.6, 0.11, 8000).is_sure


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
    radiance[4, 3], radiance[4, 4] = 900.0, 10_000.0  # the weights of cv2.MergeDebevec put this one below its neighbor
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

"""Exposure ratios of pictures whose ratios are known."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lighting.colour import srgb_encode
from lighting.errors import ProbeError
from lighting.photo.linear import LinearPhoto
from lighting.probe.exposures import bracket_of
from lighting.probe.ratios import Ratio, beside, exposed, measured_ratio

RANDOM = np.random.default_rng(11)
SCENE = np.exp(RANDOM.normal(-2.0, 1.0, (120, 120, 3)))


def taken(
    scene: NDArray[np.floating[Any]], length: float, bits: int = 14, black: float = 0.0, told: bool = False
) -> LinearPhoto:
    full = 2**bits - 1
    value = np.random.default_rng(round(1000 * length)).normal(scene * length + black, 0.002)
    counts = np.clip(np.rint(value * full), 0, full) / full
    return LinearPhoto(counts.astype(np.float32), 0.98, 1 / full, length if told else None)


@pytest.mark.parametrize(("bits", "tolerance"), [(8, 0.01), (12, 0.005), (14, 0.005)])
@pytest.mark.parametrize("ratio", [2.0, 8.0])
def test_ratios_are_measured_from_the_pixels(ratio: float, bits: int, tolerance: float) -> None:
    got = measured_ratio(taken(SCENE, 1 / ratio, bits), taken(SCENE, 1.0, bits))
    assert got is not None
    assert got.value == pytest.approx(ratio, rel=tolerance)
    assert got.error < 0.01


def test_black_that_is_not_zero_does_not_change_the_ratio() -> None:
    got = measured_ratio(taken(SCENE, 0.25, black=0.01), taken(SCENE, 1.0, black=0.01))
    assert got is not None
    assert got.value == pytest.approx(4, rel=0.01)


def test_what_moves_is_outweighed() -> None:
    moved = SCENE.copy()
    moved[:30] = RANDOM.permutation(moved[:30])  # a quarter of the picture
    got = measured_ratio(taken(moved, 0.25), taken(SCENE, 1.0))
    assert got is not None
    assert got.value == pytest.approx(4, rel=0.02)


def test_without_exif_the_longest_exposure_is_one() -> None:
    lengths = exposed(bracket_of([taken(SCENE, length) for length in (0.1, 0.4, 1.0)]))
    assert not lengths.from_exif
    assert lengths.relative == pytest.approx([0.1, 0.4, 1.0], rel=0.01)


def test_exif_is_believed_and_its_contradiction_said() -> None:
    right = exposed(bracket_of([taken(SCENE, length, told=True) for length in (0.1, 0.5)]))
    assert right.from_exif
    assert right.relative == pytest.approx([0.1, 0.5])
    assert not right.warnings
    liar = LinearPhoto(taken(SCENE, 0.1).pixels, 0.98, 2**-14, 0.08)
    wrong = exposed(bracket_of([liar, taken(SCENE, 0.5, told=True)]))
    assert "the pixels say 5" in wrong.warnings[0]


def test_pixels_coded_by_a_curve_are_refused() -> None:
    coded = [
        LinearPhoto(srgb_encode(taken(SCENE, length).pixels).astype(np.float32), 0.98, 1 / 255, length)
        for length in (0.02, 0.1, 0.5)
    ]
    with pytest.raises(ProbeError, match=r"coded by a curve.*--curve srgb"):
        exposed(bracket_of(coded))


def test_exposures_that_share_nothing_are_refused() -> None:
    with pytest.raises(ProbeError, match="share too few pixels"):
        exposed(bracket_of([taken(SCENE * 0, 0.1), taken(SCENE * 0 + 5, 1.0)]))


def test_a_mask_grows_by_one_pixel_each_way() -> None:
    mask = np.zeros((5, 5), bool)
    mask[2, 2] = True
    assert beside(mask).sum() == 9
    mask[:] = False
    mask[0, 0] = True
    assert beside(mask).sum() == 4


@pytest.mark.parametrize("bits", [12, 14])
def test_values_that_hardly_differ_tell_the_ratio_of_their_means(bits: int) -> None:
    random = np.random.default_rng(3)
    even = random.uniform(0.05, 0.053, (60, 60, 3))  # the noise of such values is as large as their spread
    even[0, 0] = 0.9
    full = 2**bits - 1

    def shot(length: float) -> LinearPhoto:
        electrons = random.normal(even * length * 20_000, np.sqrt(even * length * 20_000))
        return LinearPhoto((np.rint(electrons / 20_000 * full) / full).astype(np.float32), 0.98, 1 / full, length)

    got = measured_ratio(shot(0.2), shot(1.0))
    assert got is not None
    assert got.value == pytest.approx(5, rel=0.03)


@pytest.mark.parametrize(("level", "told"), [(0.3, True), (10 / 255, False)])
def test_values_that_are_all_the_same_tell_a_ratio_where_they_are_many_steps(level: float, told: bool) -> None:
    even = np.full((40, 40, 3), level, dtype=np.float32)
    even[0, 0] = 0.9
    got = measured_ratio(LinearPhoto(even * np.float32(0.2), 0.98, 1 / 255), LinearPhoto(even, 0.98, 1 / 255))
    assert (got is not None) == told
    assert got is None or got.value == pytest.approx(5)


def test_a_ratio_of_few_or_scattered_values_is_not_sure() -> None:
    assert Ratio(4.0, 0.01, 2000).sure
    assert not Ratio(4.0, 0.01, 200).sure
    assert not Ratio(7.6, 0.11, 8000).sure

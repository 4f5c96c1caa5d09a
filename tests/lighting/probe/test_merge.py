"""Merging against radiance that is known."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lighting.errors import ProbeError
from lighting.photo.linear import LinearPhoto
from lighting.probe.exposures import Bracket, bracket_of
from lighting.probe.merge import merge

TIMES = np.array([0.001, 0.01, 0.1, 1.0])


def bracket(radiance: NDArray[np.floating[Any]], electrons: float = 1e12, full: int = 2**14 - 1) -> Bracket:
    """Exposures with the noise of light, so many electrons at full scale."""
    rng = np.random.default_rng(2)
    photos = []
    for time in TIMES:
        value = rng.normal(radiance * time, np.sqrt(radiance * time / electrons))
        counts = np.clip(np.rint(value * full), 0, full)
        photos.append(LinearPhoto((counts / full).astype(np.float32), 0.98, 1 / full, time))
    return bracket_of(photos)


def test_radiance_over_six_decades_comes_back() -> None:
    radiance = np.repeat(np.geomspace(1e-3, 900, 400).reshape(20, 20, 1), 3, axis=-1)
    merged = merge(bracket(radiance), TIMES)
    assert merged.radiance == pytest.approx(radiance, rel=0.03)  # rounding at the darkest end
    assert merged.radiance[10:] == pytest.approx(radiance[10:], rel=0.005)
    assert not merged.clipped.any()


def test_what_is_clipped_in_every_exposure_stays_the_brightest_and_is_marked() -> None:
    radiance = np.full((9, 9, 3), 100.0)
    radiance[4, 3], radiance[4, 4] = 900.0, 10_000.0  # the weights of cv2.MergeDebevec put this one below its neighbour
    merged = merge(bracket(radiance), TIMES)
    assert merged.clipped.sum() == 1
    assert merged.clipped[4, 4]
    assert merged.radiance[4, 4].min() >= 0.98 / TIMES[0]
    assert merged.radiance[4, 3] == pytest.approx(900, rel=0.01)


def test_a_channel_alone_may_clip() -> None:
    radiance = np.full((9, 9, 3), 0.5)
    radiance[4, 4] = (0.5, 0.5, 5000.0)
    merged = merge(bracket(radiance), TIMES)
    assert merged.clipped[4, 4]
    # The other channels of such a pixel count in the shortest exposure alone, for demosaicing shares their errors.
    assert merged.radiance[4, 4, 0] == pytest.approx(0.5, rel=0.05)


def test_noise_is_less_than_in_the_best_exposure_alone() -> None:
    radiance = np.full((100, 100, 3), 0.3)
    photos = bracket(radiance, electrons=20_000)
    assert merge(photos, TIMES).radiance.std() < 0.97 * photos.photos[-1].pixels.std()
    assert merge(photos, TIMES).radiance.mean() == pytest.approx(0.3, rel=0.002)


def test_nothing_to_measure_is_said() -> None:
    with pytest.raises(ProbeError, match="clipped in the shortest"):
        merge(bracket(np.full((9, 9, 3), 1e5)), TIMES)
    with pytest.raises(ProbeError, match="black"):
        merge(bracket(np.zeros((9, 9, 3))), TIMES)

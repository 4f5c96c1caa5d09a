"""Cameras that stood still and cameras that did not."""

import numpy as np
import pytest
from numpy.typing import NDArray

from lighting.errors import PhotoError
from lighting.stereo.normals.still import check_still

NAMES = ["a", "b"]


def scene() -> NDArray[np.float32]:
    return np.asarray(np.kron(np.random.default_rng(0).uniform(0.1, 0.7, (12, 16)), np.ones((8, 8))), dtype=np.float32)


def test_other_light_from_the_same_place_passes() -> None:
    ramp = np.linspace(0.3, 1.0, 128, dtype=np.float32)
    check_still(np.stack([scene() * ramp, scene() * ramp[::-1]]), NAMES)


@pytest.mark.parametrize("shift", [(0, 4), (3, 0), (-4, 5)])
def test_a_camera_that_moved_is_named(shift: tuple[int, int]) -> None:
    with pytest.raises(PhotoError, match="b is shifted by"):
        check_still(np.stack([scene(), np.roll(scene(), shift, axis=(0, 1))]), NAMES)


def test_pictures_without_edges_say_nothing() -> None:
    check_still(np.ones((2, 64, 64), np.float32), NAMES)

"""Whether the light of a day changed in more than its strength."""

import numpy as np
import pytest

from lighting.stereo.mean_light import Skies
from lighting.stereo.normals.frame import Pose
from lighting.stereo.normals.varied import is_varied
from lighting.stereo.skies import TURBIDITY, clear_skies, overcast_skies, suns_at
from tests.lighting.stereo.sphere import JUNE, LATITUDE, ball, photos


def clear(times: np.ndarray = JUNE) -> Skies:
    return clear_skies(suns_at(times, LATITUDE, 0.0), TURBIDITY, 0.3, 32)


@pytest.mark.parametrize("noise", [0.001, 0.01])
def test_a_clear_day_is_varied_and_an_overcast_one_is_not(noise: float) -> None:
    normals, mask, _ = ball()
    assert is_varied(photos(normals, mask, clear(), Pose(), noise), mask)
    assert not is_varied(photos(normals, mask, overcast_skies(clear()), Pose(), noise), mask)


def test_two_hours_of_a_clear_day_are_varied() -> None:
    normals, mask, _ = ball()
    times = JUNE[1] + np.arange(8) * np.timedelta64(17, "m")
    assert is_varied(photos(normals, mask, clear(times), Pose()), mask)


def test_what_is_flat_is_not_varied_under_any_light() -> None:
    normals = np.broadcast_to(np.array([0.0, 0.6, 0.8], dtype=np.float32), (20, 20, 3))
    mask = np.ones((20, 20), dtype=bool)
    assert not is_varied(photos(normals, mask, clear(), Pose()), mask)
    assert not is_varied(np.zeros((3, 20, 20, 1), dtype=np.float32), mask)
    assert not is_varied(np.ones((3, 20, 20, 1), dtype=np.float32), ~mask)

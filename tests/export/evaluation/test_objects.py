"""Objects under lights whose pictures are known."""

import numpy as np
import pytest

from export.evaluation.objects import BALLS, OBJECTS, _normals, differences, matrix, pictures
from export.evaluation.sphere import HEIGHT

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("kind", BALLS)
def test_white_light_makes_white_balls(kind: str) -> None:
    white = np.ones((1, HEIGHT, 2 * HEIGHT, 3), np.float32)
    assert pictures(kind, white) == pytest.approx(1.0, rel=0.02)


def test_each_object_sees_what_lies_where_it_looks() -> None:
    behind = np.zeros((1, HEIGHT, 2 * HEIGHT, 3), np.float32)
    behind[:, :, : HEIGHT // 2] = behind[:, :, -HEIGHT // 2 :] = 1  # behind the camera, which the balls' middles face
    for kind in BALLS:
        seen = pictures(kind, behind)[0, :, 0]
        assert seen[np.argmax(_normals()[:, 2])] > 0.9
    assert matrix("plane").shape[0] > 200
    assert len(OBJECTS) == 4


def test_differences_that_are_known() -> None:
    truth = np.random.default_rng(0).uniform(0.5, 1.0, (2, 50, 3))
    same, double = differences(truth, truth), differences(truth, 2 * truth)
    assert same == pytest.approx(np.zeros((2, 3)), abs=1e-3)
    assert double[:, 1:] == pytest.approx(np.zeros((2, 2)), abs=1e-3)
    assert double[:, 0] == pytest.approx(1.0, abs=0.05)

"""The camera's scores as calibration papers define them."""

from dataclasses import replace

import numpy as np
import pytest

from export.evaluation.camera_scores import camera_scores, horizon_ends, recall_area
from lighting.geometry import Pinhole, camera_directions
from tests.export.evaluation.examples import said, truth


def test_the_area_under_the_recall_of_errors() -> None:
    assert recall_area(np.zeros(3), 5.0) == pytest.approx(100.0)
    assert recall_area(np.array([2.5, 7.0]), 5.0) == pytest.approx(25.0)


@pytest.mark.parametrize(("elevation", "roll"), [(0.0, 0.0), (12.0, 0.0), (-8.0, 15.0)])
def test_the_horizon_is_where_the_camera_sees_elevation_zero(elevation: float, roll: float) -> None:
    width, height = 400, 300
    rays = camera_directions(Pinhole(width, height, 60.0, 0.0, elevation, roll))
    ends = horizon_ends(np.array([[elevation, roll, 60.0]]), np.array([width / height]))[0]
    for column, end in ((0, ends[0]), (width - 1, ends[1])):
        row = int(np.argmin(np.abs(rays[:, column, 1])))
        if 0 < row < height - 1:
            assert 0.5 - (row + 0.5) / height == pytest.approx(end, abs=0.01)


def test_a_perfect_camera_scores_full_marks() -> None:
    known = truth([0.0, 10.0], [20.0, 30.0])
    known = replace(known, camera=np.array([[5.0, 0.0, 50.0], [-5.0, 2.0, 60.0]]))
    scores = camera_scores(known, replace(said([0.0, 10.0], [20.0, 30.0]), camera=known.camera))
    assert scores["elevation AUC 1°"] == pytest.approx(100.0)
    assert scores["horizon AUC"] == pytest.approx(100.0)
    assert scores["horizon off %"] == pytest.approx(0.0)

"""Tests of relighting."""

import math

import numpy as np
import pytest

from export.data.labels import Label
from export.evaluation.hdr_truth import HEIGHT
from export.evaluation.relighting import (
    BALLS,
    OBJECTS,
    _constant_skies,
    _errors,
    _matrix,
    _mean_sky,
    _normals,
    _relight_report,
    object_errors,
    render_object,
)
from lighting.geometry import angles, latlong_directions


@pytest.mark.slow
@pytest.mark.parametrize("kind", BALLS)
def test_white_light_makes_white_balls(kind: str) -> None:
    white = np.ones((1, HEIGHT, 2 * HEIGHT, 3), np.float32)
    assert render_object(kind, white) == pytest.approx(1.0, rel=0.02)


@pytest.mark.slow
def test_each_object_sees_what_lies_where_it_looks() -> None:
    behind = np.zeros((1, HEIGHT, 2 * HEIGHT, 3), np.float32)
    behind[:, :, : HEIGHT // 2] = behind[:, :, -HEIGHT // 2 :] = 1  # behind the camera, which the balls' middles face
    for kind in BALLS:
        seen = render_object(kind, behind)[0, :, 0]
        assert seen[np.argmax(_normals()[:, 2])] > 0.9
    assert _matrix("plane").shape[0] > 200
    assert len(OBJECTS) == 4


@pytest.mark.slow
def test_differences_that_are_known() -> None:
    truth = np.random.default_rng(0).uniform(0.5, 1.0, (2, 50, 3))
    same, double = object_errors(truth, truth), object_errors(truth, 2 * truth)
    assert same == pytest.approx(np.zeros((2, 3)), abs=1e-3)
    assert double[:, 1:] == pytest.approx(np.zeros((2, 2)), abs=1e-3)
    assert double[:, 0] == pytest.approx(1.0, abs=0.05)


@pytest.mark.slow
def test_scores_of_pictures_that_are_known() -> None:
    truth = np.random.default_rng(0).uniform(0.1, 1, (8, 8, 3))
    assert _errors(truth, truth) == pytest.approx((0, 0, 0), abs=1e-4)
    rmse, invariant, angle = _errors(truth, 2 * truth)
    assert rmse == pytest.approx(math.sqrt(np.mean(truth**2)))
    assert (invariant, angle) == pytest.approx((0, 0), abs=1e-4)
    red, green = np.zeros((2, 2, 3)), np.zeros((2, 2, 3))
    red[..., 0], green[..., 1] = 1, 1
    assert _errors(red, green)[2] == pytest.approx(90)


def label(elevation: float, direct: str = "yes") -> Label:
    return Label("p", 70.0, elevation, 2.0, "given", 70.0, elevation, 3.0, 0.5, 0.1, True, direct)


@pytest.mark.slow
def test_the_mean_sky_knows_no_azimuth_and_the_constants_look_ahead() -> None:
    mean = _mean_sky([label(20.0), label(60.0, "no")])
    assert np.ptp(mean, axis=1).max() == 0
    lit, shaded = _constant_skies([label(20.0)])[:2]
    row, column = np.unravel_index(np.argmax(lit[..., 1]), lit.shape[:2])
    azimuth, elevation = angles(latlong_directions(HEIGHT)[row, column])
    assert abs(azimuth) < 4
    assert elevation == pytest.approx(15, abs=3)
    assert lit.max() > 50 * shaded.max()


@pytest.mark.slow
def test_the_table_sets_ours_beside_each() -> None:
    names = np.repeat([f"p{i}" for i in range(6)], 4)
    ours = np.random.default_rng(1).uniform(0.1, 0.2, (24, 3))
    text = _relight_report({"outdoor": ours, "constant": ours + 1}, names)
    assert "24 crops of 6 HDR panoramas" in text
    assert "-1.0" in text.splitlines()[-1]

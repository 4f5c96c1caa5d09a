"""Relighting scores of pictures that are known."""

import math

import numpy as np
import pytest

from export.data.labels import Label
from export.evaluation.relight import constant_skies, errors, mean_sky, relight_report
from export.evaluation.sphere import HEIGHT
from lighting.geometry import angles, latlong_directions

pytestmark = pytest.mark.slow


def test_scores_of_pictures_that_are_known() -> None:
    truth = np.random.default_rng(0).uniform(0.1, 1, (8, 8, 3))
    assert errors(truth, truth) == pytest.approx((0, 0, 0), abs=1e-4)
    rmse, invariant, angle = errors(truth, 2 * truth)
    assert rmse == pytest.approx(math.sqrt(np.mean(truth**2)))
    assert (invariant, angle) == pytest.approx((0, 0), abs=1e-4)
    red, green = np.zeros((2, 2, 3)), np.zeros((2, 2, 3))
    red[..., 0], green[..., 1] = 1, 1
    assert errors(red, green)[2] == pytest.approx(90)


def label(elevation: float, direct: str = "yes") -> Label:
    return Label("p", 70.0, elevation, 2.0, "given", 70.0, elevation, 3.0, 0.5, 0.1, True, direct)


def test_the_mean_sky_knows_no_azimuth_and_the_constants_look_ahead() -> None:
    mean = mean_sky([label(20.0), label(60.0, "no")])
    assert np.ptp(mean, axis=1).max() == 0
    lit, shaded = constant_skies([label(20.0)])[:2]
    row, column = np.unravel_index(np.argmax(lit[..., 1]), lit.shape[:2])
    azimuth, elevation = angles(latlong_directions(HEIGHT)[row, column])
    assert abs(azimuth) < 4
    assert elevation == pytest.approx(15, abs=3)
    assert lit.max() > 50 * shaded.max()


def test_the_table_sets_ours_beside_each() -> None:
    names = np.repeat([f"p{i}" for i in range(6)], 4)
    ours = np.random.default_rng(1).uniform(0.1, 0.2, (24, 3))
    text = relight_report({"outdoor": ours, "constant": ours + 1}, names)
    assert "24 crops of 6 HDR panoramas" in text
    assert "-1.0" in text.splitlines()[-1]

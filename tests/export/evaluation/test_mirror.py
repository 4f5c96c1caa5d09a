"""Mirror averaging."""

import numpy as np
import pytest

from export.evaluation.mirror import mirror_averaged, mirrored
from lighting.decoding import sun_of
from lighting.geometry import angles, direction
from lighting.records import ModelSpec, Prediction
from lighting.sun_grid import soft_label

GRID = "fibonacci:1024"
SPEC = ModelSpec("test", "0", 32, 32, (0.5,) * 3, (0.5,) * 3, GRID)


def said(azimuth: float, roll: float, turbidity: float) -> Prediction:
    probability = soft_label(direction(azimuth, 40.0), 100.0, GRID).astype(np.float32)
    return Prediction(SPEC, probability, 0.8, turbidity, 2.0, 5.0, roll, 50.0)


def test_a_mirrored_sun_stands_on_the_other_side_and_the_roll_turns() -> None:
    turned = mirrored(said(30.0, 4.0, 3.0))
    sun = sun_of(turned)
    assert (sun.azimuth, sun.elevation) == pytest.approx((-30.0, 40.0), abs=0.7)
    assert turned.camera_roll == -4.0
    assert turned.sun_probability.sum() == pytest.approx(1.0, abs=1e-5)


def test_consistent_answers_average_to_themselves() -> None:
    (mean,) = mirror_averaged([said(30.0, 4.0, 2.0)], [said(-30.0, -4.0, 8.0)])
    sun = sun_of(mean)
    assert (sun.azimuth, sun.elevation) == pytest.approx((30.0, 40.0), abs=0.7)
    assert (mean.camera_roll, mean.turbidity, mean.exposure) == pytest.approx((4.0, 4.0, 2.0))


def test_answers_that_disagree_split_the_probability() -> None:
    (mean,) = mirror_averaged([said(30.0, 0.0, 2.0)], [said(30.0, 0.0, 2.0)])
    azimuth = angles(direction([30.0, -30.0], [40.0, 40.0]))[0]
    at = [float(mean.sun_probability @ (soft_label(direction(a, 40.0), 100.0, GRID) > 1e-4)) for a in azimuth]
    assert at == pytest.approx([0.5, 0.5], abs=0.03)

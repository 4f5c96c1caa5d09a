"""Motion by the essential matrix."""

import numpy as np
import pytest

from lighting.turns.parallax import epipolar_inliers, motion, sampson
from lighting.turns.rays import focal_of, rotation_vector
from lighting.turns.upright import own_axes
from tests.lighting.turns.cameras import SIZE, matches, turn

pytest.importorskip("cv2")
A, B, STEP = (0.0, 2.0, 0.0), (20.0, -1.0, 1.0), (0.8, 0.0, -1.0)
FOCAL = focal_of(50.0, *SIZE)


def test_true_motion_leaves_matches_on_their_lines() -> None:
    towards = own_axes(*B) @ (-np.array(STEP) / np.linalg.norm(STEP))
    exact = matches(A, B, 50.0, step=STEP, noise=0.0)
    assert np.abs(sampson(exact, (FOCAL, FOCAL), turn(A, B), towards, 1.0)).max() < 1e-9


def test_the_turn_and_the_way_are_found() -> None:
    seen = matches(A, B, 50.0, step=STEP)
    found = motion(seen, (FOCAL, FOCAL), [1.0], 1e6)
    assert found is not None
    assert np.degrees(np.linalg.norm(rotation_vector(found.rotation @ turn(A, B).T))) < 0.3
    way = own_axes(*B) @ (-np.array(STEP) / np.linalg.norm(STEP))
    assert abs(found.towards @ way) > np.cos(np.radians(3.0))


def test_wrong_matches_do_not_obey() -> None:
    seen = matches(A, B, 50.0, step=STEP, wrong=0.3)
    assert np.count_nonzero(epipolar_inliers(seen)) == pytest.approx(0.7 * len(seen), rel=0.15)

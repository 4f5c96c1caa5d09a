"""Boxes and meshes."""

import numpy as np

from export.towns.mesh import box, join, moved, turned
from tests.export.towns.examples import ALBEDO, NOTHING, plain


def test_a_box_stands_on_the_ground_and_turns() -> None:
    stood = box(np.array([10.0, -4.0]), np.array([2.0, 3.0, 6.0]), 90.0, np.array(ALBEDO)).corners.reshape(-1, 3)
    np.testing.assert_allclose(stood.min(axis=0), [7, 0, -5], atol=1e-9)
    np.testing.assert_allclose(stood.max(axis=0), [13, 3, -3], atol=1e-9)


def test_meshes_join_turn_and_move() -> None:
    joined = join([plain(), NOTHING])
    assert len(joined.corners) == len(joined.albedo) == 6
    np.testing.assert_allclose(turned(np.array([0.0, 2.0, 1.0]), 90.0), [1, 2, 0], atol=1e-12)
    np.testing.assert_allclose(moved(np.array([1.0, 2.0, 3.0]), np.array([10.0, 20.0])), [11, 2, 23])

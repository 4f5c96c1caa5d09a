"""RANSAC for a rotation and a zoom."""

import numpy as np
import pytest

from lighting.turns.rays import focal_of, rotation_vector
from lighting.turns.search import search
from tests.lighting.turns.cameras import SIZE, matches, turn

A, B = (0.0, 5.0, 2.0), (-28.0, 1.0, -1.0)


@pytest.mark.parametrize("wrong", [0.0, 0.5])
def test_the_rotation_is_found_among_wrong_matches(wrong: float) -> None:
    focal = focal_of(50.0, *SIZE)
    found = search(matches(A, B, 50.0, near=300.0, wrong=wrong), (focal, focal), [0.8, 1.0, 1.25])
    assert found.zoom == 1.0
    assert np.degrees(np.linalg.norm(rotation_vector(found.rotation @ turn(A, B).T))) < 1.0


def test_the_same_matches_give_the_same_answer() -> None:
    seen = matches(A, B, 50.0, near=300.0, wrong=0.5)
    first, second = (search(seen, (1.2, 1.2), [0.9, 1.0, 1.1]) for _ in range(2))
    assert (first.rotation == second.rotation).all()

"""Rotation averaging over graphs of turns."""

import numpy as np
import pytest

from lighting.turns import Turn
from lighting.turns.averaging import average, components
from lighting.turns.rays import rotation_about, rotation_vector
from lighting.turns.upright import own_axes

CAMERAS = [own_axes(azimuth, 3.0, -1.0) for azimuth in (0.0, 25.0, 50.0, 80.0)]


def edge(i: int, j: int, error: tuple[float, float, float] = (0.0, 0.0, 0.0), sigma: float = 0.2) -> Turn:
    """The turn from one camera to another, off by a rotation vector [deg]."""
    rotation = rotation_about(np.radians(error)) @ CAMERAS[j] @ CAMERAS[i].T
    return Turn(rotation, sigma**2 * np.eye(3), (50.0, 50.0), 0.1, 100, 110)


def off(rotations: np.ndarray) -> list[float]:
    """Deg between orientations and the truth, relative to the first."""
    true = [camera @ CAMERAS[0].T for camera in CAMERAS]
    return [float(np.degrees(np.linalg.norm(rotation_vector(r @ t.T)))) for r, t in zip(rotations, true, strict=True)]


def test_photos_fall_into_groups_by_what_connects_them() -> None:
    pairs = {(0, 2): edge(0, 2), (2, 3): edge(2, 3)}
    assert components(5, pairs) == [(0, 2, 3), (1,), (4,)]


def test_a_chain_is_followed_exactly() -> None:
    pairs = {(0, 1): edge(0, 1), (1, 2): edge(1, 2), (2, 3): edge(2, 3)}
    found = average((0, 1, 2, 3), pairs)
    assert max(off(found.rotations)) < 1e-6
    sigma = np.sqrt(found.covariance[:, 1, 1])
    assert sigma == pytest.approx(0.201 * np.sqrt([0, 1, 2, 3]), rel=0.01)  # variances add along a chain


def test_a_loop_shares_its_error() -> None:
    pairs = {(0, 1): edge(0, 1, (0.0, 0.3, 0.0)), (1, 2): edge(1, 2), (0, 2): edge(0, 2)}
    found = average((0, 1, 2), pairs)
    assert max(off(np.concatenate([found.rotations, [CAMERAS[3] @ CAMERAS[0].T]]))) == pytest.approx(0.2, abs=0.02)


def test_one_turn_that_contradicts_the_others_is_outvoted() -> None:
    pairs = {(i, j): edge(i, j) for i in range(4) for j in range(i + 1, 4)}
    pairs[0, 1] = edge(0, 1, (0.0, 20.0, 0.0))
    assert max(off(average((0, 1, 2, 3), pairs).rotations)) < 0.6


def test_a_photo_alone_stays_where_it_is() -> None:
    found = average((2,), {})
    assert (found.rotations == np.eye(3)).all()
    assert (found.covariance == 0.0).all()

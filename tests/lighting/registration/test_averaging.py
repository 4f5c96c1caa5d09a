"""Orientations from relative rotations that are exact, off, or contradictory."""

import numpy as np
import pytest

from lighting.registration.averaging import average_rotations, connected_components
from lighting.registration.rotations import camera_from_world, rotation_about, rotation_vector
from lighting.registration.two_view import RelativeRotation

CAMERAS = [camera_from_world(azimuth, 3.0, -1.0) for azimuth in (0.0, 25.0, 50.0, 80.0)]


def edge(i: int, j: int, error: tuple[float, float, float] = (0.0, 0.0, 0.0), std: float = 0.2) -> RelativeRotation:
    """The relative rotation of two cameras, off by a rotation vector [deg]."""
    rotation = rotation_about(np.radians(error)) @ CAMERAS[j] @ CAMERAS[i].T
    return RelativeRotation(rotation, std**2 * np.eye(3), (50.0, 50.0), 0.1, 100, 110)


def errors(rotations: np.ndarray) -> list[float]:
    """Deg between orientations and the truth, relative to the first."""
    true = [camera @ CAMERAS[0].T for camera in CAMERAS]
    return [float(np.degrees(np.linalg.norm(rotation_vector(r @ t.T)))) for r, t in zip(rotations, true, strict=True)]


def test_photos_fall_into_groups_by_what_connects_them() -> None:
    pairs = {(0, 2): edge(0, 2), (2, 3): edge(2, 3)}
    assert connected_components(5, pairs) == [(0, 2, 3), (1,), (4,)]


def test_a_chain_is_followed_exactly() -> None:
    pairs = {(0, 1): edge(0, 1), (1, 2): edge(1, 2), (2, 3): edge(2, 3)}
    oriented = average_rotations((0, 1, 2, 3), pairs)
    assert max(errors(oriented.rotations)) < 1e-6
    std = np.sqrt(oriented.covariance[:, 1, 1])
    assert std == pytest.approx(0.201 * np.sqrt([0, 1, 2, 3]), rel=0.01)  # variances add along a chain


def test_a_loop_shares_its_error() -> None:
    pairs = {(0, 1): edge(0, 1, (0.0, 0.3, 0.0)), (1, 2): edge(1, 2), (0, 2): edge(0, 2)}
    oriented = average_rotations((0, 1, 2), pairs)
    assert max(errors(np.concatenate([oriented.rotations, [CAMERAS[3] @ CAMERAS[0].T]]))) == pytest.approx(
        0.2, abs=0.02
    )


def test_one_turn_that_contradicts_the_others_is_outvoted() -> None:
    pairs = {(i, j): edge(i, j) for i in range(4) for j in range(i + 1, 4)}
    pairs[0, 1] = edge(0, 1, (0.0, 20.0, 0.0))
    assert max(errors(average_rotations((0, 1, 2, 3), pairs).rotations)) < 0.6


def test_a_photo_alone_stays_where_it_is() -> None:
    oriented = average_rotations((2,), {})
    assert (oriented.rotations == np.eye(3)).all()
    assert (oriented.covariance == 0.0).all()


def test_photos_without_a_pair_are_groups_of_one() -> None:
    assert connected_components(3, {}) == [(0,), (1,), (2,)]


def test_the_surer_of_two_ways_counts_for_more() -> None:
    """Across a loop whose one pair is off, orientations keep nearer to the pairs of small standard deviation."""
    pairs = {(0, 1): edge(0, 1), (1, 2): edge(1, 2), (0, 2): edge(0, 2, (0.0, 0.3, 0.0), std=2.0)}
    oriented = average_rotations((0, 1, 2), pairs)
    assert max(errors(np.concatenate([oriented.rotations, [CAMERAS[3] @ CAMERAS[0].T]]))) < 0.01

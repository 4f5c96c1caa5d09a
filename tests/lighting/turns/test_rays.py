"""Rays and small rotations against geometry.py and scipy."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from lighting.geometry import Pinhole, camera_pixel, direction
from lighting.turns.rays import (
    cross_matrix,
    focal_of,
    nearest_rotation,
    project,
    rays,
    rotation_about,
    rotation_vector,
    vertical_fov_of,
)
from lighting.turns.upright import own_axes
from tests.lighting.turns.cameras import SIZE

vectors = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(np.array)


@given(st.floats(5.0, 120.0), st.floats(0.3, 3.0))
def test_field_of_view_and_focal_length_go_both_ways(fov: float, aspect: float) -> None:
    assert vertical_fov_of(focal_of(fov, aspect, 1.0), aspect, 1.0) == pytest.approx(fov)


def test_a_lens_has_one_focal_length_however_the_camera_is_held() -> None:
    across = np.degrees(2 * np.arctan(np.tan(np.radians(51.5 / 2)) * 640 / 480))
    assert focal_of(across, 480, 640) == pytest.approx(focal_of(51.5, 640, 480))


def test_points_are_where_geometry_puts_them() -> None:
    towards = direction(np.array([10.0, 25.0]), np.array([5.0, -8.0]))
    pixel = camera_pixel(towards, Pinhole(*SIZE, 50.0, 12.0, 3.0, 4.0))
    expected = (pixel - 0.5 * np.array(SIZE)) * [1, -1] * 2 / np.hypot(*SIZE)
    assert project(towards @ own_axes(12.0, 3.0, 4.0).T, focal_of(50.0, *SIZE)) == pytest.approx(expected, abs=1e-9)


def test_rays_and_points_go_both_ways() -> None:
    points = np.array([[0.3, -0.2], [0.0, 0.0], [-0.7, 0.5]])
    assert project(rays(points, 1.2), 1.2) == pytest.approx(points)


@given(vectors)
def test_rotations_are_scipys(vector: np.ndarray) -> None:
    found = rotation_about(vector)
    assert found == pytest.approx(Rotation.from_rotvec(vector).as_matrix(), abs=1e-9)
    assert rotation_vector(found) == pytest.approx(Rotation.from_matrix(found).as_rotvec(), abs=1e-6)


def test_half_a_turn_has_a_vector() -> None:
    assert np.linalg.norm(rotation_vector(np.diag([1.0, -1.0, -1.0]))) == pytest.approx(np.pi)


def test_cross_matrices_multiply_as_vectors_do() -> None:
    a, b = np.array([1.0, -2.0, 0.5]), np.array([0.3, 0.1, 2.0])
    assert cross_matrix(a) @ b == pytest.approx(np.cross(a, b))


def test_the_nearest_rotation_of_a_rotation_is_itself_and_never_a_mirror() -> None:
    rotation = rotation_about(np.array([0.2, -0.4, 0.9]))
    assert nearest_rotation(1.01 * rotation) == pytest.approx(rotation)
    assert np.linalg.det(nearest_rotation(np.diag([1.0, 1.0, -1.0]))) == pytest.approx(1.0)

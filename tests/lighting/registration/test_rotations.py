"""Rays, rotations and a common vertical, against scipy and geometry."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from lighting.geometry import Pinhole, camera_pixel, direction
from lighting.registration.rotation_averaging import average_rotations, connected_components
from lighting.registration.rotations import (
    camera_from_world,
    camera_up,
    consensus_up,
    cross_matrix,
    focal_from_fov,
    fov_from_focal,
    heading_elevation_roll,
    leveling_rotation,
    nearest_rotation,
    project_points,
    rays_through,
    rotation_about,
    rotation_vector,
)
from lighting.registration.two_view import RelativeRotation
from tests.helpers.cameras import SIZE, Camera

vectors = st.tuples(*[st.floats(-3.0, 3.0)] * 3).map(np.array)


@given(st.floats(5.0, 120.0), st.floats(0.3, 3.0))
def test_field_of_view_and_focal_length_go_both_ways(fov: float, aspect: float) -> None:
    assert fov_from_focal(focal_from_fov(fov, aspect, 1.0), aspect, 1.0) == pytest.approx(fov)


def test_a_lens_has_one_focal_length_however_the_camera_is_held() -> None:
    across = np.degrees(2 * np.arctan(np.tan(np.radians(51.5 / 2)) * 640 / 480))
    assert focal_from_fov(across, 480, 640) == pytest.approx(focal_from_fov(51.5, 640, 480))


def test_points_are_where_geometry_puts_them() -> None:
    directions = direction(np.array([10.0, 25.0]), np.array([5.0, -8.0]))
    pixel = camera_pixel(directions, Pinhole(*SIZE, 50.0, 12.0, 3.0, 4.0))
    expected = (pixel - 0.5 * np.array(SIZE)) * [1, -1] * 2 / np.hypot(*SIZE)
    assert project_points(
        directions @ camera_from_world(12.0, 3.0, 4.0).T, focal_from_fov(50.0, *SIZE)
    ) == pytest.approx(expected, abs=1e-9)


def test_rays_and_points_go_both_ways() -> None:
    points = np.array([[0.3, -0.2], [0.0, 0.0], [-0.7, 0.5]])
    assert project_points(rays_through(points, 1.2), 1.2) == pytest.approx(points)


@given(vectors)
def test_rotations_are_scipys(vector: np.ndarray) -> None:
    rotation = rotation_about(vector)
    assert rotation == pytest.approx(Rotation.from_rotvec(vector).as_matrix(), abs=1e-9)
    assert rotation_vector(rotation) == pytest.approx(Rotation.from_matrix(rotation).as_rotvec(), abs=1e-6)


def test_half_a_turn_has_a_vector() -> None:
    assert np.linalg.norm(rotation_vector(np.diag([1.0, -1.0, -1.0]))) == pytest.approx(np.pi)


def test_cross_matrices_multiply_as_vectors_do() -> None:
    a, b = np.array([1.0, -2.0, 0.5]), np.array([0.3, 0.1, 2.0])
    assert cross_matrix(a) @ b == pytest.approx(np.cross(a, b))


def test_the_nearest_rotation_of_a_rotation_is_itself_and_never_a_mirror() -> None:
    rotation = rotation_about(np.array([0.2, -0.4, 0.9]))
    assert nearest_rotation(1.01 * rotation) == pytest.approx(rotation)
    assert np.linalg.det(nearest_rotation(np.diag([1.0, 1.0, -1.0]))) == pytest.approx(1.0)


CAMERAS: list[Camera] = [(-170.0, 2.0, 0.0), (-140.0, -3.0, 1.5), (165.0, 4.0, -2.0)]
TURNED = np.array([camera_from_world(*c) @ camera_from_world(*CAMERAS[0]).T for c in CAMERAS])


def test_the_vertical_outvotes_one_wrong_camera() -> None:
    ups = [camera_up(*tilt) for tilt in ((2.0, 0.0), (-3.0, 1.5), (30.0, 20.0))]
    up = consensus_up(TURNED, np.stack(ups))
    assert np.degrees(np.arccos(up @ camera_from_world(*CAMERAS[0])[:, 1])) < 1.0


def test_a_surer_camera_outvotes_two_that_agree() -> None:
    true = camera_from_world(*CAMERAS[0])[:, 1]
    ups = np.stack([camera_up(*tilt) for tilt in ((2.0, 0.0), (4.0, 1.5), (11.0, -2.0))])  # the first is right
    assert np.degrees(np.arccos(consensus_up(TURNED, ups) @ true)) > 2.0
    assert np.degrees(np.arccos(consensus_up(TURNED, ups, np.array([6.0, 1.0, 1.0])) @ true)) < 0.5


def test_a_few_wrong_levels_do_not_tilt_the_rest() -> None:
    elevation, roll = np.linspace(-20, 30, 60), np.linspace(-5, 8, 60)
    axes = np.stack([camera_from_world(4.0 * i, e, r) for i, (e, r) in enumerate(zip(elevation, roll, strict=True))])
    ups = np.stack([camera_up(e, r) for e, r in zip(elevation, roll, strict=True)])
    wrong = ups.copy()
    wrong[:8] = camera_up(60.0, 40.0)
    orientations = axes @ axes[0].T
    assert np.degrees(np.arccos(consensus_up(orientations, ups) @ consensus_up(orientations, wrong))) < 0.5


def test_a_camera_that_looks_straight_down_has_a_heading() -> None:
    axes = leveling_rotation(camera_up(-90.0, 0.0))
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(axes) > 0.99


@pytest.mark.parametrize("elevation", [-90.0, -89.5, -88.0, -87.0, 0.0, 87.0, 88.0, 89.5, 90.0])
def test_azimuth_0_is_where_the_common_camera_points_however_steep_it_is(elevation: float) -> None:
    heading, leveled_elevation, roll = heading_elevation_roll(
        np.eye(3)[None], leveling_rotation(camera_up(elevation, 0.0))
    )
    assert leveled_elevation[0] == pytest.approx(elevation, abs=1e-4)
    assert (heading[0], roll[0]) == pytest.approx((0.0, 0.0), abs=1e-6)


@pytest.mark.parametrize("straight", [-90.0, 90.0])
def test_a_camera_that_looks_straight_down_turns_with_its_picture(straight: float) -> None:
    """Its axis trembles about the vertical; its picture turns steadily."""
    headings, tremble = np.linspace(0.0, 60.0, 31), np.radians(2.0) * np.random.default_rng(0).normal(0, 1, (31, 2))
    tilt = [np.array([[1, 0, -x], [0, 1, -y], [x, y, 1]]) for x, y in tremble]
    axes = np.stack([t @ camera_from_world(a, straight, 0.0) for t, a in zip(tilt, headings.tolist(), strict=True)])
    heading, elevation, roll = heading_elevation_roll(axes / np.linalg.norm(axes, axis=2, keepdims=True), np.eye(3))
    np.testing.assert_allclose(heading, headings, atol=0.3)
    np.testing.assert_allclose(roll, 0.0, atol=0.3)
    assert np.abs(elevation).min() > 84.0


AVERAGED_CAMERAS = [camera_from_world(azimuth, 3.0, -1.0) for azimuth in (0.0, 25.0, 50.0, 80.0)]


def edge(i: int, j: int, error: tuple[float, float, float] = (0.0, 0.0, 0.0), std: float = 0.2) -> RelativeRotation:
    """The relative rotation of two cameras, off by a rotation vector [deg]."""
    rotation = rotation_about(np.radians(error)) @ AVERAGED_CAMERAS[j] @ AVERAGED_CAMERAS[i].T
    return RelativeRotation(rotation, std**2 * np.eye(3), (50.0, 50.0), 0.1, 100, 110)


def errors(rotations: np.ndarray) -> list[float]:
    """Deg between orientations and the truth, relative to the first."""
    true = [camera @ AVERAGED_CAMERAS[0].T for camera in AVERAGED_CAMERAS]
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
    assert max(
        errors(np.concatenate([oriented.rotations, [AVERAGED_CAMERAS[3] @ AVERAGED_CAMERAS[0].T]]))
    ) == pytest.approx(0.2, abs=0.02)


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
    assert max(errors(np.concatenate([oriented.rotations, [AVERAGED_CAMERAS[3] @ AVERAGED_CAMERAS[0].T]]))) < 0.01

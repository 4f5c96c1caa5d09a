"""Directions in the frame of a camera and in the world's."""

import numpy as np

from lighting.stereo.pose import Pose, _axes, camera_to_world, sample_visible_normals, world_to_camera


def test_a_camera_that_looks_north_has_south_towards_it() -> None:
    np.testing.assert_allclose(_axes(Pose()), np.eye(3), atol=1e-12)
    np.testing.assert_allclose(camera_to_world([0, 0, 1], Pose(heading=90)), [-1, 0, 0], atol=1e-12)
    vectors = sample_visible_normals(50)
    np.testing.assert_allclose(
        world_to_camera(camera_to_world(vectors, Pose(30, 20, 10)), Pose(30, 20, 10)), vectors, atol=1e-6
    )


def test_visible_normals_are_unit_vectors_spread_evenly() -> None:
    normals = sample_visible_normals(3000)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, rtol=1e-6)
    np.testing.assert_allclose(normals.mean(axis=0), [0, 0, 0.5], atol=2e-3)  # the centroid of half a sphere

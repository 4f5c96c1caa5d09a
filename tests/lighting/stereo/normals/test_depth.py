"""Depth from normals against shapes known in closed form."""

import numpy as np

from lighting.stereo.normals.depth import depth_error, integrate
from tests.lighting.stereo.sphere import ball


def test_a_ball_comes_back_round() -> None:
    normals, mask, height = ball(96)
    found = integrate(normals, mask)
    assert np.isnan(found[~mask]).all()
    assert depth_error(found, height, mask) < 0.25  # pixels; its radius is 46


def test_pieces_that_do_not_touch_are_solved_apart() -> None:
    normals, mask, height = ball(40)
    both = np.concatenate([normals, normals], axis=1), np.concatenate([mask, mask], axis=1)
    found = integrate(*both)
    assert depth_error(found[:, :40], height, mask) < 0.4
    assert depth_error(found[:, 40:], height, mask) < 0.4


def test_a_slanted_plane_seen_in_perspective() -> None:
    normal = np.array([0.3, -0.2, 0.933])
    normal /= np.linalg.norm(normal)
    focal, side = 60.0, 41
    right, down = np.meshgrid(np.arange(side) - 20.0, np.arange(side) - 20.0)
    rays = np.stack([right, -down, np.full_like(right, -focal)], axis=-1) / focal
    distance = -5.0 / (rays @ normal)  # of the plane <n, p> = -5
    found = integrate(np.broadcast_to(normal, (side, side, 3)).astype(np.float32), np.ones((side, side), bool), focal)
    np.testing.assert_allclose(found / found.mean(), distance / distance.mean(), rtol=2e-3)

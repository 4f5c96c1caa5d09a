"""Tests of surfaces."""

from pathlib import Path

import numpy as np

from export.stereo.surfaces import _of_height, project_mesh, random_relief, random_rotation, read_mesh, rotate_surface
from tests.helpers.panoramas import OCTAHEDRON


def test_reliefs_have_unit_normals_where_their_mask_is() -> None:
    rng = np.random.default_rng(0)
    for _ in range(12):
        surface = random_relief(64, rng)
        length = np.linalg.norm(surface.normals, axis=-1)
        np.testing.assert_allclose(length[surface.mask], 1, rtol=1e-5)
        assert not length[~surface.mask].any()
        assert surface.mask.any()


def test_a_mesh_is_seen_from_in_front(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(OCTAHEDRON)
    mesh = read_mesh(tmp_path / "a.obj")
    assert mesh[0].shape == (6, 3)
    assert mesh[1].shape == (8, 3)
    seen = project_mesh(mesh, np.eye(3), 64, np.random.default_rng(0))
    assert abs(seen.mask.mean() - 0.94**2 / 2) < 0.03  # a square on its corner
    assert (seen.normals[seen.mask][:, 2] > 0).all()
    row, column = np.unravel_index(int(np.nanargmax(seen.height)), seen.height.shape)
    assert abs(row - 32) <= 2
    assert abs(column - 32) <= 2


def test_turns_are_rotations_and_turned_surfaces_keep_normals_and_slopes_together() -> None:
    turn = random_rotation(np.random.default_rng(0))
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(turn) > 0
    y, x = np.mgrid[:24, :24].astype(np.float32)
    surface = _of_height(0.3 * x + 0.02 * y * y, np.ones((24, 24), bool))
    for quarters in range(4):
        for mirrored in (False, True):
            found = rotate_surface(surface, quarters, mirrored=mirrored)
            again = _of_height(found.height, found.mask)
            np.testing.assert_allclose(found.normals[2:-2, 2:-2], again.normals[2:-2, 2:-2], atol=1e-5)

"""Triangles that look outwards."""

import numpy as np
import pytest

from lighting.scene import meshes

SHAPES = {
    "ball": (meshes.ball(0.3), 4 * np.pi * 0.3**2),
    "stick": (meshes.stick(0.1, 2.0), 2 * np.pi * 0.1 * 2.0 + 2 * np.pi * 0.1**2),
    "disc": (meshes.disc(5.0), np.pi * 5.0**2),
    "picture": (meshes.picture(4.0, 3.0), 12.0),
}


@pytest.mark.parametrize("name", SHAPES)
def test_triangles_face_along_their_normals_and_cover_the_surface(name: str) -> None:
    mesh, area = SHAPES[name]
    a, b, c = (mesh.positions[mesh.triangles[:, corner]] for corner in range(3))
    facing = np.cross(b - a, c - a)
    normals = mesh.normals[mesh.triangles].mean(axis=1)
    assert np.all(np.einsum("ij,ij->i", facing, normals) > 0)
    assert np.linalg.norm(mesh.normals, axis=1) == pytest.approx(1, abs=1e-6)
    assert np.linalg.norm(facing, axis=1).sum() / 2 == pytest.approx(area, rel=0.01)


def test_where_they_stand() -> None:
    assert meshes.ball(0.3).positions[:, 1].min() == pytest.approx(-0.3)
    stick = meshes.stick(0.1, 2.0).positions[:, 1]
    assert (stick.min(), stick.max()) == pytest.approx((0.0, 2.0))
    assert np.all(meshes.disc(5.0).positions[:, 1] == 0)


def test_the_pictures_upper_left_corner() -> None:
    picture = meshes.picture(4.0, 3.0)
    assert picture.coordinates is not None
    corner = picture.positions[np.all(picture.coordinates == 0, axis=1)]
    assert corner == pytest.approx(np.array([[-2.0, 1.5, 0.0]]))

"""Tests of renders."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from export.stereo.renders import Material, cast_shadows, read_subjects, shade_surface
from export.stereo.surfaces import (
    project_mesh,
    random_relief,
    random_rotation,
    read_mesh,
    rotate_surface,
    surface_from_height,
)
from lighting.stereo.light_vectors import Skies
from lighting.stereo.normal_search import Pose
from tests.helpers.panoramas import OCTAHEDRON


def scanned(folder: Path) -> None:
    """A plane 500 mm away that faces the camera, through a lens of 1000 pixels."""
    folder.mkdir(parents=True)
    Image.fromarray(np.full((40, 50, 3), (128, 128, 255), np.uint8)).save(folder / "normal_map.png")
    mask = np.zeros((40, 50), np.uint8)
    mask[10:30, 10:40] = 255
    Image.fromarray(mask).save(folder / "mask.png")
    np.savez(folder / "depth_gt.npz", depth_gt=np.full((40, 50), 500.0))
    np.savetxt(folder / "K.txt", np.diag([1000.0, 1000.0, 1.0]))


def test_scanned_objects_are_cut_to_their_mask(tmp_path: Path) -> None:
    scanned(tmp_path / "scanned_objects" / "bear")
    (bear,) = read_subjects(tmp_path)
    assert bear.surface.mask.sum() == 600
    assert bear.surface.mask.shape == (36, 46)  # 8 pixels around
    assert bear.scale == pytest.approx(0.5)  # mm a pixel
    np.testing.assert_allclose(bear.surface.normals[bear.surface.mask], [[0, 0, 1]] * 600, atol=0.01)
    np.testing.assert_allclose(bear.surface.height[bear.surface.mask], -1000)
    (thin,) = read_subjects(tmp_path, 2)
    assert thin.surface.mask.sum() == 150
    assert thin.scale == pytest.approx(1.0)
    np.testing.assert_allclose(thin.surface.height[thin.surface.mask], -500)


def test_only_held_out_meshes_are_scored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("export.stereo.renders._VIEW_SIDE", 24)
    (tmp_path / "meshes").mkdir()
    for name in ("spot", "boot"):
        (tmp_path / "meshes" / f"{name}.obj").write_text(OCTAHEDRON)
    assert [subject.name for subject in read_subjects(tmp_path, 4)] == ["spot 1", "spot 2"]


def test_a_folder_without_shapes_gives_none(tmp_path: Path) -> None:
    assert not list(read_subjects(tmp_path))


def test_a_wall_casts_a_shadow_as_long_as_the_sun_is_low() -> None:
    height = np.zeros((40, 80), dtype=np.float32)
    height[:, :10] = 12.0
    surface = surface_from_height(height, np.ones_like(height, dtype=bool))
    sun = np.array([-1.0, 0.0, 0.5])  # from the left, falling one pixel in two
    pixels = np.array([[20, column] for column in range(12, 80)])
    lit = cast_shadows(surface, pixels, (sun / np.linalg.norm(sun))[None])[:, 0]
    edge = 12 + int(np.flatnonzero(lit)[0])
    assert abs(edge - (10 + 24)) <= 3
    assert lit[edge - 12 :].all()


def test_shading_is_lamberts_under_a_single_light() -> None:
    light = np.array([[0.6, 0.0, 0.8]])
    skies = Skies(np.zeros((1, 4, 8, 1), np.float32), light, np.full((1, 1), np.pi))
    normals = np.array([[0, 0, 1], [0.6, 0, 0.8], [-0.8, 0, 0.6]], dtype=np.float32)
    matt = Material(np.full(3, 0.5, np.float32))
    np.testing.assert_allclose(shade_surface(normals, skies, Pose(), matt, None)[:, 0, 0], [0.4, 0.5, 0.0], atol=1e-3)
    shadow = shade_surface(normals, skies, Pose(), matt, np.zeros((3, 1), dtype=bool))
    np.testing.assert_allclose(shadow, 0, atol=1e-6)
    glossy = shade_surface(normals, skies, Pose(), Material(matt.albedo, 0.1), None)
    assert (glossy[:2] > shade_surface(normals, skies, Pose(), matt, None)[:2]).all()


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
    surface = surface_from_height(0.3 * x + 0.02 * y * y, np.ones((24, 24), bool))
    for quarters in range(4):
        for mirrored in (False, True):
            found = rotate_surface(surface, quarters, mirrored=mirrored)
            again = surface_from_height(found.height, found.mask)
            np.testing.assert_allclose(found.normals[2:-2, 2:-2], again.normals[2:-2, 2:-2], atol=1e-5)


ALBEDO = 0.5


def write_sphere(file: Path, rings: int = 24, sectors: int = 48) -> None:
    polar, around = np.meshgrid(
        np.linspace(0, np.pi, rings + 1), 2 * np.pi * np.arange(sectors) / sectors, indexing="ij"
    )
    points = np.stack([np.sin(polar) * np.cos(around), np.cos(polar), np.sin(polar) * np.sin(around)], axis=-1)
    lines = ["v " + " ".join(f"{value:.6f}" for value in point) for point in points.reshape(-1, 3)]
    for ring in range(rings):
        for sector in range(sectors):
            corners = ring * sectors + sector, ring * sectors + (sector + 1) % sectors
            lines.append("f " + " ".join(str(c + 1) for c in (*corners, corners[1] + sectors, corners[0] + sectors)))
    file.write_text("\n".join(lines))

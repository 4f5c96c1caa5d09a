"""Shapes that normals are scored on, read from a folder."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from export.stereo.objects import subjects
from tests.export.stereo.test_surfaces import OCTAHEDRON


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
    (bear,) = subjects(tmp_path)
    assert bear.surface.mask.sum() == 600
    assert bear.surface.mask.shape == (36, 46)  # 8 pixels around
    assert bear.scale == pytest.approx(0.5)  # mm a pixel
    np.testing.assert_allclose(bear.surface.normals[bear.surface.mask], [[0, 0, 1]] * 600, atol=0.01)
    np.testing.assert_allclose(bear.surface.height[bear.surface.mask], -1000)
    (thin,) = subjects(tmp_path, 2)
    assert thin.surface.mask.sum() == 150
    assert thin.scale == pytest.approx(1.0)
    np.testing.assert_allclose(thin.surface.height[thin.surface.mask], -500)


def test_only_held_out_meshes_are_scored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("export.stereo.objects._VIEW", 24)
    (tmp_path / "meshes").mkdir()
    for name in ("spot", "boot"):
        (tmp_path / "meshes" / f"{name}.obj").write_text(OCTAHEDRON)
    assert [subject.name for subject in subjects(tmp_path, 4)] == ["spot 1", "spot 2"]


def test_a_folder_without_shapes_gives_none(tmp_path: Path) -> None:
    assert not list(subjects(tmp_path))

"""Pictures, meshes and records of a solved day."""

from pathlib import Path

import numpy as np
from PIL import Image

from lighting.files.exr import read_exr
from lighting.stereo.normals.files import write_mesh, write_picture, write_png16
from lighting.stereo.normals.images import read_shot
from lighting.stereo.normals.solve import NormalMap


def test_a_png_of_16_bits_holds_what_was_written(tmp_path: Path) -> None:
    values = np.random.default_rng(0).integers(0, 65536, (5, 7, 3)).astype(float)
    write_png16(tmp_path / "a.png", values)
    found = read_shot(tmp_path / "a.png", "linear").pixels
    np.testing.assert_allclose(65535 * found, values, atol=0.01)
    with Image.open(tmp_path / "a.png") as picture:
        picture.verify()


def test_numbers_beyond_16_bits_are_cut(tmp_path: Path) -> None:
    write_png16(tmp_path / "a.png", np.array([[[-5.0], [70000.0], [12.4]]]))
    np.testing.assert_allclose(
        65535 * read_shot(tmp_path / "a.png", "linear").pixels[0, :, 0], [0, 65535, 12], atol=0.1
    )


def test_an_exr_holds_every_digit(tmp_path: Path) -> None:
    values = np.random.default_rng(0).normal(size=(4, 6, 3)).astype(np.float32)
    write_picture(tmp_path / "a.exr", values)
    np.testing.assert_array_equal(read_exr(tmp_path / "a.exr")[0], values)


def test_a_mesh_has_two_triangles_for_each_four_neighbours(tmp_path: Path) -> None:
    mask = np.ones((3, 4), dtype=bool)
    mask[0, 0] = False
    up = np.zeros((3, 4, 3), np.float32)
    up[..., 2] = 1
    flat = np.zeros((3, 4), np.float32)
    found = NormalMap(mask, up, np.ones((3, 4, 3), np.float32), flat, flat, np.zeros_like(mask), 0.01)
    write_mesh(tmp_path / "a.ply", np.zeros((3, 4, 3)), found)
    header = (tmp_path / "a.ply").read_bytes().split(b"end_header")[0]
    assert b"element vertex 11\n" in header
    assert b"element face 10\n" in header  # of six squares one touches the missing corner

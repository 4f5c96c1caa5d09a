"""Folders in DiLiGenT's layout, whole and spoiled."""

from pathlib import Path

import numpy as np
import pytest

from lighting.errors import PhotoError
from lighting.stereo.normals.diligent import is_diligent, read_diligent
from lighting.stereo.normals.files import write_png16


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for index in range(3):
        write_png16(tmp_path / f"{index}.png", np.full((4, 5, 3), 20000.0))
    (tmp_path / "filenames.txt").write_text("0.png\n1.png\n2.png\n")
    np.savetxt(tmp_path / "light_directions.txt", np.array([[0.0, 0, 2], [0.6, 0, 0.8], [0, 0.6, 0.8]]))
    np.savetxt(tmp_path / "light_intensities.txt", [[1, 2, 4]] * 3)
    return tmp_path


def test_photos_are_divided_by_their_lights(folder: Path) -> None:
    assert is_diligent(folder)
    lit = read_diligent(folder)
    assert lit.images.shape == (3, 4, 5, 3)
    np.testing.assert_allclose(lit.images[0, 0, 0], 20000 / 65535 / np.array([1, 2, 4]), rtol=1e-4)
    np.testing.assert_allclose(np.linalg.norm(lit.skies.sun_direction, axis=1), 1)
    assert lit.mask.all()
    assert lit.truth is None


@pytest.mark.parametrize(
    ("file", "text", "sentence"),
    [
        ("light_directions.txt", "0 0 1\n", "three numbers for each"),
        ("light_directions.txt", "a b c\n", "numbers alone"),
        ("light_directions.txt", "0 0 1\n0 0 0\n1 0 0\n", "direction is zero"),
        ("filenames.txt", "0.png\n", "must hold three numbers"),
    ],
)
def test_spoiled_files_are_named(folder: Path, file: str, text: str, sentence: str) -> None:
    (folder / file).write_text(text)
    with pytest.raises(PhotoError, match=sentence):
        read_diligent(folder)


@pytest.mark.parametrize(
    ("file", "sentence"),
    [("filenames.txt", "not a text"), ("mask.png", "not a mask"), ("Normal_gt.mat", "not a MATLAB")],
)
def test_files_of_other_bytes_are_named(folder: Path, file: str, sentence: str) -> None:
    (folder / file).write_bytes(b"\xff\xfe\x00junk")
    with pytest.raises(PhotoError, match=rf"{file} is {sentence}"):
        read_diligent(folder)


def test_a_folder_without_lights_is_another_one(tmp_path: Path) -> None:
    assert not is_diligent(tmp_path)

"""The pixels of panoramas."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from export.data.panoramas import Panorama, read_index
from export.data.pictures import decode, read_linear, read_picture
from export.data.tables import DataError
from tests.export.data.examples import ROW, write_index


def test_an_ldr_picture_is_read_and_made_linear(tmp_path: Path) -> None:
    (panorama,) = read_index(write_index(tmp_path, ROW))
    picture = read_picture(panorama)
    assert picture.dtype == np.uint8
    assert picture.shape == (4, 8, 3)
    linear = read_linear(panorama, 2)
    assert linear.dtype == np.float32
    assert linear.shape == (2, 4, 3)
    np.testing.assert_allclose(linear[0, 0], decode(np.array([10, 20, 30], np.uint8)), rtol=1e-6)


@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("kind", [np.float16, np.float32])
def test_an_hdr_picture_is_read_and_cleaned(tmp_path: Path, channels: int, kind: type) -> None:
    import OpenEXR

    pixels: NDArray[np.floating[Any]] = np.full((4, 8, channels), 0.5, kind)
    pixels[0, 0, :3] = (np.inf, np.nan, -1.0)
    file = OpenEXR.File({"type": OpenEXR.scanlineimage}, {"RGBA"[:channels]: pixels})
    file.write(str(tmp_path / "a.exr"))
    panorama = Panorama("a", tmp_path / "a.exr", "hdr", "here", "train")
    read = read_picture(panorama)
    assert read.dtype == np.float32
    assert read.shape == (4, 8, 3)
    assert read[0, 0].tolist() == [65504.0, 0.0, 0.0]
    assert np.all(read[1:] == 0.5)
    assert np.array_equal(read_linear(panorama, 4), read)


@pytest.mark.parametrize(("kind", "message"), [("ldr", "cannot be read"), ("hdr", "cannot be read")])
def test_a_damaged_picture_is_refused(tmp_path: Path, kind: str, message: str) -> None:
    (tmp_path / "a").write_bytes(b"not a picture")
    with pytest.raises(DataError, match=message):
        read_picture(Panorama("a", tmp_path / "a", kind, "here", "train"))


def test_a_picture_of_another_shape_is_refused(tmp_path: Path) -> None:
    Image.new("RGB", (9, 4)).save(tmp_path / "a.png")
    with pytest.raises(DataError, match="9 x 4 pixels"):
        read_picture(Panorama("a", tmp_path / "a.png", "ldr", "here", "train"))

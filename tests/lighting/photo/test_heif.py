"""HEIC and AVIF: which of the two, who turns the picture, and that no plugin of ours stands in Pillow's way."""

import subprocess
import sys
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from lighting.photo.formats import _turns_picture, complete_avif, heif_kind, open_heif
from lighting.photo.reader import read_photo
from tests.conftest import encode, exif, scene

SCENE = scene(160, 120)
ORIENTATION, UNUSED = 0x112, 0x114  # tags
LOSSLESS: dict[str, dict[str, object]] = {
    "HEIF": {"quality": -1},
    "AVIF": {"quality": 100, "subsampling": "4:4:4", "speed": 10, "max_threads": 1},
}
HEIC = encode(SCENE, "HEIF", **LOSSLESS["HEIF"])


def turned_by_exif_alone(kind: str, orientation: int) -> bytes:
    """A file whose EXIF block got its orientation afterwards, as programs change it that edit no more than that."""
    block = exif()
    block[UNUSED] = orientation
    data = encode(SCENE, kind, exif=block.tobytes(), **LOSSLESS[kind])
    place, wanted = (tag.to_bytes(2) + b"\0\3\0\0\0\1" for tag in (UNUSED, ORIENTATION))
    assert data.count(place) == 1
    return data.replace(place, wanted)


@pytest.mark.parametrize("kind", LOSSLESS)
@pytest.mark.parametrize("orientation", [3, 6, 8])
def test_what_exif_alone_turns_is_turned(kind: str, orientation: int) -> None:
    photo = read_photo(turned_by_exif_alone(kind, orientation))
    expected = np.rot90(SCENE, {3: 2, 6: 3, 8: 1}[orientation])
    assert photo.pixels.shape == expected.shape
    assert np.abs(photo.pixels.astype(int) - expected).max() <= 4
    assert (photo.height, photo.width) == expected.shape[:2]


@pytest.mark.parametrize("orientation", [3, 6, 8])
def test_a_heic_that_its_container_turns_is_turned_once(orientation: int) -> None:
    block = exif()
    block[ORIENTATION] = orientation
    data = encode(SCENE, "HEIF", exif=block.tobytes(), **LOSSLESS["HEIF"])
    assert _turns_picture(data)
    assert read_photo(data).pixels.shape == np.rot90(SCENE, {3: 2, 6: 3, 8: 1}[orientation]).shape
    assert open_heif(data).getexif().get(ORIENTATION, 1) == 1


def test_the_colours_of_an_avif_are_known() -> None:
    data = encode(SCENE, "AVIF", max_threads=1)
    image = Image.open(BytesIO(data))
    complete_avif(image, data)
    assert image.info["nclx_profile"]["transfer_characteristics"] == 13


def test_kinds_by_brands() -> None:
    def kind(main: bytes, *others: bytes) -> str | None:
        body = main + bytes(4) + b"".join(others)
        return heif_kind((8 + len(body)).to_bytes(4) + b"ftyp" + body)

    assert kind(b"heic", b"mif1", b"avif") == "HEIF"
    assert kind(b"mif1", b"heix", b"miaf") == kind(b"heix") == kind(b"msf1", b"hevc") == "HEIF"
    assert kind(b"mif1", b"avif") == kind(b"avif") == kind(b"avis", b"msf1") == "AVIF"
    assert kind(b"isom", b"avif") is None
    assert heif_kind(b"") is heif_kind(HEIC[:7]) is None


@pytest.mark.parametrize("cut", range(0, 400, 7))
def test_damaged_boxes_turn_nothing(cut: int) -> None:
    assert not _turns_picture(HEIC[:cut])
    damaged = bytearray(HEIC)
    damaged[cut : cut + 4] = b"\xff\xff\xff\xff"
    _turns_picture(bytes(damaged))


def test_no_plugin_is_registered() -> None:
    """A program that uses pillow-heif itself keeps its own."""
    code = (
        "import sys, io; from PIL import Image; import pillow_heif; pillow_heif.register_heif_opener();"
        "mine = Image.OPEN['HEIF']; from lighting.photo.reader import read_photo;"
        "photo = read_photo(sys.stdin.buffer.read()); print(photo.format, photo.width, Image.OPEN['HEIF'] is mine)"
    )
    done = subprocess.run([sys.executable, "-c", code], input=HEIC, capture_output=True, check=True)
    assert done.stdout.decode().split() == ["HEIF", "160", "True"]

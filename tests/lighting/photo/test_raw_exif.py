"""What RAW files note that Pillow does not open, and that a stereo day sees changed settings in them."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import ExifTags, Image

from lighting.errors import PhotoError
from lighting.photo import linear
from lighting.photo.linear import open_raw_header, read_metadata_and_exposure
from lighting.photo.reader import read_photo
from lighting.stereo.capture import _check_same_exposure, _read_day_photo
from tests.conftest import encode, exif, scene
from tests.helpers.photos import plain_dng, taken

BASE = ExifTags.Base
SCENE = scene(96, 64)


def camera(seconds: float, orientation: int = 1) -> Image.Exif:
    block = exif(
        {BASE.ExposureTime: seconds, BASE.FNumber: 8.0, BASE.ISOSpeedRatings: 200, BASE.FocalLength: 35.0,
         BASE.DateTimeOriginal: "2024:06:01 11:00:00", BASE.OffsetTimeOriginal: "+02:00"}
    )  # fmt: skip
    block[BASE.Orientation] = orientation
    return block


def directory(tags: Image.Exif) -> bytes:
    return tags.tobytes().removeprefix(b"Exif\0\0")


def tiff_like(start: bytes, block: Image.Exif) -> bytes:
    """A directory, and a preview without a block of its own."""
    return start + directory(block)[4:] + encode(SCENE)


def raf(block: Image.Exif) -> bytes:
    photo = encode(SCENE, exif=block.tobytes())
    return b"FUJIFILMCCD-RAW ".ljust(84, b"\0") + struct.pack(">II", 160, len(photo)) + bytes(68) + photo


def box(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I4s", 8 + len(content), kind) + content


def cr3(block: Image.Exif) -> bytes:
    first, second = Image.Exif(), Image.Exif()
    first.update({tag: value for tag, value in block.items() if tag not in (0x8769, 0x8825)})
    second.update(block.get_ifd(ExifTags.IFD.Exif))
    inside = box(b"CMT1", directory(first)) + box(b"CMT2", directory(second))
    return box(b"ftyp", b"crx \0\0\0\1") + box(b"moov", box(b"uuid", bytes(16) + inside)) + box(b"mdat", encode(SCENE))


KINDS: dict[str, Any] = {
    "orf": lambda block: tiff_like(b"MMOR", block),
    "rw2": lambda block: tiff_like(b"IIU\0", little_endian(block)),
    "raf": raf,
    "cr3": cr3,
}


def little_endian(block: Image.Exif) -> Image.Exif:
    block.endian = "<"
    return block


@pytest.mark.parametrize("suffix", KINDS)
def test_time_and_exposure_are_read(suffix: str, tmp_path: Path) -> None:
    (tmp_path / f"a.{suffix}").write_bytes(KINDS[suffix](camera(1 / 125)))
    metadata, exposure = read_metadata_and_exposure(tmp_path / f"a.{suffix}")
    assert exposure == pytest.approx(200 / 100 / 125 / 64)
    assert (metadata.utc_offset, str(metadata.local_time)) == (2.0, "2024-06-01 11:00:00")


def test_a_dng_without_a_preview_tells_time_and_exposure(tmp_path: Path) -> None:
    """Its first picture is the mosaic, which Pillow does not open."""
    (tmp_path / "a.dng").write_bytes(plain_dng(np.full((8, 12), 9000.0), 16383, taken(1 / 125)))
    metadata, exposure = read_metadata_and_exposure(tmp_path / "a.dng")
    assert exposure == pytest.approx(1 / 125)
    assert (metadata.utc_offset, str(metadata.local_time)) == (2.0, "2024-06-01 11:00:00")


@pytest.mark.parametrize("suffix", KINDS)
def test_the_preview_has_the_metadata_of_its_file(suffix: str) -> None:
    photo = read_photo(KINDS[suffix](camera(1 / 125, orientation=6)))
    assert photo.format == "RAW"
    assert photo.metadata.utc_offset == 2.0
    assert (photo.width, photo.height) == (64, 96)


@pytest.mark.parametrize("suffix", KINDS)
def test_a_changed_exposure_is_seen_by_stereo(suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without these cameras' pixels, which no program here writes: the developed ones are the same in all."""
    monkeypatch.setattr(linear, "_develop_raw", lambda *_: (np.full((8, 12, 3), 20_000, np.uint16), 16_383))
    for name, seconds in (("a", 1 / 125), ("b", 1 / 125), ("c", 1 / 60)):
        (tmp_path / f"{name}.{suffix}").write_bytes(KINDS[suffix](camera(seconds)))
    day = [_read_day_photo(tmp_path / f"{name}.{suffix}") for name in "abc"]
    assert day[0].exposure.seconds == pytest.approx(1 / 125)
    _check_same_exposure(day[:2])
    with pytest.raises(PhotoError, match=rf"c\.{suffix} and a\.{suffix} differ in exposure"):
        _check_same_exposure(day)


@pytest.mark.parametrize("suffix", KINDS)
@pytest.mark.parametrize("share", [0.02, 0.1, 0.3, 0.6])
def test_damage_hides_metadata_and_raises_nothing(suffix: str, share: float, tmp_path: Path) -> None:
    data = KINDS[suffix](camera(1 / 125))
    (tmp_path / "a").write_bytes(data[: max(16, int(share * len(data)))])
    read_metadata_and_exposure(tmp_path / "a")
    open_raw_header(data[: max(16, int(share * len(data)))])

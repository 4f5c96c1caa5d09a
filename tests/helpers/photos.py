"""Photos for tests."""

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags, Image
from PIL.PngImagePlugin import PngInfo

from tests.conftest import exif

BASE = ExifTags.Base
BACK = "iPhone 13 Pro back triple camera 5.7mm f/1.5"
FRONT = "iPhone 13 Pro front camera 2.71mm f/2.2"
RDF = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
DJI = "http://www.dji.com/drone-dji/1.0/"
PIX4D = "http://pix4d.com/camera/1.0/"
_XMP_TAG = 700  # of a TIFF


def apple_note(x: float, y: float, z: float, front: int | None = None) -> bytes:
    """Apple's maker note: its own directory, big-endian, with offsets from the note's beginning."""
    numbers = b"".join(struct.pack(">ii", round(value * 10_000), 10_000) for value in (x, y, z))
    return note_of(numbers, front)


def note_of(numbers: bytes, front: int | None = None) -> bytes:
    """The same with the three rationals as bytes."""
    count = 2 if front is None else 3
    place = 16 + 12 * count + 4
    entries = struct.pack(">HHII", 0x0001, 9, 1, 14) + struct.pack(">HHII", 0x0008, 10, 3, place)
    if front is not None:
        entries += struct.pack(">HHII", 0x0045, 9, 1, front)
    return b"Apple iOS\0\0\x01MM" + struct.pack(">H", count) + entries + bytes(4) + numbers


def phone(
    x: float, y: float, z: float, orientation: int | None = None, lens: str = BACK, front: int | None = None
) -> Image.Exif:
    """What an iPhone notes with an acceleration [g]."""
    return with_note(apple_note(x, y, z, front), orientation, lens)


def with_note(note: bytes, orientation: int | None = None, lens: str = BACK) -> Image.Exif:
    """The same with that maker note."""
    block = exif({BASE.MakerNote: note, BASE.LensModel: lens})
    if orientation is not None:
        block[BASE.Orientation] = orientation
    return block


def packet(namespace: str, values: Mapping[str, str], elements: bool = False) -> bytes:
    """An XMP packet with the values as attributes, or as elements."""
    attributes = "" if elements else "".join(f' d:{name}="{value}"' for name, value in values.items())
    inside = "".join(f"<d:{name}>{value}</d:{name}>" for name, value in values.items()) if elements else ""
    return (
        '<?xpacket begin="" id="W5M0MpCehiHzreSzNTczkc9d"?><x:xmpmeta xmlns:x="adobe:ns:meta/">'
        f'<rdf:RDF xmlns:rdf="{RDF}"><rdf:Description rdf:about="" xmlns:d="{namespace}"{attributes}>{inside}'
        '</rdf:Description></rdf:RDF></x:xmpmeta><?xpacket end="w"?>'
    ).encode()


def drone(pitch: str, roll: str = "+0.00", yaw: str = "+45.30", elements: bool = False) -> bytes:
    """What DJI's drones write."""
    names = {"GimbalPitchDegree": pitch, "GimbalRollDegree": roll, "GimbalYawDegree": yaw}
    return packet(DJI, names, elements)


def with_xmp(data: bytes, kind: str) -> dict[str, Any]:
    """The options by which Pillow writes a packet into a file of that kind."""
    if kind == "TIFF":
        return {"tiffinfo": {_XMP_TAG: data}}
    if kind != "PNG":
        return {"xmp": data}
    info = PngInfo()
    info.add_itxt("XML:com.adobe.xmp", data.decode())
    return {"pnginfo": info}


def write_png16(path: Path, pixels: NDArray[np.uint16], camera: dict[int, Any] | None = None) -> Path:
    """A PNG of 16-bit colours (H, W, 3), with those EXIF tags about the camera."""
    height, width, _ = pixels.shape
    rows = pixels.astype(">u2").view(np.uint8).reshape(height, -1)
    plain = np.concatenate([np.zeros((height, 1), np.uint8), rows], axis=1).tobytes()
    block = exif(camera).tobytes().removeprefix(b"Exif\0\0") if camera else b""
    path.write_bytes(png(width, height, plain, *([chunk(b"eXIf", block)] if block else []), depth=16, colour=2))
    return path


def png(width: int, height: int, rows: bytes, *extra: bytes, depth: int = 8, colour: int = 0) -> bytes:
    """A PNG that announces this size and kind, grey if not told, before these rows and further chunks."""
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0))
    body = header + b"".join(extra) + chunk(b"IDAT", zlib.compress(rows, 1))
    return b"\x89PNG\r\n\x1a\n" + body + chunk(b"IEND", b"")


def grey_tiff(width: int, height: int, bits: int, data: bytes, *, white_is_zero: bool = False) -> bytes:
    """A little-endian TIFF of one strip, as Pillow writes none: of any number of bits, its greys in either order."""
    begin = 8 + 2 + 12 * 9 + 4
    tags = ((256, width), (257, height), (258, bits), (259, 1), (262, not white_is_zero), (273, begin), (277, 1))
    entries = b"".join(
        struct.pack("<HHII", tag, 4, 1, value) for tag, value in (*tags, (278, height), (279, len(data)))
    )
    return b"II*\0" + struct.pack("<IH", 8, 9) + entries + bytes(4) + data


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def taken(seconds: float, time: str = "2024:06:01 11:00:00", offset: str = "+02:00") -> dict[int, Any]:
    """EXIF tags of an exposure."""
    base = ExifTags.Base
    return {base.ExposureTime: seconds, base.DateTimeOriginal: time, base.OffsetTimeOriginal: offset}

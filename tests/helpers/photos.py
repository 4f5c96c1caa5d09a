"""Photos for tests."""

import struct
import zlib
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags, Image
from PIL.PngImagePlugin import PngInfo

from tests.conftest import encode, exif, munich, scene

BASE = ExifTags.Base
BACK = "iPhone 13 Pro back triple camera 5.7mm f/1.5"
FRONT = "iPhone 13 Pro front camera 2.71mm f/2.2"
RDF = "http://www.w3.org/1999/02/22-rdf-syntax-ns#"
DJI = "http://www.dji.com/drone-dji/1.0/"
PIX4D = "http://pix4d.com/camera/1.0/"
_XMP_TAG = 700  # of a TIFF
WHOLE_PAGE, THUMBNAIL_PAGE = scene(320, 240), scene(80, 60)
SUBFILE_TAG, SUBDIRECTORY_TAG, PHOTOMETRIC_TAG = 0xFE, 0x14A, 0x106
WIDE_PRIMARIES = ((0.7977, 0.2880, 0.0), (0.1352, 0.7119, 0.0001), (0.0313, 0.0001, 0.8252))
PROFILE_WHITE = (0.9642, 1.0, 0.8249)


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
    """A PNG of 16-bit colors (H, W, 3) or grays (H, W, 1), with those EXIF tags about the camera."""
    height, width, channels = pixels.shape
    rows = pixels.astype(">u2").view(np.uint8).reshape(height, -1)
    plain = np.concatenate([np.zeros((height, 1), np.uint8), rows], axis=1).tobytes()
    block = exif(camera).tobytes().removeprefix(b"Exif\0\0") if camera else b""
    path.write_bytes(
        png(
            width,
            height,
            plain,
            *([chunk(b"eXIf", block)] if block else []),
            depth=16,
            colour=2 if channels == 3 else 0,
        )
    )
    return path


def png(width: int, height: int, rows: bytes, *extra: bytes, depth: int = 8, colour: int = 0) -> bytes:
    """A PNG that announces this size and kind, gray if not told, before these rows and further chunks."""
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0))
    body = header + b"".join(extra) + chunk(b"IDAT", zlib.compress(rows, 1))
    return b"\x89PNG\r\n\x1a\n" + body + chunk(b"IEND", b"")


def grey_tiff(width: int, height: int, bits: int, data: bytes, *, white_is_zero: bool = False) -> bytes:
    """A little-endian TIFF of one strip, as Pillow writes none: of any number of bits, its grays in either order."""
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


def plain_dng(mosaic: NDArray[np.floating[Any]], white: int, camera: dict[int, Any] | None = None) -> bytes:
    """A DNG of one strip in Rec.709, perhaps with EXIF tags: header, directory, what does not fit it, pixels, EXIF."""
    height, width = mosaic.shape
    to_rec709 = (3.2406, -1.5372, -0.4986, -0.9689, 1.8758, 0.0415, 0.0557, -0.2040, 1.0570)  # of XYZ
    matrix = np.array([[round(value * 10000), 10000] for value in to_rec709], "<i4").tobytes()
    byte, text, short, long, ratio, signed = (1, 1), (2, 1), (3, 2), (4, 4), (5, 8), (10, 8)  # numbers of types, sizes
    name = b"Test\0"
    tags = [
        *((256, long, _int(width)), (257, long, _int(height)), (258, short, _int(16, 2)), (259, short, _int(1, 2))),
        *((262, short, _int(32803, 2)), (271, text, name), (272, text, name), (273, long, b"")),
        *((277, short, _int(1, 2)), (278, long, _int(height)), (279, long, _int(2 * height * width))),
        *((33421, short, _int(2, 2) * 2), (33422, byte, bytes([0, 1, 1, 2]))),
        *([(34665, long, b"")] if camera else []),
        (50706, byte, bytes([1, 4, 0, 0])),
        *((50708, text, name), (50714, short, _int(0, 2)), (50717, long, _int(white)), (50721, signed, matrix)),
        *((50728, ratio, (_int(1) * 2) * 3), (50778, short, _int(21, 2))),
    ]
    start = 8 + 2 + 12 * len(tags) + 4
    data_at = start + sum(-(-len(data) // 2) * 2 for _, _, data in tags if len(data) > 4)
    directory, beside = _int(len(tags), 2), b""
    for tag, (kind, size), data in tags:
        value = data or _int(data_at if tag == 273 else data_at + 2 * height * width)
        directory += _int(tag, 2) + _int(kind, 2) + _int(len(value) // size)
        if len(value) > 4:
            directory += _int(start + len(beside))
            beside += value + bytes(len(value) % 2)
        else:
            directory += value.ljust(4, b"\0")
    pixels: bytes = np.rint(mosaic).astype("<u2").tobytes()
    camera_at = data_at + len(pixels)
    return b"II*\0" + _int(8) + directory + bytes(4) + beside + pixels + _camera_directory(camera or {}, camera_at)


def _camera_directory(camera: dict[int, Any], start: int) -> bytes:
    """EXIF tags of a DNG: texts, and numbers as millionths."""
    directory, beside = _int(len(camera), 2), b""
    for tag, value in sorted(camera.items()):
        is_text = isinstance(value, str)
        data = f"{value}\0".encode() if is_text else _int(round(1e6 * value)) + _int(1_000_000)
        at = start + 2 + 12 * len(camera) + 4 + len(beside)
        directory += _int(tag, 2) + _int(2 if is_text else 5, 2) + _int(len(data) if is_text else 1) + _int(at)
        beside += data + bytes(len(data) % 2)
    return directory + bytes(4) + beside if camera else b""


def _int(value: int, size: int = 4) -> bytes:
    return value.to_bytes(size, "little")


def display_profile(
    name: str, primaries: tuple[tuple[float, ...], ...], curve: bytes = bytes(4), cicp: bytes = b""
) -> bytes:
    """A display profile (ICC.1, version 2) of a matrix and a curve, straight unless given; perhaps with a cicp tag."""

    def numbers(values: tuple[float, ...]) -> bytes:
        return b"".join(struct.pack(">i", round(65536 * value)) for value in values)

    described = b"desc" + struct.pack(">II", 0, len(name) + 1) + name.encode() + bytes(79)
    tags = {b"desc": described + bytes(-len(described) % 4), b"wtpt": b"XYZ " + bytes(4) + numbers(PROFILE_WHITE)}
    for channel, primary in zip((b"r", b"g", b"b"), primaries, strict=True):
        tags[channel + b"XYZ"] = b"XYZ " + bytes(4) + numbers(primary)
        tags[channel + b"TRC"] = (b"curv" + bytes(4) + curve).ljust(12 + len(curve), b"\0")
    if cicp:
        tags[b"cicp"] = b"cicp" + bytes(4) + cicp
    table, held, start = struct.pack(">I", len(tags)), b"", 128 + 4 + 12 * len(tags)
    for tag, content in tags.items():
        table += tag + struct.pack(">II", start + len(held), len(content))
        held += content
    kind = struct.pack(">I", 0x02400000) + b"mntrRGB XYZ " + bytes(12) + b"acsp" + bytes(28) + numbers(PROFILE_WHITE)
    head = struct.pack(">I", start + len(held)) + bytes(4) + kind
    return head + bytes(128 - len(head)) + table + held


def tiff(*pages: tuple[NDArray[Any], Mapping[int, Any]], **options: Any) -> bytes:
    """A TIFF of these pages with their tags."""
    pictures = [Image.fromarray(pixels) for pixels, _ in pages]
    for picture, (_, tags) in zip(pictures, pages, strict=True):
        told = {"exif": tags.tobytes()} if isinstance(tags, Image.Exif) else {"tiffinfo": tags}
        picture.encoderinfo = {**told, **options}
    stream = BytesIO()
    pictures[0].save(stream, "TIFF", save_all=True, append_images=pictures[1:])
    return stream.getvalue()


def tiff_with_exif_behind_thumbnail() -> bytes:
    """A TIFF whose whole picture has the EXIF block; of its thumbnail there is the directory alone."""
    block = munich()
    block[ExifTags.Base.Orientation] = 6
    data = encode(WHOLE_PAGE, "TIFF", exif=block.tobytes())
    (place,) = struct.unpack_from("<I", data, 4)
    return data[:4] + struct.pack("<I", len(data)) + data[8:] + directory("<", (SUBFILE_TAG, 4, 1, 1), following=place)


def directory(order: str, *entries: tuple[int, int, int, int], following: int) -> bytes:
    body = b"".join(struct.pack(order + "HHII", *entry) for entry in entries)
    return struct.pack(order + "H", len(entries)) + body + struct.pack(order + "I", following)

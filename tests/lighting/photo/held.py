"""What phones and drones write of how they were held."""

import struct
from collections.abc import Mapping
from typing import Any

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

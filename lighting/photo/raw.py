"""RAW files: which bytes are one, and the JPEG preview that cameras put into it.

A preview is found by its markers, not by the maker's own tables: cameras store it whole and in one piece.
"""

from io import BytesIO

from PIL import Image

from lighting.errors import PhotoError
from lighting.photo.jpeg import frame_size
from lighting.photo.pages import MAKERS, SENSOR, photo_page

KIND = "RAW"
MOST_PICTURES = 64  # beginnings of a JPEG that are looked at

_BEGINNINGS = (  # CR2, Olympus, Panasonic, Fujifilm, Sigma
    b"II*\0\x10\0\0\0CR", b"IIRO", b"IIRS", b"MMOR", b"IIU\0", b"FUJIFILMCCD-RAW", b"FOVb",
)  # fmt: skip
_TIFF = (b"II*\0", b"MM\0*")
_JPEG = b"\xff\xd8\xff"
_HEAD = 1 << 18  # bytes in which a preview's size must stand
_DNG_VERSION, _SUBFILE, _COMPRESSION, _PHOTOMETRIC = 0xC612, 0xFE, 0x103, 0x106


def is_raw(data: bytes) -> bool:
    """Whether the bytes begin as a camera's RAW file; TIFF files that hold a finished picture are none."""
    if data.startswith(_BEGINNINGS) or data[4:12] == b"ftypcrx ":
        return True
    if not data.startswith(_TIFF):
        return False
    try:
        tags = Image.open(BytesIO(data), formats=["TIFF"]).getexif()
    except Exception:  # a TIFF that cannot be opened is refused as such
        return False
    reduced = tags.get(_SUBFILE) == 1 and photo_page(data) is None  # a thumbnail, as RAW files begin, of no other page
    sensor = tags.get(_PHOTOMETRIC) in SENSOR or tags.get(_COMPRESSION) in MAKERS
    return _DNG_VERSION in tags or reduced or sensor


def preview(data: bytes) -> bytes:
    """The bytes from the largest JPEG in a RAW file on; raises PhotoError where there is none."""
    found = (-1, 0)  # pixels, place
    at = -1
    for _ in range(MOST_PICTURES):
        at = data.find(_JPEG, at + 1)
        if at < 0:
            break
        width, height = frame_size(data[at : at + _HEAD])
        found = max(found, (width * height, at))
    if found[0] <= 0:
        raise PhotoError(
            "The RAW photo holds no preview that can be read; convert it to JPEG or TIFF first, as darktable-cli does."
        )
    return data[found[1] :]


def described(data: bytes, shown: Image.Image) -> Image.Image:
    """The picture whose EXIF block counts: the RAW file where Pillow reads its tags, else the preview."""
    try:
        return Image.open(BytesIO(data), formats=["TIFF"])
    except Exception:
        return shown

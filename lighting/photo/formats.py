"""What a file is: the name, for errors, of what is no photo that can be read; and HEIF files, which are HEIC and AVIF.

A HEIF is turned by properties of its picture (`irot` and `imir` [1]), which decoders apply; its EXIF orientation then
says the same once more, and does not count. Some programs write the latter alone: then it counts.

References:
    [1] ISO/IEC 23008-12, 6.5.10 and 6.5.12; boxes by ISO/IEC 14496-12, 4.2 and 8.11.
"""

import codecs
import re
import struct
import zlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from io import BytesIO
from typing import Any, Literal

from PIL import ExifTags, Image

from lighting.photo.tags import UTF_16

_HEIC_BRANDS = {b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"hevm", b"hevs"}
_AVIF_BRANDS = {b"avif", b"avis"}
_ANY_CODEC_BRANDS = {b"mif1", b"msf1", b"mif2", b"miaf"}
_MAX_BRANDS = 64  # that are read
_MAX_BOXES = 4096  # beside each other that are read
_MAX_ITEMS = 1 << 16  # whose properties are read; a tile of a picture is an item


def _heif_kind(data: bytes) -> Literal["HEIC", "AVIF"] | None:
    """Which kind of HEIF a file is, by its brands; None for what is none that is read.

    Args:
        data: of any file.
    """
    brands = _ftyp_brands(data)
    if not brands or brands[0] not in _HEIC_BRANDS | _AVIF_BRANDS | _ANY_CODEC_BRANDS:
        return None
    if brands[0] not in _HEIC_BRANDS and _AVIF_BRANDS.intersection(brands):
        return "AVIF"
    return "HEIC"


def _ftyp_brands(data: bytes) -> list[bytes]:
    """The brands of an ISO media file, the main one first; none of other files.

    Args:
        data: of any file.
    """
    if data[4:8] != b"ftyp":
        return []
    end = min(int.from_bytes(data[:4]), 4 * _MAX_BRANDS)
    return [data[8:12], *(data[start : start + 4] for start in range(16, end, 4))]


def open_heif(data: bytes) -> Image.Image:
    """The picture of a HEIC or AVIF, not decoded.

    No plugin is registered with Pillow, where a program that uses this one may have registered its own.

    Args:
        data: of an ISO media file.

    Raises:
        UnidentifiedImageError: it is neither.
        SyntaxError: it is a HEIC that cannot be read.
    """
    if _heif_kind(data) != "HEIC":
        return Image.open(BytesIO(data), formats=["AVIF"])
    from pi_heif import HeifImageFile

    image: Image.Image = HeifImageFile(BytesIO(data))
    return image


def complete_avif(image: Image.Image, data: bytes) -> None:
    """Add to an AVIF's picture what Pillow leaves out: its `nclx_profile`, and an orientation by EXIF alone.

    Args:
        image: opened by Pillow; changed in place.
        data: of its file.
    """
    import pi_heif

    exif = Image.Exif()
    try:
        other = pi_heif.open_heif(BytesIO(data))
        exif.load(other.info.get("exif") or b"")
        orientation = exif.get(ExifTags.Base.Orientation)
    except Exception:  # what Pillow opened is a photo, whatever another reader says of its boxes
        return
    if nclx := other.info.get("nclx_profile"):
        image.info["nclx_profile"] = nclx
    restore_orientation(image, data, orientation)


def restore_orientation(image: Image.Image, data: bytes, orientation: Any) -> None:
    """Give a picture that its container does not turn the orientation of its EXIF block, which readers take away.

    Args:
        image: a HEIC or AVIF, opened; changed in place.
        data: of its file.
        orientation: by EXIF; what is no number from 1 to 8 says nothing.
    """
    if isinstance(orientation, int) and 1 < orientation <= 8 and not _turns_picture(data):
        with suppress(Exception):  # a damaged block must not reject a photo
            image.getexif()[ExifTags.Base.Orientation] = orientation


def _turns_picture(data: bytes) -> bool:
    """Whether the primary picture has a property that turns or mirrors it."""
    try:
        start, end = next(span for kind, span in _children(data, 0, len(data)) if kind == b"meta")
        meta = dict(_children(data, start + 4, end))
        properties = dict(_children(data, *meta[b"iprp"]))
        kinds = list(_children(data, *properties[b"ipco"]))
        start, _ = meta[b"pitm"]
        (item,) = struct.unpack_from(">I" if data[start] else ">H", data, start + 4)
        chosen = _property_indices(data, *properties[b"ipma"], item)
        own = [kinds[index - 1] for index in chosen if 0 < index <= len(kinds)]
    except (KeyError, StopIteration, struct.error):
        return False
    return any(kind == b"imir" or (kind == b"irot" and data[start] & 3) for kind, (start, _) in own)


def _children(data: bytes, position: int, end: int) -> Iterator[tuple[bytes, tuple[int, int]]]:
    """Kinds and contents of the boxes in a part of the file."""
    for _ in range(_MAX_BOXES):
        if position + 8 > end:
            return
        size, kind = struct.unpack_from(">I4s", data, position)
        head = 8
        if size == 1:
            (size,), head = struct.unpack_from(">Q", data, position + 8), 16
        size = size or end - position
        if size < head or position + size > end:
            return
        yield kind, (position + head, position + size)
        position += size


def _property_indices(data: bytes, start: int, end: int, item: int) -> list[int]:
    """Indices, from 1, of an item's properties."""
    version, wide = data[start], data[start + 3] & 1
    (count,) = struct.unpack_from(">I", data, start + 4)
    entry = struct.Struct(">IB" if version else ">HB")
    position = start + 8
    for _ in range(min(count, _MAX_ITEMS)):
        if position >= end:
            break
        number, length = entry.unpack_from(data, position)
        position += entry.size
        if number == item:
            masks = struct.unpack_from(f">{length}{'H' if wide else 'B'}", data, position)
            return [value & (0x7FFF if wide else 0x7F) for value in masks]
        position += length * (2 if wide else 1)
    return []


_READ = "JPEG, PNG, WebP, TIFF, AVIF or HEIC"
UNREADABLE = f"The file is not a {_READ} photo that can be read."

_PICTURES = (  # name with its article, and how such files begin
    ("a GIF", b"GIF8"),
    ("a JPEG XL", b"\xff\x0a"), ("a JPEG XL", b"\0\0\0\x0cJXL \r\n\x87\n"),
    ("a JPEG 2000", b"\0\0\0\x0cjP  \r\n\x87\n"), ("a JPEG 2000", b"\xff\x4f\xff\x51"),
    ("a JPEG XR", b"II\xbc"), ("a JPEG-LS", b"\xff\xd8\xff\xf7"),
    ("a Photoshop document (PSD)", b"8BPS"), ("a GIMP document (XCF)", b"gimp xcf"),
    ("an OpenEXR picture (EXR)", b"v/1\x01"), ("a Radiance HDR", b"#?RADIANCE"), ("a Radiance HDR", b"#?RGBE"),
    ("a PDF", b"%PDF"), ("a PostScript file (EPS)", b"%!PS"), ("a PostScript file (EPS)", b"\xc5\xd0\xd3\xc6"),
    ("an icon (ICO)", b"\0\0\x01\0"), ("a cursor (CUR)", b"\0\0\x02\0"), ("an icon (ICNS)", b"icns"),
    ("a DDS texture", b"DDS "), ("a KTX texture", b"\xabKTX"), ("a QOI", b"qoif"), ("a FLIF", b"FLIF"),
    ("a BPG", b"BPG\xfb"), ("a DPX", b"SDPX"), ("a DPX", b"XPDS"), ("a Cineon picture", b"\x80\x2a\x5f\xd7"),
    ("a FITS picture", b"SIMPLE  ="), ("a Sun raster picture", b"\x59\xa6\x6a\x95"), ("an SGI picture", b"\x01\xda"),
    ("an MNG animation", b"\x8aMNG"), ("a JNG", b"\x8bJNG"), ("a Lytro light field (LFP)", b"\x89LFP"),
    ("a BLP texture", b"BLP"), ("a VTF texture", b"VTF\0"), ("an InDesign document", b"\x06\x06\xed\xf5"),
    ("a PaintShop Pro document", b"Paint Shop Pro Image File"), ("a Paint.NET document (PDN)", b"PDN3"),
    ("an Affinity document", b"\0\xffKA"), ("an ImageMagick picture (MIFF)", b"id=ImageMagick"),
    ("an ASTC texture", b"\x13\xab\xa1\x5c"), ("a PVR texture", b"PVR\3"), ("a JBIG2", b"\x97JB2"),
    ("a MrSID picture", b"msid"), ("a NITF picture", b"NITF0"), ("a PGF picture", b"PGF"),
    ("a Clip Studio document", b"CSFCHUNK"), ("a Microsoft Paint picture (MSP)", b"LinS"),
    ("a Microsoft Paint picture (MSP)", b"DanM"), ("an AutoCAD drawing (DWG)", b"AC10"),
    ("an XPM", b"/* XPM"), ("an XBM", b"#define "), ("a DjVu", b"AT&TFORM"), ("a WMF", b"\xd7\xcd\xc6\x9a"),
)  # fmt: skip
_MARKED = (  # of which the mark lies behind the file's beginning
    ("an EMF", 40, b" EMF"), ("a DICOM picture", 128, b"DICM"), ("a PICT", 522, b"\0\x11\2\xff"),
    ("a Photo CD picture (PCD)", 2048, b"PCD_IPI"),
)  # fmt: skip
_OTHERS = (  # of which no picture can be made
    ("a Blender file", b"BLENDER"), ("a glTF scene (GLB)", b"glTF"), ("a USD scene", b"PXR-USDC"),
    ("a ZIP archive", b"PK\x03\x04"), ("a gzip archive", b"\x1f\x8b"), ("a 7z archive", b"7z\xbc\xaf"),
    ("a RAR archive", b"Rar!"), ("an XZ archive", b"\xfd7zXZ"), ("a bzip2 archive", b"BZh"),
    ("a Zstandard archive", b"\x28\xb5\x2f\xfd"), ("a program of Windows", b"MZ"), ("a program", b"\x7fELF"),
    ("a document of Microsoft Office", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"), ("an FBX scene", b"Kaydara FBX"),
    ("a PLY model", b"ply\n"), ("a PLY model", b"ply\r\n"),
    ("an MP3", b"ID3"), ("an MP3", b"\xff\xfb"), ("an MP3", b"\xff\xf3"), ("an Ogg file", b"OggS"), ("a FLAC", b"fLaC"),
    ("a resource file of macOS (AppleDouble)", b"\0\x05\x16\x07"),
    ("an array of NumPy", b"\x93NUMPY"), ("an HDF5 file", b"\x89HDF"), ("a property list", b"bplist00"),
    ("an SQLite database", b"SQLite format 3"), ("a shortcut of Windows", b"L\0\0\0\x01\x14\x02\0"),
    ("a pointer of Git LFS", b"version https://git-lfs"),
)  # fmt: skip
_CLIPS = (
    ("a Matroska or WebM clip", b"\x1aE\xdf\xa3"), ("an FLV clip", b"FLV\x01"), ("a WMV clip", b"\x30\x26\xb2\x75"),
    ("an MXF clip", b"\x06\x0e\x2b\x34"), ("an MPEG clip", b"\0\0\x01\xba"), ("an MPEG clip", b"\0\0\x01\xb3"),
)  # fmt: skip
_TS_PACKETS = ((0, 188), (4, 192))  # the mark of the first one, and how long a packet is
_RAWS = (
    ("a Canon CRW", b"II\x1a\0\0\0HEAPCCDR"),
    ("a Minolta MRW", b"\0MRM"),
    ("a Phase One IIQ", b"IIII"),
    ("a RED R3D", b"\0\0\0\0RED"),
)
_PHOTO_HEADS = (
    b"\xff\xd8\xff", b"\x89PNG", b"II*\0", b"MM\0*", b"IIRO", b"IIRS", b"MMOR", b"IIU\0", b"FUJIFILM", b"FOVb",
)  # fmt: skip
HEAD_BYTES = 12  # that `begins_as_photo` needs
_PHOTOS = (("JPEG", b"\xff\xd8\xff"), ("PNG", b"\x89PNG\r\n\x1a\n"))  # names without articles
_QUICKTIME_ATOMS = (b"moov", b"mdat", b"wide", b"free", b"skip", b"pnot")
_NETPBM = {b"1": "PBM", b"2": "PGM", b"3": "PPM", b"4": "PBM", b"5": "PGM", b"6": "PPM", b"7": "PAM"}
_NETPBM |= {b"f": "PFM", b"F": "PFM"}
_NETPBM_HEAD = re.compile(rb"P([1-7fF])[ \t\r\n#]")
_BMP_HEADERS = (12, 16, 40, 52, 56, 64, 108, 124)  # bytes of the second header
_DIB_HEADERS = tuple(size.to_bytes(4, "little") for size in _BMP_HEADERS[2:])
_DIB_PLANES = tuple(b"\1\0" + bits.to_bytes(2, "little") for bits in (1, 4, 8, 16, 24, 32))
_PCX_HEAD = re.compile(rb"\x0a[\x00\x02-\x05]\x01[\x01\x02\x04\x08]")
_TGA_HEAD = re.compile(rb"(?s).[\x00\x01][\x01-\x03\x09-\x0b].{13}[\x08\x0f\x10\x18\x20][\x00-\x3f]")
_TGA_UNCOMPRESSED = (1, 2, 3)
_TEXT_HEAD = 4096  # bytes
_PDF_HEAD = 1024  # bytes, within which a PDF may begin
_JSON = re.compile(rb"(?:\xef\xbb\xbf)?\s*(?:\{\s*\"|\[\s*[\[{\"\d])")
_GZIP, _ZIP = b"\x1f\x8b", b"PK\x03\x04"
_IN_ZIP = (
    (b"image/openraster", "an OpenRaster document (ORA)"), (b"application/x-krita", "a Krita document (KRA)"),
    (b"word/", "a Word document"), (b"ppt/", "a PowerPoint document"),
    (b"vnd.oasis.opendocument", "an OpenDocument file"), (b".usd", "a USD scene (USDZ)"),
)  # fmt: skip
_MARKUP = re.compile(rb"(?:\xef\xbb\xbf)?\s*(?:<\?xml|<!DOCTYPE|<!--|<svg|<html|<x:xmpmeta|<head|<body)", re.IGNORECASE)


def unreadable_sentence(data: bytes) -> str:
    """One sentence that says what a file is which is refused, and what to do about it, as far as that is known.

    Args:
        data: of a file that is not read, not empty.
    """
    for photo, start in _PHOTOS:
        if data.startswith(start) and data[3:4] != b"\xf7":
            return f"The {photo} is damaged or cut short."
    if heif := _photo_name(data):
        return f"The {heif} is damaged or cut short."
    named = ((sentence, name) for names, sentence in _SENTENCES if (name := names(data)))
    return next((sentence.format(name) for sentence, name in named), UNREADABLE)


def _photo_name(data: bytes) -> str | None:
    """The name, without an article, of what this program reads beside JPEG, PNG and TIFF."""
    return "WebP" if _riff_kind(data) == b"WEBP" else _heif_kind(data)


def _riff_kind(data: bytes) -> bytes:
    """What a RIFF file holds, four bytes; none of other files."""
    return data[8:12] if data[:4] == b"RIFF" else b""


def begins_as_photo(head: bytes) -> bool:
    """Tell whether a file may be a photo that is read, or a RAW file with a preview.

    Args:
        head: its first HEAD_BYTES bytes.
    """
    return head.startswith(_PHOTO_HEADS) or _riff_kind(head) == b"WEBP" or head[4:8] == b"ftyp"


def kind_name(data: bytes) -> str | None:
    """What a file is other than a JPEG, PNG or TIFF, with an article, such as "a GIF"; None where it has no name here.

    Args:
        data: the first bytes of a file.
    """
    if photo := _photo_name(data):
        return f"an {photo}" if photo == "AVIF" else f"a {photo}"
    return next((name for names, _ in _SENTENCES if (name := names(data))), None)


def _raw_name(data: bytes) -> str | None:
    return next((name for name, start in _RAWS if data.startswith(start)), None)


def _clip_name(data: bytes) -> str | None:
    if brands := _ftyp_brands(data):
        return _iso_clip_name(brands[0])
    if data[4:8] in _QUICKTIME_ATOMS:
        return "a MOV clip (QuickTime)"
    if _riff_kind(data) == b"AVI ":
        return "an AVI clip"
    if any(data[first : first + 1] == data[first + step : first + step + 1] == b"G" for first, step in _TS_PACKETS):
        return "an MPEG clip (transport stream)"
    return next((name for name, start in _CLIPS if data.startswith(start)), None)


def _iso_clip_name(brand: bytes) -> str | None:
    """The name of an ISO media file by its main brand; None for a picture's."""
    if brand in (b"jxl ", b"jp2 ", b"jpx ", b"avci", b"avcs", b"vvic", b"vvis", b"j2ki", b"j2is", b"jpeg", b"jpgs"):
        return None
    if brand == b"qt  ":
        return "a MOV clip (QuickTime)"
    return "a 3GP clip" if brand[:2] == b"3g" else "an MP4 clip"


def _picture_name(data: bytes) -> str | None:
    if brands := _ftyp_brands(data):
        return f"a HEIF of the kind {brands[0].decode('ascii', 'replace').strip()}"
    if _is_tga(data):
        return "a TGA (Targa)"
    if match := _NETPBM_HEAD.match(data):
        return f"a {_NETPBM[match[1]]}"
    if data[:2] == b"BM" and int.from_bytes(data[14:18], "little") in _BMP_HEADERS:
        return "a BMP"
    if _PCX_HEAD.match(data):
        return "a PCX"
    if b"%PDF-" in data[:_PDF_HEAD]:
        return "a PDF"
    if name := next((name for name, start, mark in _MARKED if data.startswith(mark, start)), None):
        return name
    if _riff_kind(data) == b"ACON":
        return "a cursor (ANI)"
    if data[:4] in _DIB_HEADERS and data[12:16] in _DIB_PLANES:
        return "a BMP without its first header (DIB)"
    if _riff_kind(data)[:3] == b"CDR":
        return "a CorelDRAW document (CDR)"
    if data[:2] == _GZIP and _is_svg(_first_of_gzip(data)):
        return "an SVG (compressed, SVGZ)"
    if data[:4] == _ZIP and (name := next((name for mark, name in _IN_ZIP if mark in data[:_TEXT_HEAD]), None)):
        return name
    if _is_svg(data):
        return "an SVG"
    return next((name for name, start in _PICTURES if data.startswith(start)), None)


def _is_svg(data: bytes) -> bool:
    if data[:2] in UTF_16:
        data = data[: 2 * _TEXT_HEAD].decode("utf-16", "ignore").encode()
    return bool(_MARKUP.match(data)) and b"<svg" in data[:_TEXT_HEAD].lower() and not _is_html(data)


def _first_of_gzip(data: bytes) -> bytes:
    try:
        return zlib.decompressobj(16 + zlib.MAX_WBITS).decompress(data[:_TEXT_HEAD], _TEXT_HEAD)
    except zlib.error:
        return b""


def _other_name(data: bytes) -> str | None:
    if data[257:262] == b"ustar":
        return "a TAR archive"
    if _riff_kind(data) == b"WAVE":
        return "a WAV"
    if data.count(0) == len(data):
        return "a file of zeros alone, as a broken copy leaves it"
    if _MARKUP.match(data):
        return "a page of the web (HTML)" if _is_html(data) else "an XML file"
    if _JSON.match(data):
        return "a JSON file"
    if data[36:40] == b"acsp":
        return "an ICC profile"
    named = next((name for name, start in _OTHERS if data.startswith(start)), None)
    return named or ("a text" if _is_text(data[:_TEXT_HEAD]) else None)


def _is_text(head: bytes) -> bool:
    """Whether the start of a file is UTF-8 of letters, blanks and line ends; a character may be cut at its end."""
    try:
        text = codecs.getincrementaldecoder("utf-8")().decode(head, final=len(head) < _TEXT_HEAD)
    except UnicodeDecodeError:
        return False
    return all(c.isprintable() or c in "\t\r\n\ufeff" for c in text)


def _is_html(data: bytes) -> bool:
    head = data[:_TEXT_HEAD].lower()
    return b"<html" in head or b"<!doctype html" in head


def _is_tga(data: bytes) -> bool:
    """Whether a file is a TGA: by its footer, or by a header that fits the file's length, for it has no signature."""
    if data[-18:-2] == b"TRUEVISION-XFILE":
        return True
    if not _TGA_HEAD.match(data) or len(data) < 18:
        return False
    width, height = int.from_bytes(data[12:14], "little"), int.from_bytes(data[14:16], "little")
    colors = int.from_bytes(data[5:7], "little") * -(-data[7] // 8)
    pixels = width * height * -(-data[16] // 8)
    least = 18 + data[0] + (colors if data[1] else 0)
    return width > 0 < height and (len(data) >= least + pixels if data[2] in _TGA_UNCOMPRESSED else pixels > least)


_SENTENCES: tuple[tuple[Callable[[bytes], str | None], str], ...] = (  # of files by who names them
    (_raw_name, "This is {}, an unsupported RAW photo; convert it to JPEG or TIFF, for example with darktable-cli."),
    (_clip_name, "This is {}, not a photo; the command `lighting video` reads clips."),
    (_picture_name, f"This is {{}}, not a supported photo; convert it to {_READ}."),
    (_other_name, "This is {}, not a photo."),
)

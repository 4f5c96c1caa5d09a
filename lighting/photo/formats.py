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

_PHOTO_HEADS = (
    b"\xff\xd8\xff", b"\x89PNG", b"II*\0", b"MM\0*", b"IIRO", b"IIRS", b"MMOR", b"IIU\0", b"FUJIFILM", b"FOVb",
)  # fmt: skip
HEAD_BYTES = 12  # that `begins_as_photo` needs
_PHOTOS = (("JPEG", rb"\xff\xd8\xff(?!\xf7)"), ("PNG", rb"\x89PNG\r\n\x1a\n"))  # names without articles
_TGA_HEAD = rb"(?s).[\x00\x01][\x01-\x03\x09-\x0b].{13}[\x08\x0f\x10\x18\x20][\x00-\x3f]"
_TGA_UNCOMPRESSED = (1, 2, 3)
_TEXT_HEAD = 4096  # bytes
_MARKUP = rb"(?i)(?:\xef\xbb\xbf)?\s*+(?:<\?xml|<!DOCTYPE|<!--|<svg|<html|<x:xmpmeta|<head|<body)"
_WEBP = rb"(?s)RIFF.{4}WEBP"


def unreadable_sentence(data: bytes) -> str:
    """One sentence that says what a file is which is refused, and what to do about it, as far as that is known.

    Args:
        data: of a file that is not read, not empty.
    """
    if photo := next((name for name, start in _PHOTOS if re.match(start, data)), None) or _photo_name(data):
        return f"The {photo} is damaged or cut short."
    return next((sentence.format(name) for name, sentence in _named_kinds(data)), UNREADABLE)


def _photo_name(data: bytes) -> str | None:
    """The name, without an article, of what this program reads beside JPEG, PNG and TIFF."""
    return "WebP" if re.match(_WEBP, data) else _heif_kind(data)


def begins_as_photo(head: bytes) -> bool:
    """Tell whether a file may be a photo that is read, or a RAW file with a preview.

    Args:
        head: its first HEAD_BYTES bytes.
    """
    return head.startswith(_PHOTO_HEADS) or bool(re.match(_WEBP, head)) or head[4:8] == b"ftyp"


def kind_name(data: bytes) -> str | None:
    """What a file is other than a JPEG, PNG or TIFF, with an article, such as "a GIF"; None where it has no name here.

    Args:
        data: the first bytes of a file.
    """
    if photo := _photo_name(data):
        return f"an {photo}" if photo == "AVIF" else f"a {photo}"
    return next((name for name, _ in _named_kinds(data)), None)


def _named_kinds(data: bytes) -> Iterator[tuple[str, str]]:
    """The names that fit a file which is no photo, with the sentences about them; the first one counts."""
    for sentence, kinds in _KINDS:
        for name, test in kinds:
            if test(data) if callable(test) else re.match(test, data, re.DOTALL):
                yield name.format(brand=data[8:12].decode("ascii", "replace").strip()), sentence


def _is_tga(data: bytes) -> bool:
    """Whether a file is a TGA: by its footer, or by a header that fits the file's length, for it has no signature."""
    if data[-18:-2] == b"TRUEVISION-XFILE":
        return True
    if not re.match(_TGA_HEAD, data) or len(data) < 18:
        return False
    width, height = int.from_bytes(data[12:14], "little"), int.from_bytes(data[14:16], "little")
    colors = int.from_bytes(data[5:7], "little") * -(-data[7] // 8)
    pixels = width * height * -(-data[16] // 8)
    least = 18 + data[0] + (colors if data[1] else 0)
    return width > 0 < height and (len(data) >= least + pixels if data[2] in _TGA_UNCOMPRESSED else pixels > least)


def _is_svg(data: bytes) -> bool:
    if data[:2] in UTF_16:
        data = data[: 2 * _TEXT_HEAD].decode("utf-16", "ignore").encode()
    return bool(re.match(_MARKUP, data)) and b"<svg" in data[:_TEXT_HEAD].lower() and not _is_html(data)


def _is_packed_svg(data: bytes) -> bool:
    try:
        return _is_svg(zlib.decompressobj(16 + zlib.MAX_WBITS).decompress(data[:_TEXT_HEAD], _TEXT_HEAD))
    except zlib.error:  # no gzip
        return False


def _is_html(data: bytes) -> bool:
    head = data[:_TEXT_HEAD].lower()
    return bool(re.match(_MARKUP, data)) and (b"<html" in head or b"<!doctype html" in head)


def _is_text(data: bytes) -> bool:
    """Whether a file starts as UTF-8 of letters, blanks and line ends; a character may be cut at the end."""
    head = data[:_TEXT_HEAD]
    try:
        text = codecs.getincrementaldecoder("utf-8")().decode(head, final=len(head) < _TEXT_HEAD)
    except UnicodeDecodeError:
        return False
    return all(c.isprintable() or c in "\t\r\n\ufeff" for c in text)


_Kinds = tuple[tuple[str, bytes | Callable[[bytes], bool]], ...]  # names with articles; how such files begin, or a test
_RAWS: _Kinds = (
    ("a Canon CRW", rb"II\x1a\0\0\0HEAPCCDR"), ("a Minolta MRW", rb"\0MRM"), ("a Phase One IIQ", rb"IIII"),
    ("a RED R3D", rb"\0\0\0\0RED"),
)  # fmt: skip
_CLIPS: _Kinds = (
    ("a MOV clip (QuickTime)", rb".{4}(?:ftypqt  |moov|mdat|wide|free|skip|pnot)"), ("a 3GP clip", rb".{4}ftyp3g"),
    ("an MP4 clip", rb".{4}ftyp(?!jxl |jp2 |jpx |avci|avcs|vvic|vvis|j2ki|j2is|jpeg|jpgs)"),
    ("an AVI clip", rb"RIFF.{4}AVI "),
    ("an MPEG clip (transport stream)", rb"G.{187}G|.{4}G.{191}G"),  # two packets of 188 bytes, or of 192
    ("a Matroska or WebM clip", rb"\x1aE\xdf\xa3"), ("an FLV clip", rb"FLV\x01"), ("a WMV clip", rb"\x30\x26\xb2\x75"),
    ("an MXF clip", rb"\x06\x0e\x2b\x34"), ("an MPEG clip", rb"\0\0\x01[\xba\xb3]"),
)  # fmt: skip
_PICTURES: _Kinds = (
    ("a HEIF of the kind {brand}", rb".{4}ftyp"), ("a TGA (Targa)", _is_tga), ("a PBM", rb"P[14][ \t\r\n#]"),
    ("a PGM", rb"P[25][ \t\r\n#]"), ("a PPM", rb"P[36][ \t\r\n#]"), ("a PAM", rb"P7[ \t\r\n#]"),
    ("a PFM", rb"P[fF][ \t\r\n#]"), ("a BMP", rb"BM.{12}[\x0c\x10(48@l|](?:\0{3}|\0{0,2}\Z)"),  # length of the header
    ("a PCX", rb"\x0a[\x00\x02-\x05]\x01[\x01\x02\x04\x08]"), ("a PDF", rb"%PDF|.{0,1019}%PDF-"),
    ("an EMF", rb".{40} EMF"),
    ("a DICOM picture", rb".{128}DICM"), ("a PICT", rb".{522}\0\x11\x02\xff"),
    ("a Photo CD picture (PCD)", rb".{2048}PCD_IPI"), ("a cursor (ANI)", rb"RIFF.{4}ACON"),
    ("a BMP without its first header (DIB)", rb"[(48@l|]\0\0\0.{8}\x01\0[\x01\x04\x08\x10\x18\x20]\0"),
    ("a CorelDRAW document (CDR)", rb"RIFF.{4}CDR"), ("an SVG (compressed, SVGZ)", _is_packed_svg),
    ("an OpenRaster document (ORA)", rb"PK\x03\x04.{0,4076}image/openraster"),
    ("a Krita document (KRA)", rb"PK\x03\x04.{0,4073}application/x-krita"),
    ("a Word document", rb"PK\x03\x04.{0,4087}word/"), ("a PowerPoint document", rb"PK\x03\x04.{0,4088}ppt/"),
    ("an OpenDocument file", rb"PK\x03\x04.{0,4070}vnd\.oasis\.opendocument"),
    ("a USD scene (USDZ)", rb"PK\x03\x04.{0,4088}\.usd"), ("an SVG", _is_svg), ("a GIF", rb"GIF8"),
    ("a JPEG XL", rb"\xff\x0a|\0\0\0\x0cJXL \r\n\x87\n"),
    ("a JPEG 2000", rb"\0\0\0\x0cjP  \r\n\x87\n|\xff\x4f\xff\x51"), ("a JPEG XR", rb"II\xbc"),
    ("a JPEG-LS", rb"\xff\xd8\xff\xf7"), ("a Photoshop document (PSD)", rb"8BPS"),
    ("a GIMP document (XCF)", rb"gimp xcf"), ("an OpenEXR picture (EXR)", rb"v/1\x01"),
    ("a Radiance HDR", rb"#\?(?:RADIANCE|RGBE)"), ("a PostScript file (EPS)", rb"%!PS|\xc5\xd0\xd3\xc6"),
    ("an icon (ICO)", rb"\0\0\x01\0"), ("a cursor (CUR)", rb"\0\0\x02\0"), ("an icon (ICNS)", rb"icns"),
    ("a DDS texture", rb"DDS "), ("a KTX texture", rb"\xabKTX"), ("a QOI", rb"qoif"), ("a FLIF", rb"FLIF"),
    ("a BPG", rb"BPG\xfb"), ("a DPX", rb"SDPX|XPDS"), ("a Cineon picture", rb"\x80\x2a\x5f\xd7"),
    ("a FITS picture", rb"SIMPLE  ="), ("a Sun raster picture", rb"\x59\xa6\x6a\x95"),
    ("an SGI picture", rb"\x01\xda"), ("an MNG animation", rb"\x8aMNG"), ("a JNG", rb"\x8bJNG"),
    ("a Lytro light field (LFP)", rb"\x89LFP"), ("a BLP texture", rb"BLP"), ("a VTF texture", rb"VTF\0"),
    ("an InDesign document", rb"\x06\x06\xed\xf5"), ("a PaintShop Pro document", rb"Paint Shop Pro Image File"),
    ("a Paint.NET document (PDN)", rb"PDN3"), ("an Affinity document", rb"\0\xffKA"),
    ("an ImageMagick picture (MIFF)", rb"id=ImageMagick"), ("an ASTC texture", rb"\x13\xab\xa1\x5c"),
    ("a PVR texture", rb"PVR\x03"), ("a JBIG2", rb"\x97JB2"), ("a MrSID picture", rb"msid"),
    ("a NITF picture", rb"NITF0"), ("a PGF picture", rb"PGF"), ("a Clip Studio document", rb"CSFCHUNK"),
    ("a Microsoft Paint picture (MSP)", rb"LinS|DanM"), ("an AutoCAD drawing (DWG)", rb"AC10"),
    ("an XPM", rb"/\* XPM"), ("an XBM", rb"#define "), ("a DjVu", rb"AT&TFORM"), ("a WMF", rb"\xd7\xcd\xc6\x9a"),
)  # fmt: skip
_OTHERS: _Kinds = (  # of which no picture can be made
    ("a TAR archive", rb".{257}ustar"), ("a WAV", rb"RIFF.{4}WAVE"),
    ("a file of zeros alone, as a broken copy leaves it", rb"\0*+\Z"),
    ("a page of the web (HTML)", _is_html), ("an XML file", _MARKUP),
    ("a JSON file", rb"(?:\xef\xbb\xbf)?\s*+(?:\{\s*+\"|\[\s*+[\[{\"\d])"), ("an ICC profile", rb".{36}acsp"),
    ("a Blender file", rb"BLENDER"), ("a glTF scene (GLB)", rb"glTF"), ("a USD scene", rb"PXR-USDC"),
    ("a ZIP archive", rb"PK\x03\x04"), ("a gzip archive", rb"\x1f\x8b"), ("a 7z archive", rb"7z\xbc\xaf"),
    ("a RAR archive", rb"Rar!"), ("an XZ archive", rb"\xfd7zXZ"), ("a bzip2 archive", rb"BZh"),
    ("a Zstandard archive", rb"\x28\xb5\x2f\xfd"), ("a program of Windows", rb"MZ"), ("a program", rb"\x7fELF"),
    ("a document of Microsoft Office", rb"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"), ("an FBX scene", rb"Kaydara FBX"),
    ("a PLY model", rb"ply\r?\n"), ("an MP3", rb"ID3|\xff[\xfb\xf3]"), ("an Ogg file", rb"OggS"), ("a FLAC", rb"fLaC"),
    ("a resource file of macOS (AppleDouble)", rb"\0\x05\x16\x07"), ("an array of NumPy", rb"\x93NUMPY"),
    ("an HDF5 file", rb"\x89HDF"), ("a property list", rb"bplist00"), ("an SQLite database", rb"SQLite format 3"),
    ("a shortcut of Windows", rb"L\0\0\0\x01\x14\x02\0"),
    ("a pointer of Git LFS", rb"version https://git-lfs"), ("a text", _is_text),
)  # fmt: skip
_KINDS = (  # sentences, and what they are about
    ("This is {}, an unsupported RAW photo; convert it to JPEG or TIFF, for example with darktable-cli.", _RAWS),
    ("This is {}, not a photo; the command `lighting video` reads clips.", _CLIPS),
    (f"This is {{}}, not a supported photo; convert it to {_READ}.", _PICTURES),
    ("This is {}, not a photo.", _OTHERS),
)

"""What is no photo is named when it is refused; and HEIF files, by their brands and boxes."""

import gzip
import subprocess
import sys
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lighting.errors import PhotoError
from lighting.photo.formats import UNREADABLE, _heif_kind, _turns_picture, complete_avif, open_heif, unreadable_sentence
from lighting.photo.linear import read_linear
from lighting.photo.reader import read_photo
from tests.conftest import encode, exif, scene

SCENE = scene(64, 48)


def ftyp(brand: bytes, *compatible: bytes) -> bytes:
    body = brand + bytes(4) + b"".join(compatible)
    return (8 + len(body)).to_bytes(4) + b"ftyp" + body + bytes(64)


def rle_tga() -> bytes:
    stream = BytesIO()
    Image.fromarray(SCENE).save(stream, "TGA", compression="tga_rle")
    return stream.getvalue()


BEGINNINGS = {
    "GIF": b"GIF89a" + bytes(40),
    "JPEG XL": b"\xff\x0a" + bytes(40),
    "JPEG 2000": b"\xff\x4f\xff\x51" + bytes(40),
    "JPEG XR": b"II\xbc\x01" + bytes(40),
    "PSD": b"8BPS\0\x01" + bytes(40),
    "EXR": b"v/1\x01" + bytes(40),
    "Radiance HDR": b"#?RADIANCE\n" + bytes(40),
    "PDF": b"%PDF-1.7\n",
    "EPS": b"%!PS-Adobe-3.0 EPSF-3.0",
    "a PDF": b"\r\n\n%PDF-1.7\n",
    "SVGZ": gzip.compress(b"<svg xmlns='http://www.w3.org/2000/svg'/>"),
    "KRA": b"PK\x03\x04" + bytes(26) + b"mimetypeapplication/x-krita",
    "ORA": b"PK\x03\x04" + bytes(26) + b"mimetypeimage/openraster",
    "MNG": b"\x8aMNG\r\n\x1a\n" + bytes(40),
    "EMF": b"\1\0\0\0" + bytes(36) + b" EMF" + bytes(40),
    "CDR": b"RIFF\0\0\0\0CDRv" + bytes(40),
    "PCD": bytes(2048) + b"PCD_IPI" + bytes(40),
    "JSON": b'{"photoTakenTime": {"timestamp": "1717260540"}}',
    "NumPy": b"\x93NUMPY\x01\0v\0" + bytes(40),
    "ICO": b"\0\0\x01\0\x01\0" + bytes(40),
    "DDS": b"DDS |" + bytes(40),
    "XCF": b"gimp xcf v011\0" + bytes(40),
    "FITS": b"SIMPLE  =                    T",
    "PFM": b"PF\n64 48\n-1.0\n" + bytes(40),
    "PAM": b"P7\nWIDTH 64\n" + bytes(40),
    "DICOM": bytes(128) + b"DICM" + bytes(40),
    "SVG": b'\xef\xbb\xbf<?xml version="1.0"?>\n<!-- x -->\n<svg xmlns="http://www.w3.org/2000/svg"/>',
    "HTML": b"<!DOCTYPE html><html><body><svg></svg></body></html>",
    "XML": b'<?xml version="1.0"?><a/>',
    "DIB": b"\x28\0\0\0\x40\0\0\0\x30\0\0\0\1\0\x18\0" + bytes(40),
    "an SVG": '<?xml version="1.0" encoding="UTF-16"?><svg xmlns="http://www.w3.org/2000/svg"/>'.encode("utf-16"),
    "PICT": bytes(522) + b"\0\x11\2\xff" + bytes(40),
    "ASTC": b"\x13\xab\xa1\x5c\6\6\1" + bytes(40),
    "PVR": b"PVR\3" + bytes(40),
    "JBIG2": b"\x97JB2\r\n\x1a\n" + bytes(40),
    "NITF": b"NITF02.10" + bytes(40),
    "MrSID": b"msid" + bytes(40),
    "Clip Studio": b"CSFCHUNK" + bytes(40),
    "DWG": b"AC1027" + bytes(40),
    "ANI": b"RIFF\x40\0\0\0ACONanih" + bytes(40),
    "ICC": bytes(36) + b"acsp" + bytes(88),
    "Office": bytes.fromhex("d0cf11e0a1b11ae1") + bytes(40),
    "program of Windows": b"MZ\x90\0" + bytes(40),
    "bzip2": b"BZh91AY&SY" + bytes(40),
    "Zstandard": b"\x28\xb5\x2f\xfd" + bytes(40),
    "FBX": b"Kaydara FBX Binary  \0" + bytes(40),
    "PLY": b"ply\nformat ascii 1.0\n",
    "MP3": b"\xff\xfb\x90\x64" + bytes(40),
    "a text": "Access denied: Zugang verwehrt, é".encode(),
    "ZIP": b"PK\x03\x04" + bytes(40),
    "zeros alone": bytes(4096),
    "AppleDouble": b"\0\x05\x16\x07" + bytes(40),
    "Git LFS": b"version https://git-lfs.github.com/spec/v1\n",
    "HEIF of the kind avci": ftyp(b"avci", b"mif1"),
    "lighting video": ftyp(b"mp42", b"isom"),
    "MP4": ftyp(b"isom", b"iso2", b"avc1"),
    "MOV": ftyp(b"qt  "),
    "3GP": ftyp(b"3gp5"),
    "QuickTime": b"\0\0\0\x08wide" + bytes(64),
    "WebM": b"\x1aE\xdf\xa3" + bytes(40),
    "AVI": b"RIFF\x40\0\0\0AVI LIST",
    "transport stream": (b"G" + bytes(187)) * 3,
    "RAW": b"II\x1a\0\0\0HEAPCCDR" + bytes(64),
}


@pytest.mark.parametrize("name", BEGINNINGS)
def test_what_is_refused_is_named(name: str) -> None:
    with pytest.raises(PhotoError, match=name) as caught:
        read_photo(BEGINNINGS[name])
    assert str(caught.value).startswith("This is a")
    assert str(caught.value).endswith(".")


@pytest.mark.parametrize("kind", ["GIF", "BMP", "PPM", "TGA", "JPEG2000", "PCX", "SGI", "ICO", "DDS", "ICNS", "MSP"])
def test_what_other_programs_write_is_named(kind: str) -> None:
    size = (256, 256) if kind == "ICNS" else (64, 48)
    picture = Image.fromarray(scene(*size)).convert("1" if kind == "MSP" else "RGB")
    text = unreadable_sentence(encode(picture, kind))
    named = {"JPEG2000": "JPEG 2000", "TGA": "TGA (Targa)"}.get(kind, kind)
    assert named in text


def test_a_packed_targa_is_named() -> None:
    assert "TGA" in unreadable_sentence(rle_tga())


@pytest.mark.parametrize(
    ("data", "name"),
    [
        (b"\xff\xd8\xff\xe0garbage", "JPEG"),
        (b"\x89PNG\r\n\x1a\n\0\0", "PNG"),
        (b"RIFF\x40\0\0\0WEBPVP8 ", "WebP"),
        (ftyp(b"heic", b"mif1"), "HEIC"),
        (ftyp(b"mif1", b"avif"), "AVIF"),
    ],
)
def test_damaged_photos_are_called_so(data: bytes, name: str) -> None:
    with pytest.raises(PhotoError, match=rf"^The ({name}|photo) is damaged or cut short"):
        read_photo(data)


@pytest.mark.parametrize(
    "data", [b"no \xffphoto", b"{}\0", b"\x00\x01\x02\x03" * 9, b"BMP is a w\xf8rd", b"P\x01", b"\0\0\x02\0"]
)
def test_what_has_no_name_gets_none(data: bytes) -> None:
    assert unreadable_sentence(data) in (UNREADABLE, "This is a cursor (CUR), not a supported photo; " + CONVERT)


@pytest.mark.parametrize(
    ("data", "name"),
    [
        (encode(SCENE, "GIF"), "a GIF"),
        (encode(SCENE, "WEBP"), "a WebP"),
        (ftyp(b"heic"), "a HEIC"),
        (ftyp(b"mp42"), "an MP4"),
    ],
)
def test_linear_values_are_refused_by_name_too(data: bytes, name: str, tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(data)
    with pytest.raises(PhotoError, match=rf"a\.png cannot be read as a PNG, TIFF or JPEG picture; it is {name}"):
        read_linear(tmp_path / "a.png")


CONVERT = "convert it to JPEG, PNG, WebP, TIFF, AVIF or HEIC."


HEIF_SCENE = scene(160, 120)
ORIENTATION, UNUSED = 0x112, 0x114  # tags
LOSSLESS: dict[str, dict[str, object]] = {
    "HEIF": {"quality": -1},
    "AVIF": {"quality": 100, "subsampling": "4:4:4", "speed": 10, "max_threads": 1},
}
HEIC = encode(HEIF_SCENE, "HEIF", **LOSSLESS["HEIF"])


def turned_by_exif_alone(kind: str, orientation: int) -> bytes:
    """A file whose EXIF block got its orientation afterwards, as programs change it that edit no more than that."""
    block = exif()
    block[UNUSED] = orientation
    data = encode(HEIF_SCENE, kind, exif=block.tobytes(), **LOSSLESS[kind])
    place, wanted = (tag.to_bytes(2) + b"\0\3\0\0\0\1" for tag in (UNUSED, ORIENTATION))
    assert data.count(place) == 1
    return data.replace(place, wanted)


@pytest.mark.parametrize("kind", LOSSLESS)
@pytest.mark.parametrize("orientation", [3, 6, 8])
def test_what_exif_alone_turns_is_turned(kind: str, orientation: int) -> None:
    photo = read_photo(turned_by_exif_alone(kind, orientation))
    expected = np.rot90(HEIF_SCENE, {3: 2, 6: 3, 8: 1}[orientation])
    assert photo.pixels.shape == expected.shape
    assert np.abs(photo.pixels.astype(int) - expected).max() <= 4
    assert (photo.height, photo.width) == expected.shape[:2]


@pytest.mark.parametrize("orientation", [3, 6, 8])
def test_a_heic_that_its_container_turns_is_turned_once(orientation: int) -> None:
    block = exif()
    block[ORIENTATION] = orientation
    data = encode(HEIF_SCENE, "HEIF", exif=block.tobytes(), **LOSSLESS["HEIF"])
    assert _turns_picture(data)
    assert read_photo(data).pixels.shape == np.rot90(HEIF_SCENE, {3: 2, 6: 3, 8: 1}[orientation]).shape
    assert open_heif(data).getexif().get(ORIENTATION, 1) == 1


def test_the_colours_of_an_avif_are_known() -> None:
    data = encode(HEIF_SCENE, "AVIF", max_threads=1)
    image = Image.open(BytesIO(data))
    complete_avif(image, data)
    assert image.info["nclx_profile"]["transfer_characteristics"] == 13


def test_kinds_by_brands() -> None:
    def kind(main: bytes, *others: bytes) -> str | None:
        body = main + bytes(4) + b"".join(others)
        return _heif_kind((8 + len(body)).to_bytes(4) + b"ftyp" + body)

    assert kind(b"heic", b"mif1", b"avif") == "HEIC"
    assert kind(b"mif1", b"heix", b"miaf") == kind(b"heix") == kind(b"msf1", b"hevc") == "HEIC"
    assert kind(b"mif1", b"avif") == kind(b"avif") == kind(b"avis", b"msf1") == "AVIF"
    assert kind(b"isom", b"avif") is None
    assert _heif_kind(b"") is _heif_kind(HEIC[:7]) is None


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

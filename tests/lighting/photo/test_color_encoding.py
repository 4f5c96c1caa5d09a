"""What the values of a picture mean: code points, profiles, chunks, EXIF and XMP."""

import struct
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import ExifTags, Image, ImageCms

from lighting.color import H273_CHROMATICITIES, chromaticities_to_rec709, srgb_decode, srgb_encode
from lighting.photo.color_encoding import is_gamma_encoded, read_color_encoding
from lighting.photo.linear import read_linear
from lighting.photo.reader import read_photo
from lighting.photo.tags import read_tags
from tests.conftest import encode, exif
from tests.helpers.photos import WIDE_PRIMARIES, chunk, display_profile, packet, png

COLORS = [[[40, 60, 110], [128, 128, 128], [200, 90, 60]], [[90, 130, 50], [235, 230, 220], [20, 25, 22]]]
SRGB = np.repeat(np.repeat(np.array(COLORS, np.uint8), 32, axis=0), 32, axis=1)  # blocks, so that no format mixes them
LINEAR = srgb_decode(SRGB / 255.0)
P3, REC2020 = H273_CHROMATICITIES[12], H273_CHROMATICITIES[9]
ADOBE = (0.64, 0.33, 0.21, 0.71, 0.15, 0.06, 0.3127, 0.329)
SRGB_XYZ = ((0.4361, 0.2225, 0.0139), (0.3851, 0.7169, 0.0971), (0.1431, 0.0606, 0.7141))


# XYZ of red, green and blue under D50: ROMM RGB (ISO 22028-2), and a profile of sRGB, as they are published
COLOURS = np.array([[[60, 90, 140], [200, 190, 180]]], dtype=np.uint8)


def test_values_of_wide_primaries_become_those_of_rec709(tmp_path: Path) -> None:
    Image.fromarray(COLOURS).save(tmp_path / "a.png", icc_profile=display_profile("Wide, linear", WIDE_PRIMARIES))
    found = read_linear(tmp_path / "a.png", "linear").pixels
    xyz = COLOURS / 255.0 @ np.array(WIDE_PRIMARIES)
    assert found @ np.array(SRGB_XYZ) == pytest.approx(xyz, abs=1e-3)


def test_white_stays_white_and_clipped_values_stay_clipped(tmp_path: Path) -> None:
    colours = np.array([[[255, 255, 255], [120, 200, 255]]], dtype=np.uint8)
    Image.fromarray(colours).save(tmp_path / "a.png", icc_profile=display_profile("Wide", WIDE_PRIMARIES))
    photo = read_linear(tmp_path / "a.png", "linear")
    assert photo.pixels[0, 0] == pytest.approx([1, 1, 1], abs=2e-3)
    assert (photo.pixels.max(axis=-1) >= photo.white).all()


LAB = ImageCms.ImageCmsProfile(ImageCms.createProfile("LAB")).tobytes()


@pytest.mark.parametrize("said", [None, b"damaged", display_profile("sRGB, linear", SRGB_XYZ), LAB])
def test_the_same_primaries_and_profiles_that_say_none_change_nothing(tmp_path: Path, said: bytes | None) -> None:
    Image.fromarray(COLOURS).save(tmp_path / "a.png", icc_profile=said)
    assert np.array_equal(read_linear(tmp_path / "a.png", "linear").pixels, COLOURS / np.float32(255))


@pytest.mark.parametrize(("name", "coded"), [("Wide", False), ("sRGB", False), ("Linear", True)])
def test_a_profile_that_has_a_curve_is_told_and_not_believed(tmp_path: Path, name: str, coded: bool) -> None:
    values = np.array([[100, 40000]], dtype=np.uint16)
    curve = struct.pack(">IH", 1, 461) if coded else bytes(4)  # value^1.8, or a straight line
    Image.fromarray(values).save(tmp_path / "a.png", icc_profile=display_profile(name, WIDE_PRIMARIES, curve))
    with Image.open(tmp_path / "a.png") as header:
        assert is_gamma_encoded(header) is coded
    photo = read_linear(tmp_path / "a.png")
    assert photo.pixels[..., 0] == pytest.approx(values / 65535, abs=1e-3)
    assert any("against what the file says" in warning for warning in photo.warnings) is coded
    assert not read_linear(tmp_path / "a.png", "linear").warnings


def pq(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    """PQ's signal (SMPTE ST 2084) of light that is 1 at 203 cd/m2."""
    power = (linear * 203 / 10000) ** (2610 / 16384)
    return np.array(((3424 / 4096 + 2413 / 128 * power) / (1 + 2392 / 128 * power)) ** (2523 / 32))


def rec709(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rec.709's signal of light of a scene."""
    return np.asarray(np.where(linear < 0.018, 4.5 * linear, 1.099 * linear**0.45 - 0.099))


def hlg(linear: NDArray[np.float64]) -> NDArray[np.float64]:
    """HLG's signal (BT.2100) of display light that is 1 at 203 cd/m2 on a display of 1000, Rec.2020."""
    level = linear @ np.array([0.2627, 0.6780, 0.0593])
    scene = linear * 0.203 * np.maximum(0.203 * level, 1e-9)[..., None] ** (1 / 1.2 - 1)
    a = 0.17883277
    low, high = np.sqrt(3 * scene), a * np.log(np.maximum(12 * scene - (1 - 4 * a), 1e-9)) + 0.5 - a * np.log(4 * a)
    return np.asarray(np.where(scene <= 1 / 12, low, high))


def coded(curve: Any, chromaticities: tuple[float, ...] | None = None) -> NDArray[np.uint8]:
    matrix = None if chromaticities is None else chromaticities_to_rec709(chromaticities)
    linear = LINEAR if matrix is None else LINEAR @ np.linalg.inv(matrix).T
    return np.asarray(np.round(np.clip(curve(np.clip(linear, 0, None)), 0, 1) * 255), np.uint8)


def png_with(pixels: NDArray[np.uint8], *chunks: bytes) -> bytes:
    height, width, _ = pixels.shape
    rows = np.concatenate([np.zeros((height, 1), np.uint8), pixels.reshape(height, -1)], axis=1).tobytes()
    return png(width, height, rows, *chunks, colour=2)


def cicp(*points: int) -> bytes:
    return chunk(b"cICP", bytes(points))


def gama(value: float) -> bytes:
    return chunk(b"gAMA", struct.pack(">I", round(1e5 * value)))


def chrm(chromaticities: tuple[float, ...]) -> bytes:
    ordered = (*chromaticities[6:], *chromaticities[:6])
    return chunk(b"cHRM", struct.pack(">8I", *(round(1e5 * value) for value in ordered)))


def gamma(exponent: float) -> Any:
    return lambda linear: linear**exponent


def narrow(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    return np.round(16 + pixels / 255.0 * 219).astype(np.uint8)


def curve_table(decode: Any) -> bytes:
    values = np.clip(np.round(65535 * decode(np.linspace(0, 1, 4096))), 0, 65535).astype(int)
    return struct.pack(">I4096H", 4096, *values)


def pq_light(signal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of 10,000 cd/m2."""
    levels = np.linspace(0, 1, 100_001)
    return np.interp(signal, pq(levels * 10000 / 203), levels)


PNGS = {
    "cICP, PQ": png_with(coded(pq, REC2020), cicp(9, 16, 0, 1)),
    "cICP, HLG": png_with(coded(hlg, REC2020), cicp(9, 18, 0, 1)),
    "cICP, PQ and P3": png_with(coded(pq, P3), cicp(12, 16, 0, 1)),
    "cICP, P3": png_with(coded(srgb_encode, P3), cicp(12, 13, 0, 1)),
    "cICP, Rec.2020": png_with(coded(rec709, REC2020), cicp(9, 14, 0, 1)),
    "cICP, Rec.2020 with sRGB's curve": png_with(coded(srgb_encode, REC2020), cicp(9, 13, 0, 1)),
    "cICP, Rec.709": png_with(coded(rec709), cicp(1, 1, 0, 1)),
    "cICP, Rec.601": png_with(coded(rec709, H273_CHROMATICITIES[6]), cicp(6, 6, 0, 1)),
    "cICP, linear": png_with(coded(gamma(1.0)), cicp(1, 8, 0, 1)),
    "cICP, narrow range": png_with(narrow(SRGB), cicp(1, 13, 0, 0)),
    "cICP before all else": png_with(coded(srgb_encode, P3), cicp(12, 13, 0, 1), gama(1.0), chunk(b"sRGB", b"\0")),
    "cICP, primaries alone": png_with(coded(srgb_encode, P3), cicp(12, 2, 0, 1)),
    "cICP, PQ alone": png_with(coded(pq, REC2020), cicp(2, 16, 0, 1)),
    "cICP of an unknown curve": png_with(SRGB, cicp(12, 99, 0, 1)),
    "cICP that says nothing": png_with(SRGB, cicp(2, 2, 0, 1)),
    "gAMA 1.0": png_with(coded(gamma(1.0)), gama(1.0)),
    "gAMA of a Mac": png_with(coded(gamma(0.55556)), gama(0.55556)),
    "gAMA of sRGB": png_with(SRGB, gama(0.45455)),
    "gAMA beside sRGB": png_with(SRGB, gama(1.0), chunk(b"sRGB", b"\0")),
    "gAMA that cannot be": png_with(SRGB, gama(22.0)),
    "gAMA of nothing": png_with(SRGB, gama(0.0)),
    "cHRM": png_with(coded(srgb_encode, P3), chrm(P3), gama(0.45455)),
    "cHRM and gAMA": png_with(coded(gamma(1 / 1.8), ADOBE), chrm(ADOBE), gama(1 / 1.8)),
    "cHRM of nothing": png_with(SRGB, chrm((0.0,) * 8)),
    "cHRM alone": png_with(coded(srgb_encode, P3), chrm(P3)),
}


def assert_same(data: bytes, tolerance: float = 4.0) -> None:
    found = read_photo(data).pixels.reshape(2, 32, 3, 32, 3)[:, 8:24, :, 8:24].mean(axis=(1, 3))
    assert np.abs(found - SRGB[::32, ::32]).max() <= tolerance


@pytest.mark.parametrize("name", PNGS)
def test_pngs(name: str) -> None:
    assert_same(PNGS[name])


@pytest.mark.parametrize(
    ("pixels", "points"),
    [
        (coded(pq, REC2020), (9, 16)),
        (coded(hlg, REC2020), (9, 18)),
        (coded(srgb_encode, P3), (12, 13)),
        (coded(rec709, REC2020), (9, 1)),
        (SRGB, (2, 2)),
    ],
    ids=["PQ", "HLG", "P3", "Rec.2020", "unspecified"],
)
@pytest.mark.parametrize("kind", ["HEIF", "AVIF"])
def test_nclx(kind: str, pixels: NDArray[np.uint8], points: tuple[int, int]) -> None:
    options: dict[str, Any] = {"quality": -1} if kind == "HEIF" else {"quality": 100, "subsampling": "4:4:4"}
    data = encode(pixels, kind, **options, **({"max_threads": 1} if kind == "AVIF" else {}))
    place = data.index(b"colrnclx") + 8
    assert_same(data[:place] + struct.pack(">HH", *points) + data[place + 4 :], 8.0)


def adobe(space: int | None, index: str | None, kind: str = "JPEG") -> bytes:
    block = exif({} if space is None else {ExifTags.Base.ColorSpace: space})
    if index is not None:
        block.get_ifd(ExifTags.IFD.Exif)[ExifTags.IFD.Interop] = {1: index}
    packed: dict[str, dict[str, Any]] = {"JPEG": {"quality": 98, "subsampling": 0}, "WEBP": {"lossless": True}}
    options = packed.get(kind, {})
    data = encode(coded(gamma(256 / 563), ADOBE), kind, exif=block.tobytes(), **options)
    return data if kind != "TIFF" or index is None else with_interop(data, index)


def with_interop(tiff: bytes, index: str) -> bytes:
    """The TIFF with its interoperability directory, of which Pillow writes the pointer alone."""
    place = tiff.index(struct.pack("<HHI", ExifTags.IFD.Interop, 4, 1)) + 8
    directory = struct.pack("<HHHI4sI", 1, 1, 2, 4, index.encode(), 0)
    return tiff[:place] + struct.pack("<I", len(tiff)) + tiff[place + 4 :] + directory


@pytest.mark.parametrize(
    ("kind", "space", "index"),
    [
        *((kind, 65535, "R03") for kind in ("JPEG", "WEBP", "TIFF")),
        *((kind, 2, None) for kind in ("JPEG", "WEBP", "TIFF")),
    ],
)
def test_adobe_rgb_as_cameras_state_it(kind: str, space: int, index: str | None) -> None:
    assert_same(adobe(space, index, kind))


@pytest.mark.parametrize(("space", "index"), [(1, "R98"), (1, "R03"), (65535, "R98"), (65535, None)])
def test_other_statements_of_cameras_leave_srgb(space: int, index: str | None) -> None:
    with Image.open(BytesIO(adobe(space, index))) as image:
        tags = read_tags(image)
        assert read_color_encoding(image, b"", tags, tags).curve == "srgb"


def test_the_index_of_adobe_rgb_may_stand_alone() -> None:
    assert_same(adobe(None, "R03"))


XMP_SPACES = {  # that XMP names, of a picture without a profile
    "Adobe RGB (1998)": (coded(gamma(256 / 563), ADOBE), {"ICCProfile": "Adobe RGB (1998)"}),
    "Display P3": (coded(srgb_encode, P3), {"ICCProfile": "Display P3"}),
    "sRGB": (SRGB, {"ICCProfile": "sRGB IEC61966-2.1"}),
}


@pytest.mark.parametrize("name", XMP_SPACES)
def test_the_space_that_xmp_alone_names(name: str) -> None:
    pixels, properties = XMP_SPACES[name]
    xmp = packet("http://ns.adobe.com/photoshop/1.0/", properties)
    assert_same(encode(pixels, "WEBP", lossless=True, xmp=xmp))


@pytest.mark.parametrize("space", [1, 2])
def test_the_space_of_xmp_by_its_number(space: int) -> None:
    xmp = packet("http://ns.adobe.com/exif/1.0/", {"ColorSpace": str(space)})
    assert_same(encode(coded(gamma(256 / 563), ADOBE) if space == 2 else SRGB, "WEBP", lossless=True, xmp=xmp))


def test_a_space_that_exif_states_counts_before_xmp() -> None:
    xmp = packet("http://ns.adobe.com/photoshop/1.0/", {"ICCProfile": "Adobe RGB (1998)"})
    block = exif({ExifTags.Base.ColorSpace: 1})
    assert_same(encode(SRGB, "WEBP", lossless=True, xmp=xmp, exif=block.tobytes()))


PROFILES = {  # by what they do, under any name
    "gamma 1.8": (coded(gamma(1 / 1.8)), display_profile("sRGB-elle-V2-g18.icc", SRGB_XYZ, struct.pack(">IH", 1, 461))),
    "linear": (coded(gamma(1.0)), display_profile("sRGB IEC61966-2.1", SRGB_XYZ)),
    "cicp, PQ": (coded(pq, REC2020), display_profile("sRGB", SRGB_XYZ, cicp=bytes((9, 16, 0, 1)))),
    "cicp, HLG": (coded(hlg, REC2020), display_profile("Rec2100 HLG", SRGB_XYZ, cicp=bytes((9, 18, 0, 1)))),
    "cicp of sRGB": (SRGB, display_profile("Wide", WIDE_PRIMARIES, cicp=bytes((1, 13, 0, 1)))),
    "PQ by its curve": (coded(pq), display_profile("sRGB", SRGB_XYZ, curve_table(pq_light))),
    "sRGB": (SRGB, ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()),
}


@pytest.mark.parametrize("name", PROFILES)
def test_profiles(name: str) -> None:
    pixels, profile = PROFILES[name]
    assert_same(encode(pixels, "JPEG", quality=98, subsampling=0, icc_profile=profile), 6.0)


def test_a_profile_of_srgb_changes_no_value() -> None:
    """Not even by rounding."""
    data = encode(SRGB, "PNG", icc_profile=PROFILES["sRGB"][1])
    assert np.array_equal(read_photo(data).pixels, SRGB)


def test_what_is_brighter_than_white_is_clipped() -> None:
    pixels = np.full((48, 64, 3), 230, np.uint8)
    assert (read_photo(png_with(pixels, cicp(9, 16, 0, 1))).pixels == 255).all()


def test_transparent_parts_are_mid_grey_in_any_encoding() -> None:
    rgba = np.zeros((48, 64, 4), np.uint8)
    rgba[24:] = 255
    height, width, _ = rgba.shape
    rows = np.concatenate([np.zeros((height, 1), np.uint8), rgba.reshape(height, -1)], axis=1).tobytes()
    photo = read_photo(png(width, height, rows, gama(1.0), colour=6))
    assert (photo.pixels[:24] == 128).all()
    assert (photo.pixels[24:] == 255).all()


def test_grey_pictures_follow_gama() -> None:
    grey = np.full((48, 64), 55, np.uint8)
    rows = np.concatenate([np.zeros((48, 1), np.uint8), grey], axis=1).tobytes()
    assert read_photo(png(64, 48, rows, gama(1.0))).pixels == pytest.approx(128, abs=1)


def test_linear_values_become_those_of_rec709(tmp_path: Any) -> None:
    (tmp_path / "p3.png").write_bytes(png_with(coded(gamma(1.0), P3), cicp(12, 8, 0, 1)))
    found = read_linear(tmp_path / "p3.png", "linear").pixels
    assert np.abs(found - LINEAR).max() < 0.01
    (tmp_path / "adobe.jpg").write_bytes(adobe(65535, "R03"))
    assert np.abs(read_linear(tmp_path / "adobe.jpg", "srgb").pixels - LINEAR).max() < 0.04


@pytest.mark.parametrize("end", range(8, 60))
def test_a_png_cut_anywhere_has_an_encoding(end: int) -> None:
    with Image.open(BytesIO(PNGS["cICP, P3"])) as image:
        tags = read_tags(image)
        assert read_color_encoding(image, PNGS["cICP, P3"][:end], tags, tags).curve in ("srgb",)

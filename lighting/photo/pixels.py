"""A decoded image's pixels: bit depth and orientation, what its values mean, and how they become upright 8-bit sRGB.

The meaning is a curve and primaries, or an ICC profile. What counts, the first of these that a file has:

1. code points of ITU-T H.273: `cICP` of a PNG [1], the `cicp` tag of an ICC profile [2], which overrides its curves,
   and `nclx` of HEIC and AVIF;
2. an ICC profile, by what it does to colors, whatever its name says;
3. `sRGB`, `gAMA` and `cHRM` of a PNG [1];
4. Adobe RGB as cameras state it: index R03 in the interoperability directory of EXIF [3];
5. the space that XMP names, whose profile a program lost.

Else the values are sRGB. Diffuse white of HDR curves becomes white, as in `lighting.color`; what is brighter is
clipped. HLG holds light of the scene, to which displays apply its OOTF [4]; sRGB holds what displays show. Pillow
converts by profiles in 8 bits alone, so linear values are converted by the matrix of the primaries.

References:
    [1] W3C, Portable Network Graphics (third edition), 11.3.2 and 4.3: the order of its chunks.
    [2] ICC.1:2022, 9.2.17.
    [3] DCF 2.0 (JEITA CP-3461), optional color space.
    [4] Rec. ITU-R BT.2100, table 5, of a display of 1000 cd/m2.
"""

import struct
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from io import BytesIO
from math import ceil
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags, Image

from lighting.color import (
    ADOBE_RGB_CHROMATICITIES,
    ADOBE_RGB_GAMMA,
    DECODE_CURVES,
    H273_CHROMATICITIES,
    Curve,
    chromaticities_to_rec709,
    srgb_bytes,
)
from lighting.errors import PhotoError
from lighting.geometry import Floats
from lighting.photo.containers import decoder_calls
from lighting.photo.tags import EXIF_NAMESPACE, TAG_ERRORS, PhotoTags, read_text

if TYPE_CHECKING:
    from PIL import ImageCms

Pixels = NDArray[np.uint8]

MAX_KEPT_PIXELS = 32_000_000  # of what is returned, so that photos kept large, as a scene's plate, are bounded too

_32_BIT_MODES = ("F", "I")  # Pillow's, whose range no rule tells
_STRIP_PIXELS = 1 << 22  # converted at once
_BITS, _PHOTOMETRIC, _PLANAR = 0x102, 0x106, 0x11C  # tags of a TIFF
_WHITE_IS_ZERO, _PLANES = 0, 2  # what the latter two may say: the order of greys, colours one after another
_MID_GRAY = (128, 128, 128)  # sRGB, behind what is transparent
_UPRIGHT = {  # EXIF orientation: what makes rows and columns (h, w, 3) upright, by views alone
    2: lambda pixels: pixels[:, ::-1],
    3: lambda pixels: pixels[::-1, ::-1],
    4: lambda pixels: pixels[::-1],
    5: lambda pixels: pixels.transpose(1, 0, 2),
    6: lambda pixels: pixels[::-1].transpose(1, 0, 2),
    7: lambda pixels: pixels[::-1, ::-1].transpose(1, 0, 2),
    8: lambda pixels: pixels[:, ::-1].transpose(1, 0, 2),
}
_Curve = float | Curve  # a number is the exponent of value^exponent
_Matrix = NDArray[np.float32]
_H273_CURVES: Mapping[int, _Curve] = {  # by their numbers; SMPTE 240's differs from Rec.709's by three levels
    **dict.fromkeys((1, 6, 7, 11, 14, 15), "rec709"),
    **{4: 2.2, 5: 2.8, 8: 1.0, 13: "srgb", 16: "pq", 17: 2.6, 18: "hlg"},
}
_UNSPECIFIED, _REC2020 = 2, 9  # numbers of H.273, the latter of primaries
_PNG_GAMMAS = (0.25, 1.2)  # of a gAMA that is believed
_SRGB_GAMMA, _LIKE_SRGB = 1 / 2.2, 0.05  # a gAMA that stands for sRGB, and the relative difference up to which it does
_NARROW_BLACK, _NARROW_WHITE = 16, 235  # of 8-bit values that do not use their full range
_SAME = 2e-3  # of a matrix's entries, by which profiles of the same primaries differ
_SAME_LEVELS = 1  # of 255, by which a profile of sRGB may differ from it
_LINEAR_GREY = 180  # the least sRGB level of value 128 where values are linear: 188; usual curves make 128 of it
_HDR_SIGNALS = (128, 148, 178, 204, 230)  # of 255, at which a profile's curve is compared with those of HDR
_HDR_TOLERANCE = 4  # of 255
_HLG_SYSTEM_GAMMA = 1.2
_BT2020_LUMINANCE = np.array([0.2627, 0.6780, 0.0593], dtype=np.float32)
_MAX_KNOWN_PROFILE = 1 << 16  # bytes of a profile that is kept in mind
_SRGB, _ADOBE_RGB, _UNCALIBRATED = 1, 2, 65535  # of EXIF's ColorSpace
_XMP_PROFILE = "http://ns.adobe.com/photoshop/1.0 ICCProfile"  # property: the name of the profile that was embedded
_NAMED_SPACES: Mapping[str, tuple[_Curve, tuple[float, ...]]] = {  # by what their names hold in small letters
    "adobergb": (ADOBE_RGB_GAMMA, ADOBE_RGB_CHROMATICITIES),
    "displayp3": ("srgb", H273_CHROMATICITIES[12]),
    "prophoto": (1.8, (0.7347, 0.2653, 0.1596, 0.8404, 0.0366, 0.0001, 0.3457, 0.3585)),  # ISO 22028-2 (ROMM RGB)
}
_WITH_DCF = ("JPEG", "MPO", "TIFF", "WEBP")  # formats whose EXIF may state the space
_INTEROP_INDEX = 1
_HDR_CURVES: tuple[Literal["pq", "hlg"], ...] = ("pq", "hlg")
_MIN_CONTRAST = 40.0  # gray levels, of 255, between the darkest and the brightest hundredth; photos in fog have more
_SAMPLED_SIDE = 320  # rows or columns of the longer side that are sampled
_PALETTE_SIDE = 112  # the same for a palette
_PALETTE_PARTS = 48  # of a palette, in which its colors are one
_MIN_PALETTE_SPREAD = 25.0  # levels, standard deviation of the colors
_PALETTE_CELL = 0.17  # spreads, side of the cells whose chain is a palette's line
_MIN_CELL_SHARE = 0.97  # of the colors, in the fullest cells
_MAX_PALETTE_RESIDUALS = (  # spreads, and shares of them by which colors are off in all; of 576 photos none has less
    (70.0, 100.0),
    (0.115, 0.3),
)
_ASPECT_TOLERANCE = 0.03  # share by which it may differ from twice as wide as high
_MAX_SEAM_SHARE = 0.6  # of the difference between distant columns, for the first and the last one
_MAX_SEAM_STEPS = 3.0  # times as much as neighbouring columns differ, which count as at least
_MIN_COLUMN_STEP = 2.0  # gray levels
_MAX_POLE_STD = 15.0  # gray levels, along the first row


@dataclass(frozen=True, eq=False, repr=False)
class _ColorEncoding:
    """What values in [0, 1] mean."""

    curve: _Curve = "srgb"
    """From stored values to linear light."""
    to_rec709: _Matrix | None = None
    """(3, 3) from linear values; None: the primaries are Rec.709's."""
    profile: bytes | None = None
    """An ICC profile, which then counts for 8-bit values."""
    full_range: bool = True
    """False: 8-bit values go from 16 to 235."""

    def to_srgb(self) -> Callable[[Image.Image], NDArray[np.uint8]]:
        """A function from pictures in mode L, RGB or CMYK to 8-bit sRGB (h, w, 3), for the parts of one picture."""
        transform = _profile_transform(self.profile) if self.profile else None
        if transform is not None:
            return transform
        if self.curve == "srgb" and self.to_rec709 is None and self.full_range:
            return _as_rgb
        table = _curve_table(self.curve, self.full_range)
        show = _hlg_ootf if self.curve == "hlg" else _unchanged
        return lambda image: srgb_bytes(_rotate_colors(show(table[_as_rgb(image)]), self.to_rec709))


def check_bit_depth(image: Image.Image, *, all_bits: bool = False) -> None:
    """Raise PhotoError for a TIFF whose colors Pillow does not read.

    Args:
        image: a TIFF, opened by Pillow.
        all_bits: whether all bits of its colors are needed, not the high ones alone.
    """
    if image.mode in _32_BIT_MODES:
        raise PhotoError(
            "The TIFF holds 32 bits per colour, or signed ones, whose white is unknown; convert it to 8 or 16 bits."
        )
    if _are_misread(image, all_bits):
        raise PhotoError("The TIFF stores red, green and blue of 16 bits one after another; store them pixel by pixel.")


def _are_misread(image: Any, all_bits: bool) -> bool:
    """Whether a TIFF stores its colors of over 8 bits in planes, of which Pillow reads the high bits if packed."""
    tags = _tiff_tags(image)
    wide = tags.get(_PLANAR) == _PLANES and max(tags.get(_BITS, (8,))) > 8
    return bool(wide and (all_bits or image.tile[0].codec_name == "raw"))


def upright_pixels(
    image: Image.Image, target: int, orientation: int | None, encoding: _ColorEncoding | None = None
) -> Pixels:
    """Pixels (h, w, 3) of the upright picture, up to MAX_KEPT_PIXELS; PhotoError where it is fully transparent.

    Args:
        image: decoded; its pixels are freed, for both would take more memory.
        target: pixels that the longer side keeps at least if it has them.
        orientation: 1 to 8 by EXIF; None: upright.
        encoding: of its colors; None: sRGB.
    """
    pixels = _convert_to_srgb(image, _reduction_factor(*image.size, target), (encoding or _ColorEncoding()).to_srgb())
    image.im = None  # type: ignore[assignment]
    return np.ascontiguousarray(make_upright(pixels, orientation))


def make_upright(pixels: NDArray[Any], orientation: int | None) -> NDArray[Any]:
    """A view of pixels that is rotated as their EXIF orientation says.

    Args:
        pixels: (h, w, C).
        orientation: 1 to 8; None: upright.
    """
    rotate = _UPRIGHT.get(orientation or 1)
    return pixels if rotate is None else rotate(pixels)


def _reduction_factor(width: int, height: int, target: int) -> int:
    """By how much each side is divided."""
    factor = max(1, max(width, height) // target)
    while ceil(width / factor) * ceil(height / factor) > MAX_KEPT_PIXELS:
        factor += 1
    return factor


def _convert_to_srgb(image: Image.Image, factor: int, to_srgb: Callable[[Image.Image], Pixels]) -> Pixels:
    """The picture as sRGB (h, w, 3), each side divided by the factor and rounded up."""
    rows = factor * max(1, _STRIP_PIXELS // (factor * image.width))
    edges = range(0, image.height, rows)
    opaque = False  # whether a pixel is not fully transparent
    out = np.empty((ceil(image.height / factor), ceil(image.width / factor), 3), dtype=np.uint8)
    tags = _tiff_tags(image)
    for top in edges:
        part = image if len(edges) == 1 else image.crop((0, top, image.width, min(top + rows, image.height)))
        small = _to_8_bits(part, tags)
        small = small.reduce(factor) if factor > 1 else small
        opaque = opaque or small.mode != "RGBA" or small.getchannel("A").getextrema() != (0, 0)
        colors = to_srgb(small.convert("RGB") if small.mode == "RGBA" else small)
        if small.mode == "RGBA":
            behind = Image.new("RGB", small.size, _MID_GRAY)
            colors = np.asarray(Image.composite(Image.fromarray(colors), behind, small.getchannel("A")))
        out[top // factor : top // factor + small.height] = colors
    if not opaque:
        raise PhotoError("The photo is fully transparent.")
    return out


def _to_8_bits(image: Image.Image, tags: Mapping[int, Any]) -> Image.Image:
    """The same picture in mode L, RGB, CMYK or RGBA; `tags` are those of `_tiff_tags`."""
    if image.mode.startswith("I"):
        return Image.fromarray((gray_16_bit(image, tags) >> 8).astype(np.uint8))
    with decoder_calls():
        if image.has_transparency_data:
            return image if image.mode == "RGBA" else image.convert("RGBA")
        return image if image.mode in ("L", "RGB", "CMYK") else image.convert("RGB")


def _tiff_tags(image: Image.Image) -> Mapping[int, Any]:
    """A TIFF's tags; none of other pictures."""
    return getattr(image, "tag_v2", {})


def gray_16_bit(image: Image.Image, tags: Mapping[int, Any] | None = None) -> NDArray[np.uint16]:
    """Gray values (h, w) of over 8 bits, black at 0 and white at 65535.

    Pillow would clip them to 8 bits, and passes over a TIFF's 12 bits and over white at 0.

    Args:
        image: of one channel.
        tags: of a TIFF, whose part it may be; None: its own.
    """
    tags = _tiff_tags(image) if tags is None else tags
    values: NDArray[Any] = np.asarray(image).astype(np.uint16)
    if tags.get(_BITS) == (12,):
        values = values << 4 | values >> 8
    return 65535 - values if tags.get(_PHOTOMETRIC) == _WHITE_IS_ZERO else values


# What the values mean, by the file.


def read_color_encoding(image: Image.Image, data: bytes, own: PhotoTags, tags: PhotoTags) -> _ColorEncoding:
    """How a picture's values are coded, by its file. Never raises.

    Args:
        image: opened by Pillow.
        data: of its file.
        own: of the picture itself.
        tags: of the file that it is embedded in; else its own.
    """
    profile = image.info.get("icc_profile")
    for code_points in (_png_code_points(data), _profile_code_points(profile), _nclx_code_points(image)):
        if code_points is not None and (encoding := _by_code_points(*code_points)) is not None:
            return encoding
    read = _by_known_profile if profile and len(profile) <= _MAX_KNOWN_PROFILE else _by_profile
    if profile and (encoding := read(profile)) is not None:
        return encoding
    return _by_png_chunks(image.info) or _by_exif(own, tags) or _by_xmp(image, own, tags)


# Code points.


def _by_code_points(primaries: int, curve: int, full_range: bool) -> _ColorEncoding | None:
    """The encoding of H.273's numbers; None where they say nothing, or a curve that is not known.

    Primaries alone have sRGB's curve, and HDR curves alone have Rec.2020's primaries.
    """
    if curve not in _H273_CURVES and not (curve == _UNSPECIFIED and primaries in H273_CHROMATICITIES):
        return None
    unstated = _REC2020 if _H273_CURVES.get(curve) in _HDR_CURVES else _UNSPECIFIED
    chromaticities = H273_CHROMATICITIES.get(primaries, H273_CHROMATICITIES.get(unstated))
    matrix = None if chromaticities is None else chromaticities_to_rec709(chromaticities)
    return _ColorEncoding(_H273_CURVES.get(curve, "srgb"), matrix, full_range=full_range)


def _png_code_points(data: bytes) -> tuple[int, int, bool] | None:
    """Primaries, curve and range of a PNG's `cICP`, which stands before its pixels and palette."""
    if not data.startswith(b"\x89PNG\r\n\x1a\n"):
        return None
    position = 8
    while position + 12 <= len(data):
        length, kind = struct.unpack_from(">I4s", data, position)
        if kind in (b"IDAT", b"PLTE", b"IEND"):
            return None
        if kind == b"cICP" and length >= 4 and position + 12 <= len(data):
            primaries, curve, _matrix, full = data[position + 8 : position + 12]
            return primaries, curve, full != 0
        position += 12 + length
    return None


def _profile_code_points(profile: bytes | None) -> tuple[int, int, bool] | None:
    """The same of an ICC profile's `cicp` tag."""
    if not profile or len(profile) < 132:
        return None
    (count,) = struct.unpack_from(">I", profile, 128)
    for place in range(132, min(len(profile) - 11, 132 + 12 * min(count, 100)), 12):
        tag, start, size = struct.unpack_from(">4sII", profile, place)
        if tag == b"cicp" and size >= 12 and profile[start : start + 4] == b"cicp" and start + 12 <= len(profile):
            return profile[start + 8], profile[start + 9], True
    return None


def _nclx_code_points(image: Image.Image) -> tuple[int, int, bool] | None:
    """The same of HEIC and AVIF, whose decoders have undone the matrix and the range."""
    nclx = image.info.get("nclx_profile")
    return (nclx["color_primaries"], nclx["transfer_characteristics"], True) if nclx else None


# Chunks of a PNG, and EXIF.


def _by_png_chunks(info: Mapping[str | tuple[int, int], Any]) -> _ColorEncoding | None:
    if "srgb" in info or not ("gamma" in info or "chromaticity" in info):
        return None
    gamma = float(info.get("gamma", _SRGB_GAMMA))
    like_srgb = abs(gamma / _SRGB_GAMMA - 1) < _LIKE_SRGB or not _PNG_GAMMAS[0] <= gamma <= _PNG_GAMMAS[1]
    try:
        white, *primaries = np.reshape(info["chromaticity"], (4, 2)).tolist()
        matrix = chromaticities_to_rec709([value for xy in (*primaries, white) for value in xy])
    except (KeyError, ValueError, ArithmeticError):
        matrix = None
    return _ColorEncoding("srgb" if like_srgb else 1 / gamma, matrix)


def _by_exif(*sources: PhotoTags) -> _ColorEncoding | None:
    """Adobe RGB where EXIF states it, of the picture itself or of the file that it is embedded in."""
    for source in sources:
        if source.format not in _WITH_DCF:
            continue
        space, index = source.camera.get(ExifTags.Base.ColorSpace), None
        with suppress(*TAG_ERRORS):
            index = read_text(source.interoperability[_INTEROP_INDEX])
        if space == _ADOBE_RGB or (space in (_UNCALIBRATED, None) and index == "R03"):
            return _ColorEncoding(ADOBE_RGB_GAMMA, chromaticities_to_rec709(ADOBE_RGB_CHROMATICITIES))
        if space is not None:
            return _ColorEncoding() if space == _SRGB else None
    return None


# XMP.


def _by_xmp(image: Image.Image, own: PhotoTags, tags: PhotoTags) -> _ColorEncoding:
    """The space that XMP states or whose profile it names, where neither PNG nor XMP states sRGB; else sRGB."""
    xmp = {**tags.xmp, **own.xmp}
    space = xmp.get(f"{EXIF_NAMESPACE} ColorSpace")
    if "srgb" in image.info or space == str(_SRGB):
        return _ColorEncoding()
    name = "adobergb" if space == str(_ADOBE_RGB) else xmp.get(_XMP_PROFILE, "")
    letters = "".join(filter(str.isalnum, name.lower()))
    for key, (curve, chromaticities) in _NAMED_SPACES.items():
        if key in letters:
            return _ColorEncoding(curve, chromaticities_to_rec709(chromaticities))
    return _ColorEncoding()


# ICC profiles.


def _by_profile(profile: bytes) -> _ColorEncoding | None:
    """The encoding that an ICC profile describes; None for what is none."""
    icc = _open_profile(profile)
    if icc is None:
        return None
    if _is_srgb(icc):
        return _ColorEncoding()
    matrix = _profile_to_rec709(profile)
    curve = _hdr_curve(profile)
    return _ColorEncoding(curve, matrix) if curve else _ColorEncoding(to_rec709=matrix, profile=profile)


_by_known_profile = lru_cache(maxsize=16)(_by_profile)  # most photos have one of few, and asking lcms takes 4 ms


def _open_profile(profile: bytes) -> "ImageCms.ImageCmsProfile | None":
    from PIL import ImageCms  # which a photo without a profile is spared

    try:
        return ImageCms.ImageCmsProfile(BytesIO(profile))
    except Exception:  # a bad profile must not reject a photo
        return None


@lru_cache(maxsize=1)
def _srgb_profile() -> "ImageCms.ImageCmsProfile":
    from PIL import ImageCms

    return ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB"))


def _profile_to_rec709(profile: bytes | None) -> _Matrix | None:
    """The matrix (3, 3) from an ICC profile's primaries to Rec.709's; None where they are the same or unknown.

    Args:
        profile: bytes of an ICC profile, damaged ones too; None: no profile.
    """
    icc = _open_profile(profile or b"")
    primaries, srgb = _to_xyz(icc.profile) if icc else None, _to_xyz(_srgb_profile().profile)
    if primaries is None or srgb is None:  # a bad profile, or one of tables
        return None
    matrix = np.linalg.solve(srgb, primaries)
    unfit = not np.isfinite(matrix).all() or np.allclose(matrix, np.eye(3), rtol=0.0, atol=_SAME)
    return None if unfit else np.asarray(matrix, dtype=np.float32)


def _to_xyz(profile: Any) -> NDArray[np.float64] | None:
    """The matrix (3, 3) from linear red, green and blue to XYZ under D50, to which profiles adapt their white.

    None where a profile has none.
    """
    colorants = profile.red_colorant, profile.green_colorant, profile.blue_colorant
    return None if None in colorants else np.array([colorant[0] for colorant in colorants]).T


def is_gamma_encoded(header: Image.Image) -> bool:
    """Whether an opened picture's header says that its values are coded by a curve.

    Args:
        header: of a PNG, TIFF or JPEG, opened by Pillow.
    """
    gamma = header.info.get("gamma")
    if "srgb" in header.info or (gamma is not None and not 0.9 <= float(gamma) <= 1.1):
        return True
    shown = _shown_greys(header.info.get("icc_profile"), (128,))
    return shown is not None and bool(shown[0] < _LINEAR_GREY)


def _shown_greys(profile: bytes | None, greys: tuple[int, ...]) -> NDArray[np.uint8] | None:
    """The sRGB levels (N,) of some greys by an ICC profile; None where it tells none."""
    icc, picture = _open_profile(profile or b""), Image.fromarray(np.array(greys, dtype=np.uint8)[None])
    for mode in ("RGB", "L"):
        if icc and (convert := _build_transform(icc, mode)):
            return convert(picture.convert(mode))[0, :, 1]
    return None


def _hdr_curve(profile: bytes) -> Literal["pq", "hlg"] | None:
    """The HDR curve that a profile has, which states none by a tag; its largest value then has the peak's light."""
    shown = _shown_greys(profile, _HDR_SIGNALS)
    if shown is None:
        return None
    signals = np.array(_HDR_SIGNALS) / 255.0
    for name in _HDR_CURVES:
        decode = DECODE_CURVES[name]
        expected = srgb_bytes(decode(signals) / decode(np.ones(1)))
        if np.abs(shown.astype(int) - expected).max() <= _HDR_TOLERANCE:
            return name
    return None


def _profile_transform(profile: bytes) -> Callable[[Image.Image], NDArray[np.uint8]] | None:
    """A function as of `to_srgb` by a profile; None for what is none."""
    icc = _open_profile(profile)
    if icc is None:
        return None
    transforms: dict[str, Callable[[Image.Image], NDArray[np.uint8]]] = {}

    def convert(image: Image.Image) -> NDArray[np.uint8]:
        if image.mode not in transforms:
            transforms[image.mode] = _build_transform(icc, image.mode) or _as_rgb
        return transforms[image.mode](image)

    return convert


def _build_transform(icc: "ImageCms.ImageCmsProfile", mode: str) -> Callable[[Image.Image], NDArray[np.uint8]] | None:
    """A function of pictures in a mode; None for a profile of another's, as of RGB for a gray picture."""
    from PIL import ImageCms

    try:
        transform = ImageCms.buildTransform(icc, _srgb_profile(), mode, "RGB")
    except Exception:  # a bad profile must not reject a photo
        return None
    return lambda image: np.asarray(ImageCms.applyTransform(image, transform))


def _is_srgb(icc: "ImageCms.ImageCmsProfile") -> bool:
    """Whether a profile makes sRGB's colors of values, whatever its name says."""
    samples, convert = _sample_colors(), _build_transform(icc, "RGB")
    if convert is None:
        return False
    return bool(np.abs(convert(Image.fromarray(samples)).astype(int) - samples).max() <= _SAME_LEVELS)


@lru_cache(maxsize=1)
def _sample_colors() -> NDArray[np.uint8]:
    """Colors (1, N, 3) that tell profiles apart: greys, primaries and what lies between."""
    levels = np.arange(0, 256, 51, dtype=np.uint8)
    cube = np.stack(np.meshgrid(levels, levels, levels, indexing="ij"), axis=-1).reshape(1, -1, 3)
    greys = np.repeat(np.arange(0, 256, 5, dtype=np.uint8)[None, :, None], 3, axis=-1)
    return np.concatenate([cube, greys], axis=1)


# Curves.


@lru_cache(maxsize=8)
def _curve_table(curve: _Curve, full_range: bool) -> NDArray[np.float32]:
    """Linear values (256,) of 8-bit ones, 1 at diffuse white."""
    levels = np.arange(256) / 255.0
    if not full_range:
        levels = np.clip((np.arange(256) - _NARROW_BLACK) / (_NARROW_WHITE - _NARROW_BLACK), 0.0, 1.0)
    if isinstance(curve, float):
        return np.asarray(levels**curve, dtype=np.float32)
    return np.asarray(DECODE_CURVES[curve](levels), dtype=np.float32)


def _hlg_ootf(scene: NDArray[np.float32]) -> NDArray[np.float32]:
    """Light that a display shows, 1 at diffuse white, of HLG's light of a scene (..., 3), 1 there as well."""
    return scene * (scene @ _BT2020_LUMINANCE)[..., None] ** np.float32(_HLG_SYSTEM_GAMMA - 1)


def _unchanged(linear: NDArray[np.float32]) -> NDArray[np.float32]:
    return linear


def _rotate_colors(linear: NDArray[np.float32], matrix: _Matrix | None) -> NDArray[np.float32]:
    return linear if matrix is None else linear @ matrix.T


def _as_rgb(image: Image.Image) -> NDArray[np.uint8]:
    return np.asarray(image if image.mode == "RGB" else image.convert("RGB"))


# A panorama is closed at its sides, and its first row shows one direction.


# What a network does not see: a frame without contrast is far from all that it learnt, and crops of panoramas are
# what it learnt from.


def is_blank(pixels: Pixels) -> bool:
    """Whether a photo has next to no contrast: a black, blank or blown-out frame.

    Args:
        pixels: (h, w, 3) sRGB.
    """
    step = -(-max(pixels.shape[:2]) // _SAMPLED_SIDE)
    red, green, blue = np.moveaxis(pixels[::step, ::step], 2, 0)
    cumulative = np.bincount((np.add(red, green, dtype=np.uint16) + blue).ravel()).cumsum()  # by red + green + blue
    edge = cumulative[-1] // 100
    darkest, brightest = np.searchsorted(cumulative, (edge, cumulative[-1] - 1 - edge), side="right")
    return bool(brightest - darkest < 3 * _MIN_CONTRAST)


def is_panorama(pixels: Pixels) -> bool:
    """Whether a picture shows all directions: twice as wide as high, closed at the sides, one color on top.

    It finds 90 % of the panoramas that the network was trained on; of other photos cut to that shape, 0.1 %.

    Args:
        pixels: (h, w, 3) sRGB.
    """
    height, width = pixels.shape[:2]
    if abs(width / (2 * height) - 1) > _ASPECT_TOLERANCE or width < 8:
        return False
    step = max(1, width // _SAMPLED_SIDE // 2)
    rows = pixels[::step].astype(np.float64)
    distant = _difference(rows, (0, 0, 0), (width // 4, width // 2, width - width // 4))
    seam, neighbour = _difference(rows, (0,), (-1,)), _difference(rows, (0, -1), (1, -2))
    closed = seam < _MAX_SEAM_SHARE * distant and seam < _MAX_SEAM_STEPS * max(neighbour, _MIN_COLUMN_STEP)
    return closed and float(pixels[0].std(axis=0).mean()) < _MAX_POLE_STD


def _difference(rows: Floats, first: Sequence[int], second: Sequence[int]) -> float:
    """The mean difference between columns of pixels (h, w, 3)."""
    return float(np.abs(rows[:, list(first)] - rows[:, list(second)]).mean())


def is_false_color(pixels: Pixels) -> bool:
    """Whether all colors lie on one line of a palette, as thermal cameras show temperatures.

    Along hue, or along brightness, the colors of each part of a palette are one; and all lie near the longest path
    through their minimum spanning tree. Colors of photos spread less, and branch off.

    Args:
        pixels: (h, w, 3) sRGB.
    """
    step = -(-max(pixels.shape[:2]) // _PALETTE_SIDE)
    height, width = (side // step for side in pixels.shape[:2])
    if height * width < 4 * _PALETTE_PARTS:
        return False
    rows = pixels[: height * step, : width * step].reshape(height, step, -1).sum(axis=1, dtype=np.uint32)
    columns = rows.reshape(height, width, step, 3)
    blocks = sum((columns[:, :, i] for i in range(1, step)), columns[:, :, 0]) / step**2  # along a short axis
    red, green, blue = np.moveaxis(blocks.reshape(-1, 3), 1, 0)
    gray, colors = 0.3 * red + 0.6 * green + 0.1 * blue, np.stack([red - green, 0.5 * (red + green) - blue], axis=1)
    spread = float(np.hypot(*colors.std(axis=0)))
    if spread < _MIN_PALETTE_SPREAD:
        return False
    hue = np.arctan2(colors[:, 1], colors[:, 0])
    values, limit = np.column_stack([gray, colors]), spread * float(np.interp(spread, *_MAX_PALETTE_RESIDUALS))
    residual = min(_palette_residual(position, values) for position in (hue, gray))
    return residual < limit and residual + _path_residual(values, _PALETTE_CELL * spread) < limit


def _palette_residual(position: Floats, colors: Floats) -> float:
    """How far colors (N, 3), in parts by their position (N,) on a palette, lie from the middle one of their part."""
    size = len(position) // _PALETTE_PARTS
    parts = colors[np.argsort(position)[: size * _PALETTE_PARTS]].reshape(_PALETTE_PARTS, size, 3)
    return float(_middle(np.linalg.norm(parts - _middle(parts)[:, None], axis=2)).mean())


def _path_residual(colors: Floats, cell: float) -> float:
    """How far colors (N, 3), in cells [levels], lie from the longest path of their minimum spanning tree: the mean."""
    cells, counts = np.unique(np.floor(colors / cell), axis=0, return_counts=True)
    order = np.argsort(-counts, kind="stable")
    kept = order[: int(np.searchsorted(np.cumsum(counts[order]), _MIN_CELL_SHARE * len(colors))) + 1]
    cells, counts = cell * cells[kept], counts[kept]
    distances = np.sqrt(np.square(cells[:, None] - cells).sum(axis=2))
    nearest, parents = distances[0].copy(), np.zeros(len(cells), dtype=np.intp)
    is_free = np.arange(len(cells)) > 0
    to_all = np.zeros_like(distances)  # along the tree, by Prim's algorithm
    tree = [0]
    while is_free.any():
        new = int(np.where(is_free, nearest, np.inf).argmin())
        to_all[new, tree] = to_all[tree, new] = to_all[parents[new], tree] + distances[new, parents[new]]
        tree.append(new)
        is_free[new] = False
        closer = is_free & (distances[new] < nearest)
        nearest[closer], parents[closer] = distances[new, closer], new
    first, last = np.unravel_index(int(to_all.argmax()), to_all.shape)
    on_path = to_all[first] + to_all[last] <= to_all[first, last] + 1e-6
    return float(np.average(distances[:, on_path].min(axis=1), weights=counts))


def _middle(values: Floats) -> Floats:
    """The median along axis 1, for which NumPy's own function would import masked arrays."""
    ordered, size = np.sort(values, axis=1), values.shape[1]
    return np.asarray((ordered[:, (size - 1) // 2] + ordered[:, size // 2]) / 2)

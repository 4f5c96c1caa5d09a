"""What the values of a decoded picture mean, by its file: the encoding that makes them sRGB.

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
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from io import BytesIO
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
from lighting.photo.containers import png_chunks
from lighting.photo.tags import EXIF_NAMESPACE, PhotoTags, text_or_empty

if TYPE_CHECKING:
    from PIL import ImageCms

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


@dataclass(frozen=True, eq=False, repr=False)
class ColorEncoding:
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
        if self.profile and (icc := _open_profile(self.profile)) is not None:
            by_mode = cache(lambda mode: _build_transform(icc, mode) or _as_rgb)
            return lambda image: by_mode(image.mode)(image)
        if self.curve == "srgb" and self.to_rec709 is None and self.full_range:
            return _as_rgb
        table = _curve_table(self.curve, self.full_range)

        def convert(image: Image.Image) -> NDArray[np.uint8]:
            linear = table[_as_rgb(image)]
            if self.curve == "hlg":  # from light of a scene to what a display shows, both 1 at diffuse white
                linear = linear * (linear @ _BT2020_LUMINANCE)[..., None] ** np.float32(_HLG_SYSTEM_GAMMA - 1)
            return srgb_bytes(linear if self.to_rec709 is None else linear @ self.to_rec709.T)

        return convert


def read_color_encoding(image: Image.Image, data: bytes, own: PhotoTags, tags: PhotoTags) -> ColorEncoding:
    """How a picture's values are coded, by its file. Never raises.

    Args:
        image: opened by Pillow.
        data: of its file.
        own: of the picture itself.
        tags: of the file that it is embedded in; else its own.
    """
    profile, nclx = image.info.get("icc_profile"), image.info.get("nclx_profile")
    of_heif = (nclx["color_primaries"], nclx["transfer_characteristics"], True) if nclx else None  # the range is undone
    for code_points in (_png_code_points(data), _profile_code_points(profile), of_heif):
        if code_points is not None and (encoding := _by_code_points(*code_points)) is not None:
            return encoding
    read = _by_known_profile if profile and len(profile) <= _MAX_KNOWN_PROFILE else _by_profile
    if profile and (encoding := read(profile)) is not None:
        return encoding
    return _by_png_chunks(image.info) or _by_exif(own, tags) or _by_xmp(image, own, tags)


# Code points.


def _by_code_points(primaries: int, curve: int, full_range: bool) -> ColorEncoding | None:
    """The encoding of H.273's numbers; None where they say nothing, or a curve that is not known.

    Primaries alone have sRGB's curve, and HDR curves alone have Rec.2020's primaries.
    """
    if curve not in _H273_CURVES and not (curve == _UNSPECIFIED and primaries in H273_CHROMATICITIES):
        return None
    unstated = _REC2020 if _H273_CURVES.get(curve) in _HDR_CURVES else _UNSPECIFIED
    chromaticities = H273_CHROMATICITIES.get(primaries, H273_CHROMATICITIES.get(unstated))
    matrix = None if chromaticities is None else chromaticities_to_rec709(chromaticities)
    return ColorEncoding(_H273_CURVES.get(curve, "srgb"), matrix, full_range=full_range)


def _png_code_points(data: bytes) -> tuple[int, int, bool] | None:
    """Primaries, curve and range of a PNG's `cICP`, which stands before its pixels and palette."""
    for kind, start, length in png_chunks(data):
        if kind in (b"IDAT", b"PLTE", b"IEND"):
            break
        if kind == b"cICP" and length >= 4 and start + 4 <= len(data):
            primaries, curve, _matrix, full = data[start : start + 4]
            return primaries, curve, full != 0
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


# Chunks of a PNG, and EXIF.


def _by_png_chunks(info: Mapping[str | tuple[int, int], Any]) -> ColorEncoding | None:
    if "srgb" in info or not ("gamma" in info or "chromaticity" in info):
        return None
    gamma = float(info.get("gamma", _SRGB_GAMMA))
    like_srgb = abs(gamma / _SRGB_GAMMA - 1) < _LIKE_SRGB or not _PNG_GAMMAS[0] <= gamma <= _PNG_GAMMAS[1]
    try:
        white, *primaries = np.reshape(info["chromaticity"], (4, 2)).tolist()
        matrix = chromaticities_to_rec709([value for xy in (*primaries, white) for value in xy])
    except (KeyError, ValueError, ArithmeticError):
        matrix = None
    return ColorEncoding("srgb" if like_srgb else 1 / gamma, matrix)


def _by_exif(*sources: PhotoTags) -> ColorEncoding | None:
    """Adobe RGB where EXIF states it, of the picture itself or of the file that it is embedded in."""
    for source in sources:
        if source.format not in _WITH_DCF:
            continue
        space = source.camera.get(ExifTags.Base.ColorSpace)
        index = text_or_empty(source.interoperability.get(_INTEROP_INDEX))
        if space == _ADOBE_RGB or (space in (_UNCALIBRATED, None) and index == "R03"):
            return ColorEncoding(ADOBE_RGB_GAMMA, chromaticities_to_rec709(ADOBE_RGB_CHROMATICITIES))
        if space is not None:
            return ColorEncoding() if space == _SRGB else None
    return None


# XMP.


def _by_xmp(image: Image.Image, own: PhotoTags, tags: PhotoTags) -> ColorEncoding:
    """The space that XMP states or whose profile it names, where neither PNG nor XMP states sRGB; else sRGB."""
    xmp = {**tags.xmp, **own.xmp}
    space = xmp.get(f"{EXIF_NAMESPACE} ColorSpace")
    if "srgb" in image.info or space == str(_SRGB):
        return ColorEncoding()
    name = "adobergb" if space == str(_ADOBE_RGB) else xmp.get(_XMP_PROFILE, "")
    letters = "".join(filter(str.isalnum, name.lower()))
    for key, (curve, chromaticities) in _NAMED_SPACES.items():
        if key in letters:
            return ColorEncoding(curve, chromaticities_to_rec709(chromaticities))
    return ColorEncoding()


# ICC profiles.


def _by_profile(profile: bytes) -> ColorEncoding | None:
    """The encoding that an ICC profile describes; None for what is none."""
    icc = _open_profile(profile)
    if icc is None:
        return None
    if _is_srgb(icc):
        return ColorEncoding()
    matrix, curve = _profile_to_rec709(icc), _hdr_curve(icc)
    return ColorEncoding(curve, matrix) if curve else ColorEncoding(to_rec709=matrix, profile=profile)


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


def _profile_to_rec709(icc: "ImageCms.ImageCmsProfile") -> _Matrix | None:
    """The matrix (3, 3) from an ICC profile's primaries to Rec.709's; None where they are the same or unknown."""
    primaries, srgb = _to_xyz(icc.profile), _to_xyz(_srgb_profile().profile)
    if primaries is None or srgb is None:  # a profile of tables
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
    icc = _open_profile(header.info.get("icc_profile") or b"")
    shown = None if icc is None else _shown_greys(icc, (128,))
    return shown is not None and bool(shown[0] < _LINEAR_GREY)


def _shown_greys(icc: "ImageCms.ImageCmsProfile", greys: tuple[int, ...]) -> NDArray[np.uint8] | None:
    """The sRGB levels (N,) of some grays by an ICC profile; None where it tells none."""
    picture = Image.fromarray(np.array(greys, dtype=np.uint8)[None])
    for mode in ("RGB", "L"):
        if convert := _build_transform(icc, mode):
            return convert(picture.convert(mode))[0, :, 1]
    return None


def _hdr_curve(icc: "ImageCms.ImageCmsProfile") -> Literal["pq", "hlg"] | None:
    """The HDR curve that a profile has, which states none by a tag; its largest value then has the peak's light."""
    shown = _shown_greys(icc, _HDR_SIGNALS)
    if shown is None:
        return None
    signals = np.array(_HDR_SIGNALS) / 255.0
    for name in _HDR_CURVES:
        decode = DECODE_CURVES[name]
        expected = srgb_bytes(decode(signals) / decode(np.ones(1)))
        if np.abs(shown.astype(int) - expected).max() <= _HDR_TOLERANCE:
            return name
    return None


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
    convert = _build_transform(icc, "RGB")
    if convert is None:
        return False
    levels = np.arange(0, 256, 51, dtype=np.uint8)
    cube = np.stack(np.meshgrid(levels, levels, levels, indexing="ij"), axis=-1).reshape(1, -1, 3)
    greys = np.repeat(np.arange(0, 256, 5, dtype=np.uint8)[None, :, None], 3, axis=-1)
    samples = np.concatenate([cube, greys], axis=1)  # which tell profiles apart
    return bool(np.abs(convert(Image.fromarray(samples)).astype(int) - samples).max() <= _SAME_LEVELS)


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


def _as_rgb(image: Image.Image) -> NDArray[np.uint8]:
    return np.asarray(image if image.mode == "RGB" else image.convert("RGB"))

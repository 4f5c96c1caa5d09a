"""What a photo's file says of its lens; all of it is hostile input.

The lens is by its focal length in 35 mm terms or by its sensor, and what a crop left of its view. A crop that the file
tells has a longer lens: of Lightroom's crops the diagonal counts, which a turn leaves as it is. Where the file leaves
open what was cropped, each lens is a candidate, and the pixels choose. Panoramas have none.
"""

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product

from PIL import ExifTags

from lighting.geometry import zoomed_fov
from lighting.photo.tags import EXIF_NAMESPACE, TAG_ERRORS, Tags, read_first_number, read_make, read_xmp_number

FULL_FRAME_DIAGONAL = math.hypot(36.0, 24.0)  # mm, to which 35 mm equivalents refer

_VERTICAL_FOV = (5.0, 120.0)  # deg, what an ordinary lens covers; values outside are clamped
_SAME_ASPECT = 0.02  # relative difference up to which a picture counts as uncropped
_CAMERA_RAW = "http://ns.adobe.com/camera-raw-settings/1.0"
_GPANO = "http://ns.google.com/photos/1.0/panorama"
_UNITS = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}  # mm, of resolutions on the focal plane
_SENSOR_DIAGONALS = (3.0, 90.0)  # mm, from phones to backs of medium format
_CROP_FACTORS = (0.4, 13.0)  # of the same; a 35 mm value over a focal length that is none of them is damage
_MIN_ZOOM = 1.02  # of a digital zoom that was used
_MAX_FRAME_ASPECT = 2.45  # longer by shorter side of what a camera takes at once: phones' 21:9 have 2.33
_MIN_PANORAMA_ASPECT = 2.8  # of what a camera writes of several frames; cameras crop to 65:24 at most
_APPLE_PANORAMA = 6  # EXIF's CustomRendered, by Apple's cameras
_MAX_VIEW = 100.0  # deg, horizontal field of view up to which a cylinder or sphere is about a plane
_SENSOR_ASPECTS = (4 / 3, 3 / 2, 16 / 9)  # longer by shorter side
_CENTERED = 0.02  # of a side, by which a crop's middle may differ from the photo's


@dataclass(frozen=True, eq=False, repr=False)
class PhotoLens:
    """What a photo's file says of its lens and of its frame."""

    focal_length: float | None = None
    """Millimeters, of the 36 x 24 mm camera with the same diagonal field of view."""
    vertical_fovs: tuple[float, ...] = ()
    """Deg, of the upright photo, those that it may have, the likeliest first."""
    is_consistent: bool = False
    """Whether focal length and 35 mm value, or sensor, agree."""
    is_whole: bool = True
    """Whether the photo shows the whole frame or its middle, for what is known of the tilt."""
    turn: float = 0.0
    """Deg, by which the camera's roll is more than that of the sensor's measurement."""
    is_panorama: bool = False
    """Of several frames."""


@dataclass(frozen=True, eq=False, repr=False)
class PhotoFrame:
    """A photo's sizes in pixels."""

    width: int
    """Of the upright photo."""
    height: int
    """Rows, pixels."""
    is_turned: bool
    """Whether its rows are the columns of the stored picture."""
    is_inside: bool = False
    """Whether it lies inside a border, so that the stored picture is larger."""


def vertical_fov_from_focal_length(focal_length: float, width: float, height: float) -> float:
    """Vertical field of view of an upright photo in deg, clamped to 5 to 120.

    By the diagonal: the lens covers the photo's diagonal as one of that focal length covers that of 36 x 24 mm.

    Args:
        focal_length: mm, in 35 mm terms.
        width: of the upright photo, pixels.
        height: of the upright photo, pixels.
    """
    half_height = 0.5 * FULL_FRAME_DIAGONAL * height / math.hypot(width, height)
    return _clamp(math.degrees(2 * math.atan2(half_height, focal_length)))


def _clamp(fov: float) -> float:
    low, high = _VERTICAL_FOV
    return min(max(fov, low), high)


def read_lens(main: Tags, camera: Tags, xmp: Mapping[str, str], frame: PhotoFrame) -> PhotoLens:
    """The lens of a photo by its file.

    Args:
        main: tags of EXIF's main directory.
        camera: tags of EXIF's directory of the camera.
        xmp: properties by "namespace name".
        frame: the photo's sizes.
    """
    equivalent, is_consistent = _equivalent(camera, xmp)
    if (view := _panorama_view(xmp)) is not None:
        across, along = view
        narrow = () if across > _MAX_VIEW else (_clamp(along),)
        return PhotoLens(equivalent, narrow, is_consistent=True, is_whole=False, is_panorama=across > _MAX_VIEW)
    is_apple = read_make(main) == "apple"
    if is_apple and camera.get(ExifTags.Base.CustomRendered) == _APPLE_PANORAMA:
        return PhotoLens(equivalent, is_whole=False, is_panorama=True)
    recorded = _recorded_size(camera, xmp)
    if recorded and frame.is_turned:
        recorded = recorded[::-1]
    fits = _fits(recorded, frame)
    if max(frame.width, frame.height) > _MAX_FRAME_ASPECT * min(frame.width, frame.height):
        is_written_so = recorded is not None and max(recorded) > _MIN_PANORAMA_ASPECT * min(recorded)
        is_panorama = is_written_so and fits is not False and not frame.is_inside
        return PhotoLens(equivalent, is_whole=False, is_panorama=is_panorama)
    crop = _developed_crop(xmp)
    if equivalent is None:
        return PhotoLens(is_whole=fits is not False and crop.is_centered, turn=crop.turn)
    zoom = _positive(camera, xmp, ExifTags.Base.DigitalZoomRatio, "DigitalZoomRatio") or 1.0
    digital_zooms = (1.0,) if zoom < _MIN_ZOOM or is_apple else (1.0, zoom)  # Apple's 35 mm value holds it already
    lengths = [equivalent * cut * digital for cut, digital in product(crop.zooms(frame), digital_zooms)]
    fovs = tuple(fov for length in lengths for fov in _possible_fovs(length, recorded, frame))
    return PhotoLens(
        equivalent, tuple(dict.fromkeys(fovs)), is_consistent, fits is not False and crop.is_centered, crop.turn
    )


# The focal length in 35 mm terms.


def _equivalent(camera: Tags, xmp: Mapping[str, str]) -> tuple[float | None, bool]:
    """The focal length in 35 mm terms, and whether what else the file says agrees with it."""
    length = _positive(camera, xmp, ExifTags.Base.FocalLength, "FocalLength")
    equivalent = _positive(camera, xmp, ExifTags.Base.FocalLengthIn35mmFilm, "FocalLengthIn35mmFilm")
    zoom = _positive(camera, xmp, ExifTags.Base.DigitalZoomRatio, "DigitalZoomRatio") or 1.0
    if equivalent is not None:
        factor = equivalent / length / max(zoom, 1.0) if length else 0.0
        return equivalent, _CROP_FACTORS[0] <= factor <= _CROP_FACTORS[1]
    diagonal = _sensor_diagonal(camera, xmp)
    if length is None or diagonal is None:
        return None, False
    return length * FULL_FRAME_DIAGONAL / diagonal, True


def _sensor_diagonal(camera: Tags, xmp: Mapping[str, str]) -> float | None:
    """The sensor's diagonal [mm] by its resolution on the focal plane; None for what no camera has."""
    base = ExifTags.Base
    across = _positive(camera, xmp, base.FocalPlaneXResolution, "FocalPlaneXResolution")
    along = _positive(camera, xmp, base.FocalPlaneYResolution, "FocalPlaneYResolution") or across
    unit = _positive(camera, xmp, base.FocalPlaneResolutionUnit, "FocalPlaneResolutionUnit") or 2
    size = _recorded_size(camera, xmp)
    if size is None or across is None or along is None:
        return None
    diagonal = _UNITS.get(int(unit), _UNITS[2]) * math.hypot(size[0] / across, size[1] / along)
    return diagonal if _SENSOR_DIAGONALS[0] <= diagonal <= _SENSOR_DIAGONALS[1] else None


def _positive(camera: Tags, xmp: Mapping[str, str], tag: int, name: str) -> float | None:
    """A number over 0 by EXIF, or else by XMP."""
    number = None
    with suppress(*TAG_ERRORS):
        number = read_first_number(camera[tag])
    if number is None:
        with suppress(*TAG_ERRORS):
            number = read_xmp_number(xmp[f"{EXIF_NAMESPACE} {name}"])
    return number if number is not None and number > 0 else None


# What a crop left of the frame.


def _recorded_size(camera: Tags, xmp: Mapping[str, str]) -> tuple[float, float] | None:
    """Width and height of what the camera wrote, in pixels; None where that is unknown."""
    width = _positive(camera, xmp, ExifTags.Base.ExifImageWidth, "PixelXDimension")
    height = _positive(camera, xmp, ExifTags.Base.ExifImageHeight, "PixelYDimension")
    return None if width is None or height is None else (width, height)


def _fits(recorded: tuple[float, float] | None, frame: PhotoFrame) -> bool | None:
    """Whether a photo has the shape that the camera wrote; None where it has it when turned by a quarter."""
    if recorded is None:
        return True
    shape, whole = math.log(frame.width / frame.height), math.log(recorded[0] / recorded[1])
    if abs(shape - whole) < _SAME_ASPECT:
        return True
    return None if abs(shape + whole) < _SAME_ASPECT else False


def _possible_fovs(length: float, recorded: tuple[float, float] | None, frame: PhotoFrame) -> tuple[float, ...]:
    """The vertical fields of view that a photo may have by a focal length [mm, in 35 mm terms] of the whole frame."""
    whole = vertical_fov_from_focal_length(length, frame.width, frame.height)
    fits = _fits(recorded, frame)
    if fits or recorded is None or frame.is_inside:
        return (whole,)
    width, height = recorded
    in_recorded = vertical_fov_from_focal_length(length, width, height)
    if fits is None and (frame.width, frame.height) == (height, width):
        return (whole,)  # a program turned the pixels
    if frame.height == height or frame.width == width:  # cut, and not resized
        return (_clamp(zoomed_fov(in_recorded, height / frame.height)),)
    if fits is None:  # turned, or cut to the frame's full height or width
        scale = min(width / frame.width, height / frame.height)
        return (whole, _clamp(zoomed_fov(in_recorded, height / (scale * frame.height))))
    return ()


@dataclass(frozen=True, eq=False, repr=False)
class _Crop:
    """A crop that a raw developer made, in shares of the whole."""

    width: float = 1.0
    height: float = 1.0
    is_centered: bool = True
    turn: float = 0.0  # deg, counter-clockwise of the picture's content

    def zooms(self, frame: PhotoFrame) -> tuple[float, ...]:
        """The whole's diagonal by the crop's, the likeliest first: sides may be those of the sensor of a turned photo.

        The developer turns the pixels and forgets that it did, so that the shape of the whole tells.
        """
        turned = replace(self, width=self.height, height=self.width)
        found = dict.fromkeys((*self._wholes(frame), *turned._wholes(frame)))
        wholes = sorted(found, key=_distance_from_sensor)
        limit = _distance_from_sensor(wholes[0]) + (0.03 if self.turn else 0.1)
        wholes = [whole for whole in wholes if _distance_from_sensor(whole) < limit]
        return tuple(math.hypot(*whole) / math.hypot(frame.width, frame.height) for whole in wholes)

    def _wholes(self, frame: PhotoFrame) -> tuple[tuple[float, float], tuple[float, float]]:
        """Width and height of the picture that was cropped; and where the crop states corners of a turned rectangle."""
        whole = (frame.width / self.width, frame.height / self.height)
        cosine, sine = math.cos(math.radians(self.turn)), math.sin(math.radians(self.turn))
        across = cosine * frame.width - sine * frame.height
        along = sine * frame.width + cosine * frame.height
        return whole, (across / self.width, along / self.height) if min(across, along) > 0 else whole


def _distance_from_sensor(size: tuple[float, float]) -> float:
    """How far a picture's shape is from those of sensors, by logarithms; equal ones keep their order."""
    shape = abs(math.log(size[0] / size[1]))
    return round(min(abs(shape - math.log(known)) for known in _SENSOR_ASPECTS), 2)


def _developed_crop(xmp: Mapping[str, str]) -> _Crop:
    """The crop by Lightroom and Camera Raw; the whole where there is none, or where it is not applied yet."""

    def setting(name: str) -> str:
        return xmp.get(f"{_CAMERA_RAW} {name}", "")

    upright = setting("PerspectiveUpright") not in ("", "0")  # verticals and horizons were made straight
    if setting("HasCrop").lower() != "true" or setting("AlreadyApplied").lower() == "false":
        return _Crop(is_centered=not upright)
    try:
        left, top, right, bottom = (
            read_xmp_number(setting(f"Crop{side}")) for side in ("Left", "Top", "Right", "Bottom")
        )
        turn = -read_xmp_number(setting("CropAngle") or "0")
    except (ArithmeticError, ValueError):
        return _Crop(is_centered=False)
    width, height = abs(right - left), abs(bottom - top)
    if not (0.0 < width <= 1.0 and 0.0 < height <= 1.0 and abs(turn) <= 45.0):
        return _Crop(is_centered=False)
    middle = max(abs(left + right - 1.0), abs(top + bottom - 1.0)) / 2
    return _Crop(width, height, middle <= _CENTERED and not upright, turn)


# Panoramas.


def _panorama_view(xmp: Mapping[str, str]) -> tuple[float, float] | None:
    """Horizontal and vertical field of view [deg] of a sphere's or cylinder's part; None of other pictures."""

    def number(name: str) -> float:
        return read_xmp_number(xmp[f"{_GPANO} {name}"])

    try:
        whole = number("FullPanoWidthPixels")
        across = number("CroppedAreaImageWidthPixels") / whole * 360.0
        along = number("CroppedAreaImageHeightPixels") / whole * 360.0
    except (ArithmeticError, LookupError, ValueError):
        declared = f"{_GPANO} ProjectionType" in xmp or xmp.get(f"{_GPANO} UsePanoramaViewer", "").lower() == "true"
        return (360.0, 180.0) if declared else None
    return (across, along) if 0.0 < across <= 360.0 and 0.0 < along <= 180.0 else None

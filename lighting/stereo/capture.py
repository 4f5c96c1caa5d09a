"""A folder with the photos of one day from a camera that does not move: times, mask, and the checks they must pass.

Times come from EXIF or from `times.csv`; a mask from `mask.png`, white where the thing is. RAW (rawpy), 16-bit PNG and
TIFF and EXR hold linear values; JPEG and 8-bit PNG are taken to be coded in sRGB, which a camera's curve only
resembles.
"""

import csv
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags, Image

from lighting.errors import EnvironmentMapError, PhotoError
from lighting.files.exr import read_exr
from lighting.fusion.instants import resolve_together
from lighting.fusion.metadata_prior import share_location
from lighting.fusion.user_input import NO_USER_INPUT, UserInput
from lighting.photo.camera import FULL_FRAME_DIAGONAL
from lighting.photo.linear import RAW_SUFFIXES, Curve, open_header, read_linear
from lighting.photo.metadata import HeadingReference, PhotoMetadata
from lighting.photo.tags import TAG_ERRORS, read_number
from lighting.photo.timestamps import parse_time
from lighting.stereo.camera_motion import check_static_camera, moved_names
from lighting.stereo.light_vectors import Skies
from lighting.stereo.planner import MAX_PROBE_GAP, probe_days, read_skies

Pixels = NDArray[np.float32]

FORMATS = (*RAW_SUFFIXES, ".exr", ".jpeg", ".jpg", ".png", ".tif", ".tiff")


@dataclass(frozen=True)
class _Exposure:
    """How a camera took a photo; None is unknown."""

    seconds: float | None = None
    aperture: float | None = None  # f-number
    sensitivity: float | None = None  # ISO
    focal_length: float | None = None  # mm, of the lens itself


@dataclass(frozen=True, eq=False)
class _DayPhoto:
    """A photo of a day."""

    name: str
    pixels: Pixels  # (H, W, C), linear, white is 1; C is 1 or 3
    clipped: NDArray[np.bool_]  # (H, W), whether a channel is at white
    coded: bool  # whether a curve was taken off
    shape: tuple[int, int]  # rows and columns of the file, however far the pixels are reduced
    metadata: PhotoMetadata = field(default_factory=PhotoMetadata)
    exposure: _Exposure = _Exposure()


def _read_day_photo(path: Path, curve: Curve | None = None) -> _DayPhoto:
    """The photo in a file; `curve` says how its values are coded where the file is not to be believed.

    Raises PhotoError for a file that cannot be read, that needs a package that is missing, or whose 16-bit values say
    that they are gamma-coded while no curve is given.
    """
    if path.suffix.lower() != ".exr":
        return _read_photo(path, curve)
    try:
        pixels = read_exr(path)[0]
    except EnvironmentMapError as error:
        raise PhotoError(f"{path.name}: {error}") from error
    if not np.isfinite(pixels).all():
        raise PhotoError(f"{path.name}: The picture holds values that are not finite numbers.")
    shape = pixels.shape[0], pixels.shape[1]
    return _DayPhoto(path.name, pixels, np.zeros(shape, dtype=bool), coded=False, shape=shape)


def _read_photo(path: Path, curve: Curve | None) -> _DayPhoto:
    photo = read_linear(path, curve, upright=True)
    if photo.gamma_doubtful:
        raise PhotoError(
            f"{path}: The file says that its values are gamma-coded; export linear values, or say --curve linear or "
            "srgb."
        )
    pixels = np.ascontiguousarray(photo.pixels[..., :1] if photo.gray else photo.pixels)
    clipped = np.asarray((pixels >= photo.white).any(axis=-1))
    shape = pixels.shape[0], pixels.shape[1]
    return _DayPhoto(path.name, pixels, clipped, photo.srgb_decoded, shape, photo.metadata, _read_exposure(path))


def _read_exposure(path: Path) -> _Exposure:
    header = open_header(path)
    tags: dict[int, object] = {}
    if header is not None:
        with header, suppress(Exception):  # Pillow raises nearly anything on hostile bytes
            tags = dict(header.getexif().get_ifd(ExifTags.IFD.Exif))
    base = ExifTags.Base
    names = (base.ExposureTime, base.FNumber, base.ISOSpeedRatings, base.FocalLength)
    return _Exposure(*(_positive_number(tags.get(name)) for name in names))


def _positive_number(tag: object) -> float | None:
    with suppress(*TAG_ERRORS):
        return value if (value := read_number(tag)) > 0 else None
    return None


_TIMES_FILE = "times.csv"
_MIN_SPAN = 20.0  # min, the shortest day


def _photo_times(
    photos: list[_DayPhoto], listed: Mapping[str, datetime], user_input: UserInput
) -> tuple[NDArray[np.datetime64], set[str]]:
    """UTC times (T,) of the photos, and warnings of their clocks. PhotoError if one is missing."""
    located = share_location([photo.metadata for photo in photos])
    clocks = [_with_listed_time(m, listed.get(photo.name)) for m, photo in zip(located, photos, strict=True)]
    if user_input.latitude is not None:
        clocks = [replace(m, latitude=user_input.latitude, longitude=user_input.longitude) for m in clocks]
    times, warnings = [], set[str]()
    for photo, clock, each in zip(photos, clocks, resolve_together(clocks, user_input), strict=True):
        if (instant := each.likeliest) is None and clock.local_time is None:
            raise PhotoError(f"{photo.name} does not say when it was taken; list the times in {_TIMES_FILE}.")
        if instant is None:
            raise PhotoError(f"The clock of {photo.name} does not say its offset from UTC; give --utc-offset.")
        times.append(instant.utc_time.replace(tzinfo=None))
        warnings |= {*each.warnings, *each.conflict_warnings(instant)}
    return np.array(times, dtype="datetime64[us]"), warnings


def _with_listed_time(metadata: PhotoMetadata, listed: datetime | None) -> PhotoMetadata:
    """The metadata with the time that the list has in place of the file's."""
    if listed is None:
        return metadata
    if listed.tzinfo is not None:
        return replace(metadata, local_time=None, utc_offset=None, gps_time=listed.astimezone(UTC))
    return replace(metadata, local_time=listed, utc_offset=None, gps_time=None)


def _listed_times(file: Path) -> dict[str, datetime]:
    if not file.exists():
        return {}
    try:
        with file.open(newline="", encoding="utf-8-sig") as stream:
            rows = list(csv.DictReader(stream))
    except (UnicodeDecodeError, csv.Error) as error:
        raise PhotoError(f"{file} is not a CSV file in UTF-8.") from error
    if rows and not {"file", "time"} <= rows[0].keys():
        raise PhotoError(f"{file} needs the columns file and time.")
    return {row["file"]: parse_time(row["time"] or "") for row in rows}


def _check_times(times: NDArray[np.datetime64]) -> None:
    """PhotoError unless the times (T,), in order, differ, and by enough for the sun to move."""
    gaps = np.diff(times) / np.timedelta64(1, "m")
    if (gaps <= 0).any():
        raise PhotoError("The photos' times do not differ; photos of several moments of a day are needed.")
    if gaps.sum() < _MIN_SPAN:
        raise PhotoError(f"The photos span {gaps.sum():.0f} minutes; the sun hardly moved. Take them over hours.")
    if gaps.sum() > 24 * 60:
        raise PhotoError("The photos are of more than one day.")


def read_nearest_skies(folder: Path, times: NDArray[np.datetime64], utc_offset: float) -> Skies:
    """Read the probes nearest to the moments of photos.

    Args:
        folder: of probes, in the SkyDB's layout.
        times: (T,) UTC.
        utc_offset: h, of the folders' names where the maps have no time.

    Raises:
        EnvironmentMapError: a photo has no probe within half of MAX_PROBE_GAP.
    """
    days, nearest = probe_days(folder, utc_offset), []
    for time in times + np.timedelta64(round(3600 * utc_offset), "s"):
        day = time.astype("datetime64[D]")
        minutes, files = float((time - day) / np.timedelta64(1, "m")), days.get(day.item(), {})
        probe = min(files, key=lambda moment: abs(moment - minutes), default=math.inf)
        if abs(probe - minutes) > MAX_PROBE_GAP / 2:
            limit = f"{MAX_PROBE_GAP / 2:g} minutes of {time.item()}"
            raise EnvironmentMapError(f"{folder} holds no sky probe within {limit}.")
        nearest.append(files[probe])
    return read_skies(nearest)


# Whether photos differ in more than their light.

_MAX_EXPOSURE_DIFFERENCE = 0.02  # relative difference of exposures that cameras round alike


def _check_same_exposure(photos: list[_DayPhoto]) -> None:
    """PhotoError unless size, colors, lens and exposure are those of the first photo throughout."""
    first = photos[0]
    for photo in photos[1:]:
        if photo.shape != first.shape:
            raise PhotoError(f"{photo.name} and {first.name} differ in size; the camera must not move or change.")
        if photo.pixels.shape != first.pixels.shape:
            raise PhotoError(f"Of {photo.name} and {first.name} one is gray and one in color; make them alike.")
        if _differ(photo.exposure.focal_length, first.exposure.focal_length):
            raise PhotoError(f"{photo.name} and {first.name} differ in focal length; the lens must not change.")
        settings = [(e.seconds, e.aperture, e.sensitivity) for e in (photo.exposure, first.exposure)]
        if any(map(_differ, *settings)):
            raise PhotoError(f"{photo.name} and {first.name} differ in exposure; fix time, aperture and ISO.")


def _differ(a: float | None, b: float | None) -> bool:
    return a is not None and b is not None and abs(a - b) > _MAX_EXPOSURE_DIFFERENCE * max(a, b)


_MIN_VARIATION = 0.02  # share of the brightest, below which it may be noise; an hour of clear sky leaves 0.025
_BRIGHT_QUANTILE = 0.999  # quantile of the values that counts as the brightest
_MAX_PIXELS = 20_000  # pixels that are looked at


def _light_varies(images: NDArray[np.float32], mask: NDArray[np.bool_]) -> bool:
    """Whether pixels of a mask (H, W) in images (T, H, W, C) brighten and darken in different ways.

    It is so where one picture times one strength for each photo leaves more than noise (root mean square).
    """
    rows, columns = np.nonzero(mask)
    step = max(1, len(rows) // _MAX_PIXELS)
    values = images[:, rows[::step], columns[::step]].mean(axis=-1, dtype=np.float64)  # (T, P)
    brightest = float(np.quantile(values, _BRIGHT_QUANTILE)) if values.size else 0.0
    powers = np.linalg.eigvalsh(values @ values.T)  # rising; the last one is that of one picture alone
    residual = np.sqrt(max(float(powers[:-1].sum()), 0.0) / max(values.size, 1))
    return bool(residual > _MIN_VARIATION * brightest)


# A whole day.

_MASK_FILE = "mask.png"
_MIN_PHOTOS = 3  # photos, for a normal and an albedo
MAX_SIZE = 1024  # pixels of the longer side, to which photos are reduced
_MIN_SIDE = 2  # pixels, that a slope is between

_MAX_CLIPPED = 0.1  # share of the thing that may be clipped in some photo


@dataclass(frozen=True)
class DayPhotos:
    """The photos of a day, ready to solve."""

    names: tuple[str, ...]
    """Of the files."""
    images: Pixels
    """(T, H, W, C), linear, in one unit."""
    times: NDArray[np.datetime64]
    """Times, (T,), UTC."""
    mask: NDArray[np.bool_]
    """(H, W), where the thing is and no photo is clipped."""
    location: tuple[float, float] | None
    """Latitude and longitude [deg] that the photos tell."""
    heading: float | None
    """Deg from true north, likewise."""
    focal_length: float | None
    """Millimeters in 35 mm terms, likewise."""
    warnings: tuple[str, ...]
    """Sentences for people."""


def read_day_photos(
    folder: Path,
    *,
    mask: Path | None = None,
    user_input: UserInput = NO_USER_INPUT,
    curve: Curve | None = None,
    size: int | None = MAX_SIZE,
    progress: Callable[[Sequence[Path]], Iterable[Path]] = iter,
) -> DayPhotos:
    """Read the photos of a folder in the order of their times.

    Args:
        folder: of photos, with `times.csv` and `mask.png` where they are needed.
        mask: a picture, white where the thing is; None is the folder's, or all.
        user_input: what the user states: place, and offset of the cameras' clocks from UTC.
        curve: how values are coded; None believes the files.
        size: pixels of the longer side, reached by a whole factor; None keeps all.
        progress: passes the files on as they are read.

    Raises:
        PhotoError: there are fewer than _MIN_PHOTOS photos, times are missing or do not differ, sizes, lenses or
            exposures do, the camera moved, or photos are clipped or too small.
    """
    photos = [_reduce_photo(_read_day_photo(path, curve), size) for path in progress(_list_photos(folder))]
    if len(photos) < _MIN_PHOTOS:
        count = "1 photo" if len(photos) == 1 else f"{len(photos)} photos"
        raise PhotoError(f"{folder} holds {count}; normals need at least {_MIN_PHOTOS} of one day.")
    listed = _listed_times(folder / _TIMES_FILE)
    times, doubts = _photo_times(photos, listed, user_input)
    order = np.argsort(times, kind="stable")
    photos, times = [photos[index] for index in order], times[order]
    _check_same_exposure(photos)
    _check_times(times)
    inside = _make_mask(folder, mask, photos[0].pixels.shape[:2])
    images, names = np.stack([shot.pixels for shot in photos]), tuple(shot.name for shot in photos)
    gray = images.mean(axis=-1)
    check_static_camera(gray, names)
    unclipped, lost = _exclude_clipped(inside, photos)
    metadata = [shot.metadata for shot in photos]
    location = next((place for m in metadata if (place := m.location)), None)
    headings = (m.heading for m in metadata if m.heading_reference == HeadingReference.TRUE)
    heading = next((degrees for degrees in headings if degrees is not None), None)
    focal_length = next((length for photo in photos if (length := _focal_length(photo)) is not None), None)
    varies, moved = _light_varies(images, unclipped), moved_names(gray, names)
    warnings = (*sorted(doubts), *_day_warnings(listed, photos, lost, varies, moved))
    return DayPhotos(names, images, times, unclipped, location, heading, focal_length, warnings)


def _focal_length(photo: _DayPhoto) -> float | None:
    """Of the lens that covers the photo, a crop as well, as on 35 mm film [mm]; None where it is unknown."""
    if (fov := photo.metadata.vertical_fov) is None:
        return None
    height, width = photo.shape
    return FULL_FRAME_DIAGONAL * 0.5 * height / math.tan(math.radians(0.5 * fov)) / math.hypot(height, width)


def _list_photos(folder: Path) -> list[Path]:
    if not folder.is_dir():
        raise PhotoError(f"There is no folder {folder}.")
    files = (path for path in folder.iterdir() if path.suffix.lower() in FORMATS and path.is_file())
    return sorted(path for path in files if path.name != _MASK_FILE and path.name[0] != ".")


def _reduce_photo(photo: _DayPhoto, size: int | None) -> _DayPhoto:
    """The photo with each side divided by a whole number, by means of blocks, which keep values linear.

    Raises PhotoError where less than _MIN_SIDE is left of a side.
    """
    height, width = photo.shape
    factor = 1 if not size else -(-max(height, width) // size)
    rows, columns = height // factor, width // factor
    if min(rows, columns) < _MIN_SIDE:
        sentence = f"{photo.name} is reduced to {columns} x {rows} pixels; normals need {_MIN_SIDE} or more each way."
        raise PhotoError(sentence)
    if factor == 1:
        return photo
    cut = photo.pixels[: rows * factor, : columns * factor].reshape(rows, factor, columns, factor, -1)
    clipped = photo.clipped[: rows * factor, : columns * factor].reshape(rows, factor, columns, factor)
    return replace(photo, pixels=cut.mean(axis=(1, 3)), clipped=np.asarray(clipped.any(axis=(1, 3))))


def _make_mask(folder: Path, user_mask: Path | None, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    file = user_mask or folder / _MASK_FILE
    if user_mask is None and not file.exists():
        return np.ones(shape, dtype=bool)
    try:
        image = Image.open(file).convert("L")
    except Exception as error:  # Pillow raises nearly anything on hostile bytes
        raise PhotoError(f"{file} is not a mask that can be read.") from error
    if abs(image.width / image.height - shape[1] / shape[0]) > 0.02 * shape[1] / shape[0]:
        raise PhotoError(f"{file} is {image.width} x {image.height} pixels; it does not have the photos' shape.")
    inside = np.asarray(image.resize((shape[1], shape[0]), Image.Resampling.NEAREST)) > 127
    if not inside.any():
        raise PhotoError(f"{file} is black all over; white marks the thing.")
    return np.asarray(inside)


def _exclude_clipped(inside: NDArray[np.bool_], photos: list[_DayPhoto]) -> tuple[NDArray[np.bool_], float]:
    """Where the mask (H, W) is clipped in no photo, and the share that is lost."""
    clipped = np.any([photo.clipped for photo in photos], axis=0)
    worst = max(photos, key=lambda photo: photo.clipped[inside].mean())
    lost_share = float(clipped[inside].mean())
    if lost_share > _MAX_CLIPPED:
        share = 100 * worst.clipped[inside].mean()
        raise PhotoError(f"{worst.name} is clipped in {share:.0f} % of its pixels; expose less.")
    return inside & ~clipped, lost_share


def _day_warnings(
    listed: Iterable[str], photos: Sequence[_DayPhoto], lost: float, varies: bool, moved: Sequence[str]
) -> Iterator[str]:
    if any(photo.coded for photo in photos):
        yield "JPEG and 8-bit photos count as sRGB: the camera's own curve bends normals."
    if any(photo.exposure.seconds is None for photo in photos):
        yield "Not every photo says its exposure; it is taken to be the same in all."
    if lost:
        yield f"{100 * lost:.1f} % of the pixels are clipped in a photo and left out."
    names = {photo.name for photo in photos}
    yield from (f"{_TIMES_FILE} lists {name}, which is not there." for name in listed if name not in names)
    if not varies:
        yield "All brightens and darkens alike: unless the thing is flat, its normals are worthless."
    if moved:
        others = f" and {len(moved) - 1} more" if len(moved) > 1 else ""
        yield f"The camera moved before {moved[0]}{others}: edges get wrong normals."

"""Ordinary photos whose true sun is known: their table, crops and suns' likelihoods, and the prior of elevations."""

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from export.crops.crops import PHONE_ASPECTS, VISIBILITY, Camera, Crop, Source, balanced_weights, sampling_weights
from export.data.labels import read_labels_of
from export.data.panoramas import DataError, decode_srgb, is_permissive, read_index, read_table
from lighting.geometry import Floats, angles, wrap_azimuth
from lighting.model import fit_size
from lighting.photo.reader import read_photo
from lighting.prediction import ModelSpec
from lighting.sun_grid import grid_directions

PHOTOS = "photos_train.csv"
PHOTO_COLUMNS = ("file", "group", "sun_azimuth", "sun_elevation", "direct", "hfov", "expected_azimuth_error")
_MIN_SHARE = 0.6  # of the largest crop of an aspect ratio
_MAX_ROTATION = 5.0  # deg, either way
_ELEVATION_STD = 3.0  # deg; time and place are exact, but what is learnt from so few photos need not be
_AZIMUTH_STD = 20.0  # deg, where the table states none
_OUTLIER_RATE = 0.07  # share of headings that are wrong altogether
_SCALES = np.arange(20.0, 301.0, 5.0)  # deg, of the prior of elevations, those tried
_BILINEAR = Image.Resampling.BILINEAR


@dataclass(frozen=True)
class PhotoRow:
    """One row; NaN where it does not tell. Angles in deg."""

    path: Path
    group: str  # one scene and hour of one photographer
    sun_azimuth: float  # relative to the camera, positive right
    sun_elevation: float
    azimuth_std: float
    direct: str  # "yes", "partly", "no", or "" where not known
    horizontal_fov: float
    licence: str = ""


def read_photo_rows(folder: str | Path) -> list[PhotoRow]:
    """The rows of a folder's photos, none if it has no such table; DataError if a row cannot be used.

    Args:
        folder: with `photos_train.csv`.
    """
    table = Path(folder) / PHOTOS
    if not table.exists():
        return []
    return [_row(row, table, line) for line, row in enumerate(read_table(table, PHOTO_COLUMNS), start=2)]


def require_photo_rows(folder: str | Path, *, licensed_only: bool = False) -> list[PhotoRow]:
    """As `read_photo_rows`, for those who cannot do without photos; DataError if there is none.

    Args:
        folder: with `photos_train.csv`.
        licensed_only: keep the rows that `is_permissive` accepts.
    """
    rows = [row for row in read_photo_rows(folder) if not licensed_only or is_permissive(row.licence)]
    if not rows:
        which = "photo with a permissive licence" if licensed_only else "photo"
        raise DataError(f"There is no {which} to learn from in {Path(folder) / PHOTOS}.")
    return rows


def _row(row: dict[str, str], table: Path, line: int) -> PhotoRow:
    try:
        numbers = {name: float(row[name] or "nan") for name in PHOTO_COLUMNS[2:] if name != "direct"}
    except ValueError as error:
        raise DataError(f"{table}, line {line}: {error}.") from error
    if math.isnan(numbers["sun_elevation"]):
        raise DataError(f"{table}, line {line}: sun_elevation is empty.")
    path = table.parent / row["file"]
    if not path.is_file():
        raise DataError(f"{table}, line {line}: there is no photo {path}.")
    direct = row["direct"] if row["direct"] in ("yes", "partly", "no") else ""
    azimuth, elevation, fov, azimuth_std = numbers.values()
    return PhotoRow(path, row["group"], azimuth, elevation, azimuth_std, direct, fov, row.get("licence", ""))


@dataclass(frozen=True)
class PhotoSource:
    """A photo in memory with its row."""

    row: PhotoRow
    pixels: NDArray[np.uint8]  # (H, W, 3) upright sRGB


def load_photos(rows: Sequence[PhotoRow]) -> list[PhotoSource]:
    """Read photos.

    Args:
        rows: those of `photos_train.csv`.
    """
    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(lambda row: PhotoSource(row, read_photo(row.path).pixels), rows))


def photo_weights(photos: Sequence[PhotoSource]) -> Floats:
    """Chances (N,) of drawing each photo: groups count by the root of their size, rare sun elevations more.

    Args:
        photos: the N photos of a run.
    """
    return balanced_weights([p.row.group for p in photos], [p.row.sun_elevation for p in photos], 0.5)


def crop_photo(photo: PhotoSource, rng: np.random.Generator, spec: ModelSpec) -> Crop:
    """A crop of a photo; the camera's elevation and roll are unknown, and so is the sky.

    Args:
        photo: the whole picture.
        rng: draws the part, its rotation and whether it is mirrored.
        spec: of the network that the crop is for.
    """
    row = photo.row
    left, top, width, height = _draw_box(photo.pixels.shape, float(rng.choice(PHONE_ASPECTS)), rng)
    center = (left + width / 2, top + height / 2)
    rotation = rng.uniform(-1, 1) * _max_rotation(photo.pixels.shape, center, width, height)
    rotated = Image.fromarray(photo.pixels).rotate(rotation, _BILINEAR, center=center)
    size = fit_size(round(width), round(height), spec)
    box = (left, top, left + width, top + height)
    pixels = np.asarray(rotated.resize(size, Image.Resampling.HAMMING, box=box))
    focal = 0.5 * photo.pixels.shape[1] / math.tan(math.radians(row.horizontal_fov) / 2)
    offset = center[0] - 0.5 * photo.pixels.shape[1]
    azimuth = float(wrap_azimuth(row.sun_azimuth - (math.degrees(math.atan2(offset, focal)) if focal > 0 else 0.0)))
    fov = 2 * math.degrees(math.atan(0.5 * height / focal))
    mirrored = bool(rng.random() < 0.5)
    nan = math.nan
    return Crop(
        linear=decode_srgb(pixels[:, ::-1] if mirrored else pixels),
        camera=Camera(0.0, nan, nan, fov, width / height, mirrored),
        sun_azimuth=-azimuth if mirrored else azimuth,
        sun_elevation=row.sun_elevation,
        sun_std=row.azimuth_std if math.isfinite(row.azimuth_std) else _AZIMUTH_STD,
        sun_visibility=VISIBILITY.get(row.direct, nan),
        turbidity=nan,
        exposure=nan,
    )


def _draw_box(shape: tuple[int, ...], aspect: float, rng: np.random.Generator) -> tuple[float, float, float, float]:
    """Left, top, width and height of a part of a picture."""
    height, width = shape[:2]
    share = rng.uniform(_MIN_SHARE, 1.0)
    box_width = min(width, height * aspect) * share
    box_height = box_width / aspect
    return rng.uniform(0, width - box_width), rng.uniform(0, height - box_height), box_width, box_height


def _max_rotation(shape: tuple[int, ...], center: tuple[float, float], width: float, height: float) -> float:
    """The largest rotation [deg] about a part's center that keeps it inside the picture, at most _MAX_ROTATION."""
    horizontal = min(center[0], shape[1] - center[0]) - width / 2
    vertical = min(center[1], shape[0] - center[1]) - height / 2
    rotation = min(2 * horizontal / height, 2 * vertical / width)
    return float(np.clip(math.degrees(rotation), 0.0, _MAX_ROTATION))


def photo_sun_likelihood(crop: Crop, layout: str) -> Floats:
    """How well each cell (N,) of a grid agrees with a photo's sun; sums to 1.

    The heading's error is normal but for a share _OUTLIER_RATE, in which it may be any. Without an azimuth only the
    elevation counts.

    Args:
        crop: of a photo.
        layout: name of the grid, such as "fibonacci:1024".
    """
    azimuth, elevation = angles(grid_directions(layout))
    agreement = np.exp(-0.5 * ((elevation - max(crop.sun_elevation, 0.0)) / _ELEVATION_STD) ** 2)
    if math.isfinite(crop.sun_azimuth):
        normal = np.exp(-0.5 * (wrap_azimuth(azimuth - crop.sun_azimuth) / crop.sun_std) ** 2)
        uniform = math.sqrt(2 * math.pi) * crop.sun_std / 360.0
        agreement = agreement * ((1 - _OUTLIER_RATE) * normal + _OUTLIER_RATE * uniform)
    return np.asarray(agreement / agreement.sum())


def fit_elevation_prior(data: Path, labels: Path) -> str:
    """How much lower the sun stands in photographs than in training crops, in words; DataError without photos.

    The crops' density of elevations times exp(-elevation / scale) is fitted to the photos' elevations by likelihood. A
    network trained on the crops answers for photographs once its probabilities are multiplied by the same factor.

    Args:
        data: folder of panoramas and of `photos_train.csv`.
        labels: CSV file of `python -m export label`.
    """
    rows = require_photo_rows(data)
    panoramas = read_index(data, "train")
    sources = [Source(p, (), label) for p, label in zip(panoramas, read_labels_of(panoramas, labels), strict=True)]
    weights = sampling_weights(sources)
    crops = np.array([s.label.sun_elevation for s in sources], dtype=np.float64)
    has_sun = np.isfinite(crops)
    groups = np.array([row.group for row in rows])
    elevation = np.array([row.sun_elevation for row in rows])
    photos = np.array([elevation[groups == group].mean() for group in np.unique(groups)])
    scale, gain = fit_elevation_scale(crops[has_sun], weights[has_sun], photos)
    return f"{len(photos)} scenes: exp(-elevation / {scale:g} deg), {gain:.3f} nat likelier than without"


def fit_elevation_scale(crops: Floats, weights: Floats, photos: Floats) -> tuple[float, float]:
    """The scale [deg] and its gain in log likelihood per photo.

    Args:
        crops: (N,) elevations [deg] of the suns of training crops.
        weights: (N,) of each.
        photos: (M,) elevations [deg] of the suns of photos.
    """
    share = weights / weights.sum()
    total = np.log(np.exp(-crops / _SCALES[:, None]) @ share)
    likelihood = -photos.mean() / _SCALES - total
    best = int(np.argmax(likelihood))
    return float(_SCALES[best]), float(likelihood[best])

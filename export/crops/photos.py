"""Crops of ordinary photos: a part of the picture, turned a little and mirrored at random, with what is known of it."""

import math
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from export.crops.cameras import PHONE_ASPECTS, Camera
from export.crops.crops import VISIBILITY, Crop
from export.data.panoramas import decode_srgb
from export.data.photos import PhotoRow
from lighting.geometry import Floats, angles, wrap_azimuth
from lighting.photo.preprocess import fit_size
from lighting.photo.reader import read_photo
from lighting.records import ModelSpec
from lighting.sun_grid import grid_directions

LEAST_SHARE = 0.6  # of the largest crop of an aspect ratio
LARGEST_TURN = 5.0  # deg, either way
ELEVATION_ERROR = 3.0  # deg; time and place are exact, but what is learnt from so few photos need not be
AZIMUTH_ERROR = 20.0  # deg, where the table states none
GROSS = 0.07  # share of headings that are wrong altogether


@dataclass(frozen=True)
class PhotoSource:
    """A photo in memory with its row."""

    row: PhotoRow
    pixels: NDArray[np.uint8]  # (H, W, 3) upright sRGB


def load_photos(rows: Sequence[PhotoRow]) -> list[PhotoSource]:
    """Photos with their rows."""
    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(lambda row: PhotoSource(row, read_photo(row.path).pixels), rows))


def photo_weights(photos: Sequence[PhotoSource]) -> Floats:
    """Chances (N,) of drawing each photo: groups count by the root of their size, rare sun elevations more."""
    groups = Counter(p.row.group for p in photos)
    bins = np.array([max(p.row.sun_elevation, 0.0) // 15 for p in photos])
    crowd = np.array([np.count_nonzero(bins == b) for b in bins], dtype=np.float64)
    weight = np.array([groups[p.row.group] for p in photos]) ** -0.5 * crowd**-0.5
    return np.asarray(weight / weight.sum())


def crop_photo(photo: PhotoSource, rng: np.random.Generator, spec: ModelSpec, upwards: float = 1.0) -> Crop:
    """A crop of a photo; the camera's elevation and roll are unknown, and so is the sky.

    `upwards` stretches the world that it shows (crops/stretch.py), as the picture of a level camera tells it.
    """
    row = photo.row
    left, top, width, height = _frame(photo.pixels.shape, upwards * float(rng.choice(PHONE_ASPECTS)), rng)
    turned = Image.fromarray(photo.pixels)
    middle = (left + width / 2, top + height / 2)
    turned = turned.rotate(
        rng.uniform(-1, 1) * _room(photo.pixels.shape, middle, width, height), _BILINEAR, center=middle
    )
    tall = upwards * height
    size = fit_size(round(width), round(tall), spec)
    box = (left, top, left + width, top + height)
    pixels = np.asarray(turned.resize(size, Image.Resampling.HAMMING, box=box))
    focal = 0.5 * photo.pixels.shape[1] / math.tan(math.radians(row.horizontal_fov) / 2)
    offset = middle[0] - 0.5 * photo.pixels.shape[1]
    azimuth = float(wrap_azimuth(row.sun_azimuth - (math.degrees(math.atan2(offset, focal)) if focal > 0 else 0.0)))
    fov = 2 * math.degrees(math.atan(0.5 * tall / focal))
    mirrored = bool(rng.random() < 0.5)
    nan = math.nan
    return Crop(
        linear=decode_srgb(pixels[:, ::-1] if mirrored else pixels),
        camera=Camera(0.0, nan, nan, fov, width / tall, mirrored),
        sun_azimuth=-azimuth if mirrored else azimuth,
        sun_elevation=math.degrees(math.atan(upwards * math.tan(math.radians(row.sun_elevation)))),
        sun_uncertainty=row.azimuth_error if math.isfinite(row.azimuth_error) else AZIMUTH_ERROR,
        sun_visibility=VISIBILITY.get(row.direct, nan),
        turbidity=nan,
        exposure=nan,
    )


_BILINEAR = Image.Resampling.BILINEAR


def _frame(shape: tuple[int, ...], aspect: float, rng: np.random.Generator) -> tuple[float, float, float, float]:
    """Left, top, width and height of a part of a picture."""
    height, width = shape[:2]
    share = rng.uniform(LEAST_SHARE, 1.0)
    wide = min(width, height * aspect) * share
    high = wide / aspect
    return rng.uniform(0, width - wide), rng.uniform(0, height - high), wide, high


def _room(shape: tuple[int, ...], middle: tuple[float, float], width: float, height: float) -> float:
    """The largest turn [deg] about a part's middle that keeps it inside the picture, at most LARGEST_TURN."""
    across = min(middle[0], shape[1] - middle[0]) - width / 2
    along = min(middle[1], shape[0] - middle[1]) - height / 2
    turn = min(2 * across / height, 2 * along / width)
    return float(np.clip(math.degrees(turn), 0.0, LARGEST_TURN))


def photo_sun_likelihood(crop: Crop, layout: str) -> Floats:
    """How well each cell (N,) of a grid agrees with what is known of a photo's sun; sums to 1.

    The heading's error is normal but for a share GROSS, in which it may be any. Without an azimuth only the elevation
    counts.
    """
    azimuth, elevation = angles(grid_directions(layout))
    near = np.exp(-0.5 * ((elevation - max(crop.sun_elevation, 0.0)) / ELEVATION_ERROR) ** 2)
    if math.isfinite(crop.sun_azimuth):
        off = np.exp(-0.5 * (wrap_azimuth(azimuth - crop.sun_azimuth) / crop.sun_uncertainty) ** 2)
        uniform = math.sqrt(2 * math.pi) * crop.sun_uncertainty / 360.0
        near = near * ((1 - GROSS) * off + GROSS * uniform)
    return np.asarray(near / near.sum())

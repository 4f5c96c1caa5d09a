"""A folder with the photos of one day from a camera that stands still.

The moments come from EXIF or from `times.csv` (moments.py); a mask from `mask.png`, white where the thing is.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.errors import PhotoError
from lighting.evidence import location_of
from lighting.photo import Curve
from lighting.photo.exif import HeadingReference
from lighting.stereo.normals.alike import check_alike
from lighting.stereo.normals.images import FORMATS, Shot, read_mask, read_shot
from lighting.stereo.normals.moments import TIMES, absent, check_times, times_of
from lighting.stereo.normals.still import check_still
from lighting.stereo.normals.varied import is_varied

Pixels = NDArray[np.float32]

MASK = "mask.png"
LEAST = 3  # photos, for a normal and an albedo
SIZE = 1024  # pixels of the longer side, to which photos are reduced
LEAST_SIDE = 2  # pixels, that a slope is between

_MOST_CLIPPED = 0.1  # share of the thing that may be clipped in some photo


@dataclass(frozen=True)
class Shots:
    """The photos of a day, ready to solve."""

    names: tuple[str, ...]
    images: Pixels  # (T, H, W, C), linear, in one unit
    times: NDArray[np.datetime64]  # (T,), UTC
    mask: NDArray[np.bool_]  # (H, W), where the thing is and no photo is clipped
    place: tuple[float, float] | None  # latitude and longitude [deg] that the photos tell
    heading: float | None  # deg from true north, likewise
    focal_length: float | None  # mm in 35 mm terms, likewise
    warnings: tuple[str, ...]


def read_shots(
    folder: Path,
    *,
    mask: Path | None = None,
    utc_offset: float | None = None,
    curve: Curve | None = None,
    size: int | None = SIZE,
    progress: Callable[[Sequence[Path]], Any] = iter,
) -> Shots:
    """The photos of a folder in the order of their times, reduced by a whole factor to `size` pixels.

    `utc_offset` [h] is of a camera's clock that does not say it. Raises PhotoError for fewer than LEAST photos, times
    that are missing or do not differ, sizes, lenses or exposures that do, a camera that moved, and photos that are
    clipped or too small.
    """
    shots = [_reduced(read_shot(path, curve), size) for path in progress(_photos(folder))]
    if len(shots) < LEAST:
        count = "1 photo" if len(shots) == 1 else f"{len(shots)} photos"
        raise PhotoError(f"{folder} holds {count}; normals need at least {LEAST} of one day.")
    times = times_of(folder, shots, utc_offset)
    order = np.argsort(times, kind="stable")
    shots, times = [shots[index] for index in order], times[order]
    check_alike(shots)
    check_times(times)
    area = _mask(folder, mask, shots[0].pixels.shape[:2])
    images = np.stack([shot.pixels for shot in shots])
    check_still(images.mean(axis=-1), [shot.name for shot in shots])
    kept, lost = _unclipped(area, shots)
    facts = [shot.facts for shot in shots]
    return Shots(
        names=tuple(shot.name for shot in shots),
        images=images,
        times=times,
        mask=kept,
        place=next((place for f in facts if (place := location_of(f))), None),
        heading=next(
            (f.heading for f in facts if f.heading is not None and f.heading_reference == HeadingReference.TRUE), None
        ),
        focal_length=next((f.focal_length for f in facts if f.vertical_fov is not None), None),  # not of cropped ones
        warnings=(*_warnings(shots, lost), *_about_the_day(folder, shots, images, kept)),
    )


def _photos(folder: Path) -> list[Path]:
    if not folder.is_dir():
        raise PhotoError(f"There is no folder {folder}.")
    files = (path for path in folder.iterdir() if path.suffix.lower() in FORMATS and path.is_file())
    return sorted(path for path in files if path.name != MASK and path.name[0] != ".")


def _reduced(shot: Shot, size: int | None) -> Shot:
    """The photo with each side divided by a whole number, by means of blocks, which keep values linear.

    Raises PhotoError where less than LEAST_SIDE is left of a side.
    """
    height, width = shot.shape
    factor = 1 if not size else -(-max(height, width) // size)
    rows, columns = height // factor, width // factor
    if min(rows, columns) < LEAST_SIDE:
        raise PhotoError(
            f"{shot.name} is reduced to {columns} x {rows} pixels; normals need {LEAST_SIDE} or more each way."
        )
    if factor == 1:
        return shot
    cut = shot.pixels[: rows * factor, : columns * factor].reshape(rows, factor, columns, factor, -1)
    clipped = shot.clipped[: rows * factor, : columns * factor].reshape(rows, factor, columns, factor)
    return replace(shot, pixels=cut.mean(axis=(1, 3)), clipped=np.asarray(clipped.any(axis=(1, 3))))


def _mask(folder: Path, given: Path | None, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    file = given or folder / MASK
    if given is None and not file.exists():
        return np.ones(shape, dtype=bool)
    image = read_mask(file)
    if abs(image.width / image.height - shape[1] / shape[0]) > 0.02 * shape[1] / shape[0]:
        raise PhotoError(f"{file} is {image.width} x {image.height} pixels; it does not have the photos' shape.")
    inside = np.asarray(image.resize((shape[1], shape[0]), Image.Resampling.NEAREST)) > 127
    if not inside.any():
        raise PhotoError(f"{file} is black all over; white marks the thing.")
    return np.asarray(inside)


def _unclipped(area: NDArray[np.bool_], shots: list[Shot]) -> tuple[NDArray[np.bool_], float]:
    """Where the mask (H, W) is clipped in no photo, and the share that is lost."""
    clipped = np.any([shot.clipped for shot in shots], axis=0)
    worst = max(shots, key=lambda shot: shot.clipped[area].mean())
    lost = float(clipped[area].mean())
    if lost > _MOST_CLIPPED:
        share = 100 * worst.clipped[area].mean()
        raise PhotoError(f"{worst.name} is clipped in {share:.0f} % of its pixels; expose less.")
    return area & ~clipped, lost


def _warnings(shots: list[Shot], lost: float) -> tuple[str, ...]:
    found = []
    if any(shot.coded for shot in shots):
        found.append("JPEG and 8-bit photos are decoded as sRGB; the camera's own curve differs and bends normals.")
    if any(shot.exposure.seconds is None for shot in shots):
        found.append("Not every photo says its exposure; it is taken to be the same in all.")
    if lost:
        found.append(f"{100 * lost:.1f} % of the pixels are clipped in a photo and left out.")
    return tuple(found)


def _about_the_day(folder: Path, shots: list[Shot], images: Pixels, mask: NDArray[np.bool_]) -> list[str]:
    found = [f"{TIMES} lists {name}, which is not there." for name in absent(folder, [shot.name for shot in shots])]
    if not is_varied(images, mask):
        found.append(
            "All that the photos show brightens and darkens alike, as under an overcast sky or within half an hour: "
            "unless the thing is flat, its normals are worthless."
        )
    return found

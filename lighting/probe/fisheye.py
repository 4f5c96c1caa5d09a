"""Projections of a probe's picture (fisheye, mirrored ball, lat-long), and its resampling to a lat-long map.

A camera that looks straight up has the top of its picture towards the south when its right is east, as one has who
leans back while facing north. Angles are in the camera's frame of geometry.py until alignment rotates them.

The sun may be smaller than a pixel. So pictures finer than the map are averaged before, and each pixel of the map is
the mean of several samples. The sum of radiance x solid angle survives.
"""

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.errors import ErrorCode, ProbeError
from lighting.geometry import Floats, camera_axes, direction, latlong_pixel
from lighting.probe.sun_detection import Mask

LensKind = Literal["equidistant", "equisolid", "ball", "latlong"]
# what can be told of other lenses, but does nothing with these
UNUSED_LENS_OPTIONS: dict[LensKind, tuple[str, ...]] = {"ball": ("fov",), "latlong": ("fov", "center", "radius")}
_ELEVATIONS = {"equidistant": 90.0, "equisolid": 90.0, "ball": 0.0, "latlong": 0.0}


@dataclass(frozen=True)
class Lens:
    """A projection; lengths in pixels of the picture, centers of pixels at (i + 0.5)."""

    kind: LensKind
    """Its projection."""
    width: int
    """Columns of the photo, pixels."""
    height: int
    """Rows of the photo, pixels."""
    center: tuple[float, float]
    """X and y of the axis."""
    radius: float
    """Of the circle that the lens fills, or of the ball."""
    fov: float = 180.0
    """Deg across that circle; a ball shows everything."""
    elevation: float = 90.0
    """Deg, elevation of the direction in which the camera looks."""
    mirrored: bool = False
    """The picture was flipped left to right."""


def make_lens(kind: LensKind, width: int, height: int, **options: Any) -> Lens:
    """Make the lens of a picture; by default it fills the largest circle in the middle, and a fisheye looks up.

    Args:
        kind: its projection.
        width: pixels of the picture.
        height: pixels of the picture.
        **options: fields of `Lens` by name: center, radius, fov, elevation, mirrored. None is the default.

    Raises:
        ProbeError: no picture has such a field of view or circle, or a panorama is not twice as wide as high.
    """
    stated = {name: value for name, value in options.items() if value is not None}
    fullest = Lens(kind, width, height, (width / 2, height / 2), min(width, height) / 2, elevation=_ELEVATIONS[kind])
    lens = replace(fullest, **stated)
    if kind == "latlong" and width != 2 * height:
        raise ProbeError(f"A lat-long picture is twice as wide as high, not {width} x {height} pixels.")
    check_lens(kind, lens.fov, lens.radius)
    if not (0 <= lens.center[0] <= width and 0 <= lens.center[1] <= height):
        raise ProbeError("The lens's circle must have its center in the picture.", "center", ErrorCode.OUT_OF_RANGE)
    return lens


def check_lens(kind: LensKind, fov: float | None, radius: float | None) -> None:
    """Check a field of view and a circle, which may be unknown.

    Args:
        kind: the lens's projection.
        fov: deg across the circle, over 0 up to 360; None is unknown.
        radius: pixels of the circle, over 0; None is unknown.

    Raises:
        ProbeError: no lens of the kind has them.
    """
    if fov is not None and not 0 < fov <= 360:
        sentence = f"The lens's field of view is {fov:g} deg; it must be over 0 and up to 360."
        raise ProbeError(sentence, "fov", ErrorCode.OUT_OF_RANGE)
    if fov == 360 and kind == "equisolid":
        raise ProbeError("The field of view of an equisolid lens must be under 360 deg.", "fov", ErrorCode.OUT_OF_RANGE)
    if radius is not None and not radius > 0:
        sentence = f"The radius of the lens's circle is {radius:g} pixels; it must be over 0."
        raise ProbeError(sentence, "radius", ErrorCode.OUT_OF_RANGE)


def project_to_lens(lens: Lens, directions: ArrayLike) -> Floats:
    """Project directions into a picture.

    Args:
        lens: the picture's projection.
        directions: (..., 3) vectors in the camera's frame.

    Returns:
        Continuous pixel coordinates (..., 2), x and y; NaN where the lens shows nothing.
    """
    unit = np.asarray(directions, dtype=np.float64)
    if lens.kind == "latlong":
        # A panorama's own axis, by the elevation.
        raised = camera_axes(0.0, lens.elevation, 0.0).T @ camera_axes(0.0, 0.0, 0.0)
        pixel = latlong_pixel(unit @ raised, lens.height)
        return np.stack([lens.width - pixel[..., 0] if lens.mirrored else pixel[..., 0], pixel[..., 1]], axis=-1)
    right, up, forward = np.moveaxis(unit @ camera_axes(0.0, lens.elevation, 0.0).T, -1, 0)
    lateral = np.hypot(right, up)
    reach = lens.radius * _radius_of_angle(lens, np.arctan2(lateral, forward))
    per_side = reach / np.maximum(lateral, 1e-12)
    x = lens.center[0] + (-1 if lens.mirrored else 1) * right * per_side
    pixel = np.stack([x, lens.center[1] - up * per_side], axis=-1)
    return np.where((reach <= lens.radius * (1 + 1e-9))[..., None], pixel, np.nan)


def unproject_from_lens(lens: Lens, pixels: ArrayLike) -> Floats:
    """Return the directions that pixels show.

    Args:
        lens: the picture's projection.
        pixels: (..., 2) continuous coordinates, x and y.

    Returns:
        Unit vectors (..., 3) in the camera's frame; NaN outside the lens's circle.
    """
    x, y = np.moveaxis(np.asarray(pixels, dtype=np.float64), -1, 0)
    if lens.kind == "latlong":
        column = lens.width - x if lens.mirrored else x
        seen = direction((column / lens.width - 0.5) * 360.0, (0.5 - y / lens.height) * 180.0)
        return np.asarray(seen @ (camera_axes(0.0, 0.0, 0.0).T @ camera_axes(0.0, lens.elevation, 0.0)))
    right, up = (x - lens.center[0]) / lens.radius, (lens.center[1] - y) / lens.radius
    reach = np.hypot(right, up)
    theta = _angle_of_radius(lens, np.minimum(reach, 1.0))
    scale = np.sin(theta) / np.maximum(reach, 1e-12)
    directions = np.stack([(-1 if lens.mirrored else 1) * right * scale, up * scale, np.cos(theta)], axis=-1)
    return np.where((reach <= 1 + 1e-9)[..., None], directions @ camera_axes(0.0, lens.elevation, 0.0), np.nan)


def pixels_per_degree(lens: Lens) -> float:
    """Return how fine a picture is, at its axis or along its horizon [pixels/deg].

    Args:
        lens: the picture's projection.
    """
    if lens.kind == "latlong":
        return lens.height / 180.0
    step = 1e-4
    start = np.pi / 2 if lens.kind == "ball" else 0.0
    across = _radius_of_angle(lens, np.asarray(start + step)) - _radius_of_angle(lens, np.asarray(start))
    return float(abs(across) * lens.radius / np.degrees(step))


def _radius_of_angle(lens: Lens, theta: Floats) -> Floats:
    """Distance from the axis / the circle's radius (...) of angles from the camera's viewing axis (...) [rad]."""
    half = np.radians(lens.fov / 2)
    if lens.kind == "equidistant":
        return np.asarray(theta / half)
    if lens.kind == "equisolid":
        return np.asarray(np.sin(theta / 2) / np.sin(half / 2))
    return np.cos(theta / 2)  # a ball seen from afar reflects the camera in its middle, what is behind it at its edge


def _angle_of_radius(lens: Lens, reach: Floats) -> Floats:
    half = np.radians(lens.fov / 2)
    if lens.kind == "equidistant":
        return np.asarray(reach * half)
    if lens.kind == "equisolid":
        return np.asarray(2 * np.arcsin(reach * np.sin(half / 2)))
    return np.asarray(2 * np.arccos(reach))


# Resampling to a lat-long map.

_MAX_SAMPLES, _MAX_SAMPLES_OF_SMALL = 4, 6  # per side of a pixel, of maps from and under
_SMALL_HEIGHT = 256  # rows
_MIN_OVERSAMPLING = 1.5  # times finer than the map a picture stays at least
_MIN_CLIPPED_SHARE = 1e-3  # of a map's pixel, from which it is clipped: the smallest sun in the largest pixel is more
_ROWS_AT_ONCE = 16  # mapped at once


def resample_to_latlong(
    radiance: NDArray[np.float32], clipped: Mask, lens: Lens, rotation: Floats, height: int
) -> tuple[NDArray[np.float32], Mask]:
    """Resample a picture to a lat-long map that has as much light in every direction.

    Args:
        radiance: (h, w, 3) linear.
        clipped: (h, w), pixels whose radiance is a lower bound.
        lens: the picture's projection.
        rotation: (3, 3), takes directions of the camera to directions of the world.
        height: H, rows of the map.

    Returns:
        The map (H, 2H, 3), 0 where the lens shows nothing, and its clipped pixels (H, 2H).
    """
    picture = np.concatenate([radiance, clipped[..., None].astype(np.float32)], axis=-1)
    picture, lens = _reduce_picture(picture, lens, height)
    most = _MAX_SAMPLES_OF_SMALL if height < _SMALL_HEIGHT else _MAX_SAMPLES
    samples = int(np.clip(np.ceil(2 * pixels_per_degree(lens) * 180.0 / height), 2, most))
    result = np.empty((height, 2 * height, 4), dtype=np.float32)
    for start in range(0, height, _ROWS_AT_ONCE):
        rows = np.arange(start, min(start + _ROWS_AT_ONCE, height))
        result[rows] = _resample_rows(picture, lens, rotation, height, samples, rows)
    return result[..., :3], result[..., 3] >= _MIN_CLIPPED_SHARE


def _resample_rows(
    picture: Floats, lens: Lens, rotation: Floats, height: int, samples: int, rows: NDArray[np.intp]
) -> Floats:
    """Some rows (R, 2H, C) of a map, the mean of `samples` samples each way of every pixel of a picture (h, w, C)."""
    within = (np.arange(samples) + 0.5) / samples
    elevation = 90.0 - (rows[:, None] + within).reshape(-1) * 180.0 / height
    azimuth = ((np.arange(2 * height)[:, None] + within).reshape(-1) / height - 1) * 180.0
    directions = direction(azimuth[None, :], elevation[:, None])
    values = _sample_bilinear(picture, project_to_lens(lens, directions @ rotation), wrap=lens.kind == "latlong")
    return np.asarray(values.reshape(len(rows), samples, 2 * height, samples, -1).mean(axis=(1, 3)))


def _sample_bilinear(picture: Floats, pixels: Floats, *, wrap: bool = False) -> Floats:
    """Samples (..., C) of a picture (h, w, C) at continuous coordinates (..., 2) as (x, y); 0 where they are NaN.

    Beyond the outermost centers the edge goes on, or with `wrap` the other side begins.
    """
    height, width = picture.shape[:2]
    valid = np.asarray(np.isfinite(pixels).all(axis=-1))
    if not valid.any():
        return np.zeros((*pixels.shape[:-1], picture.shape[-1]), dtype=np.float32)
    position = np.where(valid[..., None], pixels, 0.0) - 0.5
    corner = np.floor(position)
    share = (position - corner).astype(np.float32)
    x0, y0 = corner[..., 0].astype(np.intp), corner[..., 1].astype(np.intp)
    total = np.zeros((*pixels.shape[:-1], picture.shape[-1]), dtype=np.float32)
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        column = np.mod(x0 + dx, width) if wrap else np.clip(x0 + dx, 0, width - 1)
        weight = np.abs(1 - dx - share[..., 0]) * np.abs(1 - dy - share[..., 1])
        total += weight[..., None] * picture[np.clip(y0 + dy, 0, height - 1), column]
    return np.where(valid[..., None], total, 0)


def _reduce_picture(picture: Floats, lens: Lens, height: int) -> tuple[Floats, Lens]:
    """The picture and its lens, averaged over whole squares of pixels until it is not much finer than the map."""
    factor = int(pixels_per_degree(lens) * 180.0 / height / _MIN_OVERSAMPLING)
    if lens.kind == "latlong":
        factor = next((f for f in range(factor, 1, -1) if lens.height % f == 0), 1)
    if factor < 2:
        return picture, lens
    rows, columns = (-(-size // factor) for size in picture.shape[:2])
    padding = [(0, rows * factor - lens.height), (0, columns * factor - lens.width), (0, 0)]
    blocks = np.pad(picture, padding).reshape(rows, factor, columns, factor, -1)
    center = (lens.center[0] / factor, lens.center[1] / factor)
    small = replace(lens, width=columns, height=rows, center=center, radius=lens.radius / factor)
    return blocks.mean(axis=(1, 3)), small

"""Which direction each pixel of a probe's picture shows: fisheye lenses, a mirrored ball, a lat-long panorama.

A camera that looks straight up has the top of its picture towards the south when its right is east, as one has who
leans back while facing north. Angles are in the camera's own frame of geometry.py until alignment turns them.
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from lighting.errors import ErrorCode, ProbeError
from lighting.geometry import Floats, camera_axes, direction, latlong_pixel

Kind = Literal["equidistant", "equisolid", "ball", "latlong"]

KINDS: tuple[Kind, ...] = ("equidistant", "equisolid", "ball", "latlong")
ABSENT: dict[Kind, tuple[str, ...]] = {  # what can be told of other lenses, but does nothing with these
    "ball": ("fov",),
    "latlong": ("fov", "centre", "radius"),
}
_PITCH = {"equidistant": 90.0, "equisolid": 90.0, "ball": 0.0, "latlong": 0.0}


@dataclass(frozen=True)
class Lens:
    """A projection; lengths in pixels of the picture, centres of pixels at (i + 0.5)."""

    kind: Kind
    width: int
    height: int
    centre: tuple[float, float]  # x and y of the axis
    radius: float  # of the circle that the lens fills, or of the ball
    fov: float = 180.0  # deg across that circle; a ball shows everything
    pitch: float = 90.0  # deg, elevation of the direction in which the camera looks
    mirrored: bool = False  # the picture was flipped left to right


def lens_of(kind: Kind, width: int, height: int, **told: Any) -> Lens:
    """The lens of a picture; what is not told (None) is usual: the largest circle in the middle, a fisheye looks up.

    Raises ProbeError for a field of view or a circle that no picture has, and for a panorama not twice as wide as high.
    """
    given = {name: value for name, value in told.items() if value is not None}
    usual = {"centre": (width / 2, height / 2), "radius": min(width, height) / 2, "fov": 180.0, "pitch": _PITCH[kind]}
    lens = Lens(kind, width, height, **{**usual, **given})
    if kind == "latlong" and width != 2 * height:
        raise ProbeError(f"A lat-long picture is twice as wide as high, not {width} x {height} pixels.")
    check_circle(kind, lens.fov, lens.radius)
    if not (0 <= lens.centre[0] <= width and 0 <= lens.centre[1] <= height):
        raise ProbeError("The lens's circle must have its centre in the picture.", "centre", ErrorCode.OUT_OF_RANGE)
    return lens


def check_circle(kind: Kind, fov: float | None, radius: float | None) -> None:
    """Raise ProbeError for a field of view [deg] or a circle's radius [pixels] that no lens of the kind has."""
    if fov is not None and not 0 < fov <= 360:
        raise ProbeError(
            f"The lens's field of view is {fov:g} deg; it must be over 0 and up to 360.", "fov", ErrorCode.OUT_OF_RANGE
        )
    if fov == 360 and kind == "equisolid":
        raise ProbeError("The field of view of an equisolid lens must be under 360 deg.", "fov", ErrorCode.OUT_OF_RANGE)
    if radius is not None and not radius > 0:
        raise ProbeError(
            f"The radius of the lens's circle is {radius:g} pixels; it must be over 0.",
            "radius",
            ErrorCode.OUT_OF_RANGE,
        )


def lens_pixels(lens: Lens, towards: ArrayLike) -> Floats:
    """Continuous pixel coordinates (..., 2) as (x, y) of directions (..., 3); NaN where the lens shows nothing."""
    d = np.asarray(towards, dtype=np.float64)
    if lens.kind == "latlong":
        pixel = latlong_pixel(_to_axis(lens, d), lens.height)
        return np.stack([lens.width - pixel[..., 0] if lens.mirrored else pixel[..., 0], pixel[..., 1]], axis=-1)
    right, up, forward = np.moveaxis(d @ camera_axes(0.0, lens.pitch, 0.0).T, -1, 0)
    aside = np.hypot(right, up)
    reach = lens.radius * _radius_of_angle(lens, np.arctan2(aside, forward))
    per_side = reach / np.maximum(aside, 1e-12)
    x = lens.centre[0] + (-1 if lens.mirrored else 1) * right * per_side
    pixel = np.stack([x, lens.centre[1] - up * per_side], axis=-1)
    return np.where((reach <= lens.radius * (1 + 1e-9))[..., None], pixel, np.nan)


def lens_directions(lens: Lens, pixels: ArrayLike) -> Floats:
    """Unit vectors (..., 3) of continuous pixel coordinates (..., 2); NaN outside the lens's circle."""
    x, y = np.moveaxis(np.asarray(pixels, dtype=np.float64), -1, 0)
    if lens.kind == "latlong":
        side = lens.width - x if lens.mirrored else x
        return _from_axis(lens, direction((side / lens.width - 0.5) * 360.0, (0.5 - y / lens.height) * 180.0))
    right, up = (x - lens.centre[0]) / lens.radius, (lens.centre[1] - y) / lens.radius
    reach = np.hypot(right, up)
    theta = _angle_of_radius(lens, np.minimum(reach, 1.0))
    scale = np.sin(theta) / np.maximum(reach, 1e-12)
    towards = np.stack([(-1 if lens.mirrored else 1) * right * scale, up * scale, np.cos(theta)], axis=-1)
    return np.where((reach <= 1 + 1e-9)[..., None], towards @ camera_axes(0.0, lens.pitch, 0.0), np.nan)


def pixels_per_degree(lens: Lens) -> float:
    """How fine the picture is, at its axis or along its horizon."""
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


def _to_axis(lens: Lens, towards: Floats) -> Floats:
    """Directions as a panorama sees them whose own axis is raised by the pitch."""
    return np.asarray(towards @ (camera_axes(0.0, lens.pitch, 0.0).T @ camera_axes(0.0, 0.0, 0.0)))


def _from_axis(lens: Lens, towards: Floats) -> Floats:
    return np.asarray(towards @ (camera_axes(0.0, 0.0, 0.0).T @ camera_axes(0.0, lens.pitch, 0.0)))

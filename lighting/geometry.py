"""Frame, angles, lat-long pixels, pinhole camera, image size helpers.

Frame: right-handed, +Y up, gravity-aligned. The camera looks along -Z at azimuth 0 and +X is to its
right. Azimuth is 0 where the camera points and grows to the right (clockwise seen from above), in
(-180, 180] degrees; elevation is degrees above the horizon.

Lat-long image: width = 2 x height, row 0 is the zenith, the center column is azimuth 0, the right half is
right of the camera. Pixel coordinates are continuous with centers at (i + 0.5), and the seam wraps.

Camera: elevation positive looks up; roll positive turns the camera clockwise about its viewing axis as its
holder sees it, so that the horizon in the picture turns counter-clockwise. Field of view is vertical.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Kind = TypeVar("_Kind", bound=np.generic)
Floats = NDArray[np.floating]

SUN_RADIUS = 0.2679  # deg, angular radius of the disc: half of 0.5358, as the Hosek-Wilkie sun has it
MIN_STEEP_ELEVATION = 85.0  # deg of elevation, up or down, from which a camera has no roll
_SAMPLED_AT_ONCE = 1 << 14  # directions, few enough for the processor's cache
EYE_HEIGHT = 1.6  # m, of a camera in the hand over level ground; no photo tells its scale
OBJECT_POSITION = 0.6  # how far below the picture's middle things are put on the ground, 0 = middle, 1 = lower edge


def turn_to_degrees(angle: NDArray[np.float32]) -> NDArray[np.float32]:
    """Turn radians into degrees in place, as np.degrees does in ten times the time.

    Args:
        angle: (...) rad; the same array is returned.
    """
    angle *= np.float32(180) / np.float32(np.pi)
    return angle


def direction(azimuth: ArrayLike, elevation: ArrayLike) -> Floats:
    """Return unit vectors (..., 3) of azimuth and elevation, which broadcast.

    Args:
        azimuth: deg from where the camera points, positive to the right.
        elevation: deg above the horizon, -90 to 90.
    """
    az, el = np.radians(azimuth), np.radians(elevation)
    level = np.cos(el)
    vectors = np.empty((*np.broadcast(az, el).shape, 3), dtype=np.result_type(az, el))
    vectors[..., 0], vectors[..., 1], vectors[..., 2] = np.sin(az) * level, np.sin(el), -np.cos(az) * level
    return vectors


def angles(direction: ArrayLike) -> tuple[Floats, Floats]:
    """Return azimuth in (-180, 180] and elevation in [-90, 90] [deg] of vectors.

    Args:
        direction: (..., 3), of any length.
    """
    vectors = np.asarray(direction, dtype=np.float64)
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    azimuth = np.degrees(np.arctan2(x, -z))
    elevation = np.degrees(np.arctan2(y, np.hypot(x, z)))
    return wrap_azimuth(azimuth), elevation


def wrap_azimuth(azimuth: ArrayLike) -> Floats:
    """Return the same azimuth [deg] in (-180, 180].

    Args:
        azimuth: deg, of any size.
    """
    return -np.mod(180.0 - np.asarray(azimuth, dtype=np.float64), 360.0) + 180.0


def angle_between(a: ArrayLike, b: ArrayLike) -> Floats:
    """Return the angle [deg] between vectors, exact for tiny and for opposite ones.

    Args:
        a: (..., 3), of any length.
        b: (..., 3), of any length; broadcasts against `a`.

    References:
        W. Kahan, "How Futile are Mindless Assessments of Roundoff in Floating-Point Computation?", 2006, section 12.
    """
    u, v = _unit(a), _unit(b)
    half = np.arctan2(_length(u - v), _length(u + v))
    return np.asarray(np.degrees(2.0 * half))


def _unit(vector: ArrayLike) -> Floats:
    v = np.asarray(vector, dtype=np.float64)
    return np.asarray(v / _length(v)[..., None])


def _length(vector: Floats) -> Floats:
    """Lengths (...) of vectors (..., 3), with less to do than np.linalg.norm has."""
    return np.asarray(np.sqrt(dot_product(vector, vector)))


@lru_cache(maxsize=16)
def latlong_angles(height: int) -> tuple[Floats, Floats]:
    """Return azimuth of the columns (2H,) and elevation of the rows (H,) [deg], at pixel centers, to be read alone.

    Args:
        height: rows of the lat-long image.
    """
    azimuth = ((np.arange(2 * height) + 0.5) / (2 * height) - 0.5) * 360.0
    elevation = (0.5 - (np.arange(height) + 0.5) / height) * 180.0
    for angles_of_pixels in (azimuth, elevation):
        angles_of_pixels.setflags(write=False)
    return azimuth, elevation


def latlong_directions(height: int) -> Floats:
    """Return unit vectors (H, 2H, 3) of a lat-long image's pixel centers.

    Args:
        height: rows of the lat-long image.
    """
    azimuth, elevation = latlong_angles(height)
    return direction(azimuth[None, :], elevation[:, None])


def latlong_pixel(direction: ArrayLike, height: int) -> Floats:
    """Return continuous pixel coordinates (..., 2) as (x, y); x in [0, 2H), y in [0, H].

    Args:
        direction: (..., 3), of any length.
        height: rows of the lat-long image.
    """
    azimuth, elevation = angles(direction)
    x = np.mod((azimuth / 360.0 + 0.5) * 2 * height, 2 * height)
    return np.stack([x, (0.5 - elevation / 180.0) * height], axis=-1)


def latlong_solid_angle(height: int) -> Floats:
    """Return the solid angle [sr] of one pixel in each row (H,); the whole image sums to 4 pi.

    Args:
        height: rows of the lat-long image.
    """
    edges = np.cos(np.linspace(0.0, np.pi, height + 1))
    return (edges[:-1] - edges[1:]) * (np.pi / height)


def camera_axes(azimuth: float, elevation: float, roll: float) -> Floats:
    """Return the camera's right, up and forward unit vectors as rows (3, 3).

    Args:
        azimuth: deg, where the camera looks.
        elevation: deg, positive looks up.
        roll: deg, positive turns the camera clockwise.
    """
    forward = direction(azimuth, elevation)
    right = direction(azimuth + 90.0, 0.0)
    up = direction(azimuth, elevation + 90.0)
    c, s = np.cos(np.radians(roll)), np.sin(np.radians(roll))
    return np.stack([c * right - s * up, s * right + c * up, forward])


def zoomed_fov(vertical_fov: float, zoom: float) -> float:
    """Return the vertical field of view [deg] of a zoomed lens, or of a crop.

    Args:
        vertical_fov: deg, before the zoom.
        zoom: the new focal length by the old one, over 0; of a crop, the old height by the new one.
    """
    return float(np.degrees(2.0 * np.arctan(np.tan(np.radians(vertical_fov) / 2.0) / zoom)))


def focal_length(height: float, vertical_fov: float) -> float:
    """Return the focal length [pixels] of a pinhole camera.

    Args:
        height: of its picture, pixels.
        vertical_fov: deg, in (0, 180).
    """
    return float(0.5 * height / np.tan(np.radians(vertical_fov) / 2.0))


@dataclass(frozen=True)
class Pinhole:
    """A pinhole camera and the size of its picture; the picture's center is the principal point."""

    width: int
    """Width, pixels."""
    height: int
    """Height, pixels."""
    vertical_fov: float
    """Vertical fov, deg."""
    azimuth: float = 0.0
    """Azimuth, deg."""
    elevation: float = 0.0
    """Elevation, deg."""
    roll: float = 0.0
    """Roll, deg."""

    @cached_property
    def axes(self) -> Floats:
        """The camera's right, up and forward unit vectors as rows (3, 3); read-only."""
        axes = camera_axes(self.azimuth, self.elevation, self.roll)
        axes.flags.writeable = False
        return axes

    @cached_property
    def focal_length(self) -> float:
        """Focal length [pixels]."""
        return focal_length(self.height, self.vertical_fov)


def camera_directions(camera: Pinhole) -> Floats:
    """Return unit vectors (H, W, 3) through a camera's pixel centers.

    Args:
        camera: whose picture is H x W.
    """
    return pixel_directions(camera, np.arange(camera.width) + 0.5, np.arange(camera.height)[:, None] + 0.5)


def pixel_directions(camera: Pinhole, x: Floats, y: Floats) -> Floats:
    """Return unit vectors (..., 3) through points of a camera's picture, in pixels from its upper left corner.

    Args:
        camera: any.
        x: (...) to the right.
        y: (...) down; both broadcast.
    """
    x, y = (x - 0.5 * camera.width) / camera.focal_length, (0.5 * camera.height - y) / camera.focal_length
    forward = 1 / np.sqrt(1 + x**2 + y**2)
    rays = np.empty((*forward.shape, 3))
    rays[..., 0], rays[..., 1], rays[..., 2] = x * forward, y * forward, forward
    return np.asarray((rays.reshape(-1, 3) @ camera.axes).reshape(rays.shape))


def pixel_ray(camera: Pinhole, point: tuple[float, float]) -> Floats:
    """Return the unit vector (3,) through a point of a camera's picture.

    Args:
        camera: any.
        point: (x, y) pixels; the left upper pixel's middle is (0.5, 0.5).
    """
    x, y = (point[0] - camera.width / 2) / camera.focal_length, (camera.height / 2 - point[1]) / camera.focal_length
    ray = np.array([x, y, 1.0]) @ camera.axes
    return np.asarray(ray / np.linalg.norm(ray))


def camera_pixel(direction: ArrayLike, camera: Pinhole) -> Floats:
    """Return continuous pixel coordinates (..., 2) as (x, y); NaN behind the camera.

    Args:
        direction: (..., 3), of any length.
        camera: whose picture it is.
    """
    vectors = np.asarray(direction)
    x, y, z = (vectors.reshape(-1, 3) @ camera.axes.T).T.reshape(3, *vectors.shape[:-1])
    z = np.where(z > 1e-9, z, np.nan)
    focal = camera.focal_length
    return np.stack([0.5 * camera.width + focal * x / z, 0.5 * camera.height - focal * y / z], axis=-1)


def sample_latlong(image: NDArray[np.number], direction: ArrayLike) -> Floats:
    """Sample a lat-long image bilinearly (..., C).

    It wraps at the seam; across a pole it continues on the opposite side. Directions of 32 bits are placed with 32
    bits: to a thousandth of a pixel.

    Args:
        image: (H, 2H, C).
        direction: (..., 3), of any length.
    """
    return LatlongSampler(image)(direction)


class LatlongSampler:
    """`sample_latlong` of one image, whose border is made once."""

    def __init__(self, image: NDArray[np.number]) -> None:
        """Copy an image (H, 2H, C)."""
        self._height, _, self._channels = image.shape
        self._bordered: NDArray[Any] = _with_border(image)

    def __call__(self, direction: ArrayLike) -> Floats:
        """Sample it in directions (..., 3)."""
        vectors = np.asarray(direction)
        rays = vectors.reshape(-1, 3) if vectors.dtype == np.float32 else vectors.reshape(-1, 3).astype(np.float64)
        bordered, width, channels = self._bordered, 2 * self._height, self._channels
        kind = bordered.dtype if np.issubdtype(bordered.dtype, np.floating) else np.float32
        result = np.empty((len(rays), channels), kind)
        for start in range(0, len(rays), _SAMPLED_AT_ONCE):
            part = slice(start, start + _SAMPLED_AT_ONCE)
            first, right_share, lower_share = _place_in_border(rays[part], self._height)
            right_share, lower_share = (
                np.repeat(share, channels).reshape(-1, channels) for share in (right_share, lower_share)
            )
            upper, lower = (_mix_columns(bordered, first + step, right_share) for step in (0, width + 2))
            lower -= upper
            lower *= lower_share
            np.add(lower, upper, out=result[part])
        return result.reshape(*vectors.shape[:-1], channels)


def _place_in_border(rays: Floats, height: int) -> tuple[NDArray[np.intp], NDArray[np.float32], NDArray[np.float32]]:
    """Where directions (N, 3) lie in a lat-long image of some rows with its border.

    The index (N,) of the pixel on the upper left, and the shares (N,) of those on the right and below.
    """
    width = 2 * height
    x, y, z = np.moveaxis(rays, -1, 0)
    column, row = np.arctan2(x, -z), np.arctan2(y, np.sqrt(x * x + z * z))
    column *= width / (2 * np.pi)
    column += width / 2 + 0.5  # of the border, whose pixels begin a pixel later
    row *= -height / np.pi
    row += height / 2 + 0.5
    left, top = np.floor(column), np.floor(row)
    right_share, lower_share = (column - left).astype(np.float32), (row - top).astype(np.float32)
    first = top.astype(np.intp)
    first *= width + 2
    first += left.astype(np.intp)
    return first, right_share, lower_share


def _with_border(image: NDArray[_Kind]) -> NDArray[_Kind]:
    """The pixels ((H + 2) (2H + 2), C) of a lat-long image with those that lie beyond its edges."""
    height, width, channels = image.shape
    bordered = np.empty((height + 2, width + 2, channels), image.dtype)
    bordered[1:-1, 1:-1] = image
    half = width // 2
    for edge in (0, -1):
        bordered[edge, 1 : half + 1], bordered[edge, half + 1 : -1] = image[edge, half:], image[edge, :half]
    bordered[:, 0], bordered[:, -1] = bordered[:, -2], bordered[:, 1]
    return bordered.reshape(-1, channels)


def _mix_columns(pixels: NDArray[Any], first: NDArray[np.intp], share: NDArray[np.float32]) -> Floats:
    """Values (N, C) between the pixels at indices (N,) and those after them, which have shares (N, C)."""
    left, right = pixels.take(first, axis=0), pixels.take(first + 1, axis=0)
    if not np.issubdtype(left.dtype, np.floating):
        left, right = left.astype(np.float32), right.astype(np.float32)
    right -= left
    right *= share
    right += left
    return np.asarray(right)


def dot_product(a: Floats, b: Floats) -> Floats:
    """Return dot products (...): sums of columns, a third of the time that `np.vecdot` takes for three of them.

    Args:
        a: (..., 3) vectors.
        b: (..., 3) vectors; both broadcast.
    """
    return np.asarray(a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2])


def ray_sphere(origin: Floats, direction: Floats, center: Floats, radius: float = 1.0) -> Floats:
    """Return the distance (...) along rays to where they enter a sphere.

    It is inf where they miss it, or start inside or beyond it. All arrays broadcast and share one unit of length.

    Args:
        origin: (..., 3), where the rays start.
        direction: (..., 3), unit vectors.
        center: (..., 3), of the sphere.
        radius: of the sphere.
    """
    offset = center - origin
    along = dot_product(offset, direction)
    discriminant = along**2 - dot_product(offset, offset) + radius**2
    distance = along - np.sqrt(np.maximum(discriminant, 0))
    return np.asarray(np.where((discriminant > 0) & (distance > 0), distance, np.inf))


def pixel_window(cells: NDArray[np.bool_], height: int, width: int) -> tuple[slice, slice] | None:
    """Return the rows and columns of a picture that hold the true cells of a coarse one, and a cell on every side.

    It is None where no cell is true.

    Args:
        cells: (h, w).
        height: of the picture, pixels.
        width: of the picture, pixels.
    """
    if not cells.any():
        return None
    return _span(cells, 0, height), _span(cells, 1, width)


def clip_slice(middle: float, reach: float, count: int) -> slice:
    """Return which rows or columns lie within reach of a middle; an empty slice where none does.

    Args:
        middle: pixels.
        reach: pixels to either side.
        count: of all rows or columns.
    """
    first = max(0, int(middle - reach))
    return slice(first, max(first, min(count, int(middle + reach) + 1)))


def _span(cells: NDArray[np.bool_], axis: int, count: int) -> slice:
    """Of `count` pixels along an axis those from the first true cell to the last, and a cell on either side."""
    true, step = np.flatnonzero(cells.any(axis=1 - axis)), count / cells.shape[axis]
    return slice(max(0, int((true[0] - 1) * step)), min(count, int(np.ceil((true[-1] + 2) * step))))


def to_z_up(vector: Floats) -> Floats:
    """The same vectors in a frame where +Z is up and the camera looks along +Y.

    Args:
        vector: (..., 3) in this module's frame.
    """
    x, y, z = np.moveaxis(np.asarray(vector), -1, 0)
    return np.stack([x, -z, y], axis=-1)


def scale_size(width: int, height: int, scale: float) -> tuple[int, int]:
    """Return width and height of a scaled picture, in whole pixels, at least 1 x 1.

    Args:
        width: pixels.
        height: pixels.
        scale: factor of both.
    """
    return max(1, round(width * scale)), max(1, round(height * scale))


def fit_in_box(width: int, height: int, max_width: int, max_height: int) -> tuple[int, int]:
    """Return the largest width and height of a picture's aspect ratio in a box, at least 1 x 1.

    Args:
        width: pixels.
        height: pixels.
        max_width: of the box, pixels.
        max_height: of the box, pixels.
    """
    return scale_size(width, height, min(max_width / width, max_height / height))


def shrink_size(width: int, height: int, side: int) -> tuple[int, int]:
    """Return width and height of a picture whose longer side is reduced to a length, if it is longer.

    Args:
        width: pixels.
        height: pixels.
        side: longest that may stay, pixels.
    """
    return (width, height) if max(width, height) <= side else fit_in_box(width, height, side, side)

"""Where a photo has room for the balls: on plain ground, off people and things."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.geometry import SPOT, Floats, Pinhole, camera_directions

_ROWS = 150  # of the picture in which unrest is counted: paving and grass are plain in it, people and bollards are not
_LOWEST = 0.95  # of the picture's height, where a foot may stand
_ABOVE, _BELOW = 2.0, 0.5  # ball radii that must be free over the feet and under them
_AWAY = 100.0  # grey levels of unrest that one is ready to bear to stay in the lower middle


def has_room(camera: Pinhole, radius: float, row: float) -> bool:
    """Whether the picture of a camera shows ground for balls as `plain_spot` has them."""
    return bool(_feet(_coarse(camera), row * radius / camera.height, radius / camera.focal_length).any())


def plain_spot(picture: Image.Image, camera: Pinhole, radius: float, row: float) -> tuple[float, float] | None:
    """The pixel (x, y) where balls side by side disturb a picture least; None where it shows no ground for them.

    `radius` [pixels] is a ball's, and they are `row` radii wide to either side; none is as high as the camera. The box
    around them holds the least unrest, which is the mean difference between neighbours; the nearer to the lower middle,
    the better.
    """
    small = _coarse(camera)
    tall = radius / camera.height
    feet = _feet(small, row * tall, radius / camera.focal_length)
    if not feet.any():
        return None
    grey = picture.convert("L").resize((small.width, small.height), Image.Resampling.BOX)
    y, x = np.mgrid[: small.height, : small.width] + 0.5
    away = np.abs(x / small.width - 0.5) + np.abs(y / small.height - (1 + SPOT) / 2)
    aside, above, below = (radii * tall * small.height for radii in (row, _ABOVE, _BELOW))
    unrest = _boxed(_unrest(np.asarray(grey, dtype=np.float32)), aside, above, below)
    down, across = np.unravel_index(np.argmin(np.where(feet, unrest + _AWAY * away, np.inf)), feet.shape)
    return (float(across) + 0.5) * camera.width / small.width, (float(down) + 0.5) * camera.height / small.height


def _coarse(camera: Pinhole) -> Pinhole:
    """The camera with a picture of at most _ROWS rows."""
    rows = min(camera.height, _ROWS)
    return replace(camera, width=max(1, round(camera.width * rows / camera.height)), height=rows)


def _feet(camera: Pinhole, half: float, radius: float) -> NDArray[np.bool_]:
    """Which pixels (h, w) show ground where balls stand wholly in the picture and lower than the camera.

    `half` is the half width of all [picture heights], `radius` a ball's [focal lengths].
    """
    rays = camera_directions(camera)
    below = rays[..., 1] < -2 * radius * (rays @ camera.axes[2])
    below[int(_LOWEST * camera.height) :] = False
    aside = np.abs(np.arange(camera.width) + 0.5 - camera.width / 2) / camera.height
    return np.asarray(below & (aside <= max(camera.width / 2 / camera.height - half, 0.5 / camera.height)))


def _unrest(grey: NDArray[np.float32]) -> NDArray[np.float32]:
    """Differences (h, w) of a picture's pixels from their neighbours to the right and below."""
    across, down = (np.abs(np.diff(grey, axis=axis)) for axis in (1, 0))
    return np.asarray(np.pad(across, ((0, 0), (0, 1))) + np.pad(down, ((0, 1), (0, 0))))


def _boxed(values: NDArray[np.float32], aside: float, above: float, below: float) -> Floats:
    """The mean (h, w) of values (h, w) within the boxes around each pixel that reach so far [pixels]."""
    rows, columns = values.shape
    sums = np.pad(values.astype(np.float64).cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    y, x = np.arange(rows) + 0.5, np.arange(columns) + 0.5
    top, bottom = (np.clip(np.round(edge), 0, rows).astype(int) for edge in (y - above, y + below))
    left, right = (np.clip(np.round(edge), 0, columns).astype(int) for edge in (x - aside, x + aside))
    held = sums[bottom] - sums[top]
    area = np.maximum(np.outer(bottom - top, right - left), 1)
    return np.asarray((held[:, right] - held[:, left]) / area)

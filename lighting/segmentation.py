"""What each part of a photo shows: ground, water, plants, buildings, vehicles, people, sky; by the network.

The network says it of cells of its canvas, CELL_PIXELS wide. `photo_segments` gives those of the photo: 24 x 18 for
a landscape photo, 18 x 24 for an upright one.
"""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.geometry import fit_in_box

Segments = NDArray[np.float32]  # (R, C, classes) probabilities of SurfaceClass in the cells of a photo, rows from above

CELL_PIXELS = 8  # of the network's canvas, each way
_CELLS = (24, 18)  # of a photo's longer and shorter side


class SurfaceClass(IntEnum):
    """What a cell shows, in the order of the network's output."""

    GROUND = 0  # firm and level, and so near that cells are places
    UNEVEN = 1  # slope, steps, boulders, tall grass
    WATER = 2
    PLANTS = 3
    BUILDING = 4  # or wall, fence, bridge
    VEHICLE = 5
    PERSON = 6  # or animal
    OBJECT = 7
    FAR_TERRAIN = 8
    SKY = 9


THINGS = (  # that stand on the ground, in front of what is behind them
    SurfaceClass.PLANTS,
    SurfaceClass.BUILDING,
    SurfaceClass.VEHICLE,
    SurfaceClass.PERSON,
    SurfaceClass.OBJECT,
    SurfaceClass.SKY,
)


def photo_segments(canvas: NDArray[np.float32] | None, width: int, height: int) -> Segments | None:
    """Return what the cells of a photo show by what those of the network's canvas show.

    Args:
        canvas: (R, C, classes) probabilities, as `Prediction.segments` has them. None: not predicted, as the answer.
        width: of the photo, pixels.
        height: of the photo, pixels.
    """
    if canvas is None:
        return None
    rows, columns, _ = canvas.shape
    inside = np.array(fit_in_box(width, height, columns * CELL_PIXELS, rows * CELL_PIXELS)) / CELL_PIXELS
    left, top = (np.array([columns, rows]) - inside) / 2
    box = (left, top, left + inside[0], top + inside[1])
    size = _CELLS if width >= height else _CELLS[::-1]
    planes = (Image.fromarray(plane) for plane in np.ascontiguousarray(np.moveaxis(canvas, 2, 0)))
    return np.stack([np.asarray(plane.resize(size, Image.Resampling.BILINEAR, box=box)) for plane in planes], axis=-1)


def class_share(segments: Segments, *classes: SurfaceClass) -> NDArray[np.float32]:
    """Return the probability (R, C) that cells show one of some classes.

    Args:
        segments: of a photo.
        classes: one or more.
    """
    return np.asarray(segments[..., list(classes)].sum(axis=-1))


def pixel_share(segments: Segments, width: int, height: int, *classes: SurfaceClass) -> NDArray[np.float32]:
    """Return `class_share` for the pixels (h, w) of a picture, linear between the cells' middles.

    Args:
        segments: of the whole picture.
        width: of the picture, pixels.
        height: of the picture, pixels.
        classes: one or more.
    """
    cells = Image.fromarray(class_share(segments, *classes))
    return np.asarray(cells.resize((width, height), Image.Resampling.BILINEAR))

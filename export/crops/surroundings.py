"""A coarse map of the light around a crop's camera: a further training target, with or without a sun.

Only training uses it. It holds many values where the sun's direction is a single one, so a network that can predict it
has learnt more from a panorama than which place it is.
"""

import numpy as np
from PIL import Image

from export.crops.cameras import Camera
from export.crops.crops import resize
from export.crops.sources import Source
from export.data import linear_of
from lighting.colour import luminance
from lighting.geometry import Floats

ROWS, COLUMNS = 12, 24  # cells of the map
CELLS = ROWS * COLUMNS
_FINE = 6  # parts of a column, the steps by which the map is turned


def light_around(source: Source) -> Floats:
    """Log luminance and log blue over red (ROWS, _FINE * COLUMNS, 2) of a panorama, minus their means."""
    linear = linear_of(source.panorama, source.levels[-1])
    small = resize(linear, _FINE * COLUMNS, ROWS, Image.Resampling.BOX)
    light = np.log(luminance(small) + 0.01)
    colour = np.log((small[..., 2] + 0.02) / (small[..., 0] + 0.02))
    return np.stack([light - light.mean(), colour - colour.mean()], axis=-1).astype(np.float32)


def seen_from(around: Floats, camera: Camera) -> Floats:
    """The map (2 * CELLS,) row by row with the camera's azimuth in its middle, mirrored as the crop is."""
    turned = np.roll(around, -round(camera.azimuth / 360 * _FINE * COLUMNS), axis=1)
    turned = turned[:, ::-1] if camera.mirrored else turned
    return np.asarray(turned.reshape(ROWS, COLUMNS, _FINE, 2).mean(axis=2).ravel())

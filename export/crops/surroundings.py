"""A coarse map of the light around a crop's camera, in the crop's own exposure and white balance.

It is a training target: it holds many values where the sun's direction is a single one, so a network that predicts it
has learnt more from a panorama than which place it is. What is learnt also completes the maps that reflect the place.
"""

import numpy as np
from PIL import Image

from export.crops.cameras import Camera
from export.crops.crops import resize
from export.crops.sources import Source
from export.crops.stretch import NOT_STRETCHED, Stretch
from export.data import linear_of
from lighting.geometry import Floats, latlong_directions, sample_latlong

ROWS, COLUMNS = 12, 24  # cells of the map
CELLS = ROWS * COLUMNS
DARKEST = 0.01  # added to radiances before the logarithm
BRIGHTEST = 4.0  # the photo's white is 1; the sun's disc counts no more than this
_FINE = 6  # parts of a row and of a column, the steps by which the map is turned


def light_around(source: Source) -> Floats:
    """Linear radiance (_FINE * ROWS, _FINE * COLUMNS, 3) of a panorama, in its own exposure."""
    linear = np.asarray(linear_of(source.panorama, source.levels[-1]), dtype=np.float32)
    return resize(linear, _FINE * COLUMNS, _FINE * ROWS, Image.Resampling.BOX)


def seen_from(around: Floats, camera: Camera, gains: Floats, stretch: Stretch = NOT_STRETCHED) -> Floats:
    """Log radiance (ROWS * COLUMNS * 3,) row by row, the camera's azimuth in the map's middle, mirrored as the crop is.

    `gains` (3,) lead from the panorama's values to the photo's; `stretch` is that of the crop's world.
    """
    if stretch != NOT_STRETCHED:
        around = sample_latlong(around, stretch.undone(latlong_directions(_FINE * ROWS)))
    turned = np.roll(around, -round(camera.azimuth / 360 * _FINE * COLUMNS), axis=1)
    turned = turned[:, ::-1] if camera.mirrored else turned
    rows = turned.reshape(ROWS, _FINE, _FINE * COLUMNS, 3).mean(axis=1)
    cells = np.minimum(rows * gains, BRIGHTEST).reshape(ROWS, COLUMNS, _FINE, 3).mean(axis=2)
    return np.asarray(np.log(cells + DARKEST), dtype=np.float32).ravel()

"""Where in the picture the sun is seen: the target that training asks of the network, cell by cell."""

import numpy as np

from export.crops.crops import Crop
from lighting.geometry import Floats
from lighting.records import ModelSpec

CELL = 16  # pixels of the canvas along one side of a cell
TARGET_SPREAD = 0.7  # cells, standard deviation of the target around the sun


def where_seen(crop: Crop, spec: ModelSpec, visible: bool | None) -> Floats:
    """Probabilities (1 + cells,) that the picture shows no sun, and that each cell does, row by row; zeros if unknown.

    `visible` says whether the panorama shows the sun, None if unknown. A crop that looks elsewhere shows none.
    """
    rows, columns = spec.height // CELL, spec.width // CELL
    probability: Floats = np.zeros(1 + rows * columns)
    if visible is None:
        return probability
    place = crop.sun_pixel if visible else None
    if place is None:
        probability[0] = 1.0
        return probability
    height, width = crop.linear.shape[:2]
    margin = np.array([(spec.width - width) // 2, (spec.height - height) // 2])
    x, y = (np.array(place) + margin) / CELL - 0.5
    distance = (np.arange(columns)[None, :] - x) ** 2 + (np.arange(rows)[:, None] - y) ** 2
    bell = np.exp(-distance / (2 * TARGET_SPREAD**2)).ravel()
    probability[1:] = bell / bell.sum()
    return probability

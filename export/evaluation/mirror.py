"""Mirror averaging: what a network says of a picture and of its mirror image, as one answer."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lighting.records import Prediction
from lighting.sun_grid import grid_directions, over_cells


def mirrored(said: Prediction) -> Prediction:
    """What was said of a mirror image, turned back left for right."""
    grid = said.spec.sun_grid
    probability = over_cells(said.sun_probability, grid_directions(grid) * (-1.0, 1.0, 1.0), grid)
    return replace(said, sun_probability=probability.astype(np.float32), camera_roll=-said.camera_roll)


def averaged(one: Prediction, other: Prediction) -> Prediction:
    """The mean of two answers about one picture; of turbidity and exposure the geometric one."""
    ratio = {name: np.sqrt(getattr(one, name) * getattr(other, name)) for name in ("turbidity", "exposure")}
    plain = ("sun_visibility", "camera_elevation", "camera_roll", "vertical_fov")
    mean = {name: (getattr(one, name) + getattr(other, name)) / 2 for name in plain}
    probability = (one.sun_probability + other.sun_probability) * np.float32(0.5)
    return Prediction(one.spec, probability, **{name: float(value) for name, value in (ratio | mean).items()})


def mirror_averaged(said: Sequence[Prediction], of_mirrors: Sequence[Prediction]) -> list[Prediction]:
    """One answer a picture from those about the pictures and about their mirror images."""
    return [averaged(one, mirrored(other)) for one, other in zip(said, of_mirrors, strict=True)]

"""The camera by the straight lines that the picture shows, beside what the network says of it.

Verticals and horizontals of the world are likelihoods over a grid of elevation, roll and lens, times a heavy-tailed
prior around the network's answer.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.evidence.cameras import LENSES, Cameras, by_the_network, cameras_around, half_of
from lighting.evidence.contradiction import LENS_RATIO, lens_ratio
from lighting.evidence.horizontals import by_horizontals
from lighting.evidence.lines import Edges, edges_of
from lighting.evidence.verticals import by_verticals
from lighting.geometry import Floats, focal_length, up_in_camera
from lighting.records import Prediction
from lighting.sizes import shrunk

MOST_SIDE = 448  # pixels along the longer side; more bring no better camera
_MISLED = 0.1  # share of the photos whose lines say nothing: cropped or set upright afterwards, or of a sloping street


def with_lines(prediction: Prediction, pixels: NDArray[np.uint8], vertical_fov: float | None = None) -> Prediction:
    """The prediction with the camera by its straight lines too; its sun stays where it is. `pixels` (h, w, 3) are sRGB.

    Where the lens is known (`vertical_fov` [deg]), elevation and roll are those of a camera with it, unless the pixels
    contradict it. The field of view stays what the pixels say, so that the two can be compared.
    """
    grey = _grey(pixels)
    up = up_in_camera(prediction.camera_elevation, prediction.camera_roll)
    edges = edges_of(grey, up, focal_length(len(grey), prediction.vertical_fov))
    known = _known_lens(prediction, vertical_fov)
    if not (len(edges.upright.length) or len(edges.other.length)) and known is None:
        return prediction
    elevation, roll, lens = _means(cameras_around(prediction, LENSES), edges, len(grey))
    if known is not None:
        elevation, roll, _ = _means(cameras_around(prediction, known), edges, len(grey))
    return replace(
        prediction,
        camera_elevation=elevation,
        camera_roll=roll,
        vertical_fov=math.degrees(2 * math.atan(half_of(prediction) * math.exp(lens))),
    )


def _known_lens(prediction: Prediction, vertical_fov: float | None) -> Floats | None:
    """The known lens (1,) around the network's answer as LENSES are, unless the pixels contradict it."""
    if vertical_fov is None or lens_ratio(prediction.vertical_fov, vertical_fov) > LENS_RATIO:
        return None
    return np.array([math.log(math.tan(math.radians(vertical_fov) / 2) / half_of(prediction))])


def _grey(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Grey levels (h, w) of pixels (h, w, 3), at most MOST_SIDE along the longer side."""
    grey = Image.fromarray(pixels).convert("L")
    return np.asarray(grey.resize(shrunk(*grey.size, MOST_SIDE), Image.Resampling.BOX))


def _means(cameras: Cameras, edges: Edges, height: int) -> tuple[float, float, float]:
    """Elevation and roll [deg] and lens in the mean of the posterior, the lens as `cameras` has it."""
    log = by_the_network(cameras)
    if len(edges.upright.length):
        log = log + _perhaps(by_verticals(edges.upright, height, cameras))
    p = _normal(log)
    if len(edges.other.length):
        roll = float(p.sum(axis=(0, 1)) @ cameras.roll)
        p = _normal(log + _perhaps(by_horizontals(edges.other, height, cameras, roll)[..., None]))
    return (
        float(np.sum(p.sum(axis=2) * cameras.elevation)),
        float(p.sum(axis=(0, 1)) @ cameras.roll),
        float(p.sum(axis=(1, 2)) @ cameras.lens),
    )


def _normal(log: Floats) -> Floats:
    """Probabilities by their logarithms, up to a constant."""
    p = np.exp(log - log.max())
    return np.asarray(p / p.sum())


def _perhaps(log: Floats) -> Floats:
    """Logarithms of a likelihood (L, E, R) where lines may converge as by any other elevation and lens."""
    likelihood = np.exp(log - log.max())
    mixed = (1 - _MISLED) * likelihood + _MISLED * likelihood.mean(axis=(0, 1))
    return np.asarray(np.log(np.maximum(mixed, 1e-300)))

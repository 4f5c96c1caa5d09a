"""The camera by the verticals that the picture shows, beside what the network says of it.

What stands upright in the world converges in the picture where the camera looks up or down, and leans where it is
rolled. Each edge tells the camera a little, and some are no verticals: a mixture for each (Coughlan and Yuille, ICCV
1999), times a heavy-tailed prior around the network's answer, over a grid of elevation, roll and field of view.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.evidence.lines import AROUND, Lines, near_vertical
from lighting.geometry import Floats, focal_length, up_in_camera
from lighting.records import Prediction

ELEVATIONS = np.arange(-9.0, 9.1, 1.5)  # deg around the network's answer
ROLLS = np.arange(-4.0, 4.1, 0.5)  # deg around it
LENSES = np.arange(-0.2, 0.21, 0.1)  # around it, logarithm of the tangent of half the field of view
ELEVATION_SPREAD, LENS_SPREAD = 2.3, 0.1  # of the network's answers, in the same units
ROLL_SPREADS = (0.2, 2.0)  # deg: that of small rolls is their own size, for the network knows level cameras best
FREEDOM = 4.0  # degrees of freedom of Student's t distribution, which those errors have
MOST_LINES = 80
MOST_SIDE = 448  # pixels along the longer side; more bring no better camera

_VERTICAL = 0.3  # share of the edges that are verticals; the rest has any angle within AROUND
_LEANING = 0.8  # deg, standard deviation of verticals about the true vertical
_ENDS = 12.0  # deg x pixels, how uncertain the angle of an edge is by its length
_SHIFTED = 0.1  # share of the photos that were cropped, or whose verticals were set upright, after they were taken
_WEIGHT = 1.5  # of an edge as long as the picture is tall; others count by the root of their length


def with_verticals(prediction: Prediction, pixels: NDArray[np.uint8]) -> Prediction:
    """The prediction with the camera by its verticals too; its sun stays where it is. `pixels` (h, w, 3) are sRGB."""
    grey = _grey(pixels)
    height = len(grey)
    up = up_in_camera(prediction.camera_elevation, prediction.camera_roll)
    lines = near_vertical(grey, up, focal_length(height, prediction.vertical_fov)).longest(MOST_LINES)
    if not len(lines.length):
        return prediction
    elevation, roll, lens = _means(prediction, lines, height)
    half = _half(prediction) * np.exp(lens)
    return replace(
        prediction,
        camera_elevation=prediction.camera_elevation + elevation,
        camera_roll=prediction.camera_roll + roll,
        vertical_fov=float(np.degrees(2 * np.arctan(half))),
    )


def _grey(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Grey levels (h, w) of pixels (h, w, 3), at most MOST_SIDE along the longer side."""
    grey = Image.fromarray(pixels).convert("L")
    scale = MOST_SIDE / max(grey.size)
    if scale >= 1:
        return np.asarray(grey)
    size = (max(1, round(grey.width * scale)), max(1, round(grey.height * scale)))
    return np.asarray(grey.resize(size, Image.Resampling.BOX))


def _means(prediction: Prediction, lines: Lines, height: int) -> tuple[float, float, float]:
    """By how much elevation, roll [deg] and lens differ from the network's answer, in the mean of the posterior."""
    log = _prior(prediction.camera_roll) + _perhaps_shifted(_evidence(prediction, lines, height))
    p = np.exp(log - log.max())
    p /= p.sum()
    return (
        float(p.sum(axis=(0, 2)) @ ELEVATIONS),
        float(p.sum(axis=(0, 1)) @ ROLLS),
        float(p.sum(axis=(1, 2)) @ LENSES),
    )


def _prior(said_roll: float) -> Floats:
    """Logarithm of the density (lenses, elevations, rolls) of the camera by the network's answer alone."""
    spreads = (ELEVATION_SPREAD, float(np.clip(abs(said_roll), *ROLL_SPREADS)), LENS_SPREAD)
    elevation, roll, lens = (
        -0.5 * (FREEDOM + 1) * np.log1p((values / spread) ** 2 / FREEDOM)
        for values, spread in zip((ELEVATIONS, ROLLS, LENSES), spreads, strict=True)
    )
    return np.asarray(lens[:, None, None] + elevation[:, None] + roll)


def _perhaps_shifted(evidence: Floats) -> Floats:
    """The same logarithms (lenses, elevations, rolls) where verticals may converge as by another elevation and lens."""
    highest = evidence.max()
    likelihood = np.exp(evidence - highest)
    mixed = (1 - _SHIFTED) * likelihood + _SHIFTED * likelihood.mean(axis=(0, 1))
    return np.asarray(np.log(np.maximum(mixed, 1e-300)))


def _evidence(prediction: Prediction, lines: Lines, height: int) -> Floats:
    """Logarithm of the likelihood (lenses, elevations, rolls) of the lines for each camera of the grid."""
    elevation = (prediction.camera_elevation + ELEVATIONS)[:, None]
    up = up_in_camera(elevation, prediction.camera_roll + ROLLS)
    apart = _apart(lines, _ups(up, _half(prediction) * np.exp(LENSES)), prediction)
    spread = np.hypot(_LEANING, _ENDS / lines.length).astype(np.float32)[:, None]
    bell = np.exp(-0.5 * (apart / spread) ** 2) * (_VERTICAL / (np.sqrt(2 * np.pi, dtype=np.float32) * spread))
    weight = _WEIGHT * np.sqrt(lines.length / height)
    log = weight @ np.log(bell + np.float32((1 - _VERTICAL) / AROUND))
    return np.asarray(log.reshape(len(LENSES), len(ELEVATIONS), len(ROLLS)))


def _apart(lines: Lines, cameras: Floats, about: Prediction) -> Floats:
    """Angles [deg] (N, G) of the lines from the verticals at their middles, by cameras (3, G) near another's."""
    sine, cosine = np.sin(np.radians(lines.angle)), np.cos(np.radians(lines.angle))
    x, y = lines.middle.T
    across = np.stack([-cosine, sine, cosine * x - sine * y])
    right, up, forward = _ups(up_in_camera(about.camera_elevation, about.camera_roll), _half(about))
    across /= np.hypot(right - x * forward, up - y * forward)
    return np.degrees(across.T.astype(np.float32) @ cameras.reshape(3, -1).astype(np.float32))


def _ups(up: Floats, half: Floats | float) -> Floats:
    """The world's up (3, ...) in cameras, its last part over the focal length in picture heights, for each lens.

    At a point (x, y) of the picture the verticals run along (up[0] - x * up[2], up[1] - y * up[2]).
    """
    tilted = np.multiply.outer(2 * np.asarray(half), up[2])
    return np.stack([np.broadcast_to(up[0], tilted.shape), np.broadcast_to(up[1], tilted.shape), tilted])


def _half(prediction: Prediction) -> float:
    """Tangent of half the vertical field of view."""
    return float(np.tan(np.radians(prediction.vertical_fov) / 2))

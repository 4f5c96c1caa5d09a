"""The camera by the verticals that the picture shows, beside what the network says of it.

What stands upright in the world converges in the picture where the camera looks up or down, and leans where it is
rolled. Each edge tells the camera a little, and some are no verticals: a mixture for each (Coughlan and Yuille, ICCV
1999), times a heavy-tailed prior around the network's answer, over a grid of elevation, roll and field of view.

The network knows where the horizon lies in the picture better than it knows the lens, so where the lens is another, so
is the elevation.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.evidence.contradiction import LENS_RATIO, lens_ratio
from lighting.evidence.lines import AROUND, Lines, near_vertical
from lighting.geometry import Floats, focal_length, up_in_camera
from lighting.records import Prediction

ELEVATIONS = np.arange(-9.0, 9.1, 1.5)  # deg around the network's answer for each lens
ROLLS = np.arange(-4.0, 4.1, 0.5)  # deg around it
LENSES = np.arange(-0.2, 0.21, 0.1)  # around it, logarithm of the tangent of half the field of view
ELEVATION_SPREAD, LENS_SPREAD = 2.3, 0.1  # of the network's answers, in the same units
ROLL_SPREADS = (0.2, 2.0)  # deg: that of small rolls is their own size, for the network knows level cameras best
FREEDOM = 4.0  # degrees of freedom of Student's t distribution, which those errors have
FOLLOWS = 0.5  # power of the lens with which the network's elevation, as a tangent, goes; 1 keeps its horizon in place
MOST_LINES = 80
MOST_SIDE = 448  # pixels along the longer side; more bring no better camera

_VERTICAL = 0.3  # share of the edges that are verticals; the rest has any angle within AROUND
_LEANING = 0.8  # deg, standard deviation of verticals about the true vertical
_ENDS = 12.0  # deg x pixels, how uncertain the angle of an edge is by its length
_SHIFTED = 0.1  # share of the photos that were cropped, or whose verticals were set upright, after they were taken
_WEIGHT = 1.5  # of an edge as long as the picture is tall; others count by the root of their length


def with_verticals(prediction: Prediction, pixels: NDArray[np.uint8], vertical_fov: float | None = None) -> Prediction:
    """The prediction with the camera by its verticals too; its sun stays where it is. `pixels` (h, w, 3) are sRGB.

    Where the lens is known (`vertical_fov` [deg]), elevation and roll are those of a camera with it, unless the pixels
    contradict it. The field of view stays what the pixels say, so that the two can be compared.
    """
    grey = _grey(pixels)
    height = len(grey)
    up = up_in_camera(prediction.camera_elevation, prediction.camera_roll)
    lines = near_vertical(grey, up, focal_length(height, prediction.vertical_fov)).longest(MOST_LINES)
    known = _known_lens(prediction, vertical_fov)
    if not len(lines.length) and known is None:
        return prediction
    elevation, roll, lens = _means(prediction, lines, height, LENSES)
    if known is not None:
        elevation, roll, _ = _means(prediction, lines, height, known)
    return replace(
        prediction,
        camera_elevation=elevation,
        camera_roll=roll,
        vertical_fov=float(np.degrees(2 * np.arctan(_half(prediction) * np.exp(lens)))),
    )


def _known_lens(prediction: Prediction, vertical_fov: float | None) -> Floats | None:
    """The known lens (1,) around the network's answer as LENSES are, unless the pixels contradict it."""
    if vertical_fov is None or lens_ratio(prediction.vertical_fov, vertical_fov) > LENS_RATIO:
        return None
    return np.array([math.log(math.tan(math.radians(vertical_fov) / 2) / _half(prediction))])


def _grey(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Grey levels (h, w) of pixels (h, w, 3), at most MOST_SIDE along the longer side."""
    grey = Image.fromarray(pixels).convert("L")
    scale = MOST_SIDE / max(grey.size)
    if scale >= 1:
        return np.asarray(grey)
    size = (max(1, round(grey.width * scale)), max(1, round(grey.height * scale)))
    return np.asarray(grey.resize(size, Image.Resampling.BOX))


def _means(prediction: Prediction, lines: Lines, height: int, lenses: Floats) -> tuple[float, float, float]:
    """Elevation and roll [deg] and, around the network's answer, the lens of `lenses`, in the mean of the posterior."""
    cameras = _elevations(prediction, lenses), prediction.camera_roll + ROLLS
    log = _prior(prediction.camera_roll, lenses)
    log = log + _perhaps_shifted(_evidence(prediction, lines, height, cameras, lenses))
    p = np.exp(log - log.max())
    p /= p.sum()
    return (
        float(np.sum(p.sum(axis=2) * cameras[0])),
        float(p.sum(axis=(0, 1)) @ cameras[1]),
        float(p.sum(axis=(1, 2)) @ lenses),
    )


def _elevations(prediction: Prediction, lenses: Floats) -> Floats:
    """The elevations [deg] (lenses, elevations) of the grid."""
    said = math.tan(math.radians(prediction.camera_elevation)) * np.exp(FOLLOWS * lenses)
    return np.asarray(np.degrees(np.arctan(said))[:, None] + ELEVATIONS)


def _prior(said_roll: float, lenses: Floats) -> Floats:
    """Logarithm of the density (lenses, elevations, rolls) of the camera by the network's answer alone."""
    spreads = (ELEVATION_SPREAD, float(np.clip(abs(said_roll), *ROLL_SPREADS)), LENS_SPREAD)
    elevation, roll, lens = (
        -0.5 * (FREEDOM + 1) * np.log1p((values / spread) ** 2 / FREEDOM)
        for values, spread in zip((ELEVATIONS, ROLLS, lenses), spreads, strict=True)
    )
    return np.asarray(lens[:, None, None] + elevation[:, None] + roll)


def _perhaps_shifted(evidence: Floats) -> Floats:
    """The same logarithms (lenses, elevations, rolls) where verticals may converge as by another elevation and lens."""
    highest = evidence.max()
    likelihood = np.exp(evidence - highest)
    mixed = (1 - _SHIFTED) * likelihood + _SHIFTED * likelihood.mean(axis=(0, 1))
    return np.asarray(np.log(np.maximum(mixed, 1e-300)))


def _evidence(
    prediction: Prediction, lines: Lines, height: int, cameras: tuple[Floats, Floats], lenses: Floats
) -> Floats:
    """Logarithm of the likelihood (lenses, elevations, rolls) of the lines.

    `cameras` are elevations [deg] (lenses, elevations) and rolls [deg] (rolls,).
    """
    elevation, roll = cameras
    up = up_in_camera(elevation[..., None], roll)
    apart = _apart(lines, _ups(up, _half(prediction) * np.exp(lenses)[:, None, None]), prediction)
    spread = np.hypot(_LEANING, _ENDS / lines.length).astype(np.float32)[:, None]
    bell = np.exp(-0.5 * (apart / spread) ** 2) * (_VERTICAL / (np.sqrt(2 * np.pi, dtype=np.float32) * spread))
    weight = _WEIGHT * np.sqrt(lines.length / height)
    log = weight @ np.log(bell + np.float32((1 - _VERTICAL) / AROUND))
    return np.asarray(log.reshape(up.shape[1:]))


def _apart(lines: Lines, cameras: Floats, about: Prediction) -> Floats:
    """Angles [deg] (N, G) of the lines from the verticals at their middles, by cameras (3, G) near another's."""
    sine, cosine = np.sin(np.radians(lines.angle)), np.cos(np.radians(lines.angle))
    x, y = lines.middle.T
    across = np.stack([-cosine, sine, cosine * x - sine * y])
    right, up, forward = _ups(up_in_camera(about.camera_elevation, about.camera_roll), _half(about))
    across /= np.hypot(right - x * forward, up - y * forward)
    return np.degrees(across.T.astype(np.float32) @ cameras.reshape(3, -1).astype(np.float32))


def _ups(up: Floats, half: Floats | float) -> Floats:
    """The world's up (3, ...) in cameras, its last part over the focal length in picture heights.

    At a point (x, y) of the picture the verticals run along (up[0] - x * up[2], up[1] - y * up[2]).
    """
    return np.stack([up[0], up[1], 2 * half * up[2]])


def _half(prediction: Prediction) -> float:
    """Tangent of half the vertical field of view."""
    return math.tan(math.radians(prediction.vertical_fov) / 2)

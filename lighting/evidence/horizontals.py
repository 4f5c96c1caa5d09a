"""How likely a camera is by the horizontals that the picture shows.

Edges of walls, windows and pavements run level in two headings at right angles, which nobody knows beforehand. Those of
one heading meet in the picture on the horizon, so they tell where it lies, and both together tell the lens. The model
is the Manhattan world of Coughlan and Yuille (ICCV 1999): a mixture for each edge, whose mean over the headings counts.
"""

import math

import numpy as np

from lighting.evidence.cameras import Cameras
from lighting.evidence.lines import Lines, in_picture
from lighting.geometry import Floats, level_in_camera

_MOST_LINES = 60  # the longest, which tell as much as all
_HEADINGS = np.arange(0.0, 180.0, 3.0)  # deg from the camera's own; the second half is at right angles to the first
_HORIZONTAL = 0.35  # share of the edges that run along one of the two headings; the rest has any angle
_LEANING = 1.0  # deg, standard deviation of horizontals about the true direction
_ENDS = 12.0  # deg x pixels, how uncertain the angle of an edge is by its length
_WEIGHT = 0.5  # of an edge as long as the picture is tall; others count by the root of their length


def by_horizontals(lines: Lines, height: int, cameras: Cameras, roll: float) -> Floats:
    """Logarithm of the likelihood (L, E) of lines in a picture `height` pixels tall, by cameras with a roll [deg]."""
    lines = lines.longest(_MOST_LINES)
    level = level_in_camera(_HEADINGS[:, None, None], cameras.elevation, roll)
    bell = _apart(lines, in_picture(level, cameras.half[:, None]).reshape(3, -1))
    spread = np.radians(np.hypot(_LEANING, _ENDS / lines.length)).astype(np.float32)[:, None]
    bell *= -0.5 / (spread * spread)
    np.exp(bell, out=bell)
    half = bell.shape[1] // 2
    along = (bell[:, :half] + bell[:, half:]) * (0.5 * _HORIZONTAL / (math.sqrt(2 * math.pi) * spread))
    along += np.float32((1 - _HORIZONTAL) / math.pi)
    weight = (_WEIGHT * np.sqrt(lines.length / height)).astype(np.float32)
    by_heading = (weight @ np.log(along)).reshape(-1, *cameras.elevation.shape)
    highest = by_heading.max(axis=0)
    return np.asarray(highest + np.log(np.exp(by_heading - highest).mean(axis=0)))


def _apart(lines: Lines, directions: Floats) -> Floats:
    """Squared sines (N, G) of the angles between lines and directions (3, G) in the picture, at the lines' middles."""
    x, y = lines.middle.T
    right, up, forward = d = directions.astype(np.float32)
    off = lines.across.T.astype(np.float32) @ d
    off *= off
    parts = np.stack([right * right + up * up, forward * right, forward * up, forward * forward])
    by_middle = np.stack([np.ones_like(x), -2 * x, -2 * y, x * x + y * y], axis=1).astype(np.float32)
    off /= np.maximum(by_middle @ parts, np.float32(1e-6))
    return off

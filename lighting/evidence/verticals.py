"""How likely a camera is by the verticals that the picture shows.

What stands upright in the world converges in the picture where the camera looks up or down, and leans where it is
rolled. Each edge tells the camera a little, and some are no verticals: a mixture for each (Coughlan and Yuille, ICCV
1999).
"""

import numpy as np

from lighting.evidence.cameras import Cameras, half_of
from lighting.evidence.lines import AROUND, Lines, in_picture
from lighting.geometry import Floats, up_in_camera

_MOST_LINES = 80  # the longest, which tell as much as all
_VERTICAL = 0.3  # share of the edges that are verticals; the rest has any angle within AROUND
_LEANING = 0.8  # deg, standard deviation of verticals about the true vertical
_ENDS = 12.0  # deg x pixels, how uncertain the angle of an edge is by its length
_WEIGHT = 1.5  # of an edge as long as the picture is tall; others count by the root of their length


def by_verticals(lines: Lines, height: int, cameras: Cameras) -> Floats:
    """Logarithm of the likelihood (L, E, R) of cameras by lines near vertical, in a picture `height` pixels tall."""
    lines = lines.longest(_MOST_LINES)
    up = up_in_camera(cameras.elevation[..., None], cameras.roll)
    apart = _apart(lines, in_picture(up, cameras.half[:, None, None]), cameras)
    spread = np.hypot(_LEANING, _ENDS / lines.length).astype(np.float32)[:, None]
    bell = np.exp(-0.5 * (apart / spread) ** 2) * (_VERTICAL / (np.sqrt(2 * np.pi, dtype=np.float32) * spread))
    weight = _WEIGHT * np.sqrt(lines.length / height)
    log = weight @ np.log(bell + np.float32((1 - _VERTICAL) / AROUND))
    return np.asarray(log.reshape(up.shape[1:]))


def _apart(lines: Lines, verticals: Floats, cameras: Cameras) -> Floats:
    """Angles [deg] (N, G) of the lines from verticals (3, ...) at their middles, where all cameras see them as long.

    As long as the network's camera sees them, that is: G cameras near it differ little in that.
    """
    x, y = lines.middle.T
    said = cameras.said
    right, up, forward = in_picture(up_in_camera(said.camera_elevation, said.camera_roll), half_of(said))
    across = lines.across / np.hypot(right - x * forward, up - y * forward)
    return np.asarray(np.degrees(across.T.astype(np.float32) @ verticals.reshape(3, -1).astype(np.float32)))

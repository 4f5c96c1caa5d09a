"""How a frame is turned against its keyframe, quickly: a rotation that most followed points obey.

Where the camera walks, near things obey none; then the rotation of the essential matrix takes over (turns/parallax.py).
"""

from dataclasses import dataclass

import numpy as np

from lighting.geometry import Floats
from lighting.turns import Matches, motion, nearest_rotation, obeying_more, rays, search

TOLERANCE = 1.5  # pixels; beyond it a point counts for ever less
BLUR = 6.0  # tolerances that points may be off where a picture is blurred
WALKED = 0.7  # share of points that agree so far with a rotation, below which the camera may have moved as well
TIGHT = 0.6  # share of the agreeing points within half the tolerance, from which on others move and the camera does not
LEAST_TOLD = 0.85  # share of the points that must then agree with a motion; things that move do not
AGREEING = 0.5  # share of points that agree with a rotation nearby, below which it is sought from the beginning
BELIEVED = 0.3  # share of followed points that must agree with a turn
FEWEST_AGREEING = 12  # of them
_ROUNDS = 6  # of re-weighting, from eight times the tolerance down to it
_EXACT = 1e18  # inverse variance of the logarithm of a focal length that is known


@dataclass(frozen=True, eq=False)
class Turning:
    """A frame's turn against a keyframe."""

    rotation: Floats  # (3, 3) directions in the keyframe's camera to the frame's
    share: float  # of the points that agree within twice TOLERANCE
    agreeing: int  # how many those are


def turning(matches: Matches, focal: float, guess: Floats) -> Turning:
    """The turn that most `matches` obey, by re-weighted least squares from a `guess` (3, 3).

    Weights are those of Geman and McClure; the rotation of a round is Kabsch's. `focal` is in half diagonals.
    """
    a, b = rays(matches.a, focal), rays(matches.b, focal)
    reach = TOLERANCE * matches.pixel / focal
    found = _refined(a, b, guess, reach)
    if _is_parallax(a, b, found.rotation, reach):
        moved = _moved(matches, focal, found.agreeing)
        if moved is not None:
            return moved
    if found.share < AGREEING:
        other = _refined(a, b, search(matches, (focal, focal), (1.0,)).rotation, reach)
        found = max(found, other, key=lambda t: t.share)
    return found


def is_believed(turn: Turning, *, begins: bool) -> bool:
    """Whether a frame's turn is to be used."""
    return begins or (turn.share >= BELIEVED and turn.agreeing >= FEWEST_AGREEING)


def _is_parallax(a: Floats, b: Floats, rotation: Floats, reach: float) -> bool:
    """Whether many points are farther from where a rotation puts them than blur would explain, at all distances.

    Where things move before a place that stands still, the place's points all lie close to it.
    """
    apart = np.linalg.norm(b - a @ rotation.T, axis=1)
    near = np.count_nonzero(apart < 2.0 * reach)
    return bool(np.mean(apart < BLUR * reach) < WALKED and np.count_nonzero(apart < 0.5 * reach) < TIGHT * near)


def _moved(matches: Matches, focal: float, agreeing: int) -> Turning | None:
    """The turn of a camera that walked, where clearly more points tell it than agree with a rotation alone."""
    obeying = obeying_more(matches, agreeing)
    found = None if obeying is None else motion(obeying, (focal, focal), (1.0,), _EXACT)
    if found is None or (count := int(np.count_nonzero(found.inliers))) < LEAST_TOLD * len(matches):
        return None
    return Turning(found.rotation, count / len(matches), count)


def _refined(a: Floats, b: Floats, rotation: Floats, reach: float) -> Turning:
    for wider in np.geomspace(8.0, 1.0, _ROUNDS):
        apart = np.sum(np.square(b - a @ rotation.T), axis=1)
        weight = np.square(1.0 / (1.0 + apart / (wider * reach) ** 2))
        rotation = nearest_rotation((b * weight[:, None]).T @ a)
    agree = np.sum(np.square(b - a @ rotation.T), axis=1) < (2.0 * reach) ** 2
    return Turning(rotation, float(agree.mean()), int(agree.sum()))

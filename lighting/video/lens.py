"""The lens of a shot: given, or what turning pictures, metadata and the network say of it."""

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from lighting.turns import Matches, Turn, rotation_of
from lighting.video.follow import Key, Step
from lighting.video.keyframes import turn_between
from lighting.video.watched import Circumstances, Watched

LENS_PAIRS = 10  # of keyframes, from which the lens is learnt
FEW_PAIRS = 4  # fewer keyframes tell too little of the lens
LEAST_MOVED = 0.1  # half diagonals that points move, below which a turn says nothing of the lens
LENS_SPREAD = 5.0  # deg, one standard deviation of the network's field of view
STATED_LENS_SPREAD = 2.5  # deg, of a focal length in the metadata: stabilisation crops the picture
CLEAR = 0.5  # share of matches that agree with a rotation, below which it tells nothing of the lens
MOST_SPREADS = 3.0  # of the network's field of view, within which a walk is believed
LENS_FLOOR = 0.4  # deg, below which a pair's own error is not believed


def lens_of(watched: Watched, around: Circumstances) -> tuple[float, float]:
    """Vertical field of view and its standard deviation [deg]: given, or what turning pictures and the network say."""
    said = said_lens(watched, around)[0]
    turns = (turn for turn in _lens_turns(watched) if turn is not None and tells_lens(turn, said))
    return lens_by(watched, around, ((turn.vertical_fov[0], turn.fov_sigma) for turn in turns))


def lens_by(watched: Watched, around: Circumstances, told: Iterable[tuple[float, float]]) -> tuple[float, float]:
    """The same where fields of view and their standard deviations [deg] are `told` by turns."""
    if around.given.vertical_fov is not None:
        return around.given.vertical_fov, 0.0
    said = said_lens(watched, around)
    return _agreed([said, *((fov, math.hypot(sigma, LENS_FLOOR)) for fov, sigma in told)])


def said_lens(watched: Watched, around: Circumstances) -> tuple[float, float]:
    """The field of view, and its standard deviation, that metadata or else the network say."""
    if around.given.use_exif and (stated := around.facts.vertical_fov):
        return stated, STATED_LENS_SPREAD
    return math.exp(float(np.mean([math.log(s.prediction.vertical_fov) for s in watched.looks.values()]))), LENS_SPREAD


def _agreed(told: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """What most of several fields of view say, and its standard deviation [deg]; those far off count for less."""
    values, spreads = np.array(told).T
    weight = np.square(1.0 / spreads)
    for _ in range(5):
        mean = float(weight @ values / weight.sum())
        weight = 1.0 / (np.square(spreads) + np.square(values - mean) / 4.0)
    return mean, float(1.0 / math.sqrt(weight.sum()))


def _lens_turns(watched: Watched) -> Iterator[Turn | None]:
    """Turns by an unknown lens: between keyframes, or where there are few of those, by points that were followed."""
    pairs = _lens_pairs(list(watched.keys.values()))
    for a, b in pairs:
        yield turn_between(a, b, None)
    if len(pairs) < FEW_PAIRS:
        for step in [s for s in far_steps(watched) if moved(s.matches) > LEAST_MOVED][-FEW_PAIRS:]:
            yield rotation_of(step.matches, watched.size, watched.size)


def far_steps(watched: Watched) -> list[Step]:
    """Frames that are far from their keyframes: those that became the next one, and the last that was followed."""
    followed = [step for step in watched.steps if len(step.matches)]
    return [step for step in watched.steps if step.makes is not None] + followed[-1:]


def tells_lens(turn: Turn, said: float) -> bool:
    """Whether a turn by an unknown lens tells it, where metadata or the network `said` a field of view [deg].

    A camera that walks ahead tells next to nothing of its lens, and now and then something far off. One that is zoomed
    has no lens of the whole shot.
    """
    if turn.zoomed:
        return False
    far = abs(turn.vertical_fov[0] - said) > MOST_SPREADS * LENS_SPREAD
    clear = not far if turn.translates else turn.inliers >= CLEAR * turn.matches
    return clear and turn.fov_sigma < 2 * LENS_SPREAD


def moved(matches: Matches) -> float:
    """How far points moved in the median [half diagonals]."""
    return float(np.median(np.linalg.norm(matches.b - matches.a, axis=1))) if len(matches) else 0.0


def _lens_pairs(keys: Sequence[Key]) -> list[tuple[Key, Key]]:
    """Keyframes two apart: they overlap by half or more and are turned far enough to tell the lens."""
    pairs = [
        (a, keys[i + gap])
        for gap in (2, 1)
        for i, a in enumerate(keys)
        if i + gap < len(keys) and keys[i + gap].stretch == a.stretch
    ]
    step = max(1, math.ceil(len(pairs) / LENS_PAIRS))
    return pairs[::step]

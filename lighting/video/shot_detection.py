"""Where shots begin: cuts, and dissolves, in which one picture fades into another one.

About ten times a second a frame is compared with one before and one after it, both moved onto it by dense flow. Where
things move, each part of the frame is explained by one of the two. In a dissolve only a mixture of both explains it,
with the same share everywhere. There the two have little in common.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats
from lighting.registration.features import Matches, import_opencv, resize_to
from lighting.video.decode import Frame
from lighting.video.keyframes import GAP_KEYFRAMES, match_keyframes
from lighting.video.tracking import FEATURE_SIDE, Keyframe, ShotObservations, TrackedFrame

COMPARISON_INTERVAL = 0.1  # s between the frames that are compared
MAX_COMPARISON_GAP = 0.25  # s between them, beyond which nothing is told
LAGS = (3, 6, 12)  # of them, from a frame to the ones before and after: for dissolves of up to 0.6, 1.2 and 2.4 s
MIXED_SHARES = (0.2, 0.8)  # the earlier picture's share, within which a frame counts as mixed
MIN_DIFFERENCE = 100.0  # mean square by which neither picture alone explains a mixed frame
MIXTURE_NOISE = 15.0  # the same by which the mixture may miss it
MAX_CORRELATION = 0.8  # correlation of the two pictures, from which they are one

_COMPARED_SIDE = 64  # pixels of the longer side
_EVEN_STD = 40.0  # grey values, to which the standard deviation of every picture is brought
_MIN_STD = 16.0  # grey values, that of a picture with too little in it to be brought there
_MIN_SHARED = 0.3  # share of a frame that both other pictures must show
_MAX_UNMIXED = 4  # frames without a mixed one that a dissolve may have
_CLEAR_FRAMES = 5  # frames to both sides of a dissolve, from where on nothing is mixed
_MAX_DISSOLVE_FRAMES = 32  # frames of a dissolve; what lasts longer is no dissolve
_BUFFERED_FRAMES = 56  # frames: the longest dissolve, what is before it, and the wait for its end


@dataclass(frozen=True)
class Dissolve:
    """When two pictures are mixed."""

    first: float
    """First, seconds."""
    last: float
    """Last, seconds."""


@dataclass(frozen=True, eq=False)
class _ComparedFrame:
    """A frame that is compared."""

    number: int
    time: float  # s
    picture: NDArray[np.uint8]  # (h, w) grey, as keyframes have it
    even: NDArray[np.uint8]  # (h, w) smaller, of one mean and spread whatever the exposure


class DissolveDetector:
    """Takes a clip's frames one by one; tells a dissolve somewhat later than it is over."""

    def __init__(self) -> None:
        """Begin a clip; MissingExtraError without OpenCV."""
        self._cv2 = import_opencv()
        self._flow = self._cv2.DISOpticalFlow_create(self._cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST)
        self._flow.setFinestScale(0)
        self._flow.setPatchSize(8)
        self._flow.setPatchStride(4)
        self._flow.setGradientDescentIterations(5)
        self._kept: deque[_ComparedFrame] = deque(maxlen=_BUFFERED_FRAMES)
        self._mixed: list[int] = []  # numbers of the frames that were found to be mixed, of one dissolve

    @property
    def is_pending(self) -> bool:
        """Whether a dissolve has begun and was not yet returned."""
        return bool(self._mixed)

    def take(self, frame: Frame) -> Dissolve | None:
        """Take the next frame and return the dissolve that it shows to be over; None without one.

        Args:
            frame: later than those before.
        """
        last = self._kept[-1] if self._kept else None
        if last is not None and frame.time < last.time + COMPARISON_INTERVAL - 1e-3:
            return None
        compared = self._compared_frame(frame, 0 if last is None else last.number + 1)
        if last is not None and (compared.even.shape != last.even.shape or frame.time > last.time + MAX_COMPARISON_GAP):
            self._kept.clear()
            self._mixed = []
        self._kept.append(compared)
        for lag in LAGS:
            middle = len(self._kept) - 1 - lag
            if middle >= lag and self._kept[middle].number % (lag // LAGS[0]) == 0:
                self._compare(self._kept[middle - lag], self._kept[middle], compared)
        is_over = bool(self._mixed) and compared.number - max(self._mixed) > _MAX_UNMIXED + LAGS[-1]
        return self.finish() if is_over else None

    def finish(self) -> Dissolve | None:
        """Return the dissolve that was not yet returned, once no frame comes any more; None without one."""
        if not self._mixed:
            return None
        first, last = min(self._mixed), max(self._mixed)
        self._mixed = []
        margin = round(0.6 * (last - first) + 2.0)
        first, last = first - margin, last + margin
        lowest, highest = self._kept[0].number, self._kept[-1].number

        def at(number: int) -> _ComparedFrame:
            return self._kept[min(max(number, lowest), highest) - lowest]

        if last - first > _MAX_DISSOLVE_FRAMES or _match_frames(at(first - _CLEAR_FRAMES), at(last + _CLEAR_FRAMES)):
            return None
        return Dissolve(at(first).time, at(last).time)

    def _compare(self, before: _ComparedFrame, middle: _ComparedFrame, after: _ComparedFrame) -> None:
        is_other = bool(self._mixed) and middle.number > max(self._mixed) + _MAX_UNMIXED  # this dissolve is told first
        if not is_other and self._is_mixed(before.even, middle.even, after.even):
            self._mixed.append(middle.number)

    def _compared_frame(self, frame: Frame, number: int) -> _ComparedFrame:
        picture = resize_to(self._cv2.cvtColor(frame.pixels, self._cv2.COLOR_RGB2GRAY), FEATURE_SIDE)
        small = resize_to(picture, _COMPARED_SIDE)
        mean, std = self._cv2.meanStdDev(small)
        scale = _EVEN_STD / max(float(std[0, 0]), _MIN_STD)
        even = self._cv2.convertScaleAbs(np.maximum(small * scale + (128.0 - scale * float(mean[0, 0])), 0.0))
        return _ComparedFrame(number, frame.time, picture, np.asarray(even))

    def _is_mixed(self, before: NDArray[np.uint8], middle: NDArray[np.uint8], after: NDArray[np.uint8]) -> bool:
        """Whether a frame is a mixture of two others, and not in part the one and in part the other."""
        values, first = middle.astype(np.float32), self._moved(before, middle)
        valid = np.isfinite(first)
        if valid.mean() < _MIN_SHARED or np.square((values - first)[valid]).mean() < MIN_DIFFERENCE:
            return False
        second = self._moved(after, middle)
        valid &= np.isfinite(second)
        return bool(valid.mean() >= _MIN_SHARED) and _is_mixture(first[valid], values[valid], second[valid])

    def _moved(self, other: NDArray[np.uint8], onto: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Another picture (h, w) as seen from this one, NaN where it shows nothing."""
        height, width = onto.shape
        rows, columns = np.mgrid[:height, :width].astype(np.float32)
        flow: Any = self._flow.calc(onto, other, None)
        x, y, linear = columns + flow[..., 0], rows + flow[..., 1], self._cv2.INTER_LINEAR
        return np.asarray(self._cv2.remap(other.astype(np.float32), x, y, linear, borderValue=np.nan))


def _is_mixture(first: Floats, values: Floats, second: Floats) -> bool:
    """Whether values (N,) are those of two pictures (N,) with one share throughout, and the two differ."""
    difference = first - second
    share = float(difference @ (values - second)) / max(float(difference @ difference), 1e-6)
    if not MIXED_SHARES[0] < share < MIXED_SHARES[1]:
        return False
    residual = float(np.square(values - second - share * difference).mean()) + MIXTURE_NOISE
    distance = float(np.minimum(np.square(values - first), np.square(values - second)).mean())
    return bool(distance >= max(MIN_DIFFERENCE, residual) and _correlation(first, second) < MAX_CORRELATION)


def _correlation(a: Floats, b: Floats) -> float:
    a, b = a - a.mean(), b - b.mean()
    return float(a @ b) / max(float(np.sqrt((a @ a) * (b @ b))), 1e-6)


def _match_frames(before: _ComparedFrame, after: _ComparedFrame) -> bool:
    a, b = (Keyframe(small.number, 0, small.number, small.time, small.picture) for small in (before, after))
    return match_keyframes(a, b, None) is not None


MIN_SHOT_FRAMES = 5  # frames, fewer than which are no shot but a gap in one


def split_shots(tracked: ShotObservations) -> list[ShotObservations]:
    """Divide what was tracked into shots; frames in which nothing can be followed belong to the shot before them.

    Args:
        tracked: one frame or more.
    """
    long = _long_stretches(tracked.steps)
    keys = {s: sorted((k for k in tracked.keys.values() if k.stretch == s), key=lambda k: k.number) for s in long}
    shot_of, number = {}, 0
    for before, after in zip([None, *long[:-1]], long, strict=True):
        if before is not None and not _is_same_shot(keys[before], keys[after]):
            number += 1
        shot_of[after] = number
    current, members = 0, []
    for step in tracked.steps:
        current = shot_of.get(step.stretch, current)
        members.append(current)
    return [_select_frames(tracked, [i for i, m in enumerate(members) if m == n]) for n in range(number + 1)]


def split_at_dissolve(tracked: ShotObservations, dissolve: Dissolve) -> list[ShotObservations]:
    """Divide what was tracked at the middle of a dissolve, if a shot is before it.

    Nothing counts as followed or seen while it lasts; nor does what is followed from before it later on.

    Args:
        tracked: frames before, in and after the dissolve.
        dissolve: when it begins and ends.
    """
    steps = tracked.steps
    before = [step for step in steps if step.time < dissolve.first]
    old_keys = {number for step in before for number in (step.key, step.next_key)}
    after = [i for i, step in enumerate(steps) if step.time > dissolve.last and step.key not in old_keys]
    if not after:
        return [tracked]
    middle = 0.5 * (dissolve.first + dissolve.last)
    begin = sum(step.time < middle for step in steps) if len(before) >= MIN_SHOT_FRAMES else 0
    ending = [*before, *(_as_lost(step, before[-1]) for step in steps[len(before) : begin])][:begin]
    beginning = [_as_lost(step, steps[after[0]]) for step in steps[begin : after[0]]]
    mixed = {step.frame for step in steps if dissolve.first <= step.time <= dissolve.last}
    keys = {n: key for n, key in tracked.keys.items() if key.frame not in mixed}
    estimates = {frame: estimate for frame, estimate in tracked.estimates.items() if frame not in mixed}
    unmixed = ShotObservations(tracked.size, [*ending, *beginning, *steps[after[0] :]], keys, estimates)
    return [_select_frames(unmixed, part) for part in (range(begin), range(begin, len(steps))) if part]


def _as_lost(step: TrackedFrame, like: TrackedFrame) -> TrackedFrame:
    """A frame in which nothing can be followed, in the stretch of another one."""
    none = np.empty((0, 2), np.float32)
    matches = Matches(none, none, step.matches.pixel)
    return replace(like, frame=step.frame, time=step.time, matches=matches, is_start=False, next_key=None)


def _long_stretches(steps: Sequence[TrackedFrame]) -> list[int]:
    stretches, counts = np.unique([step.stretch for step in steps], return_counts=True)
    long = stretches[counts >= MIN_SHOT_FRAMES]
    return [int(s) for s in (long if len(long) else stretches[[int(np.argmax(counts))]])]


def _is_same_shot(before: Sequence[Keyframe], after: Sequence[Keyframe]) -> bool:
    """Whether keyframes to both sides of a gap show the same things."""
    return any(match_keyframes(a, b, None) is not None for a in before[-GAP_KEYFRAMES:] for b in after[:GAP_KEYFRAMES])


def _select_frames(tracked: ShotObservations, positions: Sequence[int]) -> ShotObservations:
    steps = [tracked.steps[i] for i in positions]
    frames = {step.frame for step in steps}
    keys = {n: k for n, k in tracked.keys.items() if k.frame in frames}
    return ShotObservations(tracked.size, steps, keys, {f: p for f, p in tracked.estimates.items() if f in frames})

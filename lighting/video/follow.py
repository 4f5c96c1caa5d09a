"""Points followed from frame to frame: what a frame shares with the last keyframe, and how the light's gain changed.

Corners of a keyframe are followed by the pyramidal method of Lucas and Kanade (as OpenCV has it), then compared with
the keyframe itself, so that errors do not add up from frame to frame. When a frame shares too little with its keyframe,
it becomes the next one. Where nothing can be followed, a new stretch begins; whether it belongs to the same shot is
decided by who asks.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lighting.colour import SRGB_LINEAR
from lighting.geometry import Floats
from lighting.turns.match import Features, Matches, centred, features, opencv
from lighting.video.clip import Frame

POINTS = 200  # sought in a keyframe
FEWEST = 24  # followed, below which a frame counts as lost
LEAST_KEPT = 0.4  # share of a keyframe's points, below which the next keyframe is due
FARTHEST = 0.35  # half diagonals that points move in the median before the next keyframe is due
FEATURES = 800  # of a keyframe, to be found again by
FEATURE_SIDE = 400  # pixels of the longer side in which those are sought

_WINDOW = (15, 15)
_LEVELS = 4  # of the pyramid: a point may move by a fifth of the picture from one frame to the next
_CORRECTED = 3.0  # pixels by which the comparison with the keyframe may move a point
_ALIKE = 12.0  # grey values by which a point's surroundings may differ from those in its keyframe
_SPREAD = 50.0  # grey values, the standard deviation to which every frame is brought: gains do not disturb
_CODED = (8, 247)  # coded values between which a gain is measured


@dataclass(frozen=True, eq=False)
class Key:
    """A keyframe."""

    number: int  # counted from 0
    stretch: int  # the number of frames lost before it: within one stretch all keyframes are linked
    frame: int
    time: float  # s
    picture: NDArray[np.uint8]  # (h, w) grey, FEATURE_SIDE pixels along its longer side at most

    @cached_property
    def features(self) -> Features:
        """What it can be found again by; sought when it is first asked for, since that takes a tenth of a second."""
        return features(self.picture, FEATURE_SIDE, FEATURES)


@dataclass(frozen=True, eq=False)
class Step:
    """What one frame shares with a keyframe."""

    frame: int
    time: float  # s
    key: int  # number of the keyframe
    stretch: int
    matches: Matches  # of the keyframe's points, to the frame's; none in the keyframe that begins a stretch
    gain: Floats  # (3,) of linear values, the frame's by the keyframe's
    begins: bool  # whether it is the keyframe that begins a stretch
    makes: int | None = None  # number of the keyframe that the frame became, another one than `key`


class Follower:
    """Takes frames one by one and remembers one keyframe."""

    def __init__(self) -> None:
        """Raises MissingExtraError without OpenCV."""
        self._cv2 = opencv()
        self._stretch = self._number = -1
        self._grey = self._key_grey = np.empty((0, 0), np.uint8)
        self._corners = self._at = np.empty((0, 2), np.float32)
        self._colours = np.empty((0, 3), np.float32)
        self._sought = 1
        self._unproven: Frame | None = None  # the keyframe while no frame was followed from it
        self.new_key: Key | None = None  # from which the last frame was the first to be followed

    def follow(self, frame: Frame) -> Step:
        """What the frame shares with the last keyframe; it may be the next one itself."""
        grey, self.new_key = self._even(frame.pixels), None
        found = self._followed(grey) if grey.shape == self._grey.shape else np.zeros(0, bool)
        lost = bool(np.count_nonzero(found) < FEWEST)
        if lost:
            self._stretch += 1
            self._make_key(frame, grey)
        else:
            self._prove()
            self._corners, self._at, self._colours = (v[found] for v in (self._corners, self._at, self._colours))
        self._grey = grey
        makes = self._number + 1 if not lost and self._is_far() else None
        at = (frame.index, frame.time, self._number, self._stretch)
        step = Step(*at, self._matches(), self._gained(frame.pixels), lost, makes)
        if makes is not None:
            self._make_key(frame, grey)
        return step

    def _even(self, pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Grey values of one mean and spread, whatever the exposure."""
        grey = self._cv2.cvtColor(pixels, self._cv2.COLOR_RGB2GRAY)
        mean, spread = self._cv2.meanStdDev(grey)
        scale = _SPREAD / max(float(spread[0, 0]), 4.0)
        return np.asarray(self._cv2.convertScaleAbs(grey, alpha=scale, beta=128.0 - scale * float(mean[0, 0])))

    def _followed(self, grey: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """Moves the points into the frame; which of them are still there."""
        if not len(self._at):
            return np.zeros(0, bool)
        flow = self._cv2.calcOpticalFlowPyrLK
        there, ok, _ = flow(self._grey, grey, self._at, None, winSize=_WINDOW, maxLevel=_LEVELS)
        fine, ok_fine, apart = flow(
            self._key_grey,
            grey,
            self._corners,
            there.copy(),
            winSize=_WINDOW,
            maxLevel=0,
            flags=self._cv2.OPTFLOW_USE_INITIAL_FLOW,
        )
        alike = (apart.ravel() < _ALIKE) & (np.linalg.norm(fine - there, axis=1) < _CORRECTED)
        self._at = fine
        inside = np.all((fine > 2) & (fine < np.array(grey.shape[::-1]) - 3), axis=1)
        return np.asarray((ok.ravel() > 0) & (ok_fine.ravel() > 0) & alike & inside)

    def _prove(self) -> None:
        """Hand out the keyframe, once: what nothing can be followed from is not worth keeping."""
        if self._unproven is not None:
            frame, self._unproven = self._unproven, None
            grey = self._cv2.cvtColor(frame.pixels, self._cv2.COLOR_RGB2GRAY)
            scale = min(1.0, FEATURE_SIDE / max(grey.shape))
            size = (round(grey.shape[1] * scale), round(grey.shape[0] * scale))
            small = self._cv2.resize(grey, size, interpolation=self._cv2.INTER_AREA)
            self.new_key = Key(self._number, self._stretch, frame.index, frame.time, np.asarray(small))

    def _make_key(self, frame: Frame, grey: NDArray[np.uint8]) -> None:
        """Seek corners in the frame, to be followed from now on."""
        self._number += 1
        self._key_grey = grey
        found = self._cv2.goodFeaturesToTrack(grey, POINTS, 0.005, max(6, max(grey.shape) // 64), blockSize=5)
        self._corners = np.empty((0, 2), np.float32) if found is None else found.reshape(-1, 2).astype(np.float32)
        self._at, self._sought = self._corners.copy(), max(len(self._corners), 1)
        self._colours = self._sampled(frame.pixels)
        self._unproven = frame

    def _is_far(self) -> bool:
        half = 0.5 * float(np.hypot(*self._grey.shape))
        moved = float(np.median(np.linalg.norm(self._at - self._corners, axis=1))) / half
        return len(self._at) < max(2 * FEWEST, LEAST_KEPT * self._sought) or moved > FARTHEST

    def _matches(self) -> Matches:
        height, width = self._grey.shape
        pixel = 2.0 / float(np.hypot(width, height))
        a, b = (centred(v, width, height).astype(np.float32) for v in (self._corners, self._at))
        return Matches(a, b, pixel)

    def _sampled(self, pixels: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Coded values (N, 3) around the points, averaged over 9 x 9 pixels."""
        soft = self._cv2.blur(pixels, (9, 9))
        x, y = np.round(self._at).astype(int).T if len(self._at) else np.empty((2, 0), int)
        rows, columns = np.clip(y, 0, pixels.shape[0] - 1), np.clip(x, 0, pixels.shape[1] - 1)
        return np.asarray(soft[rows, columns])

    def _gained(self, pixels: NDArray[np.uint8]) -> Floats:
        """Median ratios (3,) of linear values to the keyframe's, by points that are neither black nor clipped."""
        now = self._sampled(pixels)
        both = np.stack([now, self._colours.astype(np.uint8)])
        fit = np.all((both > _CODED[0]) & (both < _CODED[1]), axis=(0, 2))
        if np.count_nonzero(fit) < FEWEST // 2:
            return np.ones(3)
        log = np.log(SRGB_LINEAR[both[0][fit]] / SRGB_LINEAR[both[1][fit]])
        return np.asarray(np.exp(np.median(log, axis=0)), dtype=np.float64)

"""Points followed from frame to frame: what a frame shares with the last keyframe, and how the light's gain changed.

Corners of a keyframe are followed by the pyramidal method of Lucas and Kanade (as OpenCV has it), then compared with
the keyframe itself, so that errors do not add up from frame to frame. When a frame shares too little with its keyframe,
it becomes the next one. Where nothing can be followed, a new stretch begins; whether it belongs to the same shot is
decided by who asks.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lighting import sizes
from lighting.colour import SRGB_LINEAR
from lighting.geometry import Floats
from lighting.turns import Features, Matches, centred, features, opencv, shrunk
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
_LIGHT_SIDE = 160  # pixels of the longer side in which a gain is measured
_LEAST_LIT = 0.02  # share of the picture that must be neither black nor clipped
_MEASURED = np.where((np.arange(256) > 8) & (np.arange(256) < 248), SRGB_LINEAR, np.float32(np.nan))  # by coded value


@dataclass(frozen=True, eq=False)
class Key:
    """A keyframe."""

    number: int  # counted from 0
    stretch: int  # the number of frames lost before it: within one stretch all keyframes are linked
    frame: int
    time: float  # s
    picture: NDArray[np.uint8]  # (h, w) grey, FEATURE_SIDE pixels along its longer side at most
    zoom: float = 1.0  # its focal length by that of the lens as which its features are to be seen

    @cached_property
    def features(self) -> Features:
        """What it can be found again by; sought when it is first asked for, since that takes a tenth of a second."""
        found = features(self.picture, FEATURE_SIDE, FEATURES)
        width, height = (round(self.zoom * side) for side in (found.width, found.height))
        return Features(found.points / self.zoom, found.descriptors, width, height)


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
        self._light = np.empty((0, 0, 3), np.float32)  # of the keyframe, as `_linear` has it
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
            self._corners, self._at = self._corners[found], self._at[found]
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
            small = shrunk(self._cv2.cvtColor(frame.pixels, self._cv2.COLOR_RGB2GRAY), FEATURE_SIDE)
            self.new_key = Key(self._number, self._stretch, frame.index, frame.time, small)

    def _make_key(self, frame: Frame, grey: NDArray[np.uint8]) -> None:
        """Seek corners in the frame, to be followed from now on."""
        self._number += 1
        self._key_grey = grey
        found = self._cv2.goodFeaturesToTrack(grey, POINTS, 0.005, max(6, max(grey.shape) // 64), blockSize=5)
        self._corners = np.empty((0, 2), np.float32) if found is None else found.reshape(-1, 2).astype(np.float32)
        self._at, self._sought = self._corners.copy(), max(len(self._corners), 1)
        self._light, _ = self._linear(frame.pixels)
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

    def _gained(self, pixels: NDArray[np.uint8]) -> Floats:
        """Median ratios (3,) of linear values to the keyframe's, pixel by pixel where both show the same.

        A homography that the points obey says where that is. Around the points alone things look larger or smaller
        as the camera turns, so that there the ratio would not be that of the light.
        """
        if len(self._at) < FEWEST:
            return np.ones(3)
        now, scale = self._linear(pixels)
        moved, _ = self._cv2.findHomography(scale * self._corners, scale * self._at, self._cv2.RANSAC, 1.0)
        if moved is None:
            return np.ones(3)
        before = self._cv2.warpPerspective(self._light, moved, now.shape[1::-1], borderValue=(np.nan,) * 3)
        both = np.isfinite(before).all(axis=-1) & np.isfinite(now).all(axis=-1)
        if np.count_nonzero(both) < _LEAST_LIT * both.size:
            return np.ones(3)
        return np.asarray(np.median(now[both] / before[both], axis=0), dtype=np.float64)

    def _linear(self, pixels: NDArray[np.uint8]) -> tuple[NDArray[np.float32], float]:
        """Linear values (h, w, 3) of the picture made small, NaN where it is black or clipped, and how small it is."""
        height, width = pixels.shape[:2]
        scale, size = min(1.0, _LIGHT_SIDE / max(height, width)), sizes.shrunk(width, height, _LIGHT_SIDE)
        small = self._cv2.resize(self._cv2.LUT(pixels, _MEASURED), size, interpolation=self._cv2.INTER_AREA)
        return np.asarray(small), scale


def gains_of(steps: Sequence[Step]) -> Floats:
    """Gains (N, 3) of linear values against the first frame's, by way of the keyframes."""
    found: list[Floats] = []
    of_key: dict[int, Floats] = {}
    last: Floats = np.ones(3)
    for step in steps:
        base = of_key.setdefault(step.key, last)
        last = base * step.gain
        if step.makes is not None:
            of_key[step.makes] = last
        found.append(last)
    gains = np.array(found)
    return np.asarray(gains / gains[0])

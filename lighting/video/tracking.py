"""Points tracked from a keyframe (KLT), the rotation and the gain of each frame, and the records of both.

Corners of a keyframe are followed by the pyramidal method of Lucas and Kanade (as OpenCV has it). Then they are
compared with the keyframe itself, so that errors do not add up from frame to frame. A frame that shares too little with
its keyframe becomes the next one. Where nothing can be followed, a new stretch begins; whether it belongs to the same
shot is decided by the caller.

Where the camera walks, near things obey no rotation; then that of the essential matrix takes over
(registration/two_view.py).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import timedelta
from functools import cached_property, partial
from typing import Self

import numpy as np
from numpy.typing import NDArray

from lighting.color import SRGB_LINEAR
from lighting.fusion.metadata_prior import MetadataPrior, merge_user_input, observations_from_metadata
from lighting.fusion.user_input import UserInput
from lighting.geometry import Floats, shrink_size
from lighting.photo.metadata import HeadingReference, PhotoMetadata
from lighting.prediction import Prediction
from lighting.registration.features import (
    Features,
    Matches,
    detect_features,
    import_opencv,
    match_features,
    resize_to,
    to_centered,
)
from lighting.registration.robust_fit import ransac_rotation
from lighting.registration.rotations import nearest_rotation, rays_through
from lighting.registration.two_view import RelativeRotation, essential_motion, estimate_rotation, prefers_translation
from lighting.video.decode import Clip, Frame
from lighting.video.metadata import Gimbal

MAX_POINTS = 200  # sought in a keyframe
MIN_POINTS = 24  # followed, below which a frame counts as lost
MIN_KEPT_SHARE = 0.4  # share of a keyframe's points, below which the next keyframe is due
MAX_KEYFRAME_MOTION = 0.35  # half diagonals that points move in the median before the next keyframe is due
_MAX_FEATURES = 800  # of a keyframe, to be found again by
FEATURE_SIDE = 400  # pixels of the longer side in which those are sought

TRACKING_TOLERANCE = 1.5  # pixels; beyond it a point counts for ever less
BLUR_TOLERANCES = 6.0  # tolerances that points may be off where a picture is blurred
MAX_PARALLAX_SHARE = 0.7  # share of points that agree so far with a rotation, below which the camera may have moved
MIN_TIGHT_SHARE = 0.6  # share of these within half the tolerance, from which other things move, not the camera
MIN_MOTION_SHARE = 0.85  # share of the points that must then agree with a motion; things that move do not
MIN_LOCAL_SHARE = 0.5  # share of points that agree with a rotation nearby, below which it is sought from the beginning
MIN_RELIABLE_SHARE = 0.3  # share of followed points that must agree with a rotation
MIN_RELIABLE_POINTS = 12  # of them

_REWEIGHTINGS = 6  # of re-weighting, from eight times the tolerance down to it
_EXACT_PRIOR = 1e18  # inverse variance of the logarithm of a focal length that is known
_FLOW_WINDOW = (15, 15)
_FLOW_LEVELS = 4  # of the pyramid: a point may move by a fifth of the picture from one frame to the next
_MAX_CORRECTION = 3.0  # pixels by which the comparison with the keyframe may move a point
_MAX_FLOW_ERROR = 12.0  # gray values by which a point's surroundings may differ from those in its keyframe
_EVEN_STD = 50.0  # gray values, the standard deviation to which every frame is brought: gains do not disturb
_LIGHT_SIDE = 160  # pixels of the longer side in which a gain is measured
_MIN_LIT_SHARE = 0.02  # share of the picture that must be neither black nor clipped
_CODES = np.arange(256)
_LINEAR_TABLE = np.where((_CODES > 8) & (_CODES < 248), SRGB_LINEAR, np.float32(np.nan))  # NaN where black or clipped
_SUITABLE_TOLERANCE = 0.1  # below the most suitable frame's probability, within which the sharpest frame is chosen
GAP_KEYFRAMES = 2  # keyframes to either side of a gap that are compared


@dataclass(frozen=True, eq=False)
class Keyframe:
    """A keyframe."""

    number: int
    """Counted from 0."""
    stretch: int
    """The number of frames lost before it: within one stretch all keyframes are linked."""
    frame: int
    """Number in the shot, from 0."""
    time: float
    """Time, seconds."""
    picture: NDArray[np.uint8]
    """(h, w) gray, FEATURE_SIDE pixels along its longer side at most."""
    zoom: float = 1.0
    """Its focal length by that of the lens as which its features are to be seen."""

    @cached_property
    def features(self) -> Features:
        """SIFT features by which it is recognised; detected at the first use, which takes a tenth of a second."""
        features = detect_features(self.picture, FEATURE_SIDE, _MAX_FEATURES)
        width, height = (round(self.zoom * side) for side in (features.width, features.height))
        return Features(features.points / self.zoom, features.descriptors, width, height)


@dataclass(frozen=True, eq=False)
class TrackedFrame:
    """What one frame shares with a keyframe."""

    frame: int
    """Number in the shot, from 0."""
    time: float
    """Time, seconds."""
    key: int
    """Number of the keyframe."""
    stretch: int
    """Number, from 0, of the part without a gap that it belongs to."""
    matches: Matches
    """Of the keyframe's points, to the frame's; none in the keyframe that begins a stretch."""
    gain: Floats
    """(3,) of linear values, the frame's by the keyframe's."""
    is_start: bool
    """Whether it is the keyframe that begins a stretch."""
    next_key: int | None = None
    """Number of the keyframe that the frame became, another one than `key`."""


class PointTracker:
    """Takes frames one by one and remembers one keyframe."""

    def __init__(self) -> None:
        """Begin a clip; MissingExtraError without OpenCV."""
        self._cv2 = import_opencv()
        self._stretch = self._number = -1
        self._gray = self._key_gray = np.empty((0, 0), np.uint8)
        self._corners = self._points = np.empty((0, 2), np.float32)
        self._light = np.empty((0, 0, 3), np.float32)  # of the keyframe, as `_linear` has it
        self._corner_count = 1
        self._pending_key: Frame | None = None  # the keyframe while no frame was followed from it
        self.new_key: Keyframe | None = None  # from which the last frame was the first to be followed

    def follow(self, frame: Frame) -> TrackedFrame:
        """Track the last keyframe's points into a frame, which may become the next keyframe.

        Args:
            frame: the next one of the clip.
        """
        gray, self.new_key = self._even(frame.pixels), None
        is_kept = self._track_points(gray) if gray.shape == self._gray.shape else np.zeros(0, bool)
        if is_lost := bool(np.count_nonzero(is_kept) < MIN_POINTS):
            self._stretch += 1
            self._begin_key(frame, gray)
        else:
            self._release_key()
            self._corners, self._points = self._corners[is_kept], self._points[is_kept]
        self._gray = gray
        next_key = self._number + 1 if not is_lost and self._is_far() else None
        identity = (frame.index, frame.time, self._number, self._stretch)
        step = TrackedFrame(*identity, self._matches(), self._measure_gain(frame.pixels), is_lost, next_key)
        if next_key is not None:
            self._begin_key(frame, gray)
        return step

    def _even(self, pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Gray values of one mean and spread, whatever the exposure."""
        gray = self._cv2.cvtColor(pixels, self._cv2.COLOR_RGB2GRAY)
        mean, std = self._cv2.meanStdDev(gray)
        scale = _EVEN_STD / max(float(std[0, 0]), 4.0)
        return np.asarray(self._cv2.convertScaleAbs(gray, alpha=scale, beta=128.0 - scale * float(mean[0, 0])))

    def _track_points(self, gray: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """Moves the points into the frame; which of them are still there."""
        if not len(self._points):
            return np.zeros(0, bool)
        flow = partial(self._cv2.calcOpticalFlowPyrLK, winSize=_FLOW_WINDOW)
        coarse, ok, _ = flow(self._gray, gray, self._points, None, maxLevel=_FLOW_LEVELS)
        from_coarse = self._cv2.OPTFLOW_USE_INITIAL_FLOW
        fine, ok_fine, error = flow(self._key_gray, gray, self._corners, coarse.copy(), maxLevel=0, flags=from_coarse)
        close = (error.ravel() < _MAX_FLOW_ERROR) & (np.linalg.norm(fine - coarse, axis=1) < _MAX_CORRECTION)
        self._points = fine
        inside = np.all((fine > 2) & (fine < np.array(gray.shape[::-1]) - 3), axis=1)
        return np.asarray((ok.ravel() > 0) & (ok_fine.ravel() > 0) & close & inside)

    def _release_key(self) -> None:
        """Hand out the keyframe, once: what nothing can be followed from is not worth keeping."""
        if self._pending_key is not None:
            frame, self._pending_key = self._pending_key, None
            small = resize_to(self._cv2.cvtColor(frame.pixels, self._cv2.COLOR_RGB2GRAY), FEATURE_SIDE)
            self.new_key = Keyframe(self._number, self._stretch, frame.index, frame.time, small)

    def _begin_key(self, frame: Frame, gray: NDArray[np.uint8]) -> None:
        """Seek corners in the frame, to be followed from now on."""
        self._number += 1
        self._key_gray = gray
        corners = self._cv2.goodFeaturesToTrack(gray, MAX_POINTS, 0.005, max(6, max(gray.shape) // 64), blockSize=5)
        self._corners = np.empty((0, 2), np.float32) if corners is None else corners.reshape(-1, 2).astype(np.float32)
        self._points, self._corner_count = self._corners.copy(), max(len(self._corners), 1)
        self._light, _ = self._linear(frame.pixels)
        self._pending_key = frame

    def _is_far(self) -> bool:
        half = 0.5 * float(np.hypot(*self._gray.shape))
        moved = float(np.median(np.linalg.norm(self._points - self._corners, axis=1))) / half
        fewest = max(2 * MIN_POINTS, MIN_KEPT_SHARE * self._corner_count)
        return len(self._points) < fewest or moved > MAX_KEYFRAME_MOTION

    def _matches(self) -> Matches:
        height, width = self._gray.shape
        pixel = 2.0 / float(np.hypot(width, height))
        a, b = (to_centered(v, width, height).astype(np.float32) for v in (self._corners, self._points))
        return Matches(a, b, pixel)

    def _measure_gain(self, pixels: NDArray[np.uint8]) -> Floats:
        """Median ratios (3,) of linear values to the keyframe's, pixel by pixel where both show the same.

        A homography that the points obey says where that is. Around the points alone things look larger or smaller
        as the camera turns, so that there the ratio would not be that of the light.
        """
        if len(self._points) < MIN_POINTS:
            return np.ones(3)
        now, scale = self._linear(pixels)
        homography, _ = self._cv2.findHomography(scale * self._corners, scale * self._points, self._cv2.RANSAC, 1.0)
        if homography is None:
            return np.ones(3)
        before = self._cv2.warpPerspective(self._light, homography, now.shape[1::-1], borderValue=(np.nan,) * 3)
        red, green, blue = ratios = self._cv2.split(now / before)
        valid = np.isfinite(red + green + blue)
        if (count := np.count_nonzero(valid)) < _MIN_LIT_SHARE * valid.size:
            return np.ones(3)
        middle = [(count - 1) // 2, count // 2]  # of an even number two; `np.median` takes twice as long
        return np.array([np.partition(ratio[valid], middle)[middle].mean() for ratio in ratios], np.float64)

    def _linear(self, pixels: NDArray[np.uint8]) -> tuple[NDArray[np.float32], float]:
        """Linear values (h, w, 3) of the picture made small, NaN where it is black or clipped, and how small it is."""
        height, width = pixels.shape[:2]
        scale, size = min(1.0, _LIGHT_SIDE / max(height, width)), shrink_size(width, height, _LIGHT_SIDE)
        small = self._cv2.resize(self._cv2.LUT(pixels, _LINEAR_TABLE), size, interpolation=self._cv2.INTER_AREA)
        return np.asarray(small), scale


def chain_gains(steps: Sequence[TrackedFrame]) -> Floats:
    """Chain gains by way of the keyframes.

    Args:
        steps: of all frames, in order.

    Returns:
        Gains (N, 3) of linear values against the first frame's.
    """
    gains: list[Floats] = [np.ones(3)]
    of_key: dict[int, Floats] = {}
    for step in steps:
        gains.append(of_key.setdefault(step.key, gains[-1]) * step.gain)
        if step.next_key is not None:
            of_key[step.next_key] = gains[-1]
    return np.asarray(np.array(gains[1:]) / gains[1])


# Rotation of a frame against its keyframe.


@dataclass(frozen=True, eq=False)
class FrameRotation:
    """A frame's rotation against a keyframe."""

    rotation: Floats
    """(3, 3) directions in the keyframe's camera to the frame's."""
    share: float
    """Of the points that agree within twice TRACKING_TOLERANCE."""
    agreeing: int
    """How many those are."""


def estimate_frame_rotation(matches: Matches, focal: float, guess: Floats) -> FrameRotation:
    """Estimate the rotation that most matches obey, by re-weighted least squares.

    Weights are those of Geman and McClure; the rotation of a round is Kabsch's.

    Args:
        matches: of the keyframe's points to the frame's.
        focal: half diagonals, focal length of both.
        guess: (3, 3) rotation to begin with.
    """
    a, b = rays_through(matches.a, focal), rays_through(matches.b, focal)
    reach = TRACKING_TOLERANCE * matches.pixel / focal
    best = _refine_rotation(a, b, guess, reach)
    if _is_parallax(a, b, best.rotation, reach) and (walk := _walking_rotation(matches, focal, best.agreeing)):
        return walk
    if best.share < MIN_LOCAL_SHARE:
        restarted = _refine_rotation(a, b, ransac_rotation(matches, (focal, focal), (1.0,)).rotation, reach)
        best = max(best, restarted, key=lambda t: t.share)
    return best


def is_reliable(rotation: FrameRotation, *, is_start: bool) -> bool:
    """Tell whether a frame's rotation is to be used.

    Args:
        rotation: the frame's against its keyframe.
        is_start: whether the frame is the keyframe that begins a stretch.
    """
    return is_start or (rotation.share >= MIN_RELIABLE_SHARE and rotation.agreeing >= MIN_RELIABLE_POINTS)


def _is_parallax(a: Floats, b: Floats, rotation: Floats, reach: float) -> bool:
    """Whether many points are farther from where a rotation puts them than blur would explain, at all distances.

    Where things move before a place that stands still, the place's points all lie close to it.
    """
    distance = np.linalg.norm(b - a @ rotation.T, axis=1)
    close = np.count_nonzero(distance < 2.0 * reach)
    tight = np.count_nonzero(distance < 0.5 * reach)
    return bool(np.mean(distance < BLUR_TOLERANCES * reach) < MAX_PARALLAX_SHARE and tight < MIN_TIGHT_SHARE * close)


def _walking_rotation(matches: Matches, focal: float, agreeing: int) -> FrameRotation | None:
    """The rotation of a camera that walked, where clearly more points tell it than agree with a rotation alone."""
    consistent = prefers_translation(matches, agreeing)
    motion = None if consistent is None else essential_motion(consistent, (focal, focal), (1.0,), _EXACT_PRIOR)
    if motion is None or (count := int(np.count_nonzero(motion.inliers))) < MIN_MOTION_SHARE * len(matches):
        return None
    return FrameRotation(motion.rotation, count / len(matches), count)


def _refine_rotation(a: Floats, b: Floats, rotation: Floats, reach: float) -> FrameRotation:
    for wider in np.geomspace(8.0, 1.0, _REWEIGHTINGS):
        distance = np.sum(np.square(b - a @ rotation.T), axis=1)
        weight = np.square(1.0 / (1.0 + distance / (wider * reach) ** 2))
        rotation = nearest_rotation((b * weight[:, None]).T @ a)
    agrees = np.sum(np.square(b - a @ rotation.T), axis=1) < (2.0 * reach) ** 2
    return FrameRotation(rotation, float(agrees.mean()), int(agrees.sum()))


# Records of a clip.


@dataclass(frozen=True, eq=False)
class FrameEstimate:
    """What one frame shows by itself."""

    prediction: Prediction
    """Its sky in the color that the frame shows."""
    ground: Floats | None = None
    """(3,) reflectance, where the frame shows enough of it."""
    by_lens: "FrameEstimate | None" = None
    """The same by a camera with the clip's known lens, where it has one."""
    sharpness: float = 0.0
    """Mean difference of neighboring pixels, gray levels."""

    @property
    def suitable(self) -> float:
        """Probability that the frame suits an estimate, as `Light.suitable` has it; 0 where the network tells none."""
        return 0.0 if self.prediction.light is None else self.prediction.light.suitable


def choose_sharpest(estimates: Mapping[int, FrameEstimate]) -> int:
    """Return the key of the sharpest of the most suitable frames, the first of equals.

    Args:
        estimates: one or more.
    """
    least = max(estimate.suitable for estimate in estimates.values()) - _SUITABLE_TOLERANCE
    suitable = [key for key, estimate in estimates.items() if estimate.suitable >= least]
    return max(suitable, key=lambda key: estimates[key].sharpness)


@dataclass(frozen=True, eq=False)
class ShotObservations:
    """What was gathered of a clip, or of one shot of it."""

    size: tuple[int, int]
    """Width and height of the frames, pixels."""
    steps: list[TrackedFrame]
    """One a frame."""
    keys: dict[int, Keyframe]
    """Keys, by number."""
    estimates: dict[int, FrameEstimate]
    """By the frame's index."""


@dataclass(frozen=True, eq=False)
class ClipMetadata:
    """What is known of a clip beside its pixels."""

    metadata: PhotoMetadata = field(default_factory=PhotoMetadata)
    """Of the clip's first moment."""
    gimbal: Gimbal = field(default_factory=Gimbal)
    """The camera's tilt by its gimbal."""
    user_input: UserInput = field(default_factory=UserInput)
    """What the user states of the clip."""
    subject: str = "clip"
    """What warnings call it."""
    warnings: tuple[str, ...] = ()
    """Sentences about its pictures."""

    @classmethod
    def of_clip(cls, clip: Clip, user_input: UserInput) -> Self:
        """Collect what is known of an open clip beside its pixels.

        Args:
            clip: an open one.
            user_input: of its first frame; may forbid the clip's own metadata.
        """
        if not user_input.metadata:
            return cls(user_input=user_input, warnings=clip.info.warnings)
        return cls(clip.info.metadata, clip.info.gimbal, user_input, warnings=clip.info.warnings)

    @property
    def vertical_fov(self) -> float | None:
        """Of the lens [deg] by the user or the metadata; None is unknown."""
        return merge_user_input(self.metadata, self.user_input).vertical_fov

    def prior_at(self, seconds: float, heading: float | None = None) -> MetadataPrior:
        """Return what metadata and the user say of a frame.

        Args:
            seconds: s from the clip's first frame.
            heading: deg clockwise from north, where the gimbal points it; None without a gimbal.

        Raises:
            ParameterError: the user's time and place are of night at 0 s. Later they are not used then.
        """
        later = timedelta(seconds=seconds)
        times = (self.metadata.local_time, self.metadata.gps_time, self.user_input.time)
        local, gps, told = (None if moment is None else moment + later for moment in times)
        metadata = replace(self.metadata, local_time=local, gps_time=gps)
        user_input = replace(self.user_input, time=told)
        if heading is not None:
            metadata = replace(metadata, heading=heading, heading_reference=HeadingReference.TRUE)
        elif seconds > 0.0:  # the one that is known is of the clip's first frame
            metadata = replace(metadata, heading=None)
        if seconds > 0.0:  # what the user states, too
            user_input = replace(user_input, heading=None)
        return observations_from_metadata(metadata, user_input, self.subject, allow_night=seconds != 0.0)


def match_keyframes(
    a: Keyframe, b: Keyframe, vertical_fov: float | None, fov_std: float = 0.0
) -> RelativeRotation | None:
    """Estimate the rotation from one keyframe to another by their features; None where too little is common.

    Args:
        a: the first keyframe.
        b: the second one.
        vertical_fov: deg, of both; None is unknown.
        fov_std: deg, of that; 0 is exact.
    """
    if a.picture.shape != b.picture.shape:
        return None
    size = (a.picture.shape[1], a.picture.shape[0])
    return estimate_rotation(match_features(a.features, b.features), size, size, (vertical_fov, vertical_fov), fov_std)

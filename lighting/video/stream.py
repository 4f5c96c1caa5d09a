"""One light for a live stream of frames: where the camera points, and the sun as it sees it; memory is constant.

Orientations are chained from keyframe to keyframe. Keyframes that are linked without a gap form a chain; their
orientations are against that chain's first camera. Earlier keyframes are recognised by their features, which takes
back the drift; the sun does so too where time and place are known.

Where the thread is lost, another chain begins, with estimates of its own. How two chains lie to each other is unknown
until a keyframe of one is recognised in the other; then the later chain is rotated into the earlier one. A lens that is
zoomed loses the thread: what comes then is seen through another lens.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lighting.color import check_pixels, luminance
from lighting.decoding import with_ground_color
from lighting.envmap.relighting import scale_exposure
from lighting.errors import ErrorCode, ParameterError, warn_of_old_name
from lighting.fusion.estimate import build_estimate
from lighting.fusion.metadata_prior import MetadataPrior
from lighting.fusion.single_view import Posterior
from lighting.fusion.user_input import UserInput, check_user_input
from lighting.geometry import Floats, angle_between, shrink_size
from lighting.model import Model, model_or_packaged
from lighting.records import Lighting
from lighting.registration.rotations import (
    camera_up,
    focal_from_fov,
    heading_elevation_roll,
    leveling_rotation,
    nearest_rotation,
    rotation_about,
    rotation_vector,
)
from lighting.registration.two_view import RelativeRotation
from lighting.video.decode import FRAME_SIDE, Frame
from lighting.video.framing import StreamFraming
from lighting.video.intrinsics import GUESSED_FOV_STD, MIN_FOV_STD, NETWORK_FOV_STD, constrains_fov, is_zoomed
from lighting.video.observation import FrameObservation, ShotLight, estimate_frame, is_dark
from lighting.video.shot import estimate_north, lighting_in_camera
from lighting.video.tracking import (
    ClipMetadata,
    FrameEstimate,
    Keyframe,
    PointTracker,
    TrackedFrame,
    estimate_frame_rotation,
    is_reliable,
    match_keyframes,
)

MAX_TIME = 1e10  # s of a stream, 317 years: no clock that counts seconds is beyond it, and calendars can follow
STREAM_NETWORK_INTERVAL = 2.0  # s between the frames that the network sees
MAX_LOOKS = 64  # estimates whose gravity and lens count; older ones fade
CORRECTION_SHARE = 0.5  # share of the correction by a recognised keyframe that is taken at once
ZOOM_CHECK_FRAMES = 4  # frames, of which one is asked whether the lens was zoomed

MAX_KEYFRAMES = 32  # keyframes that are remembered
MIN_KEYFRAME_ANGLE = 12.0  # deg between two of a chain
RECENT_KEYFRAMES = 3  # keyframes; those just before are no news
MAX_COMPARED = 3  # keyframes of its own chain, with a new one
MAX_OTHER_CHAINS = 3  # of other chains, those that seem nearest, and as many of the others, in turn
FIRST_CHAIN = 0  # the chain that headings are against


@dataclass(frozen=True, eq=False)
class BankKeyframe:
    """A keyframe of the bank."""

    keyframe: Keyframe
    """With the points that are found again."""
    orientation: Floats
    """(3, 3) against the first camera of its chain."""
    chain: int
    """The number of its chain, from 0."""


class KeyframeBank:
    """Keyframes with their orientations, not two of one direction in a chain."""

    def __init__(self) -> None:
        self.keyframes: list[BankKeyframe] = []

    def nearest_of_chain(self, key: Keyframe, orientation: Floats, chain: int, within: float) -> Sequence[BankKeyframe]:
        """The nearest MAX_COMPARED of a new keyframe's chain within an angle [deg], its neighbors in time left out."""
        near = [k for k in self._by_angle(orientation) if k.chain == chain and _angle(k, orientation) < within]
        recent = key.number - RECENT_KEYFRAMES
        return [k for k in near if k.keyframe.number < recent or k.keyframe.stretch != key.stretch][:MAX_COMPARED]

    def of_other_chains(self, key: Keyframe, orientation: Floats, chain: int) -> Sequence[BankKeyframe]:
        """Keyframes of other chains, whose directions are unknown: none is too far off, and each gets its turn."""
        order = [k for k in self._by_angle(orientation) if k.chain != chain]
        rest = order[MAX_OTHER_CHAINS:]
        start = key.number * MAX_OTHER_CHAINS % max(len(rest), 1)
        in_turn = (rest + rest)[start : start + min(MAX_OTHER_CHAINS, len(rest))]
        return [*order[:MAX_OTHER_CHAINS], *in_turn]

    def add(self, new: BankKeyframe) -> None:
        """Remember a keyframe, unless its chain has one of nearly the same direction."""
        same = [k for k in self.keyframes if k.chain == new.chain]
        if any(_angle(k, new.orientation) < MIN_KEYFRAME_ANGLE for k in same):
            return
        self.keyframes.append(new)
        if len(self.keyframes) > MAX_KEYFRAMES:
            del self.keyframes[self._least_needed(new.chain)]

    def join(self, chain: int, other: int, correction: Floats) -> None:
        """Make a chain part of another one, its orientations being turned by a rotation (3, 3)."""
        for i, k in enumerate(self.keyframes):
            if k.chain == chain:
                self.keyframes[i] = replace(k, orientation=k.orientation @ correction, chain=other)

    def _by_angle(self, orientation: Floats) -> list[BankKeyframe]:
        """All keyframes, those first that look nearly where a camera does."""
        return sorted(self.keyframes, key=lambda k: _angle(k, orientation))

    def _least_needed(self, chain: int) -> int:
        """The oldest of chains that were left, or of the longer one of the first and the present `chain`.

        The first frame's stays: it is what all headings refer to.
        """
        abandoned = [i for i, k in enumerate(self.keyframes) if k.chain not in (FIRST_CHAIN, chain)]
        first, current = ([i for i, k in enumerate(self.keyframes) if k.chain == c] for c in (FIRST_CHAIN, chain))
        return abandoned[0] if abandoned else (current if len(current) > len(first) else first[1:])[0]


def _angle(k: BankKeyframe, orientation: Floats) -> float:
    """Between where a keyframe and a camera look [deg]."""
    return float(angle_between(-k.orientation[2], -orientation[2]))


class _ChainLight:
    """What estimates say in the frame of one chain: which way is up, and the light."""

    def __init__(self, chain: int) -> None:
        self.chain = chain
        self.light = ShotLight()
        self.posterior: Posterior | None = None  # the light's last answer; None before the first estimate
        self._up: Floats | None = None
        self._count = 0

    def add(
        self, estimate: FrameEstimate, orientation: Floats, vertical_fov: float, gain: float, prior: MetadataPrior
    ) -> None:
        """Count an estimate by a camera of that orientation (3, 3)."""
        prediction = estimate.prediction
        up = orientation.T @ camera_up(prediction.camera_elevation, prediction.camera_roll)
        self._count = min(self._count + 1, MAX_LOOKS)
        previous = up if self._up is None else self._up
        mean = previous + (up - previous) / self._count
        self._up = np.asarray(mean / np.linalg.norm(mean))
        self.light.add(FrameObservation(estimate, self.angles(orientation)[0], vertical_fov, gain, prior.observations))
        self.posterior = self.light.answer(prior.observations)

    def angles(self, orientation: Floats) -> tuple[float, float, float]:
        """Heading, elevation and roll [deg] of a camera, once there was an estimate."""
        assert self._up is not None
        heading, elevation, roll = heading_elevation_roll(orientation[None], leveling_rotation(self._up))
        return float(heading[0]), float(elevation[0]), float(roll[0])


class _LensEstimator:
    """The field of view, learnt as frames come: fixed, or by the network and by rotations between keyframes."""

    def __init__(self, fixed: float | None) -> None:
        self.fixed = fixed  # deg; None where it is not known
        self._sum, self._weight = 0.0, 0.0  # of what rotations say
        self._network_fov, self._count = 50.0, 0

    @property
    def fov(self) -> float:
        """Vertical, deg."""
        if self.fixed is not None:
            return self.fixed
        network_weight = NETWORK_FOV_STD**-2
        return (self._sum + network_weight * self._network_fov) / (self._weight + network_weight)

    def add_prediction(self, fov: float) -> None:
        """Count the network's field of view [deg] of a frame."""
        self._count = min(self._count + 1, MAX_LOOKS)
        self._network_fov += (fov - self._network_fov) / self._count

    def add_keyframes(self, a: Keyframe, b: Keyframe) -> None:
        """Learn from the rotation between two keyframes, while the lens is not known well."""
        if self.fixed is not None or self._weight > 1.0 / MIN_FOV_STD**2 * 4:
            return
        if (rotation := match_keyframes(a, b, None)) is not None and not rotation.zoomed:
            self.add_rotation(rotation)

    def add_rotation(self, rotation: RelativeRotation) -> None:
        """Learn from a rotation to a picture that was seen through this lens."""
        if rotation.zoomed or constrains_fov(rotation, self._network_fov):
            weight = 1.0 / (rotation.fov_std**2 + MIN_FOV_STD**2)
            self._sum, self._weight = self._sum + weight * rotation.vertical_fov[1], self._weight + weight


@dataclass(frozen=True)
class StreamFrame:
    """What is known after a frame."""

    lighting: Lighting
    """As this frame's camera sees it; `camera_heading` is absolute, where time and place are known."""
    heading: float
    """Deg clockwise from the first frame, -180 to 180."""
    gain: tuple[float, float, float]
    """Linear red, green and blue against the first frame."""
    followed: bool
    """False where nothing could be followed: the angles are those of the frame before."""
    linked: bool
    """Whether headings are against the first frame; if not, they only go on from where the thread was lost."""


class Tracker:
    """Follows the light through a stream of frames of one size; not for several threads."""

    def __init__(
        self,
        model: Model | None = None,
        user_input: UserInput | None = None,
        *,
        look_every: float = STREAM_NETWORK_INTERVAL,
        given: UserInput | None = None,
    ) -> None:
        """Begin a stream.

        Args:
            model: the network; None is the one in this package.
            user_input: time, location, heading and field of view of the first frame, as far as they are known.
            look_every: s between the frames that the network sees, at least 0.
            given: old name of `user_input`.

        Raises:
            ParameterError: an argument is of another type or out of range.
            ModelError: the network cannot be read.
            MissingExtraError: OpenCV is not installed.
        """
        if not 0.0 <= look_every < math.inf:
            predicate = f"must be a finite number of seconds, at least 0, not {look_every}."
            raise ParameterError.about("look_every", predicate, ErrorCode.OUT_OF_RANGE)
        if given is not None:
            warn_of_old_name("lighting.video.stream.Tracker.given")
            user_input = given
        user_input = UserInput(metadata=False) if user_input is None else user_input
        check_user_input(user_input)
        self._model = model_or_packaged(model)
        self._clip_metadata = ClipMetadata(user_input=user_input, subject="stream")
        self._look_every, self._due = look_every, -math.inf
        self._framing = StreamFraming()
        self._point_tracker, self._lens = PointTracker(), _LensEstimator(user_input.vertical_fov)
        self._lens_std = 0.0  # deg, of the lens that keyframes are compared by: of its own once it was zoomed
        self._zoomed_key = -1  # the keyframe against which it was found to be zoomed
        self._bank = KeyframeBank()
        self._chain = self._last_chain = FIRST_CHAIN  # the one in use, and the last that was begun
        self._previous_key: Keyframe | None = None  # the keyframe before, where the thread was not lost since
        self._key_poses: dict[int, tuple[Floats, Floats]] = {}  # orientation and gain of the keyframes in use
        self._orientation, self._gain = np.eye(3), np.ones(3)
        self._first_light = self._light = _ChainLight(FIRST_CHAIN)  # of the first chain, and of the one last estimated
        self._count = 0
        self._prior = MetadataPrior()  # of the last moment that is not of night

    def __call__(self, pixels: NDArray[np.uint8], time: float) -> StreamFrame | None:
        """Take a frame and return the light as its camera sees it; None while all frames were too dark.

        When night falls by the time and place of the user, the sun stays where the last frame before that had it.

        Args:
            pixels: (h, w, 3) upright sRGB, uint8, of one size throughout.
            time: s after the first frame, finite.

        Raises:
            PhotoError: the pixels have another shape or type.
            ParameterError: the time is not finite or beyond MAX_TIME, or it is night at the first frame.
        """
        if not math.isfinite(time):
            sentence = f"The time of a frame must be a finite number of seconds, not {time}."
            raise ParameterError(sentence, "time", ErrorCode.WRONG_TYPE)
        if abs(time) > MAX_TIME:
            sentence = f"The time of a frame must be seconds after the first, not {time:g}."
            raise ParameterError(sentence, "time", ErrorCode.OUT_OF_RANGE)
        shown = self._framing.fill(_shrink_frame(check_pixels(pixels)), time)
        frame = Frame(self._count, time, shown)
        self._count += 1
        step = self._point_tracker.follow(frame)
        size = (frame.pixels.shape[1], frame.pixels.shape[0])
        if (key := self._point_tracker.new_key) is not None:
            self._close_loop(key)
        followed = self._update_orientation(step, size)
        if not (prior := self._prior_at(time)).is_night:
            self._prior = prior
        if time >= self._due and followed and not prior.is_night and not is_dark(frame.pixels):
            self._estimate(frame, prior)
        return self._answer(followed)

    def _update_orientation(self, step: TrackedFrame, size: tuple[int, int]) -> bool:
        """Update the camera's orientation; whether the frame's points said it."""
        if step.is_start:
            self._begin_chain()
            self._key_poses = {step.key: (self._orientation, self._gain)}
            return len(step.matches) > 0
        base, gain = self._key_poses[step.key]
        focal = focal_from_fov(self._lens.fov, *size)
        rotation = estimate_frame_rotation(step.matches, focal, self._orientation @ base.T)
        self._gain = gain * step.gain
        reliable = is_reliable(rotation, is_start=False)
        if reliable:
            self._orientation = rotation.rotation @ base
        if self._is_zoomed(step, size):
            self._zoomed_key, self._lens, self._lens_std = step.key, _LensEstimator(None), GUESSED_FOV_STD
            self._begin_chain()
        elif step.next_key is not None and not reliable:
            self._begin_chain()
        if step.next_key is not None:
            self._key_poses[step.next_key] = (self._orientation, self._gain)
        self._key_poses = {k: v for k, v in self._key_poses.items() if k >= step.key}
        return reliable

    def _is_zoomed(self, step: TrackedFrame, size: tuple[int, int]) -> bool:
        """Whether the lens was zoomed since the keyframe, asked once of a keyframe and when the next one begins."""
        if step.next_key is None and (step.key == self._zoomed_key or step.frame % ZOOM_CHECK_FRAMES):
            return False
        return self._first_light.posterior is not None and is_zoomed(step.matches, self._lens.fov, size)

    def _begin_chain(self) -> None:
        """Begin another chain; all begins anew where there was no answer yet."""
        self._previous_key = None
        if self._first_light.posterior is None:
            self._bank, self._orientation, self._gain = KeyframeBank(), np.eye(3), np.ones(3)
            return
        self._last_chain += 1
        self._chain, self._due = self._last_chain, -math.inf

    def _close_loop(self, key: Keyframe) -> None:
        """Compare a keyframe with those of the bank: take back what the chain has drifted, and join chains."""
        previous, self._previous_key = self._previous_key, key
        nearest = self._bank.nearest_of_chain(key, self._key_poses[key.number][0], self._chain, 0.5 * self._lens.fov)
        if match := self._match_bank(key, nearest):
            self._correct(rotation_about(CORRECTION_SHARE * rotation_vector(match[1])))
        others = self._bank.of_other_chains(key, self._key_poses[key.number][0], self._chain)
        if other_match := self._match_bank(key, others):
            self._join(*other_match)
        if match or other_match:
            return
        if previous is not None:
            self._lens.add_keyframes(previous, key)
        self._bank.add(BankKeyframe(key, nearest_rotation(self._key_poses[key.number][0]), self._chain))

    def _match_bank(self, key: Keyframe, candidates: Sequence[BankKeyframe]) -> tuple[BankKeyframe, Floats] | None:
        """The first keyframe that a new one shows again, and the rotation (3, 3) from its chain's frame to this one."""
        for kept in candidates:
            if (rotation := match_keyframes(kept.keyframe, key, self._lens.fov, self._lens_std)) is not None:
                if self._lens_std:
                    self._lens.add_rotation(rotation)
                return kept, self._key_poses[key.number][0].T @ rotation.rotation @ kept.orientation
        return None

    def _join(self, kept: BankKeyframe, rotation: Floats) -> None:
        """Turn the later of two chains, one of which has a keyframe that the other recognised, into the earlier."""
        if kept.chain > self._chain:
            self._bank.join(kept.chain, self._chain, rotation.T)
            return
        self._bank.join(self._chain, kept.chain, rotation)
        self._correct(rotation)
        self._chain, self._due = kept.chain, -math.inf
        if self._chain == FIRST_CHAIN:
            self._light = self._first_light

    def _correct(self, correction: Floats) -> None:
        """Turn the camera, and the keyframes that it is followed from, by a rotation (3, 3) of their chain's frame."""
        self._orientation = self._orientation @ correction
        self._key_poses = {k: (orientation @ correction, gain) for k, (orientation, gain) in self._key_poses.items()}

    def _estimate(self, frame: Frame, prior: MetadataPrior) -> None:
        self._due = frame.time + self._look_every - 1e-6
        estimate = estimate_frame(self._model, frame.pixels, self._lens.fixed)
        estimate = estimate.by_lens or estimate
        self._lens.add_prediction(estimate.prediction.vertical_fov)
        if self._light.chain != self._chain:
            self._light = _ChainLight(self._chain)
        gain = float(luminance(self._gain))
        self._light.add(estimate, self._orientation, self._lens.fov, gain, self._in_chain(prior))

    def _in_chain(self, prior: MetadataPrior) -> MetadataPrior:
        """What is known in the frame of the present chain: a heading is that of the first frame."""
        if self._chain == FIRST_CHAIN:
            return prior
        return replace(prior, observations=replace(prior.observations, heading=None))

    def _prior_at(self, time: float) -> MetadataPrior:
        """What is known of a moment, the heading being that of the first frame."""
        prior, first = self._clip_metadata.prior_at(time), self._clip_metadata.prior_at(0.0).observations
        compass = replace(prior.observations, heading=first.heading, heading_std=first.heading_std)
        return replace(prior, observations=compass)

    def _answer(self, followed: bool) -> StreamFrame | None:
        if (posterior := self._light.posterior) is None:
            return None
        angles = self._light.angles(self._orientation)
        prior = self._in_chain(self._prior)
        base = with_ground_color(build_estimate(posterior, prior).lighting, self._light.light.ground)
        base = replace(base, warnings=(*base.warnings, *self._framing.warnings))
        north = estimate_north(posterior, prior)
        lighting = lighting_in_camera(scale_exposure(base, self._gain), angles, self._lens.fov, north)
        red, green, blue = map(float, self._gain)
        return StreamFrame(lighting, angles[0], (red, green, blue), followed, self._chain == FIRST_CHAIN)


def _shrink_frame(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The frame with its longer side at most FRAME_SIDE pixels."""
    from PIL import Image

    height, width = pixels.shape[:2]
    size = shrink_size(width, height, FRAME_SIDE)
    if size == (width, height):
        return np.ascontiguousarray(pixels)
    return np.asarray(Image.fromarray(pixels).resize(size, Image.Resampling.BILINEAR, reducing_gap=2.0))

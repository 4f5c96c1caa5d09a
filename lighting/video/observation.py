"""A clip observed frame by frame: every frame is tracked, some are shown to the network, and shots are divided.

A shot has one sun: the network's estimates of many frames, rotated into one frame and multiplied. Frames that look the
same way see the same evidence, so they are averaged in sectors of the camera's heading; memory does not grow with the
shot. Sectors that overlap are alike in part and count as fusion/multi_view.py has it.

Shots begin at cuts and at dissolves. About ten times a second a frame is compared with one before and one after it,
both moved onto it by dense flow. Where things move, each part of the frame is explained by one of the two. In a
dissolve only a mixture of both explains it, with the same share everywhere. There the two have little in common.
"""

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.color import luminance, srgb_decode
from lighting.decoding import light_from_vector, light_to_vector, lighting_from_prediction, sun_from_prediction
from lighting.envmap.appearance import PhotoSamples, estimate_ground_albedo, sky_white_balance
from lighting.fusion.estimate import screen_prediction
from lighting.fusion.pooling import (
    AZIMUTH_CORRELATION,
    SUN_CORRELATION,
    Correlation,
    effective_weights,
    pool_log_likelihoods,
    rotate_density,
)
from lighting.fusion.single_view import (
    Observations,
    Posterior,
    candidates_above_horizon,
    compass_prior,
    fuse,
    likelihood_by_heading,
    posterior_on_rings,
)
from lighting.geometry import Floats, direction
from lighting.model import Model
from lighting.photo.picture_checks import is_blank
from lighting.photo.reader import Photo
from lighting.prediction import Prediction
from lighting.records import EvidenceKind
from lighting.registration.features import Matches, import_opencv, resize_to
from lighting.sun_grid import HEADINGS, grid_solid_angle
from lighting.tracing import trace_step
from lighting.video.decode import Frame
from lighting.video.tracking import (
    FEATURE_SIDE,
    GAP_KEYFRAMES,
    FrameEstimate,
    Keyframe,
    PointTracker,
    ShotObservations,
    TrackedFrame,
    choose_sharpest,
    match_keyframes,
)

NETWORK_INTERVAL = 0.2  # s between the frames that the network sees
MIN_LOOK_INTERVAL = 0.1  # s between frames that it sees because something new begins
MIN_STRETCH_FRAMES = 15  # frames of a new stretch, after which it is compared with what was before
MIN_BRIGHTNESS = 0.01  # linear value that 5 % of a daylight frame's pixels exceed

Pixels = NDArray[np.uint8]

COMPARISON_INTERVAL = 0.1  # s between the frames that are compared
MAX_COMPARISON_GAP = 0.25  # s between them, beyond which nothing is told
LAGS = (3, 6, 12)  # of them, from a frame to the ones before and after: for dissolves of up to 0.6, 1.2 and 2.4 s
MIXED_SHARES = (0.2, 0.8)  # the earlier picture's share, within which a frame counts as mixed
MIN_DIFFERENCE = 100.0  # mean square by which neither picture alone explains a mixed frame
MIXTURE_NOISE = 15.0  # the same by which the mixture may miss it
MAX_CORRELATION = 0.8  # correlation of the two pictures, from which they are one

_COMPARED_SIDE = 64  # pixels of the longer side
_EVEN_STD = 40.0  # gray values, to which the standard deviation of every picture is brought
_MIN_STD = 16.0  # gray values, that of a picture with too little in it to be brought there
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
    picture: NDArray[np.uint8]  # (h, w) gray, as keyframes have it
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
            if len(self._kept) <= 2 * lag or (middle := self._kept[-1 - lag]).number % (lag // LAGS[0]) != 0:
                continue
            # The pending one is told first: until then another one does not count.
            is_other = bool(self._mixed) and middle.number > max(self._mixed) + _MAX_UNMIXED
            if not is_other and self._is_mixed(self._kept[-1 - 2 * lag].even, middle.even, compared.even):
                self._mixed.append(middle.number)
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

        ends = at(first - _CLEAR_FRAMES), at(last + _CLEAR_FRAMES)
        before, after = (Keyframe(end.number, 0, end.number, end.time, end.picture) for end in ends)
        if last - first > _MAX_DISSOLVE_FRAMES or match_keyframes(before, after, None) is not None:
            return None
        return Dissolve(at(first).time, at(last).time)

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


MIN_SHOT_FRAMES = 5  # frames, fewer than which are no shot but a gap in one


def _split_shots(tracked: ShotObservations) -> list[ShotObservations]:
    """Divide what was tracked into shots; frames in which nothing can be followed belong to the shot before them.

    Args:
        tracked: one frame or more.
    """
    long = _long_stretches(tracked.steps)
    keys = {s: sorted((k for k in tracked.keys.values() if k.stretch == s), key=lambda k: k.number) for s in long}
    shot_of, number = {}, 0
    for before, after in zip([None, *long[:-1]], long, strict=True):
        if before is not None:
            pairs = product(keys[before][-GAP_KEYFRAMES:], keys[after][:GAP_KEYFRAMES])  # to both sides of a gap
            number += all(match_keyframes(a, b, None) is None for a, b in pairs)
        shot_of[after] = number
    current, members = 0, []
    for step in tracked.steps:
        current = shot_of.get(step.stretch, current)
        members.append(current)
    return [_select_frames(tracked, [i for i, m in enumerate(members) if m == n]) for n in range(number + 1)]


def _split_at_dissolve(tracked: ShotObservations, dissolve: Dissolve) -> list[ShotObservations]:
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


def _select_frames(tracked: ShotObservations, positions: Sequence[int]) -> ShotObservations:
    steps = [tracked.steps[i] for i in positions]
    frames = {step.frame for step in steps}
    keys = {n: k for n, k in tracked.keys.items() if k.frame in frames}
    return ShotObservations(tracked.size, steps, keys, {f: p for f, p in tracked.estimates.items() if f in frames})


class _ClipObserver:
    """Takes a clip's frames one by one, and hands out what was gathered of each shot."""

    def __init__(
        self, model: Model, every: float, vertical_fov: float | None, keep: Callable[[int], object] | None
    ) -> None:
        self._model, self._every, self._due, self._keep_picture = model, every, 0.0, keep
        self._last_look = -math.inf
        self._vertical_fov = vertical_fov
        self._tracker, self._dissolves = PointTracker(), DissolveDetector()
        self._check_pending = False  # whether a new stretch is to be compared with what was before
        self._open = ShotObservations((0, 0), [], {}, {})  # of the frames that are not of a shot handed out
        self._rivals: dict[int, FrameEstimate] = {}  # for the shot's map, of the stretch that is being followed

    def take(self, frame: Frame) -> Iterator[ShotObservations]:
        """Take a frame and hand out the shots that it shows to be over, as one of another size does."""
        size = (frame.pixels.shape[1], frame.pixels.shape[0])
        if size != self._open.size:
            yield from self.finish()
            self._keep(ShotObservations(size, [], {}, {}))
        self._frame = frame
        step = self._tracker.follow(frame)
        self._open.steps.append(step)
        if (key := self._tracker.new_key) is not None:
            self._open.keys[key.number] = key
        if step.is_start:
            self._rivals = {}
        if step.is_start and step.frame > 0:  # where every frame begins a stretch, not every one is looked at
            self._due = min(self._due, self._last_look + MIN_LOOK_INTERVAL)
        if frame.time >= self._due:
            self._estimate(frame)
        if (dissolve := self._dissolves.take(frame)) is not None:
            yield from self._divide(dissolve)
        self._check_pending |= self._is_check_due(step.stretch)
        if self._check_pending and not self._dissolves.is_pending:
            *over, rest = _split_shots(self._open)
            yield from over
            self._keep(rest)

    def finish(self) -> Iterator[ShotObservations]:
        """Hand out the shots that are left, once no frame comes any more."""
        if (dissolve := self._dissolves.finish()) is not None:
            yield from self._divide(dissolve)
        if self._open.steps:
            yield from _split_shots(self._open)

    def _keep(self, rest: ShotObservations) -> None:
        self._open, self._check_pending = rest, False

    def _divide(self, dissolve: Dissolve) -> Iterator[ShotObservations]:
        """Hand out what is before a dissolve."""
        *before, rest = _split_at_dissolve(self._open, dissolve)
        for part in before:
            yield from _split_shots(part)
        self._keep(rest)
        if not rest.estimates:
            self._estimate(self._frame)

    def _estimate(self, frame: Frame) -> None:
        self._due = frame.time
        if not (is_dark(frame.pixels) or is_blank(frame.pixels)):
            self._last_look = frame.time
            estimate = estimate_frame(self._model, frame.pixels, self._vertical_fov)
            self._open.estimates[frame.index] = self._rivals[frame.index] = estimate
            self._due = frame.time + self._every - 1e-6
            if self._keep_picture is not None and choose_sharpest(self._rivals) == frame.index:
                self._keep_picture(frame.index)

    def _is_check_due(self, stretch: int) -> bool:
        """Whether a new stretch has just become long enough to see if it is a new shot."""
        before, *recent = [step.stretch == stretch for step in self._open.steps[-MIN_STRETCH_FRAMES - 1 :]]
        return len(recent) == MIN_STRETCH_FRAMES and all(recent) and not before


def observe_shots(
    frames: Iterable[Frame],
    model: Model,
    every: float = NETWORK_INTERVAL,
    progress: Callable[[float], object] | None = None,
    vertical_fov: float | None = None,
    keep: Callable[[int], object] | None = None,
) -> Iterator[ShotObservations]:
    """Track a clip and hand out what each shot shows, as soon as it is over.

    An interruption by the user ends the last shot where the clip had been read to, and is raised after that.

    Args:
        frames: of one clip, in order.
        model: the network.
        every: s between the frames that the network sees; it sees the first of each shot.
        progress: called with the time [s] of each frame; None is not called.
        vertical_fov: deg, of the lens; None is unknown.
        keep: called with the index of the frame read last, where maps would show it by now; None is not called.
    """
    observer, interruption = _ClipObserver(model, every, vertical_fov, keep), None
    try:
        for frame in frames:
            yield from observer.take(frame)
            if progress is not None:
                progress(frame.time)
    except KeyboardInterrupt as error:
        interruption = error
    yield from observer.finish()
    if interruption is not None:
        raise interruption


def estimate_frame(model: Model, pixels: Pixels, vertical_fov: float | None = None) -> FrameEstimate:
    """Estimate a frame by itself, sky and ground in the colors that it shows.

    Args:
        model: the network.
        pixels: (h, w, 3) sRGB, upright.
        vertical_fov: deg, of the lens, for a second estimate by that lens; None is unknown.
    """
    photo = Photo(pixels, pixels.shape[1], pixels.shape[0], "frame of a clip")
    with trace_step("network"):
        prediction = replace(model.predict_one(photo), segments=None)  # which nothing asks of most frames
    green = pixels[..., 1].astype(np.float32)
    sharpness = float(np.abs(np.diff(green, axis=0)).mean() + np.abs(np.diff(green, axis=1)).mean())
    estimate = _apply_colors(screen_prediction(prediction, pixels), pixels, sharpness)
    if vertical_fov is None:
        return estimate
    by_lens = _apply_colors(screen_prediction(prediction, pixels, vertical_fov), pixels, sharpness)
    return replace(estimate, by_lens=by_lens)


def _apply_colors(prediction: Prediction, pixels: Pixels, sharpness: float) -> FrameEstimate:
    """The estimate of a frame, in the colors that it shows."""
    if (light := prediction.light) is None:
        return FrameEstimate(prediction, sharpness=sharpness)
    sun = sun_from_prediction(prediction)
    lighting = lighting_from_prediction(prediction, sun)
    samples = PhotoSamples.of_photo(pixels, lighting)
    if (tint := sky_white_balance(samples, lighting)) is not None:
        prediction = replace(prediction, light=replace(light, sky_irradiance=light.sky_irradiance * tint))
        lighting = lighting_from_prediction(prediction, sun)
    ground = estimate_ground_albedo(samples, lighting, light.surroundings)
    return FrameEstimate(prediction, ground, sharpness=sharpness)


def is_dark(pixels: Pixels) -> bool:
    """Tell whether a frame is too dark for daylight, such as black frames and nights.

    Args:
        pixels: (h, w, 3) sRGB.
    """
    brightness = np.percentile(luminance(srgb_decode(pixels[::8, ::8] / 255.0)), 95)
    return bool(brightness < MIN_BRIGHTNESS)


SECTOR_WIDTH = 15.0  # deg of heading
MIN_SECTOR_WEIGHT = 0.5  # of the sectors' mean weight, below which one counts for less
MAX_SECTOR_WEIGHT = 60.0  # estimates in a sector; older ones fade, so that a stream follows sun and clouds
_EPSILON_DENSITY = 1e-12  # density that stands for none


@dataclass(frozen=True, eq=False)
class FrameObservation:
    """What one frame shows, and how that frame lies in the shot."""

    estimate: FrameEstimate
    """The network's, of this frame."""
    heading: float
    """Deg clockwise from the shot's azimuth 0."""
    vertical_fov: float
    """Vertical fov, deg."""
    gain: float = 1.0
    """Of the frame's linear values, by the first frame's."""
    observations: Observations = field(default_factory=Observations)
    """At its time; the candidates alone count here."""


@dataclass
class _Sector:
    """Running means of the estimates in one direction."""

    weight: float = 0.0  # estimates
    log_cells: Floats = field(default_factory=lambda: np.zeros(0))  # (N,) densities over the grid, in the shot's frame
    log_rings: Floats = field(default_factory=lambda: np.zeros((0, 360)))  # (K, 360) by the heading of azimuth 0
    numbers: Floats = field(default_factory=lambda: np.zeros(0))  # what _numbers says
    ground_weight: float = 0.0  # estimates that show ground
    log_ground: Floats = field(default_factory=lambda: np.zeros(3))  # of their reflectance

    def add(self, count: float, log_cells: Floats, log_rings: Floats, numbers: Floats, ground: Floats | None) -> None:
        """Count a `count` (0 to 1) of a look."""
        if self.weight == 0.0 or self.log_rings.shape != log_rings.shape:
            self.log_rings = log_rings
        if self.weight == 0.0:
            self.log_cells, self.numbers = log_cells, numbers
        self.weight = min(self.weight + count, MAX_SECTOR_WEIGHT)
        share = count / self.weight
        self.log_cells = self.log_cells + share * (log_cells - self.log_cells)
        self.log_rings = self.log_rings + share * (log_rings - self.log_rings)
        self.numbers = self.numbers + share * (numbers - self.numbers)
        if ground is not None:
            self.ground_weight = min(self.ground_weight + count, MAX_SECTOR_WEIGHT)
            self.log_ground = self.log_ground + count / self.ground_weight * (np.log(ground) - self.log_ground)


class ShotLight:
    """Takes estimates one by one; says at any time where the sun is in the shot's frame."""

    def __init__(self) -> None:
        self._sectors: dict[int, _Sector] = {}
        self._count = 0
        self._vertical_fov = 50.0
        self._last: Prediction | None = None

    def add(self, observation: FrameObservation) -> None:
        """Count an estimate, in parts for the two sectors between whose middles it lies.

        Args:
            observation: what one frame shows, and its place in the shot.
        """
        self._count += 1
        self._last, self._vertical_fov = observation.estimate.prediction, observation.vertical_fov
        parts = _log_cells(observation), _log_rings(observation), _averaged_numbers(observation)
        sector = observation.heading % 360.0 / SECTOR_WIDTH
        low, count = math.floor(sector), round(360.0 / SECTOR_WIDTH)
        for number, share in ((low, 1.0 - sector + low), (low + 1, sector - low)):
            if share > 0.0:
                nearest = self._sectors.setdefault(number % count, _Sector())
                nearest.add(share, *parts, observation.estimate.ground)

    def answer(self, observations: Observations) -> Posterior:
        """Combine all estimates, as a camera at azimuth 0 would see the light.

        Args:
            observations: of the moment that is asked for; the heading is that of azimuth 0.

        Raises:
            ValueError: there is no estimate yet.
            ParameterError: the sun is below the horizon.
        """
        if self._last is None:
            raise ValueError("There was no look yet.")
        cells = np.stack([s.log_cells for s in self._sectors.values()])
        area = grid_solid_angle(self._last.spec.sun_grid)
        weight = pool_log_likelihoods(cells, self._weights(SUN_CORRELATION), SUN_CORRELATION, area)
        by_pixels = replace(self._averaged(self._last), sun_probability=weight.astype(np.float32))
        posterior = fuse(by_pixels, observations)
        if observations.candidates and (rings := self._rings(observations)) is not None:
            posterior = replace(
                posterior_on_rings(by_pixels, observations, rings * candidates_above_horizon(observations)[1][:, None]),
                warnings=posterior.warnings,
            )
        if self._count == 1:
            return posterior
        return replace(posterior, used=(*posterior.used, EvidenceKind.TURNS, EvidenceKind.OTHER_PHOTOS))

    @property
    def ground(self) -> Floats | None:
        """Reflectance (3,) of the ground, the mean of the directions that show it; None where none does."""
        weight = self._present() * np.array([sector.ground_weight > 0.0 for sector in self._sectors.values()])
        if not weight.any():
            return None
        log_ground = np.average([s.log_ground for s in self._sectors.values()], axis=0, weights=weight)
        return np.asarray(np.exp(log_ground))

    def _rings(self, observations: Observations) -> Floats | None:
        """Weights (K, 360) of each candidate that is up and each heading of azimuth 0; None where looks had others."""
        up = [elevation >= 0.0 for elevation, _ in observations.candidates]
        rings = [sector.log_rings for sector in self._sectors.values()]
        if any(len(ring) != len(up) for ring in rings):
            return None
        weight = pool_log_likelihoods(np.stack(rings)[:, up], self._weights(AZIMUTH_CORRELATION), AZIMUTH_CORRELATION)
        return np.asarray(weight * compass_prior(observations))

    def _present(self) -> Floats:
        """How far (S,) each sector is there at all, 0 to 1: one that was only brushed counts for little."""
        weight = np.array([sector.weight for sector in self._sectors.values()])
        return np.asarray(np.minimum(weight / (MIN_SECTOR_WEIGHT * weight.mean()), 1.0))

    def _weights(self, correlation: Correlation) -> Floats:
        """How much each sector (S,) counts."""
        ahead = direction(SECTOR_WIDTH * np.array(list(self._sectors)), 0.0)
        return effective_weights(ahead, np.full(len(ahead), self._vertical_fov), correlation, present=self._present())

    def _averaged(self, last: Prediction) -> Prediction:
        """The numbers of all sectors, each counted once however many looks it has."""
        mean = np.average([s.numbers for s in self._sectors.values()], axis=0, weights=self._present())
        turbidity, exposure, fov = map(float, np.exp(mean[:3]))
        shown, light = float(mean[3]), light_from_vector(mean[4:]) if last.light else None
        return replace(
            last, turbidity=turbidity, exposure=exposure, vertical_fov=fov, sun_visibility=shown, light=light
        )


def _log_cells(observation: FrameObservation) -> Floats:
    """Log densities (N,) over the cells of a camera at azimuth 0."""
    p = observation.estimate.prediction
    density = rotate_density(p.sun_probability, -observation.heading, p.spec.sun_grid)
    return np.asarray(np.log(np.maximum(density, _EPSILON_DENSITY)))


def _log_rings(observation: FrameObservation) -> Floats:
    """Log densities (K, 360) of each candidate's sun by the heading of azimuth 0."""
    candidates = np.array(observation.observations.candidates, dtype=np.float64).reshape(-1, 2)
    if not len(candidates):
        return np.zeros((0, 360))
    above = np.column_stack([np.maximum(candidates[:, 0], 0.0), candidates[:, 1]])
    density = likelihood_by_heading(observation.estimate.prediction, above)
    density[candidates[:, 0] < 0.0] = 0.0
    log = np.log(np.maximum(density, _EPSILON_DENSITY))
    return np.stack([np.interp(HEADINGS + observation.heading, HEADINGS, row, period=360.0) for row in log])


def _averaged_numbers(observation: FrameObservation) -> Floats:
    """What of a look is averaged, (4,) or with a Light (12,), in the linear values of the shot's first frame.

    Logarithms of turbidity, exposure and field of view, the visibility, then `light_to_vector`.
    """
    p, gain = observation.estimate.prediction, max(observation.gain, _EPSILON_DENSITY)
    exposure = math.log(max(p.exposure, _EPSILON_DENSITY) / gain)
    numbers = [math.log(max(p.turbidity, _EPSILON_DENSITY)), exposure, math.log(p.vertical_fov), p.sun_visibility]
    light = light_to_vector(p.light) if p.light else np.zeros(0)
    light[:6] -= math.log(gain)
    return np.concatenate([numbers, light])

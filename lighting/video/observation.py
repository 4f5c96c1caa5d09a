"""A clip observed frame by frame: every frame is tracked, some are shown to the network, and shots are divided."""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.color import luminance, srgb_decode
from lighting.decoding import lighting_from_prediction
from lighting.envmap.appearance import estimate_ground_albedo, sky_white_balance
from lighting.fusion.estimate import screen_prediction
from lighting.model import Model
from lighting.photo.preprocess import is_blank, preprocess
from lighting.photo.reader import Photo
from lighting.records import Prediction
from lighting.tracing import trace_step
from lighting.video.decode import Frame
from lighting.video.shot_detection import Dissolve, DissolveDetector, split_at_dissolve, split_shots
from lighting.video.tracking import FrameEstimate, Keyframe, PointTracker, ShotObservations, TrackedFrame

NETWORK_INTERVAL = 0.2  # s between the frames that the network sees
MIN_LOOK_INTERVAL = 0.1  # s between frames that it sees because something new begins
MIN_STRETCH_FRAMES = 15  # frames of a new stretch, after which it is compared with what was before
MIN_BRIGHTNESS = 0.01  # linear value that 5 % of a daylight frame's pixels exceed

Pixels = NDArray[np.uint8]


class _ClipObserver:
    """Takes a clip's frames one by one, and hands out what was gathered of each shot."""

    def __init__(self, model: Model, every: float, vertical_fov: float | None) -> None:
        self._model, self._every, self._due = model, every, 0.0
        self._last_look = -math.inf
        self._vertical_fov = vertical_fov
        self._tracker, self._dissolves = PointTracker(), DissolveDetector()
        self._check_pending = False  # whether a new stretch is to be compared with what was before
        self._steps: list[TrackedFrame] = []
        self._keys: dict[int, Keyframe] = {}
        self._estimates: dict[int, FrameEstimate] = {}
        self._size = (0, 0)

    def take(self, frame: Frame) -> Iterator[ShotObservations]:
        """Take a frame and hand out the shots that it shows to be over, as one of another size does."""
        size = (frame.pixels.shape[1], frame.pixels.shape[0])
        if self._steps and size != self._size:
            yield from self.finish()
            self._keep(ShotObservations(size, [], {}, {}))
        self._size, self._frame = size, frame
        step = self._tracker.follow(frame)
        self._steps.append(step)
        if (key := self._tracker.new_key) is not None:
            self._keys[key.number] = key
        if step.is_start and step.frame > 0:  # where every frame begins a stretch, not every one is looked at
            self._due = min(self._due, self._last_look + MIN_LOOK_INTERVAL)
        if frame.time >= self._due:
            self._estimate(frame)
        if (dissolve := self._dissolves.take(frame)) is not None:
            yield from self._divide(dissolve)
        self._check_pending |= self._is_check_due(step.stretch)
        if self._check_pending and not self._dissolves.is_pending:
            *over, rest = split_shots(self._tracked())
            yield from over
            self._keep(rest)

    def finish(self) -> Iterator[ShotObservations]:
        """Hand out the shots that are left, once no frame comes any more."""
        if (dissolve := self._dissolves.finish()) is not None:
            yield from self._divide(dissolve)
        if self._steps:
            yield from split_shots(self._tracked())

    def _tracked(self) -> ShotObservations:
        """What was gathered of the frames that are not of a shot handed out."""
        return ShotObservations(self._size, self._steps, self._keys, self._estimates)

    def _keep(self, rest: ShotObservations) -> None:
        self._steps, self._keys, self._estimates = list(rest.steps), dict(rest.keys), dict(rest.estimates)
        self._check_pending = False

    def _divide(self, dissolve: Dissolve) -> Iterator[ShotObservations]:
        """Hand out what is before a dissolve."""
        *before, rest = split_at_dissolve(self._tracked(), dissolve)
        for part in before:
            yield from split_shots(part)
        self._keep(rest)
        if not rest.estimates:
            self._estimate(self._frame)

    def _estimate(self, frame: Frame) -> None:
        self._due = frame.time
        if not (is_dark(frame.pixels) or is_blank(frame.pixels)):
            self._last_look = frame.time
            self._estimates[frame.index] = estimate_frame(self._model, frame.pixels, self._vertical_fov)
            self._due = frame.time + self._every - 1e-6

    def _is_check_due(self, stretch: int) -> bool:
        """Whether a new stretch has just become long enough to see if it is a new shot."""
        if self._steps[0].stretch == stretch or len(self._steps) <= MIN_STRETCH_FRAMES:
            return False
        is_same = [step.stretch == stretch for step in self._steps[-MIN_STRETCH_FRAMES - 1 :]]
        return all(is_same[1:]) and not is_same[0]


def observe_shots(
    frames: Iterable[Frame],
    model: Model,
    every: float = NETWORK_INTERVAL,
    progress: Callable[[float], Any] | None = None,
    vertical_fov: float | None = None,
) -> Iterator[ShotObservations]:
    """Track a clip and hand out what each shot shows, as soon as it is over.

    An interruption by the user ends the last shot where the clip had been read to, and is raised after that.

    Args:
        frames: of one clip, in order.
        model: the network.
        every: s between the frames that the network sees; it sees the first of each shot.
        progress: called with the time [s] of each frame; None is not called.
        vertical_fov: deg, of the lens; None is unknown.
    """
    observer, interruption = _ClipObserver(model, every, vertical_fov), None
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
        prediction = model.predict(preprocess(photo, model.spec))[0]
    estimate = _apply_colors(screen_prediction(prediction, pixels), pixels)
    estimate = replace(estimate, sharpness=_measure_sharpness(pixels))
    if vertical_fov is None:
        return estimate
    by_lens = _apply_colors(screen_prediction(prediction, pixels, vertical_fov), pixels)
    return replace(estimate, by_lens=replace(by_lens, sharpness=estimate.sharpness))


def _measure_sharpness(pixels: Pixels) -> float:
    """The mean difference of neighboring greens of a frame (h, w, 3) sRGB, levels."""
    green = pixels[..., 1].astype(np.float32)
    return float(np.abs(np.diff(green, axis=0)).mean() + np.abs(np.diff(green, axis=1)).mean())


def _apply_colors(prediction: Prediction, pixels: Pixels) -> FrameEstimate:
    """The estimate of a frame, in the colors that it shows."""
    if (light := prediction.light) is None:
        return FrameEstimate(prediction)
    if (tint := sky_white_balance(pixels, lighting_from_prediction(prediction))) is not None:
        prediction = replace(prediction, light=replace(light, sky_irradiance=light.sky_irradiance * tint))
    ground = estimate_ground_albedo(pixels, lighting_from_prediction(prediction), light.surroundings)
    return FrameEstimate(prediction, ground)


def is_dark(pixels: Pixels) -> bool:
    """Tell whether a frame is too dark for daylight, such as black frames and nights.

    Args:
        pixels: (h, w, 3) sRGB.
    """
    brightness = np.percentile(luminance(srgb_decode(pixels[::8, ::8] / 255.0)), 95)
    return bool(brightness < MIN_BRIGHTNESS)

"""Reading a clip: every frame is followed, some are shown to the network."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.colour import luminance, srgb_decode
from lighting.decoding import lighting_from
from lighting.envmap import photo_ground, photo_sky
from lighting.evidence import as_shown
from lighting.model import Model
from lighting.photo import Photo, to_tensor
from lighting.records import Prediction
from lighting.video.clip import Frame
from lighting.video.cuts import divided, split
from lighting.video.dissolves import Dissolve, Dissolves
from lighting.video.follow import Follower, Key, Step
from lighting.video.watched import Seen, Watched

EVERY = 0.2  # s between the frames that the network sees
JUDGED_AFTER = 15  # frames of a new stretch, after which it is compared with what was before
DARK = 0.01  # linear value that 5 % of a daylight frame's pixels exceed

Pixels = NDArray[np.uint8]


class Watcher:
    """Takes a clip's frames one by one, and hands out what was gathered of them."""

    def __init__(self, model: Model, every: float = EVERY, vertical_fov: float | None = None) -> None:
        """The network sees the first frame of each shot and one every `every` seconds; MissingExtraError.

        `vertical_fov` [deg] is that of the clip's lens, if it is known.
        """
        self._model, self._every, self._due = model, every, 0.0
        self._vertical_fov = vertical_fov
        self._follower, self._dissolves = Follower(), Dissolves()
        self._is_to_judge = False  # whether a new stretch is to be compared with what was before
        self._steps: list[Step] = []
        self._keys: dict[int, Key] = {}
        self._looks: dict[int, Seen] = {}
        self._size = (0, 0)

    def take(self, frame: Frame) -> Iterator[Watched]:
        """Counts a frame; hands out the shots that it shows to be over, as one of another size does."""
        size = (frame.pixels.shape[1], frame.pixels.shape[0])
        if self._steps and size != self._size:
            yield from self.finish()
            self._keep(Watched(size, [], {}, {}))
        self._size, self._frame = size, frame
        step = self._follower.follow(frame)
        self._steps.append(step)
        if (key := self._follower.new_key) is not None:
            self._keys[key.number] = key
        if frame.time >= self._due or (step.begins and step.frame > 0):
            self._look(frame)
        if (dissolve := self._dissolves.take(frame)) is not None:
            yield from self._divide(dissolve)
        self._is_to_judge |= self._is_time_to_judge(step.stretch)
        if self._is_to_judge and not self._dissolves.is_open:
            *over, rest = split(self.watched())
            yield from over
            self._keep(rest)

    def finish(self) -> Iterator[Watched]:
        """Hands out the shots that are left, once no frame comes any more."""
        if (dissolve := self._dissolves.finish()) is not None:
            yield from self._divide(dissolve)
        if self._steps:
            yield from split(self.watched())

    def watched(self) -> Watched:
        """What was gathered of the frames that are not of a shot handed out."""
        return Watched(self._size, self._steps, self._keys, self._looks)

    def _keep(self, rest: Watched) -> None:
        self._steps, self._keys, self._looks = list(rest.steps), dict(rest.keys), dict(rest.looks)
        self._is_to_judge = False

    def _divide(self, dissolve: Dissolve) -> Iterator[Watched]:
        """Hands out what is before a dissolve."""
        *before, rest = divided(self.watched(), dissolve)
        for part in before:
            yield from split(part)
        self._keep(rest)
        if not rest.looks:
            self._look(self._frame)

    def _look(self, frame: Frame) -> None:
        if is_dark(frame.pixels):
            self._due = frame.time
            return
        self._looks[frame.index] = see(self._model, frame.pixels, self._vertical_fov)
        self._due = frame.time + self._every - 1e-6

    def _is_time_to_judge(self, stretch: int) -> bool:
        """Whether a new stretch has just become long enough to see if it is a new shot."""
        if self._steps[0].stretch == stretch or len(self._steps) <= JUDGED_AFTER:
            return False
        own = [step.stretch == stretch for step in self._steps[-JUDGED_AFTER - 1 :]]
        return all(own[1:]) and not own[0]


def shots_watched(
    frames: Iterable[Frame],
    model: Model,
    every: float = EVERY,
    progress: Callable[[float], Any] | None = None,
    vertical_fov: float | None = None,
) -> Iterator[Watched]:
    """What each shot of a clip shows, as soon as it is over; `progress` is told the time [s] of each frame.

    `vertical_fov` [deg] is that of the lens, if it is known.

    An interruption by the user ends the last shot where the clip had been read to, and is raised after that.
    """
    watcher, interruption = Watcher(model, every, vertical_fov), None
    try:
        for frame in frames:
            yield from watcher.take(frame)
            if progress is not None:
                progress(frame.time)
    except KeyboardInterrupt as error:
        interruption = error
    yield from watcher.finish()
    if interruption is not None:
        raise interruption


def see(model: Model, pixels: Pixels, vertical_fov: float | None = None) -> Seen:
    """What the network says of a frame (h, w, 3), upright sRGB, with the colours of sky and ground that it shows.

    Beside it the same by a lens of `vertical_fov` [deg], if it is known.
    """
    photo = Photo(pixels, pixels.shape[1], pixels.shape[0], "frame of a clip")
    said = model.predict(to_tensor(photo, model.spec))[0]
    alone = _coloured(as_shown(said, pixels), pixels)
    if vertical_fov is None:
        return alone
    return replace(alone, by_lens=_coloured(as_shown(said, pixels, vertical_fov), pixels))


def _coloured(said: Prediction, pixels: Pixels) -> Seen:
    """What is said of a frame, with the colours that it shows."""
    if (light := said.light) is None:
        return Seen(said)
    if (tint := photo_sky(pixels, lighting_from(said))) is not None:
        said = replace(said, light=replace(light, sky_irradiance=light.sky_irradiance * tint))
    return Seen(said, photo_ground(pixels, lighting_from(said), light.around))


def is_dark(pixels: Pixels) -> bool:
    """Whether a frame is too dark for daylight, black frames and nights among them."""
    bright = np.percentile(luminance(srgb_decode(pixels[::8, ::8] / 255.0)), 95)
    return bool(bright < DARK)

"""How well clips are followed: accuracy, trembling, drift, dissolves and streams, with exact truth.

Cameras of clips are turned in panoramas, or carried through rendered places. Each clip is decided by its panorama's
name and its kind alone.
"""

import resource
import time as clock
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from export.crops.crops import generator
from export.data.panoramas import DataError, Panorama, decode_srgb, read_index, read_picture
from export.evaluation.metadata import sighting
from export.evaluation.metrics import table
from export.reports.registration import Standpoint, WalkableTown, expose_panorama
from lighting.color import luminance, srgb_decode, tone_map
from lighting.fusion.single_view import Observations
from lighting.fusion.user_input import UserInput
from lighting.geometry import (
    Floats,
    Pinhole,
    angle_between,
    angles,
    camera_axes,
    camera_directions,
    direction,
    wrap_azimuth,
)
from lighting.model import Model
from lighting.records import SunEstimate
from lighting.video.decode import Frame
from lighting.video.intrinsics import zoomed_fov
from lighting.video.keyframes import smoothed
from lighting.video.light import FrameObservation, ShotLight
from lighting.video.shot import SEEN_EVERY, Shot, estimate_frame, shots_watched, solve_shot
from lighting.video.shot_detection import COMPARED_EVERY as DISSOLVES_EVERY
from lighting.video.shot_detection import Dissolves
from lighting.video.stream import Tracker
from lighting.video.tracking import ClipMetadata

# Clips.

CLIP_WIDTH, CLIP_HEIGHT = 640, 360  # pixels
CLIP_RATE, CLIP_SECONDS = 30.0, 6.0
WALK_RATE = 15.0  # frames a second of walks, which take long to render
CLIP_FOVS = (35.0, 60.0)  # deg, vertical
SHAKE = 0.4  # deg, of a hand
BLURRED = 8  # instants averaged in a frame that is exposed for half of its time
PACE = 1.4  # m/s
ZOOM = 2.0  # times, in or out, in the middle two thirds of a clip

Pixels = NDArray[np.uint8]
Angles = tuple[Floats, Floats, Floats]  # azimuth, elevation and roll (N,) [deg]; the azimuth is continuous


@dataclass(frozen=True, eq=False)
class _KnownClip:
    """A clip, rendered when it is read, and the truth about it."""

    name: str
    time: Floats  # (N,) s
    path: Angles  # in the panorama
    gain: Floats  # (N, 3) of linear values
    vertical_fov: float  # of the first frame
    zoom: Floats  # (N,) focal lengths by the first frame's
    sun: tuple[float, float]  # azimuth in the panorama and elevation, deg
    picture: Callable[[int], Pixels]  # a frame by its index, its gain not yet applied

    def frames(self, every: int = 1) -> Iterator[Frame]:
        """The clip, or one of `every` so many frames of it."""
        for i in range(0, len(self.time), every):
            yield Frame(i, float(self.time[i]), _apply_gain(self.picture(i), self.gain[i]))


def _known_clips(panoramas: Sequence[Panorama], kind: str) -> Iterator[_KnownClip]:
    """One of a kind for each panorama; `walk` takes a rendered place in its stead."""
    for number, panorama in enumerate(panoramas):
        rng = generator(panorama.name, 0, f"clip {kind}")
        yield _film_walk(number, rng) if kind == "walk" else _film_panorama(panorama, kind, rng)


def _film_panorama(panorama: Panorama, kind: str, rng: np.random.Generator) -> _KnownClip:
    """A camera that stands in a panorama."""
    time, fov = np.arange(round(CLIP_RATE * CLIP_SECONDS)) / CLIP_RATE, float(rng.uniform(*CLIP_FOVS))
    path, gain = _handheld_path(time, kind, rng), _gains(time, kind, rng)
    zoom = (
        ZOOM ** (rng.choice([-1, 1]) * np.clip(1.5 * time / time[-1] - 0.25, 0, 1)) if kind == "zoom" else 1 + 0 * time
    )
    picture = _develop_panorama(panorama)
    things = {"moving things": _things, "crowd": _crowd}.get(kind, lambda _: [])(rng)

    def shot(i: int) -> Pixels:
        if kind == "motion blur":
            return _blurred(picture, float(time[i]), time, path, fov)
        return _crossed(
            _view_panorama(picture, _camera_angles_at(path, i), zoomed_fov(fov, float(zoom[i]))), things, float(time[i])
        )

    return _KnownClip(panorama.name, time, path, gain, fov, zoom, _panorama_sun(panorama), shot)


def _panorama_sun(panorama: Panorama) -> tuple[float, float]:
    """Azimuth and elevation [deg] of a sun that the index gives."""
    assert panorama.sun_azimuth is not None
    assert panorama.sun_elevation is not None
    return panorama.sun_azimuth, panorama.sun_elevation


def _develop_panorama(panorama: Panorama) -> Pixels:
    """The panorama as sRGB, exposed as a photo would be."""
    return read_picture(panorama) if panorama.kind == "ldr" else tone_map(expose_panorama(panorama))


def _camera_angles_at(path: Angles, i: int) -> tuple[float, float, float]:
    """The camera's angles in one frame."""
    azimuth, elevation, roll = (float(p[i]) for p in path)
    return azimuth, elevation, roll


def _handheld_path(time: Floats, kind: str, rng: np.random.Generator) -> Angles:
    """How a hand turns a camera in a clip of that kind."""
    share = (1 - np.cos(np.pi * time / time[-1])) / 2
    reach = {"tilt": 8.0, "hand": 15.0, "motion blur": 180.0}.get(kind, float(rng.uniform(20, 90)))
    azimuth = rng.uniform(-180, 180) + rng.choice([-1, 1]) * reach * share
    rise = rng.choice([-1, 1]) * 25.0 if kind == "tilt" else 0.0
    elevation = rng.uniform(-8, 10) + rise * (share - 0.5)
    roll = rng.uniform(-3, 3) + 0.0 * time
    shake = SHAKE * (4.0 if kind == "hand" else 1.0)
    azimuth, elevation, roll = (base + shake * _wobble(time, rng) for base in (azimuth, elevation, roll))
    return azimuth, elevation, roll


def _wobble(time: Floats, rng: np.random.Generator) -> Floats:
    """What a hand does (N,), of about unit size: a few waves."""
    waves = [np.sin(2 * np.pi * (f * time + rng.uniform())) / (1 + f) for f in (0.3, 0.8, 1.9, 3.1)]
    return np.asarray(np.sum(waves, axis=0))


def _gains(time: Floats, kind: str, rng: np.random.Generator) -> Floats:
    if kind != "exposure":
        return np.ones((len(time), 3))
    brightness = 0.4 * np.sin(2 * np.pi * (time / 4.0 + rng.uniform()))
    balance = 0.15 * np.stack([np.sin(2 * np.pi * (time / 5.0 + rng.uniform())) for _ in range(3)], axis=-1)
    gains = np.exp(brightness[:, None] + balance)
    return np.asarray(gains / gains.max())


def _apply_gain(picture: Pixels, gain: Floats) -> Pixels:
    """The picture (h, w, 3) with its linear values multiplied by gains (3,)."""
    if np.all(gain == 1.0):
        return picture
    table = tone_map(srgb_decode(np.arange(256) / 255.0)[:, None] * gain)
    return np.stack([table[picture[..., c], c] for c in range(3)], axis=-1)


def _view_panorama(
    picture: Pixels, at: tuple[float, float, float], fov: float, size: tuple[int, int] = (CLIP_WIDTH, CLIP_HEIGHT)
) -> Pixels:
    """What a camera with these angles sees of a panorama (H, 2H, 3): (height, width, 3) sRGB."""
    import cv2

    x, y, z = np.moveaxis(_rays(size, fov) @ camera_axes(*at).astype(np.float32), -1, 0)
    column = (np.arctan2(x, -z) / np.float32(2 * np.pi) + np.float32(0.5)) * picture.shape[1] - np.float32(0.5)
    row = (np.float32(0.5) - np.arcsin(np.clip(y, -1, 1)) / np.float32(np.pi)) * picture.shape[0] - np.float32(0.5)
    seen = cv2.remap(picture, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    return np.asarray(seen, dtype=np.uint8)


@lru_cache(maxsize=4)
def _rays(size: tuple[int, int], fov: float) -> NDArray[np.float32]:
    """Unit vectors (h, w, 3) along a camera's right, up and forward; as `camera_directions`, in single precision."""
    return (camera_directions(Pinhole(*size, fov)) * [1, 1, -1]).astype(np.float32)


def _blurred(picture: Pixels, moment: float, time: Floats, path: Angles, fov: float) -> Pixels:
    """What is seen while the shutter is open, averaged in linear light."""
    near = moment + (np.arange(BLURRED) / BLURRED - 0.5) * 0.5 / CLIP_RATE
    moved: Angles = (np.interp(near, time, path[0]), np.interp(near, time, path[1]), np.interp(near, time, path[2]))
    seen = [_view_panorama(picture, _camera_angles_at(moved, i), fov) for i in range(BLURRED)]
    return tone_map(np.mean([decode_srgb(s) for s in seen], axis=0))


@dataclass(frozen=True, eq=False)
class _Thing:
    """A textured box that crosses the picture."""

    texture: Pixels
    start: Floats  # (2,) pixels
    speed: Floats  # (2,) pixels/s


def _things(rng: np.random.Generator) -> list[_Thing]:
    """Boxes that hide up to a quarter of the picture."""
    found = []
    for _ in range(4):
        width, height = rng.integers(60, 150, 2)
        coarse = rng.integers(30, 220, (height // 8, width // 8, 3), dtype=np.uint8)
        texture = coarse.repeat(8, axis=0).repeat(8, axis=1)
        start = rng.uniform([0, 0.35 * CLIP_HEIGHT], [CLIP_WIDTH, 0.8 * CLIP_HEIGHT])
        found.append(_Thing(texture, start, rng.uniform([-120, -10], [120, 10])))
    return found


def _crowd(rng: np.random.Generator) -> list[_Thing]:
    """Twelve boxes that go one way."""
    speed = np.array([rng.choice([-1, 1]) * rng.uniform(40, 110), 0.0])
    return [replace(thing, speed=speed) for _ in range(3) for thing in _things(rng)]


def _crossed(picture: Pixels, things: Sequence[_Thing], time: float) -> Pixels:
    shown = picture.copy()
    for thing in things:
        left = int(thing.start[0] + thing.speed[0] * time) % (CLIP_WIDTH + 200) - 150
        y = int(np.clip(thing.start[1] + thing.speed[1] * time, 0, CLIP_HEIGHT - 10))
        x, hidden = max(left, 0), max(-left, 0)
        part = thing.texture[: CLIP_HEIGHT - y, hidden : hidden + max(CLIP_WIDTH - x, 0)]
        shown[y : y + part.shape[0], x : x + part.shape[1]] = part
    return shown


def _film_walk(number: int, rng: np.random.Generator) -> _KnownClip:
    """A camera that is carried through a rendered place."""
    walk = WalkableTown(number)
    time, fov = np.arange(round(WALK_RATE * CLIP_SECONDS)) / WALK_RATE, float(rng.uniform(*CLIP_FOVS))
    path = _handheld_path(time, "hand", rng)
    for _ in range(60):
        towards = np.radians(path[0][0] + rng.uniform(-30, 30))
        steps = PACE * time[:, None] * np.array([np.sin(towards), -np.cos(towards)])
        points = rng.uniform(-10, 10, 2) + steps
        stands = [_stand(points[i], path, i, fov) for i in (0, len(time) // 2, -1)]
        if all(walk.is_clear(stand) for stand in stands):
            break

    def shot(i: int) -> Pixels:
        return walk.photo(_stand(points[i], path, i, fov), CLIP_WIDTH, CLIP_HEIGHT)

    azimuth, elevation = angles(walk.light.sun)
    sun = (float(azimuth), float(elevation))
    return _KnownClip(f"place {number}", time, path, np.ones((len(time), 3)), fov, np.ones(len(time)), sun, shot)


def _stand(point: Floats, path: Angles, i: int, fov: float) -> Standpoint:
    return Standpoint((float(point[0]), float(point[1])), *_camera_angles_at(path, i), fov)


# How well a clip is followed.

SMOOTH = 1.0  # s of the smooth curve that trembling is measured against
CLIPS_NOTE = (
    "Medians over the clips, angles in deg. `heading`: error of the camera's heading against the first frame, in the "
    "median and at 90 % of a clip's frames. `trembling`: of the sun's azimuth in each frame, the standard deviation of "
    "its error against a smooth curve (a parabola through one second). `to best`: from the clip's sun to what the "
    "network says of five frames a second, truly turned. `sun`, `best's sun`: errors of both. `gain`: error "
    "of the exposure against the first frame [%]. `bridged`: frames in which nothing could be followed [%]. `split`: "
    "clips that were taken for several shots. `doubted`: clips whose answer has a warning."
)
CLIP_MEDIANS = (
    "heading",
    "heading, 90 %",
    "trembling",
    "field of view",
    "elevation",
    "roll",
    "to best",
    "sun",
    "best's sun",
    "gain",
)


def report_video(data: Path, count: int, kinds: Sequence[str], model: Model, only: str | None = None) -> Iterator[str]:
    """The report's parts: clips and dissolves of `count` `val` panoramas, and streams; or `only` one of VIDEO_PARTS."""
    panoramas = _choose_panoramas(data, count)
    if only in (None, "clips"):
        yield _clip_report(panoramas, kinds, model)
    if only in (None, "dissolves"):
        yield _dissolve_report(panoramas, kinds, model)
    if only in (None, "streams"):
        yield _stream_report(panoramas, model)


def _clip_report(panoramas: Sequence[Panorama], kinds: Sequence[str], model: Model) -> str:
    """The table of clips, a row a kind."""
    rows = {kind: _clip_figures([_measure_clip(s, model) for s in _known_clips(panoramas, kind)]) for kind in kinds}
    title = f"## Clips of 6 s, 640 x 360 pixels, {len(panoramas)} of each kind, in places that training never saw"
    return f"{title}\n\n{CLIPS_NOTE}\n\n{_decimals_table(rows)}"


def _decimals_table(rows: dict[str, dict[str, float]]) -> str:
    """A table with two decimals."""
    columns = list(next(iter(rows.values())))
    return table(["", *columns], [[name, *(f"{row[c]:.2f}" for c in columns)] for name, row in rows.items()])


def _choose_panoramas(data: Path, count: int) -> list[Panorama]:
    """`val` panoramas that show their sun, each of another place as long as there are some, in a fixed order.

    DataError if there are none.
    """
    suited = [p for p in read_index(data, "val") if p.sun == "visible" and p.sun_azimuth is not None]
    if not suited:
        raise DataError(f"{data} has no panorama in `val` that shows a given sun.")
    order = np.random.default_rng(21).permutation(len(suited))
    first: dict[str, Panorama] = {}
    for i in order:
        first.setdefault(suited[i].place, suited[i])
    rest = [suited[i] for i in order if suited[i] not in first.values()]
    return [*first.values(), *rest][:count]


def _measure_clip(truth: _KnownClip, model: Model) -> dict[str, float]:
    """What one clip gives."""
    shots = list(shots_watched(truth.frames(), model))
    longest = max(shots, key=lambda w: len(w.steps))
    shot = solve_shot(longest, ClipMetadata())
    best, true = _sun_by_true_rotations(truth, int(shot.frames[0]), model), _true_sun(truth, shot)
    sun, fovs = _sun_vector(shot.fused.sun), _fovs(shot.vertical_fov, shot.zoom)
    error = float(angle_between(sun, true))
    return {
        **_followed(shot, truth),
        "field of view": float(np.median(np.abs(fovs - _fovs(truth.vertical_fov, truth.zoom[shot.frames])))),
        "to best": float(angle_between(sun, _sun_vector(best))),
        "sun": error,
        "best's sun": float(angle_between(_sun_vector(best), true)),
        "in 50 %": 100.0 * (error <= shot.fused.sun.radius_50),
        "in 90 %": 100.0 * (error <= shot.fused.sun.radius_90),
        "split": float(len(shots) > 1),
        "doubted": float(bool(shot.known.warnings)),
    }


def _fovs(vertical_fov: float, zoom: Floats) -> Floats:
    """Of each frame (N,) [deg]."""
    return np.array([zoomed_fov(vertical_fov, z) for z in zoom.tolist()])


def _followed(shot: Shot, truth: _KnownClip) -> dict[str, float]:
    """How well the camera was followed."""
    path, part = shot.path, shot.frames
    azimuth, elevation, roll = (angle[part] for angle in truth.path)
    heading = np.abs(wrap_azimuth(path.heading - path.heading[0] - (azimuth - azimuth[0])))
    off = np.degrees(np.unwrap(np.radians(shot.fused.sun.azimuth - path.heading - (truth.sun[0] - azimuth))))
    window = min(len(off), round(SMOOTH / float(np.median(np.diff(path.time)))) // 2 * 2 + 1)
    return {
        "heading": float(np.median(heading)),
        "heading, 90 %": float(np.percentile(heading, 90)),
        "trembling": float((off - smoothed(path.time, off, window)).std()),
        "elevation": float(np.median(np.abs(path.elevation - elevation))),
        "roll": float(np.median(np.abs(path.roll - roll))),
        "gain": _gain_error(shot, truth),
        "bridged": 100.0 * float(path.bridged.mean()),
    }


def _sun_vector(sun: SunEstimate) -> Floats:
    """Unit vector (3,)."""
    return direction(sun.azimuth, sun.elevation)


def _true_sun(truth: _KnownClip, shot: Shot) -> Floats:
    """Where the sun stands as the shot's first frame sees it."""
    return direction(truth.sun[0] - truth.path[0][shot.frames[0]], truth.sun[1])


def _sun_by_true_rotations(truth: _KnownClip, first: int, model: Model) -> SunEstimate:
    """The sun that many frames give with true rotations, as frame `first` sees it."""
    light, azimuth = ShotLight(), truth.path[0]
    every = max(1, round(SEEN_EVERY / float(np.median(np.diff(truth.time)))))
    for frame in truth.frames(every):
        turn = float(azimuth[frame.index] - azimuth[first])
        fov = zoomed_fov(truth.vertical_fov, float(truth.zoom[frame.index]))
        light.add(FrameObservation(estimate_frame(model, frame.pixels), turn, fov))
    return light.answer(Observations()).sun


def _gain_error(shot: Shot, truth: _KnownClip) -> float:
    """Percent, in the median over the frames."""
    true = truth.gain[shot.frames] / truth.gain[shot.frames[0]]
    said = [float(luminance(g) / luminance(t)) for g, t in zip(shot.gains, true, strict=True)]
    return 100.0 * float(np.median(np.abs(np.array(said) - 1.0)))


def _clip_figures(clips: Iterable[dict[str, float]]) -> dict[str, float]:
    """One row of the table."""
    all_of = list(clips)
    every = {name: np.array([clip[name] for clip in all_of]) for name in all_of[0]}
    found = {name: float(np.median(every[name])) for name in CLIP_MEDIANS}
    worst = {f"{name}, worst": float(every[name].max()) for name in ("trembling", "to best")}
    means = {name: float(every[name].mean()) for name in ("in 50 %", "in 90 %", "bridged")}
    return {**found, **worst, **means, **{name: float(every[name].sum()) for name in ("split", "doubted")}}


# Dissolves between two places: how many are found, and how many clips without one are divided all the same.

DISSOLVE_LENGTHS = (0.3, 0.5, 1.0, 2.0)  # s
DISSOLVE_ALONE = 2.5  # s of each picture without the other
DISSOLVE_CAMERAS = ("still", "hand", "pan", "tilt", "zoom")

DISSOLVES_NOTE = (
    f"Two cameras, each still, held, turned or zoomed, in two places: {DISSOLVE_ALONE:g} s of the first, a dissolve, "
    f"{DISSOLVE_ALONE:g} s of the second. `two shots`: clips that were taken for two [%]; `one shot`: for one [%]. "
    "`off`: error of where the second shot begins, against the dissolve's middle, in the median and at the worst [s]."
)
UNDIVIDED_NOTE = "Clips without a dissolve or cut. `divided`: those in which a dissolve was found [%]."


@dataclass(frozen=True, eq=False)
class _DissolvingClip:
    """A clip of two places."""

    first: _KnownClip
    second: _KnownClip
    seconds: float  # that both are seen

    @property
    def middle(self) -> float:
        """s, of the dissolve."""
        return DISSOLVE_ALONE + self.seconds / 2.0

    def frames(self) -> Iterator[Frame]:
        """The clip."""
        alone, both = round(DISSOLVE_ALONE * CLIP_RATE), round(self.seconds * CLIP_RATE)
        for i in range(2 * alone + both):
            share = float(np.clip((i - alone + 1) / (both + 1), 0.0, 1.0))
            yield Frame(i, i / CLIP_RATE, self._mixed(i, i - alone, share))

    def _mixed(self, i: int, j: int, share: float) -> Pixels:
        if share in (0.0, 1.0):
            return self.second.picture(j) if share else self.first.picture(i)
        mixed = (1.0 - share) * self.first.picture(i) + share * self.second.picture(j)
        return np.round(mixed).astype(np.uint8)


def _dissolve_report(panoramas: Sequence[Panorama], kinds: Sequence[str], model: Model) -> str:
    """Both tables."""
    found = [[f"{s:g} s", *(f"{v:.2f}" for v in _dissolve_figures(panoramas, s, model))] for s in DISSOLVE_LENGTHS]
    divided = [[kind, *(f"{v:.2f}" for v in _divided_figures(panoramas, kind))] for kind in kinds]
    return "\n\n".join(
        [
            "## Dissolves",
            DISSOLVES_NOTE,
            table(["", "clips", "two shots", "one shot", "off", "off, worst"], found),
            UNDIVIDED_NOTE,
            table(["", "clips", "divided"], divided),
        ]
    )


def _dissolving_clips(panoramas: Sequence[Panorama], seconds: float) -> Iterator[_DissolvingClip]:
    """One for each panorama, which dissolves into the next one."""
    for first, second in zip(panoramas, [*panoramas[1:], panoramas[0]], strict=True):
        rng = generator(first.name, 0, f"dissolve {seconds}")
        yield _DissolvingClip(_filmed(first, rng), _filmed(second, rng), seconds)


def _filmed(panorama: Panorama, rng: np.random.Generator) -> _KnownClip:
    camera = str(rng.choice(DISSOLVE_CAMERAS))
    if camera != "still":
        return _film_panorama(panorama, camera, rng)
    held = _film_panorama(panorama, "hand", rng)
    picture = held.picture(0)
    return replace(held, picture=lambda _: picture)


def _dissolve_figures(panoramas: Sequence[Panorama], seconds: float, model: Model) -> tuple[float, ...]:
    counts, off = [], [np.nan]
    for clip in _dissolving_clips(panoramas, seconds):
        shots = list(shots_watched(clip.frames(), model, 1.0))
        counts.append(len(shots))
        off += [abs(shots[1].steps[0].time - clip.middle)] if len(shots) == 2 else []
    shares = (100.0 * float(np.mean(np.array(counts) == n)) for n in (2, 1))
    return len(counts), *shares, float(np.nanmedian(off)), float(np.nanmax(off))


def _divided_figures(panoramas: Sequence[Panorama], kind: str) -> tuple[float, float]:
    told = [_is_divided(clip) for clip in _known_clips(panoramas, kind)]
    return len(told), 100.0 * float(np.mean(told))


def _is_divided(clip: _KnownClip) -> bool:
    dissolves = Dissolves()
    every = max(1, round(DISSOLVES_EVERY / float(np.median(np.diff(clip.time)))))
    told = [dissolves.take(frame) for frame in clip.frames(every)]
    return any(dissolve is not None for dissolve in (*told, dissolves.finish()))


# Streams: what `Tracker` makes of a robot's camera that looks around for minutes.

STREAM_SECONDS, STREAM_RATE = 90.0, 10.0
STREAM_SIZE = (640, 480)
STREAM_FOV = 50.0  # deg
STREAM_ROUNDS = 2.0  # to the right, and as many back
STREAMS = 3
STREAM_ZOOM, STREAM_ZOOMED = 2.0, (20.0, 25.0)  # times, s
STREAM_OFF = 3.0  # deg

STREAMS_NOTE = (
    f"A camera of {STREAM_SIZE[0]} x {STREAM_SIZE[1]} pixels, {STREAM_FOV:g}° high, {STREAM_SECONDS:g} s at "
    f"{STREAM_RATE:g} frames a second: {STREAM_ROUNDS:g} rounds to the right and as many back. `heading` is "
    "against the first frame, in the median, at the worst, and at the end, where the camera is where it began; "
    "`absolute` by sun, time and place (simulated as `evaluate --with-metadata` does), after a sixth of the stream and "
    "at its end. `CPU` and `wall` are ms a frame, `slowest` the longest of all; `growth` is that of the process's peak "
    "memory [MB] over the last two thirds. `linked`: frames whose heading is told as one against the first frame [%]; "
    f"`silent`: those of them that are off by more than {STREAM_OFF:g}° [% of all]. Where the lens is zoomed, its "
    f"focal length grows by {STREAM_ZOOM:g} times from {STREAM_ZOOMED[0]:g} to {STREAM_ZOOMED[1]:g} s."
)


def _stream_report(panoramas: Sequence[Panorama], model: Model) -> str:
    """The table of streams."""
    rows = {
        panorama.name + (", zoomed" if zoom != 1.0 else ""): _measure_stream(panorama, model, zoom)
        for panorama in panoramas[:STREAMS]
        for zoom in (1.0, STREAM_ZOOM)
    }
    columns = list(next(iter(rows.values())))
    lines = [[name, *(f"{row[c]:.1f}" for c in columns)] for name, row in rows.items()]
    return f"## Streams\n\n{STREAMS_NOTE}\n\n{table(['', *columns], lines)}"


def _measure_stream(panorama: Panorama, model: Model, zoom: float) -> dict[str, float]:
    """What one stream gives, whose lens is zoomed by so many times."""
    sun, rng = _panorama_sun(panorama), generator(panorama.name, 0, "stream")
    there = sighting(max(sun[1], 1.0), rng)
    tracker = Tracker(model, UserInput(time=there.time, latitude=there.latitude, longitude=there.longitude))
    picture, time = _develop_panorama(panorama), np.arange(round(STREAM_SECONDS * STREAM_RATE)) / STREAM_RATE
    azimuth = rng.uniform(-180, 180) + 360 * STREAM_ROUNDS * (1 - np.abs(1 - 2 * time / time[-1]))
    north = there.compass - sun[0] + azimuth  # the camera's true heading
    zooms = zoom ** np.clip((time - STREAM_ZOOMED[0]) / (STREAM_ZOOMED[1] - STREAM_ZOOMED[0]), 0.0, 1.0)
    errors, linked, spent, before = [], [], [], 0.0
    for i, moment in enumerate(time):
        at = (float(azimuth[i]), 4.0 * float(np.sin(moment / 3.1)), 1.5 * float(np.sin(moment / 2.3)))
        frame = _view_panorama(picture, at, zoomed_fov(STREAM_FOV, float(zooms[i])), STREAM_SIZE)
        start = clock.process_time(), clock.perf_counter()
        answer = tracker(frame, float(moment))
        spent.append((clock.process_time() - start[0], clock.perf_counter() - start[1]))
        before = _peak() if i == len(time) // 3 else before
        if answer is not None and answer.lighting.camera_heading is not None:
            own = (answer.heading - (azimuth[i] - azimuth[0]), answer.lighting.camera_heading - north[i])
            errors.append(np.abs(wrap_azimuth(own)))
            linked.append(answer.linked)
    return {
        **_stream_errors(np.array(errors), np.array(linked)),
        **_times(1000.0 * np.array(spent)),
        "growth": _peak() - before,
    }


def _stream_errors(errors: Floats, linked: NDArray[np.bool_]) -> dict[str, float]:
    """Of headings relative and absolute (N, 2), of which those `linked` (N,) are told as against the first frame."""
    sixth = len(errors) // 6
    return {
        "heading": float(np.median(errors[:, 0])),
        "worst": float(errors[:, 0].max()),
        "at the end": float(np.median(errors[-20:, 0])),
        "absolute": float(np.median(errors[sixth : sixth + 20, 1])),
        "absolute, end": float(np.median(errors[-20:, 1])),
        "linked": 100.0 * float(linked.mean()),
        "silent": 100.0 * float(np.mean(linked & (errors[:, 0] > STREAM_OFF))),
    }


def _times(spent: Floats) -> dict[str, float]:
    """Of CPU and wall times (N, 2) [ms]."""
    cpu, wall = spent.mean(axis=0)
    return {"CPU": float(cpu), "wall": float(wall), "slowest": float(spent[:, 1].max())}


def _peak() -> float:
    """Peak memory of this process [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0

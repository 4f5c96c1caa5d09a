"""How well clips are tracked: accuracy, trembling and drift, with exact truth.

Cameras of clips are rotated in panoramas. Each clip is decided by its panorama's name and its kind alone.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from export import CLIP_KINDS
from export.crops.crops import crop_rng
from export.data.panoramas import DataError, Panorama, decode_srgb, read_index, read_picture
from export.evaluation.metrics import figures_table
from export.reports.photo_sets import expose_panorama
from lighting.color import luminance, srgb_decode, tone_map
from lighting.fusion.single_view import Observations
from lighting.geometry import (
    Floats,
    Pinhole,
    angle_between,
    camera_axes,
    camera_directions,
    direction,
    wrap_azimuth,
    zoomed_fov,
)
from lighting.model import Model
from lighting.prediction import SunEstimate
from lighting.video.decode import Frame
from lighting.video.intrinsics import smooth_parabolic
from lighting.video.observation import NETWORK_INTERVAL, FrameObservation, ShotLight, estimate_frame, observe_shots
from lighting.video.shot import Shot, solve_shot
from lighting.video.tracking import ClipMetadata

CLIP_WIDTH, CLIP_HEIGHT = 640, 360  # pixels
CLIP_RATE, CLIP_SECONDS = 30.0, 6.0
CLIP_FOVS = (35.0, 60.0)  # deg, vertical
SHAKE = 0.4  # deg, of a hand
BLUR_INSTANTS = 8  # averaged in a frame that is exposed for half of its time
ZOOM = 2.0  # times, in or out, in the middle two thirds of a clip
SMOOTHING = 1.0  # s of the smooth curve that trembling is measured against
CLIPS_NOTE = (
    "Medians over the clips, angles in deg. `heading`: error of the camera's heading against the first frame, in the "
    "median and at 90 % of a clip's frames. `trembling`: of the sun's azimuth in each frame, the standard deviation of "
    "its error against a smooth curve (a parabola through one second). `to best`: from the clip's sun to what the "
    "network says of five frames a second, truly rotated. `sun`, `best's sun`: errors of both. `gain`: error "
    "of the exposure against the first frame [%]. `bridged`: frames in which nothing could be followed [%]. `split`: "
    "clips that were taken for several shots. `doubted`: clips whose answer has a warning."
)
_OF_CAMERA = ("heading", "heading, 90 %", "trembling", "field of view", "elevation", "roll")
MEDIANS = (*_OF_CAMERA, "to best", "sun", "best's sun", "gain")

Pixels = NDArray[np.uint8]
Angles = tuple[Floats, Floats, Floats]  # azimuth, elevation and roll (N,) [deg]; the azimuth is continuous


def report_video(data: Path, model: Model, kinds: Sequence[str] = (), count: int = 8) -> str:
    """A table in Markdown of clips of 6 s, a row a kind.

    Args:
        data: folder of panoramas.
        model: the network to ask.
        kinds: of CLIP_KINDS; none for all.
        count: clips of each kind, each of another panorama of `val`.

    Raises:
        DataError: if no panorama of `val` shows its sun.
    """
    panoramas = _choose_panoramas(data, count)
    rows = {}
    for kind in kinds or CLIP_KINDS:
        rows[kind] = _kind_figures([_measure_clip(_film_panorama(p, kind), model) for p in panoramas])
    title = f"## Clips of 6 s, 640 x 360 pixels, {len(panoramas)} of each kind, in places that training never saw"
    return f"{title}\n\n{CLIPS_NOTE}\n\n{figures_table(rows, digits=2)}"


def _choose_panoramas(data: Path, count: int) -> list[Panorama]:
    """`val` panoramas that show their sun, in a fixed order: each of another place as long as there are some."""
    suited = [p for p in read_index(data, "val") if p.sun == "visible" and p.sun_azimuth is not None]
    if not suited:
        raise DataError(f"{data} has no panorama in `val` that shows a given sun.")
    order = np.random.default_rng(21).permutation(len(suited))
    first: dict[str, Panorama] = {}
    for i in order:
        first.setdefault(suited[i].place, suited[i])
    rest = [suited[i] for i in order if suited[i] not in first.values()]
    return [*first.values(), *rest][:count]


# Clips of a camera that is rotated in a panorama.


@dataclass(frozen=True, eq=False)
class _Clip:
    """A clip, rendered when it is read, and the truth about it."""

    time: Floats  # (N,) s
    path: Angles  # in the panorama
    gain: Floats  # (N, 3) of linear values
    vertical_fov: float  # deg, of the first frame
    zoom: Floats  # (N,) focal lengths by the first frame's
    sun: tuple[float, float]  # azimuth in the panorama and elevation, deg
    picture: Callable[[int], Pixels]  # a frame by its index, its gain not yet applied

    def frames(self, every: int = 1) -> Iterator[Frame]:
        """The clip, or one of `every` so many frames of it."""
        for i in range(0, len(self.time), every):
            yield Frame(i, float(self.time[i]), _apply_gain(self.picture(i), self.gain[i]))


def _film_panorama(panorama: Panorama, kind: str) -> _Clip:
    rng = crop_rng(panorama.name, 0, f"clip {kind}")
    time, fov = np.arange(round(CLIP_RATE * CLIP_SECONDS)) / CLIP_RATE, float(rng.uniform(*CLIP_FOVS))
    path, gain = _handheld_path(time, kind, rng), _gains(time, kind, rng)
    zoom = np.ones(len(time))
    if kind == "zoom":
        zoom = ZOOM ** (rng.choice([-1, 1]) * np.clip(1.5 * time / time[-1] - 0.25, 0, 1))
    pixels = read_picture(panorama) if panorama.kind == "ldr" else tone_map(expose_panorama(panorama))
    boxes = {"moving things": _moving_boxes, "crowd": _crowd}.get(kind, lambda _: [])(rng)

    def picture(i: int) -> Pixels:
        if kind == "motion blur":
            return _blurred_view(pixels, float(time[i]), time, path, fov)
        view = _view_panorama(pixels, _camera_angles_at(path, i), zoomed_fov(fov, float(zoom[i])))
        return _paste_boxes(view, boxes, float(time[i]))

    assert panorama.sun_azimuth is not None
    assert panorama.sun_elevation is not None
    return _Clip(time, path, gain, fov, zoom, (panorama.sun_azimuth, panorama.sun_elevation), picture)


def _camera_angles_at(path: Angles, i: int) -> tuple[float, float, float]:
    azimuth, elevation, roll = (float(p[i]) for p in path)
    return azimuth, elevation, roll


def _handheld_path(time: Floats, kind: str, rng: np.random.Generator) -> Angles:
    """How a hand rotates a camera in a clip of that kind."""
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
    panorama: Pixels, at: tuple[float, float, float], fov: float, size: tuple[int, int] = (CLIP_WIDTH, CLIP_HEIGHT)
) -> Pixels:
    """What a camera with these angles sees of a panorama (H, 2H, 3): (height, width, 3) sRGB."""
    import cv2

    x, y, z = np.moveaxis(_rays(size, fov) @ camera_axes(*at).astype(np.float32), -1, 0)
    column = (np.arctan2(x, -z) / np.float32(2 * np.pi) + np.float32(0.5)) * panorama.shape[1] - np.float32(0.5)
    row = (np.float32(0.5) - np.arcsin(np.clip(y, -1, 1)) / np.float32(np.pi)) * panorama.shape[0] - np.float32(0.5)
    view = cv2.remap(panorama, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    return np.asarray(view, dtype=np.uint8)


@lru_cache(maxsize=4)
def _rays(size: tuple[int, int], fov: float) -> NDArray[np.float32]:
    """Unit vectors (h, w, 3) along a camera's right, up and forward; as `camera_directions`, in single precision."""
    return (camera_directions(Pinhole(*size, fov)) * [1, 1, -1]).astype(np.float32)


def _blurred_view(panorama: Pixels, moment: float, time: Floats, path: Angles, fov: float) -> Pixels:
    """What is seen while the shutter is open, averaged in linear light."""
    near = moment + (np.arange(BLUR_INSTANTS) / BLUR_INSTANTS - 0.5) * 0.5 / CLIP_RATE
    moved: Angles = (np.interp(near, time, path[0]), np.interp(near, time, path[1]), np.interp(near, time, path[2]))
    views = [_view_panorama(panorama, _camera_angles_at(moved, i), fov) for i in range(BLUR_INSTANTS)]
    return tone_map(np.mean([decode_srgb(view) for view in views], axis=0))


@dataclass(frozen=True, eq=False)
class _Box:
    """A textured box that crosses the picture."""

    texture: Pixels
    start: Floats  # (2,) pixels
    speed: Floats  # (2,) pixels/s


def _moving_boxes(rng: np.random.Generator) -> list[_Box]:
    """Boxes that hide up to a quarter of the picture."""
    boxes = []
    for _ in range(4):
        width, height = rng.integers(60, 150, 2)
        coarse = rng.integers(30, 220, (height // 8, width // 8, 3), dtype=np.uint8)
        texture = coarse.repeat(8, axis=0).repeat(8, axis=1)
        start = rng.uniform([0, 0.35 * CLIP_HEIGHT], [CLIP_WIDTH, 0.8 * CLIP_HEIGHT])
        boxes.append(_Box(texture, start, rng.uniform([-120, -10], [120, 10])))
    return boxes


def _crowd(rng: np.random.Generator) -> list[_Box]:
    """Twelve boxes that go one way."""
    speed = np.array([rng.choice([-1, 1]) * rng.uniform(40, 110), 0.0])
    return [replace(box, speed=speed) for _ in range(3) for box in _moving_boxes(rng)]


def _paste_boxes(picture: Pixels, boxes: Sequence[_Box], time: float) -> Pixels:
    pasted = picture.copy()
    for box in boxes:
        left = int(box.start[0] + box.speed[0] * time) % (CLIP_WIDTH + 200) - 150
        y = int(np.clip(box.start[1] + box.speed[1] * time, 0, CLIP_HEIGHT - 10))
        x, hidden = max(left, 0), max(-left, 0)
        part = box.texture[: CLIP_HEIGHT - y, hidden : hidden + max(CLIP_WIDTH - x, 0)]
        pasted[y : y + part.shape[0], x : x + part.shape[1]] = part
    return pasted


# Figures of a clip, and of all clips of a kind.


def _measure_clip(clip: _Clip, model: Model) -> dict[str, float]:
    shots = list(observe_shots(clip.frames(), model))
    longest = max(shots, key=lambda watched: len(watched.steps))
    shot = solve_shot(longest, ClipMetadata())
    first = int(shot.frames[0])
    best = _sun_vector(_sun_by_true_rotations(clip, first, model))
    true = direction(clip.sun[0] - clip.path[0][first], clip.sun[1])  # as the shot's first frame sees it
    sun, fovs = _sun_vector(shot.posterior.sun), _fovs(shot.vertical_fov, shot.zoom)
    error = float(angle_between(sun, true))
    return {
        **_tracking_errors(shot, clip),
        "field of view": float(np.median(np.abs(fovs - _fovs(clip.vertical_fov, clip.zoom[shot.frames])))),
        "to best": float(angle_between(sun, best)),
        "sun": error,
        "best's sun": float(angle_between(best, true)),
        "in 50 %": 100.0 * (error <= shot.posterior.sun.radius_50),
        "in 90 %": 100.0 * (error <= shot.posterior.sun.radius_90),
        "split": float(len(shots) > 1),
        "doubted": float(bool(shot.prior.warnings)),
    }


def _sun_vector(sun: SunEstimate) -> Floats:
    return direction(sun.azimuth, sun.elevation)


def _fovs(vertical_fov: float, zoom: Floats) -> Floats:
    """Of each frame (N,) [deg]."""
    return np.array([zoomed_fov(vertical_fov, z) for z in zoom.tolist()])


def _tracking_errors(shot: Shot, clip: _Clip) -> dict[str, float]:
    """Errors of the camera's angles and of the exposure."""
    path, part = shot.path, shot.frames
    azimuth, elevation, roll = (angle[part] for angle in clip.path)
    heading = np.abs(wrap_azimuth(path.heading - path.heading[0] - (azimuth - azimuth[0])))
    sun = np.degrees(np.unwrap(np.radians(shot.posterior.sun.azimuth - path.heading - (clip.sun[0] - azimuth))))
    window = min(len(sun), round(SMOOTHING / float(np.median(np.diff(path.time)))) // 2 * 2 + 1)
    true_gains = clip.gain[part] / clip.gain[part[0]]
    gains = [float(luminance(gain) / luminance(true)) for gain, true in zip(shot.gains, true_gains, strict=True)]
    return {
        "heading": float(np.median(heading)),
        "heading, 90 %": float(np.percentile(heading, 90)),
        "trembling": float((sun - smooth_parabolic(path.time, sun, window)).std()),
        "elevation": float(np.median(np.abs(path.elevation - elevation))),
        "roll": float(np.median(np.abs(path.roll - roll))),
        "gain": 100.0 * float(np.median(np.abs(np.array(gains) - 1.0))),
        "bridged": 100.0 * float(path.bridged.mean()),
    }


def _sun_by_true_rotations(clip: _Clip, first: int, model: Model) -> SunEstimate:
    """The sun that many frames give with true rotations, as frame `first` sees it."""
    light, azimuth = ShotLight(), clip.path[0]
    every = max(1, round(NETWORK_INTERVAL / float(np.median(np.diff(clip.time)))))
    for frame in clip.frames(every):
        heading = float(azimuth[frame.index] - azimuth[first])
        fov = zoomed_fov(clip.vertical_fov, float(clip.zoom[frame.index]))
        light.add(FrameObservation(estimate_frame(model, frame.pixels), heading, fov))
    return light.answer(Observations()).sun


def _kind_figures(clips: Sequence[dict[str, float]]) -> dict[str, float]:
    """One row of the table: medians, worst cases, means and counts."""
    values = {name: np.array([clip[name] for clip in clips]) for name in clips[0]}
    return {
        **{name: float(np.median(values[name])) for name in MEDIANS},
        **{f"{name}, worst": float(values[name].max()) for name in ("trembling", "to best")},
        **{name: float(values[name].mean()) for name in ("in 50 %", "in 90 %", "bridged")},
        **{name: float(values[name].sum()) for name in ("split", "doubted")},
    }

"""Clips of a camera that is rotated in a panorama, decided by the panorama's name and the kind of clip alone."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from export.crops.crops import crop_rng
from export.data.panoramas import Panorama, decode_srgb, read_picture
from export.reports.photo_sets import expose_panorama
from lighting.color import srgb_decode, tone_map
from lighting.geometry import (
    Floats,
    Pinhole,
    camera_axes,
    camera_directions,
    zoomed_fov,
)
from lighting.video.decode import Frame

CLIP_WIDTH, CLIP_HEIGHT = 640, 360  # pixels
CLIP_RATE, CLIP_SECONDS = 30.0, 6.0
CLIP_FOVS = (35.0, 60.0)  # deg, vertical
SHAKE = 0.4  # deg, of a hand
BLUR_INSTANTS = 8  # averaged in a frame that is exposed for half of its time
ZOOM = 2.0  # times, in or out, in the middle two thirds of a clip

Pixels = NDArray[np.uint8]
Angles = tuple[Floats, Floats, Floats]  # azimuth, elevation and roll (N,) [deg]; the azimuth is continuous


@dataclass(frozen=True, eq=False)
class RenderedClip:
    """A clip, rendered when it is read, and the truth about it."""

    time: Floats  # (N,) s
    path: Angles  # in the panorama
    gain: Floats  # (N, 3) of linear values
    vertical_fov: float  # deg, of the first frame
    zoom: Floats  # (N,) focal lengths by the first frame's
    sun: tuple[float, float]  # azimuth in the panorama and elevation, deg
    picture: Callable[[int], Pixels]  # a frame by its index, its gain not yet applied

    def frames(self, every: int = 1) -> Iterator[Frame]:
        """The clip, or a part of its frames.

        Args:
            every: so many frames one is taken.
        """
        for i in range(0, len(self.time), every):
            yield Frame(i, float(self.time[i]), _apply_gain(self.picture(i), self.gain[i]))


def film_panorama(panorama: Panorama, kind: str) -> RenderedClip:
    """The clip of a kind in a panorama.

    Args:
        panorama: with a sun.
        kind: of CLIP_KINDS.
    """
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
        view = view_panorama(pixels, _camera_angles_at(path, i), zoomed_fov(fov, float(zoom[i])))
        return _paste_boxes(view, boxes, float(time[i]))

    assert panorama.sun_azimuth is not None
    assert panorama.sun_elevation is not None
    return RenderedClip(time, path, gain, fov, zoom, (panorama.sun_azimuth, panorama.sun_elevation), picture)


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


def view_panorama(
    panorama: Pixels, at: tuple[float, float, float], fov: float, size: tuple[int, int] = (CLIP_WIDTH, CLIP_HEIGHT)
) -> Pixels:
    """What a camera sees of a panorama: (height, width, 3) sRGB.

    Args:
        panorama: (H, 2H, 3) sRGB.
        at: azimuth, elevation and roll of the camera [deg].
        fov: deg, vertical.
        size: width and height, pixels.
    """
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
    views = [view_panorama(panorama, _camera_angles_at(moved, i), fov) for i in range(BLUR_INSTANTS)]
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

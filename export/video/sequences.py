"""Clips whose camera is known exactly: turned in panoramas, or walked through rendered places.

Each is decided by its panorama's name and its kind alone.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from export.crops import generator
from export.data import Panorama, decode, read_picture
from export.turns.sets import exposed
from export.turns.walk import Standpoint, Walk
from lighting.colour import srgb_decode, tone_map
from lighting.geometry import Floats, Pinhole, angles, camera_axes, camera_directions
from lighting.video import Frame
from lighting.video.zoom import zoomed_fov

WIDTH, HEIGHT = 640, 360  # pixels
RATE, SECONDS = 30.0, 6.0
WALK_RATE = 15.0  # frames a second of walks, which take long to render
FOVS = (35.0, 60.0)  # deg, vertical
SHAKE = 0.4  # deg, of a hand
BLURRED = 8  # instants averaged in a frame that is exposed for half of its time
PACE = 1.4  # m/s
ZOOM = 2.0  # times, in or out, in the middle two thirds of a clip

Pixels = NDArray[np.uint8]
Angles = tuple[Floats, Floats, Floats]  # azimuth, elevation and roll (N,) [deg]; the azimuth is continuous


@dataclass(frozen=True, eq=False)
class Sequenced:
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
            yield Frame(i, float(self.time[i]), gained(self.picture(i), self.gain[i]))


def sequences(panoramas: Sequence[Panorama], kind: str) -> Iterator[Sequenced]:
    """One of a kind for each panorama; `walk` takes a rendered place in its stead."""
    for number, panorama in enumerate(panoramas):
        rng = generator(panorama.name, 0, f"clip {kind}")
        yield walked(number, rng) if kind == "walk" else turned(panorama, kind, rng)


def turned(panorama: Panorama, kind: str, rng: np.random.Generator) -> Sequenced:
    """A camera that stands in a panorama."""
    time, fov = np.arange(round(RATE * SECONDS)) / RATE, float(rng.uniform(*FOVS))
    path, gain = camera_path(time, kind, rng), _gains(time, kind, rng)
    zoom = (
        ZOOM ** (rng.choice([-1, 1]) * np.clip(1.5 * time / time[-1] - 0.25, 0, 1)) if kind == "zoom" else 1 + 0 * time
    )
    picture = displayed(panorama)
    things = {"moving things": _things, "crowd": _crowd}.get(kind, lambda _: [])(rng)

    def shot(i: int) -> Pixels:
        if kind == "motion blur":
            return _blurred(picture, float(time[i]), time, path, fov)
        return _crossed(look(picture, held(path, i), zoomed_fov(fov, float(zoom[i]))), things, float(time[i]))

    return Sequenced(panorama.name, time, path, gain, fov, zoom, sun_of(panorama), shot)


def sun_of(panorama: Panorama) -> tuple[float, float]:
    """Azimuth and elevation [deg] of a sun that the index gives."""
    assert panorama.sun_azimuth is not None
    assert panorama.sun_elevation is not None
    return panorama.sun_azimuth, panorama.sun_elevation


def displayed(panorama: Panorama) -> Pixels:
    """The panorama as sRGB, exposed as a photo would be."""
    return read_picture(panorama) if panorama.kind == "ldr" else tone_map(exposed(panorama))


def held(path: Angles, i: int) -> tuple[float, float, float]:
    """The camera's angles in one frame."""
    azimuth, elevation, roll = (float(p[i]) for p in path)
    return azimuth, elevation, roll


def camera_path(time: Floats, kind: str, rng: np.random.Generator) -> Angles:
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


def gained(picture: Pixels, gain: Floats) -> Pixels:
    """The picture (h, w, 3) with its linear values multiplied by gains (3,)."""
    if np.all(gain == 1.0):
        return picture
    table = tone_map(srgb_decode(np.arange(256) / 255.0)[:, None] * gain)
    return np.stack([table[picture[..., c], c] for c in range(3)], axis=-1)


def look(
    picture: Pixels, at: tuple[float, float, float], fov: float, size: tuple[int, int] = (WIDTH, HEIGHT)
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
    near = moment + (np.arange(BLURRED) / BLURRED - 0.5) * 0.5 / RATE
    moved: Angles = (np.interp(near, time, path[0]), np.interp(near, time, path[1]), np.interp(near, time, path[2]))
    seen = [look(picture, held(moved, i), fov) for i in range(BLURRED)]
    return tone_map(np.mean([decode(s) for s in seen], axis=0))


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
        start = rng.uniform([0, 0.35 * HEIGHT], [WIDTH, 0.8 * HEIGHT])
        found.append(_Thing(texture, start, rng.uniform([-120, -10], [120, 10])))
    return found


def _crowd(rng: np.random.Generator) -> list[_Thing]:
    """Twelve boxes that go one way."""
    speed = np.array([rng.choice([-1, 1]) * rng.uniform(40, 110), 0.0])
    return [replace(thing, speed=speed) for _ in range(3) for thing in _things(rng)]


def _crossed(picture: Pixels, things: Sequence[_Thing], time: float) -> Pixels:
    shown = picture.copy()
    for thing in things:
        left = int(thing.start[0] + thing.speed[0] * time) % (WIDTH + 200) - 150
        y = int(np.clip(thing.start[1] + thing.speed[1] * time, 0, HEIGHT - 10))
        x, hidden = max(left, 0), max(-left, 0)
        part = thing.texture[: HEIGHT - y, hidden : hidden + max(WIDTH - x, 0)]
        shown[y : y + part.shape[0], x : x + part.shape[1]] = part
    return shown


def walked(number: int, rng: np.random.Generator) -> Sequenced:
    """A camera that is carried through a rendered place."""
    walk = Walk(number)
    time, fov = np.arange(round(WALK_RATE * SECONDS)) / WALK_RATE, float(rng.uniform(*FOVS))
    path = camera_path(time, "hand", rng)
    for _ in range(60):
        towards = np.radians(path[0][0] + rng.uniform(-30, 30))
        steps = PACE * time[:, None] * np.array([np.sin(towards), -np.cos(towards)])
        points = rng.uniform(-10, 10, 2) + steps
        stands = [_stand(points[i], path, i, fov) for i in (0, len(time) // 2, -1)]
        if all(walk.is_clear(stand) for stand in stands):
            break

    def shot(i: int) -> Pixels:
        return walk.photo(_stand(points[i], path, i, fov), WIDTH, HEIGHT)

    azimuth, elevation = angles(walk.light.sun)
    sun = (float(azimuth), float(elevation))
    return Sequenced(f"place {number}", time, path, np.ones((len(time), 3)), fov, np.ones(len(time)), sun, shot)


def _stand(point: Floats, path: Angles, i: int, fov: float) -> Standpoint:
    return Standpoint((float(point[0]), float(point[1])), *held(path, i), fov)

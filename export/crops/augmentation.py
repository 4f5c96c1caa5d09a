"""Photometric augmentation: random versions of what cameras and their software do; and CutMix of two places.

Each effect draws from a random stream of its own, made of the crop's seed and the effect's name. A new effect changes
no draw of another: it takes one function, and one entry of SCENE_EFFECTS, CAMERA_EFFECTS or PICTURE_EFFECTS.

CutMix [1] rotates the second panorama until the same camera sees its sun where it sees the first one's. On one side of
a straight line through the picture, the crop then shows the second place.

References: [1] Yun et al., CutMix, ICCV 2019.
"""

import math
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from io import BytesIO
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageFilter

from export.crops.crops import Camera, Crop, Source, pinhole_camera
from lighting.color import luminance, tone_map
from lighting.geometry import Floats, camera_directions, wrap_azimuth

Linear = NDArray[np.float32]  # (h, w, 3) linear Rec.709
Picture = NDArray[np.uint8]  # (h, w, 3) sRGB
Pixels = TypeVar("Pixels", Linear, Picture)

_BOX, _BICUBIC = Image.Resampling.BOX, Image.Resampling.BICUBIC
_WHITE_BALANCE_STD = (0.025, 0.0075, 0.025)  # of the logarithms of red, green and blue; a low sun is told by its color
JPEG_SHARE = 0.6  # of the pictures, which are compressed once more
_EXPOSURE_STOPS = (-1.2, 1.0)  # range of the change of exposure


@dataclass(frozen=True)
class Effect(Generic[Pixels]):
    """One thing that happens to a share of the crops."""

    name: str  # of its random stream, so no two have the same
    probability: float  # share of the crops, 0 to 1
    apply: Callable[[Pixels, Crop, np.random.Generator], Pixels]


def augment(crop: Crop, rng: np.random.Generator) -> tuple[Picture, Floats, bool]:
    """The processed picture (h, w, 3), the factors (3,) on its linear values, and whether the sun it showed is hidden.

    The factors' mean is the change of exposure, the rest of them the change of white balance.

    Args:
        crop: the crop as its panorama or photo gives it.
        rng: gives one number, whatever effects there are.
    """
    seed = int(rng.integers(2**63))
    gain = float(2.0 ** _effect_stream(seed, "exposure").uniform(*_EXPOSURE_STOPS))
    recovered = crop.linear
    if gain < 1:  # lift clipped highlights, so that an underexposed sun is still white
        recovered = np.asarray(crop.linear / (1.0 - 0.85 * np.minimum(crop.linear, 1.0) ** 8), dtype=np.float32)
    scene = _apply_all(SCENE_EFFECTS, recovered, crop, seed)
    balance = np.exp(_effect_stream(seed, "white balance").normal(0, _WHITE_BALANCE_STD))
    gains = gain * np.asarray(balance / balance.mean(), dtype=np.float32)
    linear = _apply_all(CAMERA_EFFECTS, np.asarray(scene * gains, dtype=np.float32), crop, seed)
    picture = _apply_all(PICTURE_EFFECTS, tone_map(np.maximum(linear, 0.0)), crop, seed)
    return picture, gains.astype(np.float64), _differs_at_sun(scene, recovered, crop)


def _effect_stream(seed: int, name: str) -> np.random.Generator:
    """The random numbers of the effect `name` in the crop `seed`."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


def _apply_all(effects: tuple[Effect[Pixels], ...], pixels: Pixels, crop: Crop, seed: int) -> Pixels:
    for effect in effects:
        stream = _effect_stream(seed, effect.name)
        if stream.random() < effect.probability:
            pixels = effect.apply(pixels, crop, stream)
    return pixels


def _differs_at_sun(one: Linear, other: Linear, crop: Crop) -> bool:
    if crop.sun_pixel is None:
        return False
    x, y = (min(int(value), size - 1) for value, size in zip(crop.sun_pixel, one.shape[1::-1], strict=True))
    return not np.array_equal(one[y, x], other[y, x])


def _cover(linear: Linear, crop: Crop, rng: np.random.Generator) -> Linear:
    """Cover the sun, or any other part, with a plain patch: shading and shadows then have to suffice."""
    height, width = linear.shape[:2]
    center: Floats = rng.uniform((0, 0), (width, height))
    if rng.random() < 2 / 3:
        if crop.sun_pixel is None:
            return linear
        center = np.array(crop.sun_pixel)
    half = rng.uniform(0.06, 0.2, 2) * max(width, height)
    x0, y0 = np.maximum(center - half * rng.uniform(0.7, 1.3, 2), 0).astype(int)
    x1, y1 = np.minimum(center + half * rng.uniform(0.7, 1.3, 2), (width, height)).astype(int)
    hidden = linear.copy()
    hidden[y0:y1, x0:x1] = linear[rng.integers(height), rng.integers(width)] * rng.uniform(0.3, 1.0)
    return hidden


def _hide_sky(linear: Linear, crop: Crop, rng: np.random.Generator) -> Linear:
    """Paint everything above the horizon in one color: what lies on the ground then has to suffice."""
    height, width = linear.shape[:2]
    up = camera_directions(pinhole_camera(crop.camera, width, height))[..., 1]
    color = rng.uniform(0.15, 1.3) * np.exp(rng.normal(0, 0.08, 3)).astype(np.float32)
    return np.where((up > np.sin(np.radians(rng.uniform(0, 12))))[..., None], color, linear).astype(np.float32)


def _vignette(linear: Linear, _: Crop, rng: np.random.Generator) -> Linear:
    """Darken the corners."""
    height, width = linear.shape[:2]
    strength = 0.4 * rng.random() ** 3
    y, x = np.linspace(-1, 1, height, dtype=np.float32), np.linspace(-1, 1, width, dtype=np.float32)
    return np.asarray(linear * (1 - strength * (y[:, None] ** 2 + x**2) / 2)[..., None], dtype=np.float32)


def _tone_locally(linear: Linear, _: Crop, rng: np.random.Generator) -> Linear:
    """Compress large contrasts and raise small ones, as phones and tone mapping do."""
    light = np.log(luminance(linear) + 1e-3).astype(np.float32)
    coarse = tuple(max(2, round(side / rng.uniform(8, 30))) for side in light.shape[::-1])
    base = np.asarray(Image.fromarray(light).resize(coarse, _BOX).resize(light.shape[::-1], _BICUBIC))
    flatter, crisper = rng.uniform(0.4, 0.95), rng.uniform(0.9, 1.4)
    mean = float(light.mean())
    change = (flatter - 1) * (base - mean) + (crisper - 1) * (light - base)
    return np.asarray(linear * np.exp(change)[..., None], dtype=np.float32)


def _haze(linear: Linear, _: Crop, rng: np.random.Generator) -> Linear:
    """A veil of one pale color: mist, flare, a dirty lens."""
    veil = rng.uniform(0.3, 0.9) * np.exp(rng.normal(0, 0.05, 3)).astype(np.float32)
    return np.asarray(linear + rng.uniform(0.05, 0.35) * (veil - linear), dtype=np.float32)


def _add_noise(linear: Linear, _: Crop, rng: np.random.Generator) -> Linear:
    """A sensor's noise."""
    strength = np.float32(0.02 * rng.random() ** 2)
    noise = rng.standard_normal(linear.shape, np.float32)
    return np.asarray(linear + strength * noise * np.sqrt(linear + np.float32(0.02)), dtype=np.float32)


def _tone(picture: Picture, _: Crop, rng: np.random.Generator) -> Picture:
    """Gamma, an S-curve, lifted blacks by table; then saturation, at times down to gray."""
    v = np.linspace(0, 1, 256) ** np.exp(rng.normal(0, 0.15))
    v = v + rng.uniform(-0.15, 0.35) * v * (1 - v) * (2 * v - 1) * 2
    lift = 0.08 * rng.random() ** 2
    table = np.clip((lift + (1 - lift) * v) * 255, 0, 255).astype(np.float32)
    toned = table[picture]
    saturation = 0.0 if rng.random() < 0.03 else np.exp(rng.normal(0.05, 0.3))
    gray = luminance(toned)[..., None]
    return np.asarray(np.clip(gray + saturation * (toned - gray), 0, 255), dtype=np.uint8)


def _sharpen(picture: Picture, _: Crop, rng: np.random.Generator) -> Picture:
    """Sharpen, or less often blur."""
    kernel: ImageFilter.MultibandFilter = ImageFilter.GaussianBlur(rng.uniform(0.2, 1.0))
    if rng.random() < 0.7:
        kernel = ImageFilter.UnsharpMask(rng.uniform(0.5, 2.0), int(rng.uniform(20, 160)), 0)
    return np.asarray(Image.fromarray(picture).filter(kernel))


def recompress(picture: Picture, rng: np.random.Generator) -> Picture:
    """The picture as a JPEG file of random quality holds it.

    Args:
        picture: (h, w, 3) sRGB.
        rng: gives one number, the quality.
    """
    buffer = BytesIO()
    Image.fromarray(picture).save(buffer, "JPEG", quality=int(rng.uniform(35, 96)))
    return np.asarray(Image.open(buffer))


SCENE_EFFECTS: tuple[Effect[Linear], ...] = (  # what hides a part of the scene, perhaps the sun
    Effect("cover", 0.3, _cover),
    Effect("hidden sky", 0.12, _hide_sky),
)
CAMERA_EFFECTS: tuple[Effect[Linear], ...] = (  # on linear values, after the exposure
    Effect("vignette", 1.0, _vignette),
    Effect("local tone mapping", 0.3, _tone_locally),
    Effect("haze", 0.12, _haze),
    Effect("noise", 1.0, _add_noise),
)
PICTURE_EFFECTS: tuple[Effect[Picture], ...] = (  # on the developed picture
    Effect("tone curve", 1.0, _tone),
    Effect("sharpness", 0.5, _sharpen),
    Effect("JPEG", JPEG_SHARE, lambda picture, _, rng: recompress(picture, rng)),
)

_MAX_SUN_DIFFERENCE = 5.0  # deg, of the elevations of the suns of two places in one picture


def cutmix_partners(sources: Sequence[Source], chances: Floats) -> list[tuple[NDArray[np.intp], Floats]]:
    """For each source, the indices (M,) of sources that may share its picture, and their cumulative chances (M,).

    They are of other places, have about the same sun elevation and the same `direct`; sources without a sun go with
    each other. A source without any gets itself.

    Args:
        sources: the N panoramas of a run.
        chances: (N,) of drawing each source, 0 to 1.
    """
    elevation = np.array([s.label.sun_elevation for s in sources])
    direct = np.array([s.label.direct for s in sources])
    place = np.array([s.panorama.place for s in sources])
    partners = []
    for i, height in enumerate(elevation):
        near = np.abs(elevation - height) < _MAX_SUN_DIFFERENCE if math.isfinite(height) else ~np.isfinite(elevation)
        numbers = np.flatnonzero(near & (direct == direct[i]) & (place != place[i]) & (chances > 0))
        shares = np.cumsum(chances[numbers]) / chances[numbers].sum() if len(numbers) else np.ones(1)
        partners.append((numbers if len(numbers) else np.array([i]), shares))
    return partners


def matching_camera(camera: Camera, source: Source, other: Source, rng: np.random.Generator) -> Camera:
    """The camera that sees the other's sun where `camera` sees the source's, mirrored at random.

    Without a sun it looks in a random direction.

    Args:
        camera: in the frame of `source`.
        source: the panorama that `camera` looks at.
        other: the panorama that the answer looks at.
        rng: gives whether the answer is mirrored, and a direction where there is no sun.
    """
    mirrored = bool(rng.random() < 0.5)
    if not math.isfinite(source.label.sun_azimuth):
        return replace(camera, azimuth=rng.uniform(-180, 180))
    flip = 1.0 if mirrored == camera.mirrored else -1.0
    relative = flip * (source.label.sun_azimuth - camera.azimuth)
    azimuth = float(wrap_azimuth(other.label.sun_azimuth - relative))
    return replace(camera, azimuth=azimuth, roll=flip * camera.roll, mirrored=mirrored)


def cutmix(one: Crop, other: Crop, rng: np.random.Generator) -> Crop:
    """The first crop with the second one on one side of a straight line.

    The side with the sun's pixel shows the first crop; a sun that only the second crop holds is not shown. Turbidity
    and exposure are unknown. The sun's deviation combines those of both with the difference of their elevations.

    Args:
        one: the crop that gives the targets.
        other: a crop of the same size, by the camera of `matching_camera`.
        rng: draws the line.
    """
    height, width = one.linear.shape[:2]
    angle = rng.uniform(-math.pi, math.pi)
    x0, y0 = rng.uniform(0.25, 0.75) * width, rng.uniform(0.25, 0.75) * height

    def side(x: Floats, y: Floats) -> Floats:
        return np.asarray((x - x0) * math.cos(angle) + (y - y0) * math.sin(angle))

    beyond = side(np.arange(width)[None, :] + 0.5, np.arange(height)[:, None] + 0.5) > 0
    sun = one.sun_pixel or other.sun_pixel
    if sun is not None and side(*np.array(sun)) > 0:
        beyond = ~beyond
    difference = one.sun_elevation - other.sun_elevation
    return replace(
        one,
        linear=np.where(beyond[..., None], other.linear, one.linear).astype(np.float32),
        sun_std=float(np.sqrt((one.sun_std**2 + other.sun_std**2 + difference**2) / 2)),
        turbidity=math.nan,
        exposure=math.nan,
    )

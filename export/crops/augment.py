"""Random versions of what cameras and their software do to a picture, applied to training crops."""

from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageFilter

from export.crops.cameras import pinhole
from export.crops.crops import Crop
from lighting.colour import luminance, tone_map
from lighting.geometry import Floats, camera_directions

_BOX, _BICUBIC = Image.Resampling.BOX, Image.Resampling.BICUBIC
_CASTS = (0.025, 0.0075, 0.025)  # spread of the logarithms of red, green and blue; a low sun is told by its colour


def augment(crop: Crop, rng: np.random.Generator) -> tuple[NDArray[np.uint8], Floats, bool]:
    """The processed picture (h, w, 3), the factors (3,) on its linear values, and whether the sun it showed is hidden.

    The factors' mean is the change of exposure, the rest of them the change of white balance.
    """
    gain = float(2.0 ** rng.uniform(-1.2, 1.0))
    recovered = _recover(crop.linear) if gain < 1 else crop.linear
    shown = _hide_sky(_occlude(recovered, crop, rng), crop, rng)
    hidden = _differ_at_the_sun(shown, recovered, crop)
    gains = gain * _white_balance(rng)
    linear = shown * gains * _vignette(shown.shape, rng)
    linear = _haze(_tone_locally(linear, rng), rng)
    linear = linear + rng.normal(0, 0.02 * rng.random() ** 2, linear.shape).astype(np.float32) * np.sqrt(linear + 0.02)
    picture = _tone(tone_map(np.maximum(linear, 0.0)), rng)
    return recompress(_sharpen(picture, rng), rng), gains.astype(np.float64), hidden


def _differ_at_the_sun(one: NDArray[np.float32], other: NDArray[np.float32], crop: Crop) -> bool:
    place = crop.sun_pixel
    if place is None:
        return False
    x, y = (min(int(value), size - 1) for value, size in zip(place, one.shape[1::-1], strict=True))
    return not np.array_equal(one[y, x], other[y, x])


def _recover(linear: NDArray[np.float32]) -> NDArray[np.float32]:
    """Lift clipped highlights, so that an underexposed sun is still white."""
    return np.asarray(linear / (1.0 - 0.85 * np.minimum(linear, 1.0) ** 8), dtype=np.float32)


def _occlude(linear: NDArray[np.float32], crop: Crop, rng: np.random.Generator) -> NDArray[np.float32]:
    """At times cover the sun, or any other part, with a plain patch: shading and shadows then have to suffice."""
    draw = rng.random()
    if draw > 0.3:
        return linear
    height, width = linear.shape[:2]
    centre: Floats = rng.uniform((0, 0), (width, height))
    if draw < 0.2:
        if crop.sun_pixel is None:
            return linear
        centre = np.array(crop.sun_pixel)
    half = rng.uniform(0.06, 0.2, 2) * max(width, height)
    x0, y0 = np.maximum(centre - half * rng.uniform(0.7, 1.3, 2), 0).astype(int)
    x1, y1 = np.minimum(centre + half * rng.uniform(0.7, 1.3, 2), (width, height)).astype(int)
    hidden = linear.copy()
    hidden[y0:y1, x0:x1] = linear[rng.integers(height), rng.integers(width)] * rng.uniform(0.3, 1.0)
    return hidden


def _hide_sky(linear: NDArray[np.float32], crop: Crop, rng: np.random.Generator) -> NDArray[np.float32]:
    """At times paint everything above the horizon in one colour: what lies on the ground then has to suffice."""
    if rng.random() > 0.12:
        return linear
    height, width = linear.shape[:2]
    up = camera_directions(pinhole(crop.camera, width, height))[..., 1]
    colour = rng.uniform(0.15, 1.3) * np.exp(rng.normal(0, 0.08, 3)).astype(np.float32)
    return np.where((up > np.sin(np.radians(rng.uniform(0, 12))))[..., None], colour, linear).astype(np.float32)


def _tone_locally(linear: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
    """At times compress large contrasts and raise small ones, as phones and tone mapping do."""
    if rng.random() > 0.3:
        return linear
    light = np.log(luminance(linear) + 1e-3).astype(np.float32)
    coarse = tuple(max(2, round(side / rng.uniform(8, 30))) for side in light.shape[::-1])
    base = np.asarray(Image.fromarray(light).resize(coarse, _BOX).resize(light.shape[::-1], _BICUBIC))
    flatter, crisper = rng.uniform(0.4, 0.95), rng.uniform(0.9, 1.4)
    middle = float(light.mean())
    change = (flatter - 1) * (base - middle) + (crisper - 1) * (light - base)
    return np.asarray(linear * np.exp(change)[..., None], dtype=np.float32)


def _haze(linear: NDArray[np.float32], rng: np.random.Generator) -> NDArray[np.float32]:
    """At times a veil of one pale colour: mist, flare, a dirty lens."""
    if rng.random() > 0.12:
        return linear
    veil = rng.uniform(0.3, 0.9) * np.exp(rng.normal(0, 0.05, 3)).astype(np.float32)
    return np.asarray(linear + rng.uniform(0.05, 0.35) * (veil - linear), dtype=np.float32)


def _white_balance(rng: np.random.Generator) -> NDArray[np.float32]:
    gains = np.exp(rng.normal(0, _CASTS))
    return np.asarray(gains / gains.mean(), dtype=np.float32)


def _vignette(shape: tuple[int, ...], rng: np.random.Generator) -> NDArray[np.float32]:
    strength = 0.4 * rng.random() ** 3
    y, x = np.linspace(-1, 1, shape[0], dtype=np.float32), np.linspace(-1, 1, shape[1], dtype=np.float32)
    return (1 - strength * (y[:, None] ** 2 + x**2) / 2)[..., None].astype(np.float32)


def _tone(picture: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.uint8]:
    """Gamma, an S-curve, lifted blacks by table; then saturation, at times down to grey."""
    v = np.linspace(0, 1, 256) ** np.exp(rng.normal(0, 0.15))
    v = v + rng.uniform(-0.15, 0.35) * v * (1 - v) * (2 * v - 1) * 2
    lift = 0.08 * rng.random() ** 2
    table = np.clip((lift + (1 - lift) * v) * 255, 0, 255).astype(np.float32)
    toned = table[picture]
    saturation = 0.0 if rng.random() < 0.03 else np.exp(rng.normal(0.05, 0.3))
    grey = luminance(toned)[..., None]
    return np.asarray(np.clip(grey + saturation * (toned - grey), 0, 255), dtype=np.uint8)


def _sharpen(picture: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.uint8]:
    draw = rng.random()
    if draw < 0.35:
        radius, percent = rng.uniform(0.5, 2.0), int(rng.uniform(20, 160))
        kernel: ImageFilter.MultibandFilter = ImageFilter.UnsharpMask(radius, percent, 0)
    elif draw < 0.5:
        kernel = ImageFilter.GaussianBlur(rng.uniform(0.2, 1.0))
    else:
        return picture
    return np.asarray(Image.fromarray(picture).filter(kernel))


def recompress(picture: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.uint8]:
    if rng.random() < 0.4:
        return picture
    buffer = BytesIO()
    Image.fromarray(picture).save(buffer, "JPEG", quality=int(rng.uniform(35, 96)))
    return np.asarray(Image.open(buffer))

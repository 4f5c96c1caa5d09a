"""What the network looks at: how much less it believes its own answer once a part of the photo is covered [1].

References:
    [1] Zeiler and Fergus, Visualizing and understanding convolutional networks, ECCV 2014.
"""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps

from lighting.files import atomic_write
from lighting.geometry import Floats
from lighting.model import Model, fit_size, preprocess
from lighting.photo.reader import Photo, read_photo
from lighting.sun_grid import bayes_direction, grid_directions

_PATCH = 48  # pixels of the network's canvas, along each side of the cover
_STEP = 12  # pixels between neighbouring covers
_BATCH = 16  # covered photos that the network sees at once
_NEAR = 8.0  # deg around the answer, within which its probability is summed
_MIN_PROBABILITY = 1e-4  # of the logarithm
_WARM, _COLD = (255, 80, 0), (0, 110, 255)  # of parts that speak for the answer, and against it
_ACROSS, _TILE = 3, (400, 300)  # pictures in a row, and the size in pixels of each where there are several
_MAX_OPACITY = 0.8
_FULL = 0.1  # nats, of a loss that is painted with the full opacity; the largest loss of a photo, where that is more


def _occlusion_map(model: Model, photo: Photo) -> Floats:
    """What each part of a photo adds (H, W) [nat] to the logarithm of the probability near the answer.

    A grey square moves over the photo. Each pixel gets the mean of what the squares over it take away, those around
    it counting most. Positive parts speak for the answer, negative ones against it. H and W are the photo's size on
    the network's canvas.

    Args:
        model: the network.
        photo: upright.
    """
    spec = model.spec
    canvas = preprocess(photo, spec).reshape(3, spec.height, spec.width)
    width, height = fit_size(photo.pixels.shape[1], photo.pixels.shape[0], spec)
    left, top = (spec.width - width) // 2, (spec.height - height) // 2
    whole = np.asarray(model.predict(canvas[None])[0].sun_probability)
    cells = grid_directions(spec.sun_grid)
    near = cells @ bayes_direction(whole, spec.sun_grid) >= np.cos(np.radians(_NEAR))
    corners = [(y, x) for y in _starts(height) for x in _starts(width)]
    tent = np.bartlett(_PATCH + 2)[1:-1]
    total, weight = np.zeros((2, height + 2 * _PATCH, width + 2 * _PATCH))
    for first in range(0, len(corners), _BATCH):
        part = corners[first : first + _BATCH]
        covered = np.repeat(canvas[None], len(part), axis=0)
        for one, (y, x) in zip(covered, part, strict=True):
            one[:, top : top + height, left : left + width][:, max(y, 0) : y + _PATCH, max(x, 0) : x + _PATCH] = 0.0
        for prediction, (y, x) in zip(model.predict(covered), part, strict=True):
            kept = np.asarray(prediction.sun_probability)[near].sum()
            lost = np.log(max(whole[near].sum(), _MIN_PROBABILITY) / max(kept, _MIN_PROBABILITY))
            window = np.s_[y + _PATCH : y + 2 * _PATCH, x + _PATCH : x + 2 * _PATCH]
            total[window] += lost * np.outer(tent, tent)
            weight[window] += np.outer(tent, tent)
    inside = np.s_[_PATCH : _PATCH + height, _PATCH : _PATCH + width]
    return np.asarray(total[inside] / weight[inside])


def _starts(size: int) -> range:
    """Where covers begin along a side, so that they reach over both of its ends."""
    return range(_STEP - _PATCH, size - 1, _STEP)


def _draw_occlusion(photo: NDArray[np.uint8], added: Floats) -> NDArray[np.uint8]:
    """The photo (H, W, 3) in grey, orange where parts speak for the answer and blue where they speak against it.

    Args:
        photo: (H, W, 3) sRGB.
        added: (h, w) [nat] of `_occlusion_map`.
    """
    height, width = photo.shape[:2]
    image = Image.fromarray(added.astype(np.float32)).resize((width, height), Image.Resampling.BICUBIC)
    strength = np.asarray(image) / max(_FULL, float(np.abs(added).max()))
    grey = np.asarray(Image.fromarray(photo).convert("L"), dtype=np.float64)[..., None]
    color = np.where(strength[..., None] > 0, _WARM, _COLD)
    opacity = _MAX_OPACITY * np.clip(np.abs(strength), 0.0, 1.0)[..., None]
    return np.asarray(np.round(grey + opacity * (color - grey)), dtype=np.uint8)


def write_occlusion(model: Model, photos: Sequence[Path], target: Path) -> None:
    """Write a picture of what the network looks at in photos, at most _ACROSS of them in a row.

    Args:
        model: the network.
        photos: files.
        target: the PNG or JPEG file to write.

    Raises:
        PhotoError: a photo cannot be read.
    """
    tiles = []
    for path in photos:
        photo = read_photo(path)
        picture = Image.fromarray(_draw_occlusion(photo.pixels, _occlusion_map(model, photo)))
        tiles.append(ImageOps.pad(picture, _TILE, Image.Resampling.LANCZOS, "white") if len(photos) > 1 else picture)
    width, height = tiles[0].size
    across = min(_ACROSS, len(tiles))
    sheet = Image.new("RGB", (width * across, height * math.ceil(len(tiles) / across)), "white")
    for i, tile in enumerate(tiles):
        sheet.paste(tile, (i % across * width, i // across * height))
    with atomic_write(target) as temporary:
        sheet.save(temporary, "PNG" if target.suffix.lower() == ".png" else "JPEG", quality=85)

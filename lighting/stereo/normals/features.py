"""What the network of normals sees: each image beside its sun, and what the search says."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.stereo.normals.search import Answer

Image = NDArray[np.float32]

BY_IMAGE = 6  # planes of each image: relative brightness, difference to the search's fit, cosine to the sun, sun x y z
SHARED = 15  # planes of the search: best, mean and other normal, residual, odds, spread, brightness, noise, mask

_SOFT = 0.05  # of the mean brightness, what counts as a large difference


@dataclass(frozen=True)
class Features:
    """Planes of a picture."""

    by_image: Image  # (T, BY_IMAGE, H, W)
    shared: Image  # (SHARED, H, W)


def features(images: Image, mask: NDArray[np.bool_], suns: NDArray[Any], answer: Answer, noise: float) -> Features:
    """The planes of pixels (P, T, C) that fill a mask (H, W), all 0 outside it.

    `suns` (T, 3) are unit vectors in the camera frame; `noise` is in the unit of the images.
    """
    brightness = images.mean(axis=2)
    size = np.sqrt(np.mean(brightness**2, axis=1)) + np.float32(1e-9)
    by_image = np.zeros((images.shape[1], BY_IMAGE, *mask.shape), dtype=np.float32)
    by_image[:, 0, mask] = (brightness / size[:, None]).T
    by_image[:, 1, mask] = np.tanh(answer.difference / (_SOFT * size[:, None])).T
    by_image[:, 2, mask] = suns.astype(np.float32) @ answer.normal.T
    by_image[:, 3:][..., mask] = suns[:, :, None]
    shared = np.zeros((SHARED, *mask.shape), dtype=np.float32)
    shared[:, mask] = _search_planes(answer, size, noise)
    return Features(by_image, shared)


def _search_planes(answer: Answer, size: Image, noise: float) -> Image:
    """The planes (SHARED, P) of the search."""
    numbers = (
        np.log1p(answer.residual / noise),
        np.tanh(answer.odds / 4),
        answer.spread / 30,
        np.clip(np.log(size / np.median(size)), -3, 3),
        np.clip(np.log(noise / size), -8, 0) / 4,
        np.ones_like(size),
    )
    vectors = (answer.normal.T, answer.mean.T, answer.other.T)
    return np.concatenate([*vectors, np.stack(numbers)]).astype(np.float32)

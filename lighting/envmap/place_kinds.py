"""What kind of place a photo is of: city, garden, park, meadow, forest, shore, bare land or snow.

A linear classifier [1] of what the network tells: what the photo shows at each height, and how bright and colorful it
is around the camera at each elevation. `python -m export kinds` fits it.

References: [1] Bishop, Pattern Recognition and Machine Learning, section 4.3.4 (2006).
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lighting.color import LUMINANCE_WEIGHTS
from lighting.geometry import Floats
from lighting.prediction import Segments, SurfaceClass

PLACE_KINDS = ("city", "garden", "park", "meadow", "forest", "shore", "bare", "snow")

_PHOTO_ROWS = 4  # parts of a photo, from its top
_AROUND_ROWS = 6  # rings of what is around the camera
KIND_FEATURES = _PHOTO_ROWS * len(SurfaceClass) + 3 * _AROUND_ROWS
_DARKEST = 0.02  # of the mean luminance around, that counts in a logarithm


def kind_features(segments: Segments, surroundings: NDArray[np.float32]) -> Floats:
    """By what a place's kind is told (F,): square roots of shares of the classes, logarithms of rings of light.

    Args:
        segments: (R, C, classes) of the photo.
        surroundings: (R, 2R, 3) linear, any scale, what is around the camera.
    """
    edges = np.arange(_PHOTO_ROWS + 1) * len(segments) // _PHOTO_ROWS
    parts = [segments[low : max(high, low + 1)].mean(axis=(0, 1)) for low, high in pairwise(edges)]
    rings = surroundings.reshape(_AROUND_ROWS, -1, 3).mean(axis=1, dtype=np.float64)
    brightness = rings @ LUMINANCE_WEIGHTS
    log = np.log(rings / max(float(brightness.mean()), 1e-9) + _DARKEST)
    gray = log @ LUMINANCE_WEIGHTS
    return np.concatenate([np.sqrt(parts).ravel(), gray - gray.mean(), (log[:, ::2] - log[:, 1:2]).ravel()])


def kind_probability(features: Floats, weights: Floats) -> Floats:
    """Probabilities (..., K) of PLACE_KINDS.

    Args:
        features: (..., F) of `kind_features`.
        weights: (F + 1, K) of the classifier, the last row for 1.
    """
    logits = features @ weights[:-1] + weights[-1]
    odds = np.exp(logits - logits.max(axis=-1, keepdims=True))
    return np.asarray(odds / odds.sum(axis=-1, keepdims=True))

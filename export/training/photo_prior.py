"""How much lower the sun stands in photographs than in training crops, which show low and high suns more often.

The crops' density of elevations times exp(-elevation / scale) is fitted to the photos' elevations by likelihood. A
network trained on the crops answers for photographs once its probabilities are multiplied by the same factor.
"""

from pathlib import Path

import numpy as np

from export.crops.crops import Source, sampling_weights
from export.data.labels import read_labels_of
from export.data.panoramas import read_index
from export.data.photos import require_photo_rows
from lighting.geometry import Floats

SCALES = np.arange(20.0, 301.0, 5.0)  # deg, those tried


def describe_prior(data: Path, labels: Path) -> str:
    """The fitted scale in words, over places of the photos of `photos_train.csv`; DataError for data without any."""
    rows = require_photo_rows(data)
    panoramas = read_index(data, "train")
    sources = [Source(p, (), label) for p, label in zip(panoramas, read_labels_of(panoramas, labels), strict=True)]
    weights = sampling_weights(sources)
    crops = np.array([s.label.sun_elevation for s in sources], dtype=np.float64)
    seen = np.isfinite(crops)
    groups = np.array([row.group for row in rows])
    elevation = np.array([row.sun_elevation for row in rows])
    photos = np.array([elevation[groups == group].mean() for group in np.unique(groups)])
    scale, gain = _fit_scale(crops[seen], weights[seen], photos)
    return f"{len(photos)} scenes: exp(-elevation / {scale:g} deg), {gain:.3f} nat likelier than without"


def _fit_scale(crops: Floats, weights: Floats, photos: Floats) -> tuple[float, float]:
    """The scale [deg] and its gain in log likelihood per photo, from elevations of crops with weights and of photos."""
    share = weights / weights.sum()
    total = np.log(np.exp(-crops / SCALES[:, None]) @ share)
    likelihood = -photos.mean() / SCALES - total
    best = int(np.argmax(likelihood))
    return float(SCALES[best]), float(likelihood[best])

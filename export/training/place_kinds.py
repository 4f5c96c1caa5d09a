"""The classifier of places in the library of detail, by what `panoramas.csv` calls their scenes.

Views of the panoramas of `train` are described as photos are. A softmax regression tells their kinds apart, each place
and each kind counted by the root of its views. What it says of views of the library's own panoramas, and the kinds that
they are filed under, is written into the library beside it.
"""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from export.crops.crops import crop_rng
from export.data.detail_library import level_views, library_pictures, read_detail_library, write_detail_library
from export.data.panoramas import Panorama, read_index, read_linear_panorama, read_table
from lighting.color import tone_map
from lighting.envmap.appearance import PLACE_KINDS, kind_features, kind_probability
from lighting.envmap.detail_library import LIBRARY_PATH
from lighting.geometry import Floats, Pinhole, camera_directions, sample_latlong
from lighting.model import Model
from lighting.photo.reader import Photo, photo_from_array
from lighting.prediction import photo_segments

# Words of `scene` that name a kind; the first that is found counts. Views from the air are of no kind.
_WORDS = {
    "snow": "snow|ski|winter lake",
    "forest": r"\b(forest|wood|woods|jungle|grove)\b",
    "shore": r"beach|coast|shore|\bsea\b|lake|river|water|pier|harbou?r|pond|marina|bay|cove|ocean",
    "bare": "desert|dune|steppe|arid|oil well|quarry|mountain|peak|alp|summit|ridge|valley|canyon|rock",
    "garden": "garden|pool|resort|villa|patio|terrace|house|hotel",
    "city": "street|square|court|building|city|town|market|old|temple|church|plaza|lane|alley|castle|palace|monastery|"
    "school|museum|mosque|village|ruin|fort|car park|yard|site|factory|industrial|station|housing|road|highway|bridge",
    "meadow": "field|meadow|farm|savanna|lawn|golf|pasture|grass|vineyard|countryside",
    "park": "park|campus|cemetery|playground|zoo|stadium|sports",
}
_FROM_THE_AIR = r"\bair\b|aerial|puresky"
# What the kinds of the library are, of PLACE_KINDS.
_SHARES = {
    "waterfront": {"city": 0.5, "shore": 0.5},
    "parking": {"city": 0.6, "park": 0.4},
    "meadow": {"meadow": 0.8, "park": 0.2},
    "desert": {"bare": 1.0},
    "mountain": {"bare": 1.0},
}
_FILED = 0.5  # share of what a panorama is filed under, beside what is said of its views

_ROWS = 512  # of a panorama of which views are taken
_VIEWS = 3  # of each panorama, a third of a turn apart
_SIZES = ((384, 288), (288, 384), (384, 216), (216, 384))  # pixels
_ELEVATIONS = (-8.0, 15.0)  # deg
_FIELDS = (40.0, 75.0)  # deg, vertical
_BRIGHT, _QUANTILE = 0.9, 0.95  # exposure of HDR: this quantile becomes so bright
_DECAY = 0.03  # of the squared weights
_STEPS = 200


def fit_place_kinds(data: Path, model: Model) -> str:
    """Fit the classifier on `train`, write it into the library of detail, and return in words what it tells of `val`.

    Args:
        data: folder of panoramas, with the column `scene`.
        model: the network to ask.
    """
    scenes = {row["name"]: scene_kind(row["scene"]) for row in read_table(data / "panoramas.csv", ("name", "scene"))}
    (features, kinds, places), (others, truth, _) = (
        _describe([p for p in read_index(data, split) if scenes.get(p.name)], scenes, model)
        for split in ("train", "val")
    )
    weights = _fit(features, kinds, places)
    table, _, pictures = read_detail_library(LIBRARY_PATH)
    views = ((photo for _, photo in level_views(linear)) for linear in library_pictures(table, pictures))
    seen = np.stack([_describe_views(photos, model) for photos in views])  # (N, V, F)
    shares = [_SHARES.get(kind, {kind: 1.0}) for kind in table["kind"].tolist()]
    filed = np.array([[share.get(name, 0.0) for name in PLACE_KINDS] for share in shares])
    table["kinds"] = _FILED * filed + (1 - _FILED) * kind_probability(seen, weights).mean(axis=1)
    write_detail_library(LIBRARY_PATH, table, weights.astype(np.float32), pictures)
    said = kind_probability(others, weights)
    right, cost = (said.argmax(axis=1) == truth).mean(), -np.log(said[np.arange(len(truth)), truth]).mean()
    return (
        f"{LIBRARY_PATH}: {100 * right:.0f} % of {len(truth)} views of val are of their likeliest kind; {cost:.2f} nat."
    )


def scene_kind(scene: str) -> str | None:
    """The kind, of PLACE_KINDS, that a scene's words name; None: none.

    Args:
        scene: of a row of `panoramas.csv`.
    """
    scene = scene.lower()
    if re.search(_FROM_THE_AIR, scene):
        return None
    return next((kind for kind, words in _WORDS.items() if re.search(words, scene)), None)


def _describe(
    panoramas: Sequence[Panorama], scenes: dict[str, str | None], model: Model
) -> tuple[Floats, NDArray[np.intp], list[str]]:
    """Features (N, F) of views, the number of each view's kind (N,), and its place."""
    features = [_describe_views(_views(panorama), model) for panorama in panoramas]
    kinds = [PLACE_KINDS.index(scenes[p.name] or "") for p in panoramas]
    places = [p.place for p in panoramas for _ in range(_VIEWS)]
    return np.concatenate(features), np.repeat(kinds, _VIEWS).astype(np.intp), places


def _describe_views(views: Iterator[Photo], model: Model) -> Floats:
    """Features (V, F) of views."""
    rows = []
    for photo in views:
        predicted = model.predict_one(photo)
        segments = photo_segments(predicted.segments, photo.width, photo.height)
        assert segments is not None
        assert predicted.light is not None
        assert predicted.light.surroundings is not None
        rows.append(kind_features(segments, predicted.light.surroundings))
    return np.stack(rows)


def _views(panorama: Panorama) -> Iterator[Photo]:
    """Views of a panorama all around, of several shapes and fields of view."""
    rng = crop_rng(panorama.name, 0, "kinds")
    linear = read_linear_panorama(panorama, _ROWS)
    if panorama.kind == "hdr":
        bright = float(np.quantile(linear[_ROWS // 4 : -_ROWS // 4], _QUANTILE))
        linear = linear * np.float32(_BRIGHT / max(bright, 1e-6))
    linear, start = np.clip(linear, 0, 1), rng.uniform(0, 360)
    for number in range(_VIEWS):
        size, azimuth = _SIZES[rng.integers(len(_SIZES))], start + number * 360 / _VIEWS
        camera = Pinhole(*size, rng.uniform(*_FIELDS), azimuth, rng.uniform(*_ELEVATIONS))
        yield photo_from_array(tone_map(sample_latlong(linear, camera_directions(camera))))


def _fit(features: Floats, kinds: NDArray[np.intp], places: Sequence[str]) -> Floats:
    """Weights (F + 1, K) of the classifier."""
    mean, std = features.mean(axis=0), features.std(axis=0) + 1e-3
    x, y = torch.tensor((features - mean) / std), torch.tensor(kinds)
    views, members = Counter(places), np.bincount(kinds, minlength=len(PLACE_KINDS))
    counts = np.array([views[place] for place in places]) * members[kinds]
    share = torch.tensor(counts**-0.5 / (counts**-0.5).sum())
    weight = nn.Parameter(torch.zeros(x.shape[1], len(PLACE_KINDS), dtype=x.dtype))
    bias = nn.Parameter(torch.zeros(len(PLACE_KINDS), dtype=x.dtype))
    optimizer: Any = torch.optim.LBFGS([weight, bias], max_iter=_STEPS, line_search_fn="strong_wolfe")

    def cost() -> torch.Tensor:
        optimizer.zero_grad()
        loss = share @ nn.functional.cross_entropy(x @ weight + bias, y, reduction="none")
        total = loss + _DECAY * (weight**2).sum()
        torch.autograd.backward(total)
        return total

    optimizer.step(cost)
    slope = weight.detach().numpy() / std[:, None]
    return np.concatenate([slope, (bias.detach().numpy() - mean @ slope)[None]])

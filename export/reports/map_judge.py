"""Does a network that has seen the world tell maps from real panoramas, and does it see the photo's edges?

The judge is the whole vision transformer of `export.networks.vision_transformer`. The other figures of `report
map-detail` come about by EfficientNet-Lite0, whose family is trained here.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from export.evaluation.metrics import figures_table
from export.networks.vision_transformer import VisionTransformer, class_tokens, load_wheel
from export.reports.map_detail import (
    CROP_FOV,
    CROP_HEIGHT,
    CROP_WIDTH,
    VIEW_AZIMUTHS,
    VIEW_FOV,
    VIEW_PIXELS,
    distances_by_places,
    draw_camera,
    looked_at,
    prepare_views,
    read_view,
    render_detail,
)
from lighting.color import srgb_bytes
from lighting.geometry import Floats, Pinhole, camera_directions, sample_latlong
from lighting.model import Model

_KINDS = {"frame": slice(0, 3), "far": slice(3, 6), "ball": slice(6, 7)}
JUDGE_NOTE = (
    "A vision transformer's kernel distance x 1000 from true panoramas of other places, with its standard deviation. "
    "`frame`: views with the photo's left, right and upper edge in their middle; `far`: at 90, 180 and -90 deg; "
    "`ball`: a mirror ball. `nearer`: the share of draws of places in which it is less than that of earlier maps."
)

_DRAWS = 200  # of halves of the places
_FILE = "judged.npz"  # in the cache: features and places

Features = Callable[[NDArray[np.uint8]], Floats]


def judged_views(image: NDArray[np.float32], elevation: float) -> NDArray[np.uint8]:
    """What is judged of a map: views (7, VIEW_PIXELS, VIEW_PIXELS, 3), sRGB, in the order of _KINDS.

    Args:
        image: (H, 2H, 3) linear, with the photo's camera at azimuth 0.
        elevation: deg, that camera's elevation.
    """
    side = float(np.degrees(np.arctan(np.tan(np.radians(CROP_FOV / 2)) * CROP_WIDTH / CROP_HEIGHT)))
    edges = [(-side, elevation), (side, elevation), (0.0, elevation + CROP_FOV / 2)]
    aims = [*edges, *((azimuth, 0.0) for azimuth in VIEW_AZIMUTHS)]
    cameras = [Pinhole(VIEW_PIXELS, VIEW_PIXELS, VIEW_FOV, azimuth=a, elevation=e) for a, e in aims]
    views = [srgb_bytes(sample_latlong(np.clip(image, 0, 1), camera_directions(camera))) for camera in cameras]
    return np.stack([*views, np.round(255 * looked_at(image)[0]).astype(np.uint8)])


def _judge_features() -> Features:
    """A function that takes pictures (N, S, S, 3), sRGB, to their class tokens (N, F), all of one length.

    Raises:
        DataError: the network's wheel is not installed.
    """
    network = VisionTransformer().eval()
    load_wheel(network)

    def features(pictures: NDArray[np.uint8]) -> Floats:
        tokens = class_tokens(network, pictures).astype(np.float64)
        return np.asarray(tokens * (np.sqrt(tokens.shape[1]) / np.linalg.norm(tokens, axis=1, keepdims=True)))

    return features


def report_map_judge(data: Path, model: Model, count: int, split: str, cache: Path, earlier: Path | None = None) -> str:
    """A table in Markdown: a row for true panoramas, for maps, and for earlier maps of the same crops.

    Args:
        data: folder of panoramas.
        model: the network to ask.
        count: crops, as that of `report_map_detail`.
        split: likewise.
        cache: likewise; it gets a file with the features, which is `earlier` to a later run.
        earlier: such a file; None: no pairs.
    """
    features = _judge_features()
    panoramas, files = prepare_views(data, model, count, split, cache)
    found: dict[str, list[Floats]] = {"true": [], "maps": []}
    for file, panorama in zip(files, panoramas, strict=True):
        view, look = read_view(file), partial(judged_views, elevation=draw_camera(panorama)[1])
        kept = file.with_suffix(".judged.npy")
        if not kept.exists():
            np.save(kept, features(look(view.truth)))
        found["true"].append(np.load(kept))
        found["maps"].append(features(look(render_detail(view.lighting, view.context))))
    stacked = {name: np.stack(one) for name, one in found.items()}
    names = np.array([panorama.name for panorama in panoramas])
    places = np.array([panorama.place for panorama in panoramas])
    if earlier is not None:
        with np.load(earlier) as stored:
            order = [stored["names"].tolist().index(name) for name in names]
            stacked["earlier maps"] = stored["maps"][order]
    np.savez_compressed(cache / _FILE, names=names, places=places, true=stacked["true"], maps=stacked["maps"])
    rows: dict[str, dict[str, float]] = {name: {} for name in stacked}
    for kind, views in _KINDS.items():
        true = stacked["true"][:, views]
        drawn = {name: distances_by_places(one[:, views], true, places, _DRAWS) for name, one in stacked.items()}
        for name, distances in drawn.items():
            rows[name] |= {kind: float(distances.mean()), f"{kind} +-": float(distances.std())}
        if earlier is not None:  # the share of draws of places in which maps are nearer to true panoramas
            share = float(np.mean(drawn["maps"] < drawn["earlier maps"]))
            rows.setdefault("nearer", {}).update({kind: share, f"{kind} +-": float("nan")})
    return f"## Judged by a network\n\n{JUDGE_NOTE}\n\n{figures_table(rows, digits=2)}"

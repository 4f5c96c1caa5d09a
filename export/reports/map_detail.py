"""What the detail around a map is worth: maps of crops of panoramas against the panoramas, outside the crop's frame.

Estimates and truths are kept in a folder, so that a second run renders and measures alone.
"""

import io
import json
import random
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from export.data.detail_library import balance_library
from export.data.panoramas import Panorama, linearize, read_index, read_picture
from export.evaluation import map_quality
from export.evaluation.map_quality import MapErrors
from export.evaluation.metrics import figures_table
from lighting.color import luminance, tone_map
from lighting.envmap.detail import DetailSource, PhotoFeatures
from lighting.envmap.detail_library import LIBRARY_PATH, cheapest_choice, choice_costs
from lighting.envmap.latlong import shrink_envmap
from lighting.envmap.projection import project_photo
from lighting.envmap.relighting import rotate_envmap
from lighting.envmap.surroundings import PhotoContext, describe_place, render_with_surroundings
from lighting.estimator import Estimator
from lighting.files.exr import write_exr
from lighting.fusion.user_input import UserInput
from lighting.geometry import Floats, Pinhole, camera_directions, sample_latlong
from lighting.model import Model
from lighting.photo.reader import photo_from_array
from lighting.records import Lighting
from lighting.segmentation import packaged_segmenter

MAP_ROWS = 512
CROP_WIDTH, CROP_HEIGHT, CROP_FOV = 800, 600, 60.0  # pixels; deg, vertical

_TRIED = 7  # panoramas of the library for each crop, the cheapest
_SEEN_CROPS = 100  # of those by which panoramas are chosen, whose maps are looked at
_UNLIKE_COST = 0.04  # of a thousandth by which a map's views are unlike true ones
_FEW = 5  # maps with a panorama, beside which those of its own count half

DETAIL_NOTE = (
    "`KID`: kernel inception distance x 1000 of mirror balls, and of views at 90, 180 and -90 deg, to those of true "
    "panoramas of other places. `mirror`, `roughness`: relative RMSE of balls, clipped to what a screen shows; "
    "`angle`: of the mirror ball's colors [deg]; `diffuse`: scale-invariant RMSE. `repetition`: best correlation of a "
    "window of 24 deg elsewhere. `ball changed`: change of a diffuse ball against the map without detail [%], the mean "
    "over maps, and the share of maps [%] under 1 %. `second sun`: brightest 2 deg patch of the sky away from sun and "
    "photo over that without detail, at 90 % of maps. `CPU`: ms of one map, the median. `EXR`: MB."
)

Render = Callable[[Lighting, PhotoContext], NDArray[np.float32]]
Features = Callable[[list[NDArray[np.float32]]], Floats]


@dataclass(frozen=True, eq=False)
class _TrueView:
    """A crop of a panorama, what is estimated of it, and the panorama as its map should be."""

    place: str
    lighting: Lighting
    context: PhotoContext
    truth: NDArray[np.float32]  # (MAP_ROWS, 2 MAP_ROWS, 3) linear, 0 to 1


@dataclass(frozen=True, eq=False)
class _Looks:
    """Figures of one way to make maps of N views."""

    features: Floats  # (N, V, F)
    errors: list[MapErrors]
    changes: list[float]  # of a diffuse ball
    suns: list[float]
    seconds: list[float]
    bytes: list[int]


def report_map_detail(data: Path, model: Model, count: int, split: str, cache: Path) -> str:
    """Tables in Markdown: a row each for true panoramas, maps without detail and maps with it.

    Args:
        data: folder of panoramas.
        model: the network to ask.
        count: crops, each of another panorama, of as many places as there are.
        split: "val", or "train" to develop on.
        cache: folder for estimates and truths.
    """
    panoramas, files = _prepare_views(data, model, count, split, cache)
    features = _imagenet_features()
    looks = {"true panorama": _measure_truth(files, panoramas, features)}
    for name, render in METHODS.items():
        looks[name] = _measure_maps(_read_views(files, panoramas), render, features)
    places = np.array([panorama.place for panorama in panoramas])
    return _format_looks(looks, places)


def balance_detail(data: Path, model: Model, count: int, cache: Path) -> str:
    """Write into the library of detail what its panoramas cost, by crops of `train`; what it then is, in a sentence.

    A panorama costs the more the less real maps with it look, and what keeps it from being chosen too often.

    Args:
        data: folder of panoramas.
        model: the network to ask.
        count: crops, each of another panorama.
        cache: folder for estimates and truths.
    """
    panoramas, files = _prepare_views(data, model, count, "train", cache)
    cheapest = np.stack([_place_costs(view)[1].min(axis=(0, 2)) for view in _read_views(files, panoramas)])
    features, seen, seen_files = _imagenet_features(), panoramas[:_SEEN_CROPS], files[:_SEEN_CROPS]
    true = _measure_truth(seen_files, seen, features).features[:, 1:]
    order = np.argsort(cheapest + balance_library(cheapest[:_SEEN_CROPS]), axis=1, kind="stable")[:_SEEN_CROPS, :_TRIED]
    views = zip(_read_views(seen_files, seen), order, strict=True)
    looks = np.stack([_look_with(view, indices, features) for view, indices in views])
    extra = balance_library(cheapest, _cost_of_unlike(order, looks, true, cheapest.shape[1]))
    with np.load(LIBRARY_PATH) as stored:
        arrays = {**stored, "cost": extra}
    np.savez_compressed(LIBRARY_PATH, allow_pickle=False, **arrays)
    used = np.bincount((cheapest + extra).argmin(axis=1))
    return f"{LIBRARY_PATH}: {np.count_nonzero(used)} of {len(extra)} panoramas suit {len(files)} crops."


def _place_costs(view: _TrueView) -> tuple[PhotoFeatures, Floats]:
    """By what the detail for a view is chosen, and what each choice costs (2, N, turns)."""
    found = describe_place(view.lighting, view.context)
    return found, choice_costs(found.target, found.weight, found.sun_azimuth, found.snow)


def _look_with(view: _TrueView, indices: NDArray[np.intp], features: Features) -> Floats:
    """Features (T, V, F) of a map's views with each of T panoramas of the library."""
    found, cost = _place_costs(view)
    looks = []
    for index in indices:
        others = np.arange(cost.shape[1])[:, None] != index
        source = DetailSource(cheapest_choice(np.where(others, np.inf, cost)), found.saturation)
        image = render_with_surroundings(view.lighting, replace(view.context, detail=True, source=source), MAP_ROWS)
        looks.append(features(map_quality.looked_at(image)[1:]))
    return np.stack(looks)


def _cost_of_unlike(order: NDArray[np.intp], looks: Floats, true: Floats, count: int) -> Floats:
    """What each of `count` panoramas costs by how unlike true views those of maps with it are.

    Args:
        order: (N, T) the panoramas that were tried for each crop, the cheapest first.
        looks: (N, T, V, F) features of the views of maps with them.
        true: (N, V, F) features of the true views.
        count: of panoramas.
    """
    size = looks.shape[-1]
    unlike = map_quality.tell_apart(looks.reshape(-1, size), looks[:, 0].reshape(-1, size), true.reshape(-1, size))
    total = np.bincount(order.reshape(-1), unlike.reshape(*looks.shape[:3]).mean(axis=2).reshape(-1), count)
    return _UNLIKE_COST * np.maximum(total / (np.bincount(order.reshape(-1), minlength=count) + _FEW), 0)


def _prepare_views(data: Path, model: Model, count: int, split: str, cache: Path) -> tuple[list[Panorama], list[Path]]:
    """Panoramas, and a file in the cache with a crop of each."""
    panoramas = _choose_views([p for p in read_index(data, split) if split == "val" or not _in_library(p)], count)
    files = [cache / f"{model.spec.name}-{model.spec.version}-{p.name}.npz" for p in panoramas]
    estimator = Estimator(model)
    for panorama, file in zip(panoramas, files, strict=True):
        if not file.exists():
            _write_view(panorama, estimator, file)
    return panoramas, files


def _imagenet_features() -> Features:
    """A function that takes N pictures (S, S, 3), sRGB 0 to 1, to their features (N, 1280) by EfficientNet-Lite0."""
    import torch

    from export.networks.backbone import Backbone, load_imagenet

    network = Backbone(drop_path=0.0)
    load_imagenet(network)
    network.eval()

    def features(pictures: list[NDArray[np.float32]]) -> Floats:
        batch = torch.from_numpy(np.stack(pictures).transpose(0, 3, 1, 2).astype(np.float32))
        with torch.no_grad():
            return np.asarray(network((batch * 255 - 127) / 128)[2].numpy(), dtype=np.float64)

    return features


def _render_plain(lighting: Lighting, context: PhotoContext) -> NDArray[np.float32]:
    return render_with_surroundings(lighting, replace(context, detail=False), MAP_ROWS)


def _render_detail(lighting: Lighting, context: PhotoContext) -> NDArray[np.float32]:
    return render_with_surroundings(lighting, replace(context, detail=True), MAP_ROWS)


METHODS: dict[str, Render] = {"without detail": _render_plain, "with detail": _render_detail}


def _in_library(panorama: Panorama) -> bool:
    """Whether the detail that ships may come from it."""
    return "poly haven" in panorama.licence.lower()


def _choose_views(panoramas: Sequence[Panorama], count: int) -> list[Panorama]:
    """Panoramas in a fixed order, one of each place first."""
    shuffled = list(panoramas)
    random.Random(7).shuffle(shuffled)
    earlier: dict[str, int] = {}
    rank = {}
    for panorama in shuffled:
        rank[panorama.name] = earlier[panorama.place] = earlier.get(panorama.place, -1) + 1
    return sorted(shuffled, key=lambda panorama: rank[panorama.name])[:count]


def _write_view(panorama: Panorama, estimator: Estimator, file: Path) -> None:
    """Crop a panorama and estimate its light; the camera is decided by the panorama's name alone."""
    rng = random.Random(panorama.name)
    yaw, pitch = rng.uniform(-180, 180), rng.uniform(-5, 12)
    linear = linearize(panorama, read_picture(panorama))
    crop = _crop(linear, yaw, pitch)
    gain = _exposure_gain(crop) if panorama.kind == "hdr" else 1.0
    photo = photo_from_array(tone_map(crop * gain))
    estimate = estimator(photo, UserInput(vertical_fov=CROP_FOV))
    truth = np.clip(shrink_envmap(rotate_envmap(linear, -yaw) * np.float32(gain), MAP_ROWS), 0, 1)
    if len(truth) < MAP_ROWS:
        planes = [Image.fromarray(np.ascontiguousarray(truth[..., c])) for c in range(3)]
        size = (2 * MAP_ROWS, MAP_ROWS)
        truth = np.stack([np.asarray(plane.resize(size, Image.Resampling.BILINEAR)) for plane in planes], axis=-1)
    file.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(
        file,
        photo=photo.pixels,
        coarse=estimate.surroundings if estimate.surroundings is not None else np.zeros(0, np.float32),
        truth=truth.astype(np.float16),
        lighting=json.dumps(estimate.lighting.to_dict()),
    )


def _crop(linear: NDArray[np.float32], yaw: float, pitch: float) -> NDArray[np.float32]:
    """A view (CROP_HEIGHT, CROP_WIDTH, 3), the mean of four samples a pixel."""
    camera = Pinhole(2 * CROP_WIDTH, 2 * CROP_HEIGHT, CROP_FOV, azimuth=yaw, elevation=pitch)
    fine = sample_latlong(linear, camera_directions(camera))
    return np.asarray(fine.reshape(CROP_HEIGHT, 2, CROP_WIDTH, 2, 3).mean(axis=(1, 3)), dtype=np.float32)


def _exposure_gain(crop: NDArray[np.float32]) -> float:
    """The factor that exposes a view for its bright parts, but no brighter than a mean of a quarter."""
    bright = luminance(crop)
    return min(0.9 / max(float(np.quantile(bright, 0.95)), 1e-6), 0.25 / max(float(bright.mean()), 1e-6))


def _read_views(files: Sequence[Path], panoramas: Sequence[Panorama]) -> Iterator[_TrueView]:
    for file, panorama in zip(files, panoramas, strict=True):
        with np.load(file) as stored:
            lighting = Lighting.from_dict(json.loads(str(stored["lighting"])))
            coarse = stored["coarse"] if stored["coarse"].size else None
            photo = stored["photo"]
            context = PhotoContext(photo, coarse, lighting.exposure, lighting, packaged_segmenter()(photo))
            yield _TrueView(panorama.place, lighting, context, stored["truth"].astype(np.float32))


def _measure_truth(files: Sequence[Path], panoramas: Sequence[Panorama], features: Features) -> _Looks:
    """The panoramas themselves; their features are kept beside them."""
    looks, errors = [], []
    for file, view in zip(files, _read_views(files, panoramas), strict=True):
        kept = file.with_suffix(".features.npy")
        if not kept.exists():
            np.save(kept, features(map_quality.looked_at(view.truth)))
        looks.append(np.load(kept))
        errors.append(map_quality.map_errors(view.truth, view.truth))
    zeros = [0.0] * len(files)
    return _Looks(np.stack(looks), errors, zeros, [1.0] * len(files), zeros, [0] * len(files))


def _measure_maps(views: Iterator[_TrueView], render: Render, features: Features) -> _Looks:
    looks = _Looks(np.zeros(0), [], [], [], [], [])
    found = []
    for view in views:
        started = time.process_time()
        image = render(view.lighting, view.context)
        looks.seconds.append(time.process_time() - started)
        plain = _render_plain(view.lighting, view.context)
        photo = project_photo(view.lighting, view.context.photo, MAP_ROWS)
        hidden = np.zeros(image.shape[:2], np.bool_)
        if photo is not None:
            hidden[photo.rows, photo.columns] = photo.whole.weight > 0
        sun = view.lighting.sun_direction if view.lighting.sun_painted else None
        looks.suns.append(map_quality.second_sun(image, plain, sun, hidden))
        looks.changes.append(map_quality.diffuse_change(image, plain))
        looks.errors.append(map_quality.map_errors(image, view.truth))
        found.append(features(map_quality.looked_at(image)))
        write_exr(stream := io.BytesIO(), image, view.lighting)
        looks.bytes.append(len(stream.getvalue()))
    return _Looks(np.stack(found), looks.errors, looks.changes, looks.suns, looks.seconds, looks.bytes)


def _format_looks(looks: dict[str, _Looks], places: NDArray[np.str_]) -> str:
    true = next(iter(looks.values()))
    rows = {name: _figures(one, true, places) for name, one in looks.items()}
    power = {name: _power_figures(one, true) for name, one in looks.items()}
    parts = [
        f"## Detail around maps of {len(places)} crops of {len(set(places.tolist()))} places",
        DETAIL_NOTE,
        figures_table(rows, digits=3),
        "Power at so many cycles per degree over that of true panoramas [dB], outside the photo's azimuths:",
        figures_table(power, digits=1),
    ]
    return "\n\n".join(parts)


def _figures(looks: _Looks, true: _Looks, places: NDArray[np.str_]) -> dict[str, float]:
    ball, ball_std = map_quality.distance_by_places(looks.features[:, :1], true.features[:, :1], places)
    view, view_std = map_quality.distance_by_places(looks.features[:, 1:], true.features[:, 1:], places)
    errors = {
        "mirror": "mirror",
        "angle": "mirror_angle",
        "roughness .2": "roughness_2",
        "roughness .4": "roughness_4",
        "diffuse": "diffuse",
        "repetition": "repetition",
    }
    changes = np.array(looks.changes)
    return {
        "KID ball": ball,
        "+-": ball_std,
        "KID views": view,
        "+- ": view_std,
        **{column: float(np.mean([getattr(e, name) for e in looks.errors])) for column, name in errors.items()},
        "ball changed": 100 * float(changes.mean()),
        "under 1 %": 100 * float(np.mean(changes < 0.01)),
        "second sun": float(np.quantile(looks.suns, 0.9)),
        "CPU": 1000 * float(np.median(looks.seconds)),
        "EXR": float(np.mean(looks.bytes)) / 1e6,
    }


def _power_figures(looks: _Looks, true: _Looks) -> dict[str, float]:
    names = [f"{band} {frequency:g}" for band in map_quality.BANDS for frequency in map_quality.FREQUENCIES]
    power, true_power = (np.nanmean([e.power for e in one.errors], axis=0) for one in (looks, true))
    return dict(zip(names, (power - true_power).tolist(), strict=True))

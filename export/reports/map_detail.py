"""What the detail around a map is worth: maps of crops of panoramas against the panoramas, outside the crop's frame.

Realism is the kernel inception distance (KID) [1] of a mirror ball and of perspective views to those of true panoramas.
It can be cheated by false light or by copies of the photo, so read it with the errors of lit balls [2] and with
repetition.

Estimates and truths are kept in a folder, so that a second run renders and measures alone.

References:
    [1] Binkowski et al., Demystifying MMD GANs, ICLR 2018.
    [2] Hold-Geoffroy et al., Deep outdoor illumination estimation, CVPR 2017.
"""

import io
import json
import random
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from export.crops.crops import resize
from export.data.detail_library import balance_library, read_detail_library, write_detail_library
from export.data.panoramas import Panorama, linearize, read_index, read_picture
from export.evaluation.metrics import figures_table
from export.evaluation.relighting import ball_normals, picture_plane, rgb_angle
from lighting.color import luminance, srgb_encode, tone_map
from lighting.envmap.detail_library import LIBRARY_PATH, choice_costs
from lighting.envmap.latlong import shrink_envmap
from lighting.envmap.projection import project_photo
from lighting.envmap.relighting import rotate_envmap
from lighting.envmap.surroundings import PhotoContext, describe_place, render_with_surroundings
from lighting.estimator import Estimator
from lighting.files.exr import write_exr
from lighting.fusion.user_input import UserInput
from lighting.geometry import (
    Floats,
    Pinhole,
    angle_between,
    camera_directions,
    latlong_angles,
    latlong_directions,
    latlong_solid_angle,
    sample_latlong,
)
from lighting.model import Model
from lighting.photo.reader import photo_from_array
from lighting.records import Lighting

# How like a real place a map looks, and how near objects in it come to the truth.

Images = NDArray[np.float32]

VIEW_PIXELS = 224  # along each side of a view
VIEW_AZIMUTHS = (90.0, 180.0, -90.0)  # deg, away from the photo
VIEW_FOV = 75.0  # deg
BANDS = {"sky": (15.0, 55.0), "horizon": (-12.0, 15.0), "ground": (-55.0, -15.0)}  # deg of elevation
FREQUENCIES = (0.07, 0.2, 0.58)  # cycles per degree

_SUPERSAMPLING = 2  # samples along each side of the mirror ball's pixels
_BALL_RIM = 0.98  # squared radius to which a ball is looked at
_LIGHT_ROWS = 96  # of the maps that light rough and diffuse balls
_LIT_PIXELS = 28  # along the side of the picture of a lit ball
_LOBE_WIDTHS = (3.2, 13.0)  # deg, of normal distributions around the mirror direction, for roughness 0.2 and 0.4
_HIDDEN = 40.0  # deg of azimuth to either side that the spectrum leaves out: the photo's
_OCTAVE = 2 ** (1 / 4)  # half width of a band of frequencies
_WINDOW = 24  # deg, of the piece that is sought elsewhere
_WINDOW_STARTS = range(60, 300, _WINDOW)  # deg from the seam
_APART = 20  # deg from which a piece is elsewhere
_REPETITION_ROWS = slice(72, 102)  # of 180: 18 deg above the horizon to 12 below
_REPETITION_BLUR = 12.0  # deg; what is coarser is left out
_LOG_OFFSET = 0.01  # linear value added before a logarithm
_PATCH_ROWS = 90  # rows of 2 deg
_SUN_REACH = 20.0  # deg around the sun where the sky may be bright
_SPLITS = 40  # of the places into halves


def _map_errors(image: Images, truth: Images) -> dict[str, float]:
    """The errors of a map by column of DETAIL_NOTE; both are clipped to what a screen shows.

    Args:
        image: (H, 2H, 3) linear.
        truth: as `image`.
    """
    shown, true = np.clip(image, 0, 1), np.clip(truth, 0, 1)
    rays = _mirror_directions(ball_normals(VIEW_PIXELS // 2, _BALL_RIM))
    ball, ball_true = sample_latlong(shown, rays), sample_latlong(true, rays)
    lit, lit_true = (_pool(one) for one in (shown, true))
    rough = [_relative_rms(matrix @ lit, matrix @ lit_true) for matrix in map(_lobe_matrix, _LOBE_WIDTHS)]
    return {
        "mirror": _relative_rms(ball, ball_true),
        "angle": float(rgb_angle(ball, ball_true).mean()),
        "roughness .2": rough[0],
        "roughness .4": rough[1],
        "diffuse": _scale_invariant_rms(_diffuse_matrix() @ lit, _diffuse_matrix() @ lit_true),
        "repetition": _repetition(shown),
    }


def _diffuse_change(image: Images, before: Images) -> float:
    """Share by which a diffuse ball changes, in the mean over its points and channels.

    Args:
        image: (H, 2H, 3) linear.
        before: as `image`.
    """
    lit, lit_before = (_diffuse_matrix() @ _pool(one) for one in (image, before))
    return float(np.mean(np.abs(lit - lit_before) / np.maximum(lit_before, 1e-6)))


def _second_sun(image: Images, before: Images, sun: Floats | None, hidden: NDArray[np.bool_]) -> float:
    """The brightest 2 deg patch of the sky of a map over that of the map before, away from sun and photo.

    Args:
        image: (H, 2H, 3) linear.
        before: as `image`.
        sun: (3,) unit vector; None without a sun.
        hidden: (H, 2H) where the photo is.
    """
    directions = latlong_directions(_PATCH_ROWS)[: _PATCH_ROWS // 2]
    away = shrink_envmap(hidden[..., None].astype(np.float32), _PATCH_ROWS)[: len(directions), :, 0] == 0
    if sun is not None:
        away &= angle_between(directions, sun) > _SUN_REACH
    bright, bright_before = (
        float(luminance(shrink_envmap(one, _PATCH_ROWS)[: len(directions)])[away].max()) for one in (image, before)
    )
    return bright / max(bright_before, 1e-6)


def _repetition(image: Images) -> float:
    """Mean of the best correlation of windows of 24 deg at the horizon with others, shifted or flipped.

    Args:
        image: (H, 2H, 3) linear, 0 to 1; 180 rows at least.
    """
    log = shrink_envmap(np.log(luminance(image) + _LOG_OFFSET)[..., None].astype(np.float32), 180)[..., 0]
    fine = log[_REPETITION_ROWS]
    band = fine - _blur_band(fine, _REPETITION_BLUR)
    columns = (np.arange(360)[:, None] + np.arange(_WINDOW)) % 360
    windows = np.moveaxis(band[:, columns], 1, 0)  # (360, R, W)
    flipped = _standardize(windows[..., ::-1].reshape(360, -1))
    plain = _standardize(windows.reshape(360, -1))
    best = []
    for start in _WINDOW_STARTS:
        distance = np.abs((np.arange(360) - start + 180) % 360 - 180)
        correlation = np.maximum(plain @ plain[start], flipped @ plain[start])
        best.append(float(correlation[distance >= _APART].max()))
    return float(np.mean(best))


def _blur_band(band: Floats, deg: float) -> Floats:
    """A band (R, 360) of rows and columns of a degree, blurred; columns wrap and rows are reflected."""
    rows = np.concatenate([band[::-1], band, band[::-1]])
    kernels = [np.exp(-0.5 * (np.fft.fftfreq(n, 1 / n) / deg) ** 2) for n in rows.shape]
    spectrum = np.fft.fft2(rows) * np.outer(*(np.fft.fft(k / k.sum()) for k in kernels))
    return np.asarray(np.fft.ifft2(spectrum).real[len(band) : 2 * len(band)])


def _standardize(windows: Floats) -> Floats:
    """Windows (N, P) of mean 0 and length 1; zeros where they have no contrast."""
    centered = windows - windows.mean(axis=1, keepdims=True)
    length = np.linalg.norm(centered, axis=1, keepdims=True)
    return np.asarray(np.where(length > 1e-3, centered / np.maximum(length, 1e-9), 0.0))


def _band_power(image: Images) -> list[float]:
    """Power [dB] along the rows of the logarithm of luminance, by BANDS and FREQUENCIES, without the photo's columns.

    Args:
        image: (H, 2H, 3) linear, 0 to 1; 180 rows at least.
    """
    height = len(image)
    azimuth, elevation = latlong_angles(height)
    log = np.roll(np.log(luminance(image) + _LOG_OFFSET), height, axis=1)  # what lies behind the camera in the middle
    kept = np.roll(np.abs(azimuth) >= _HIDDEN, height)
    log = log[:, kept]
    window = np.hanning(log.shape[1])
    levels = []
    for low, high in BANDS.values():
        rows = (elevation > low) & (elevation < high)
        values = (log[rows] - log[rows].mean(axis=1, keepdims=True)) * window
        power = np.abs(np.fft.rfft(values, axis=1)) ** 2 / np.sum(window**2)
        level = np.cos(np.radians(elevation[rows]))[:, None]
        frequency = np.fft.rfftfreq(log.shape[1], 180.0 / height)[None] / level
        for center in FREQUENCIES:
            inside = (frequency > center / _OCTAVE) & (frequency < center * _OCTAVE)
            levels.append(float(10 * np.log10(power[inside].mean() + 1e-12)) if inside.any() else float("nan"))
    return levels


def looked_at(image: Images) -> list[Images]:
    """What is looked at of a map: a mirror ball and views at VIEW_AZIMUTHS, sRGB 0 to 1, VIEW_PIXELS square.

    Args:
        image: (H, 2H, 3) linear.
    """
    shown = np.clip(image, 0, 1)
    ball = sample_latlong(shown, _mirror_directions(ball_normals(VIEW_PIXELS * _SUPERSAMPLING)))
    ball = ball.reshape(VIEW_PIXELS, _SUPERSAMPLING, VIEW_PIXELS, _SUPERSAMPLING, 3).mean(axis=(1, 3))
    x, y = picture_plane(VIEW_PIXELS)
    cameras = [Pinhole(VIEW_PIXELS, VIEW_PIXELS, VIEW_FOV, azimuth) for azimuth in VIEW_AZIMUTHS]
    views = [ball * (x**2 + y**2 < _BALL_RIM)[..., None]]
    views += [sample_latlong(shown, camera_directions(camera)) for camera in cameras]
    return [np.asarray(srgb_encode(np.maximum(view, 0)), dtype=np.float32) for view in views]


def _kernel_distance(features: Floats, true: Floats) -> float:
    """KID x 1000 of two sets of features, without bias.

    Args:
        features: (N, F).
        true: (M, F).
    """
    n, m = len(features), len(true)
    own, others = _kernel(features, features), _kernel(true, true)
    within = (own.sum() - np.trace(own)) / (n * (n - 1)) + (others.sum() - np.trace(others)) / (m * (m - 1))
    return float(1000 * (within - 2 * _kernel(features, true).mean()))


def _kernel(a: Floats, b: Floats) -> Floats:
    """The kernel (N, M) of features (N, F) and (M, F)."""
    return np.asarray((a @ b.T / a.shape[1] + 1) ** 3)


def distances_by_places(features: Floats, true: Floats, places: NDArray[np.str_], draws: int = _SPLITS) -> Floats:
    """KID x 1000 (draws,) between maps of half of the places and panoramas of the other half.

    Args:
        features: (N, V, F) of V views of each map.
        true: as `features`, of the panoramas.
        places: (N,) names.
        draws: of halves.
    """
    rng, names = np.random.default_rng(0), np.unique(places)
    distances = []
    for _ in range(draws):
        half = np.isin(places, rng.permutation(names)[: len(names) // 2])
        flat = [chosen.reshape(-1, features.shape[-1]) for chosen in (features[half], true[~half])]
        distances.append(_kernel_distance(*flat))
    return np.array(distances)


def _relative_rms(values: Floats, true: Floats) -> float:
    return float(np.sqrt(np.mean((values - true) ** 2) / np.mean(true**2)))


def _scale_invariant_rms(values: Floats, true: Floats) -> float:
    scale = np.sum(values * true) / max(float(np.sum(values**2)), 1e-12)
    return _relative_rms(scale * values, true)


def _pool(image: Images) -> Images:
    """The pixels (P, 3) of a map at _LIGHT_ROWS."""
    return np.asarray(shrink_envmap(image, _LIGHT_ROWS).reshape(-1, 3), dtype=np.float32)


@lru_cache(maxsize=3)
def _lobe_matrix(width: float) -> Images:
    """Shares (B, P) of the pixels of a map in the light of a glossy ball's points."""
    concentration = np.radians(width) ** -2
    mirrored = _mirror_directions(ball_normals(_LIT_PIXELS, _BALL_RIM))
    return _light_matrix(mirrored, lambda cosine: np.exp(concentration * (cosine - 1)))


@lru_cache(maxsize=1)
def _diffuse_matrix() -> Images:
    """The same of a diffuse ball's points."""
    return _light_matrix(ball_normals(_LIT_PIXELS, _BALL_RIM), lambda cosine: np.maximum(cosine, 0))


def _light_matrix(directions: Floats, lobe: Callable[[Floats], Floats]) -> Images:
    rays = latlong_directions(_LIGHT_ROWS).reshape(-1, 3).astype(np.float32)
    weight = lobe(directions.astype(np.float32) @ rays.T) * np.repeat(latlong_solid_angle(_LIGHT_ROWS), 2 * _LIGHT_ROWS)
    return np.asarray(weight / weight.sum(axis=1, keepdims=True), dtype=np.float32)


def _mirror_directions(normals: Floats) -> Floats:
    """Where (..., 3) a distant camera looks by a mirror with normals (..., 3)."""
    return np.asarray(2 * normals[..., 2:] * normals - np.array([0.0, 0.0, 1.0]))


# The report.

MAP_ROWS = 512
CROP_WIDTH, CROP_HEIGHT, CROP_FOV = 800, 600, 60.0  # pixels; deg, vertical

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

    lighting: Lighting
    context: PhotoContext
    truth: NDArray[np.float32]  # (MAP_ROWS, 2 MAP_ROWS, 3) linear, 0 to 1


@dataclass(frozen=True, eq=False)
class _Looks:
    """How the maps of N views look that are made in one way."""

    features: Floats  # (N, V, F)
    figures: dict[str, Floats]  # by column (N,)
    power: Floats  # (N, B) dB, by BANDS and FREQUENCIES


def report_map_detail(data: Path, model: Model, count: int, split: str, cache: Path) -> str:
    """Tables in Markdown: a row each for true panoramas, maps without detail and maps with it.

    Args:
        data: folder of panoramas.
        model: the network to ask.
        count: crops, each of another panorama, of as many places as there are.
        split: "val", or "train" to develop on.
        cache: folder for estimates and truths.
    """
    panoramas, files = prepare_views(data, model, count, split, cache)
    features = _imagenet_features()
    looks = {"true panorama": _collect(_measure_truth(file, features) for file in files)}
    for name, render in METHODS.items():
        looks[name] = _collect(_measure_map(file, render, features) for file in files)
    places, true = np.array([panorama.place for panorama in panoramas]), looks["true panorama"]
    parts = [
        f"## Detail around maps of {len(places)} crops of {len(np.unique(places))} places",
        DETAIL_NOTE,
        figures_table({name: _figures(one, true, places) for name, one in looks.items()}, digits=3),
        "Power at so many cycles per degree over that of true panoramas [dB], outside the photo's azimuths:",
        figures_table({name: _power_figures(one, true) for name, one in looks.items()}, digits=1),
    ]
    return "\n\n".join(parts)


def balance_detail(data: Path, model: Model, count: int, cache: Path) -> str:
    """Write into the library of detail what its panoramas cost, by crops of `train`; what it then is, in a sentence.

    Args:
        data: folder of panoramas.
        model: the network to ask.
        count: crops, each of another panorama.
        cache: folder for estimates and truths.
    """
    _, files = prepare_views(data, model, count, "train", cache)
    found = [describe_place(view.lighting, view.context) for view in map(read_view, files)]
    costs = [choice_costs(one).min(axis=(0, 2)) for one in found]
    table, weights, pictures = read_detail_library(LIBRARY_PATH)
    table["cost"] = balance_library(np.stack(costs))
    write_detail_library(LIBRARY_PATH, table, weights, pictures)
    used = np.bincount((np.stack(costs) + table["cost"]).argmin(axis=1))
    return (
        f"{LIBRARY_PATH}: {np.count_nonzero(used)} of {len(table)} panoramas suit {len(files)} crops, "
        f"one of them up to {used.max()}."
    )


def prepare_views(data: Path, model: Model, count: int, split: str, cache: Path) -> tuple[list[Panorama], list[Path]]:
    """Panoramas, and a file in the cache with a crop of each.

    Args:
        data: folder of panoramas.
        model: the network to ask.
        count: crops, each of another panorama.
        split: "val" or "train".
        cache: folder for estimates and truths.
    """
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


def render_detail(lighting: Lighting, context: PhotoContext) -> NDArray[np.float32]:
    """The map of a crop with detail.

    Args:
        lighting: of the crop.
        context: its photo.
    """
    return render_with_surroundings(lighting, replace(context, detail=True), MAP_ROWS)


METHODS: dict[str, Render] = {"without detail": _render_plain, "with detail": render_detail}


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


def draw_camera(panorama: Panorama) -> tuple[float, float]:
    """The azimuth and the elevation [deg] of a panorama's crop, which its name alone decides.

    Args:
        panorama: a row of the index.
    """
    rng = random.Random(panorama.name)
    return rng.uniform(-180, 180), rng.uniform(-5, 12)


def _write_view(panorama: Panorama, estimator: Estimator, file: Path) -> None:
    """Crop a panorama and estimate its light."""
    yaw, elevation = draw_camera(panorama)
    linear = linearize(panorama, read_picture(panorama))
    crop = crop_view(linear, yaw, elevation)
    gain = exposure_gain(crop) if panorama.kind == "hdr" else 1.0
    photo = photo_from_array(tone_map(crop * gain))
    estimate = estimator(photo, UserInput(vertical_fov=CROP_FOV))
    truth = np.clip(shrink_envmap(rotate_envmap(linear, -yaw) * np.float32(gain), MAP_ROWS), 0, 1)
    truth = resize(truth, 2 * MAP_ROWS, MAP_ROWS, Image.Resampling.BILINEAR)
    answers = {"coarse": estimate.surroundings, "segments": estimate.segments}
    stated: dict[str, Any] = {name: values for name, values in answers.items() if values is not None}
    record = json.dumps(estimate.lighting.to_dict())
    file.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(file, photo=photo.pixels, truth=truth.astype(np.float16), lighting=record, **stated)


def crop_view(linear: NDArray[np.float32], yaw: float, elevation: float) -> NDArray[np.float32]:
    """A view (CROP_HEIGHT, CROP_WIDTH, 3) of a panorama, the mean of four samples a pixel.

    Args:
        linear: (H, 2H, 3), the panorama.
        yaw: deg, the azimuth to which the camera looks.
        elevation: deg, its elevation.
    """
    camera = Pinhole(2 * CROP_WIDTH, 2 * CROP_HEIGHT, CROP_FOV, azimuth=yaw, elevation=elevation)
    fine = sample_latlong(linear, camera_directions(camera))
    return np.asarray(fine.reshape(CROP_HEIGHT, 2, CROP_WIDTH, 2, 3).mean(axis=(1, 3)), dtype=np.float32)


def exposure_gain(crop: NDArray[np.float32]) -> float:
    """The factor that exposes a view for its bright parts, but no brighter than a mean of a quarter.

    Args:
        crop: (..., 3) linear.
    """
    bright = luminance(crop)
    return min(0.9 / max(float(np.quantile(bright, 0.95)), 1e-6), 0.25 / max(float(bright.mean()), 1e-6))


def read_view(file: Path) -> _TrueView:
    """A crop that `prepare_views` wrote.

    Args:
        file: of it.
    """
    with np.load(file) as stored:
        lighting = Lighting.from_dict(json.loads(str(stored["lighting"])))
        coarse, segments = (stored.get(name) for name in ("coarse", "segments"))
        context = PhotoContext(stored["photo"], coarse, lighting.exposure, lighting, segments)
        return _TrueView(lighting, context, stored["truth"].astype(np.float32))


# Of one view: its features (V, F), its figures by column, and its power.
_Measured = tuple[Floats, dict[str, float], list[float]]


def _collect(measured: Iterable[_Measured]) -> _Looks:
    features, figures, power = zip(*measured, strict=True)
    columns = {name: np.array([one[name] for one in figures]) for name in figures[0]}
    return _Looks(np.stack(features), columns, np.array(power))


def _measure_truth(file: Path, features: Features) -> _Measured:
    """A panorama itself; its features are kept beside it."""
    truth = read_view(file).truth
    kept = file.with_suffix(".features.npy")
    if not kept.exists():
        np.save(kept, features(looked_at(truth)))
    perfect = {"ball changed": 0.0, "second sun": 1.0, "CPU": 0.0, "EXR": 0.0}
    return np.load(kept), _map_errors(truth, truth) | perfect, _band_power(np.clip(truth, 0, 1))


def _measure_map(file: Path, render: Render, features: Features) -> _Measured:
    view = read_view(file)
    started = time.process_time()
    image = render(view.lighting, view.context)
    seconds = time.process_time() - started
    plain = _render_plain(view.lighting, view.context)
    photo = project_photo(view.lighting, view.context.photo, MAP_ROWS)
    hidden = np.zeros(image.shape[:2], np.bool_)
    hidden[photo.rows, photo.columns] = photo.whole.weight[..., 0] > 0
    sun = view.lighting.sun_direction if view.lighting.sun_painted else None
    write_exr(stream := io.BytesIO(), image, view.lighting)
    figures = {
        **_map_errors(image, view.truth),
        "ball changed": _diffuse_change(image, plain),
        "second sun": _second_sun(image, plain, sun, hidden),
        "CPU": seconds,
        "EXR": len(stream.getvalue()),
    }
    return features(looked_at(image)), figures, _band_power(np.clip(image, 0, 1))


def _figures(looks: _Looks, true: _Looks, places: NDArray[np.str_]) -> dict[str, float]:
    ball, view = (
        distances_by_places(looks.features[:, part], true.features[:, part], places)
        for part in (slice(1), slice(1, None))
    )
    columns = looks.figures
    changes = columns["ball changed"]
    return {
        "KID ball": float(ball.mean()),
        "+-": float(ball.std()),
        "KID views": float(view.mean()),
        "+- ": float(view.std()),
        **{name: float(values.mean()) for name, values in columns.items()},
        "ball changed": 100 * float(changes.mean()),
        "under 1 %": 100 * float(np.mean(changes < 0.01)),
        "second sun": float(np.quantile(columns["second sun"], 0.9)),
        "CPU": 1000 * float(np.median(columns["CPU"])),
        "EXR": float(np.mean(columns["EXR"])) / 1e6,
    }


def _power_figures(looks: _Looks, true: _Looks) -> dict[str, float]:
    names = [f"{band} {frequency:g}" for band in BANDS for frequency in FREQUENCIES]
    power, true_power = (np.nanmean(one.power, axis=0) for one in (looks, true))
    return dict(zip(names, (power - true_power).tolist(), strict=True))

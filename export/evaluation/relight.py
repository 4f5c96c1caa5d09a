"""Relighting error: a bumpy diffuse sphere on a plane, lit by the panorama itself and by what a photo of it told.

The measures of Hold-Geoffroy et al. (CVPR 2017): RMSE, scale-invariant RMSE, the angle between RGB vectors.
Light is linear, so one matrix takes any map to the picture; shadows are cast by the sphere, light bounces not at all.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from export.crops.crops import Crop, take
from export.data.labels import Label
from export.data.panoramas import read_index
from export.evaluation.evaluate import Scene, by_name, cameras
from export.evaluation.metrics import difference_interval, table
from export.training.train import labels_of, load_sources
from lighting.colour import tone_map
from lighting.decoding import lighting_from
from lighting.envmap import render, rotate
from lighting.files import replacing
from lighting.geometry import direction, latlong_directions, latlong_solid_angle
from lighting.model import Model
from lighting.photo import place
from lighting.records import Lighting, ModelSpec

Floats = NDArray[np.floating[Any]]

HEIGHT = 64  # rows of the maps that light the scene
SIZE = 64  # pixels of the square picture
HALF_WIDTH = 2.2  # of the view, in radii of the sphere
VIEW_ELEVATION = -25.0  # deg: the scene is seen from above
SPHERE_ALBEDO, PLANE_ALBEDO = 0.8, 0.5
BUMPS = ((7.0, 2.0, 3.0), (-4.0, 6.0, 5.0), (3.0, -8.0, 6.0), (9.0, 5.0, -4.0))  # wave vectors, per radius
BUMP_HEIGHT = 0.018  # radii, of each wave
SHOWN_WHITE = 0.9  # linear value at which the true picture's brightest parts are shown


@lru_cache(maxsize=1)
def transfer() -> NDArray[np.float32]:
    """Matrix (SIZE², 2 HEIGHT²) from a map's pixels to the radiance that the camera sees."""
    points, normals, smooth, albedo = scene_points()
    rays = latlong_directions(HEIGHT).reshape(-1, 3)
    solid_angle = np.repeat(latlong_solid_angle(HEIGHT), 2 * HEIGHT)
    seen = np.maximum(normals @ rays.T, 0) * (smooth @ rays.T > 0) * ~_shadowed(points, rays)
    return np.asarray(albedo[:, None] / np.pi * seen * solid_angle, dtype=np.float32)


def scene_points() -> tuple[Floats, Floats, Floats, Floats]:
    """What each pixel sees: points (P, 3), bumpy and smooth normals (P, 3), albedo (P,).

    The unit sphere at the origin stands on the plane y = -1.
    """
    forward = direction(0.0, VIEW_ELEVATION)
    right, up = np.array([1.0, 0.0, 0.0]), direction(0.0, VIEW_ELEVATION + 90)
    steps = ((np.arange(SIZE) + 0.5) / SIZE * 2 - 1) * HALF_WIDTH
    start = (steps[None, :, None] * right - steps[:, None, None] * up).reshape(-1, 3) - 10 * forward
    along = start @ forward
    discriminant = along**2 - (np.sum(start**2, axis=1) - 1)
    on_sphere = discriminant > 0
    distance = np.where(on_sphere, -along - np.sqrt(np.maximum(discriminant, 0)), (-1 - start[:, 1]) / forward[1])
    points = start + distance[:, None] * forward
    smooth = np.where(on_sphere[:, None], points, [0.0, 1.0, 0.0])
    bumpy = np.where(on_sphere[:, None], _bumpy(points), smooth)
    return points, bumpy, smooth, np.where(on_sphere, SPHERE_ALBEDO, PLANE_ALBEDO)


def _bumpy(points: Floats) -> Floats:
    """Normals of the unit sphere with waves on it: the smooth ones less the waves' tangential slope."""
    waves = np.array(BUMPS)
    slope = BUMP_HEIGHT * np.cos(points @ waves.T) @ waves
    normals = points - (slope - np.sum(slope * points, axis=1, keepdims=True) * points)
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def _shadowed(points: Floats, rays: Floats) -> NDArray[np.bool_]:
    """Which rays (R, 3) from points (P, 3) on the plane hit the sphere; on the sphere itself none do."""
    along = points @ rays.T
    outside = np.sum(points**2, axis=1, keepdims=True) - 1
    return np.asarray((along < 0) & (along**2 > outside) & (outside > 1e-6))


def picture(light: Floats) -> Floats:
    """The scene (SIZE, SIZE, 3) under a map of any even height that HEIGHT divides or equals."""
    return np.asarray(transfer() @ pooled(light).reshape(-1, 3).astype(np.float32)).reshape(SIZE, SIZE, 3)


def pooled(light: Floats) -> Floats:
    """A map (H, 2H, 3) at HEIGHT rows; means by solid angle, so that the sun keeps its power."""
    factor = light.shape[0] // HEIGHT
    weight = latlong_solid_angle(light.shape[0])[:, None, None]
    blocks = (light * weight).reshape(HEIGHT, factor, 2 * HEIGHT, factor, 3).sum(axis=(1, 3))
    return np.asarray(blocks / (factor * weight.reshape(HEIGHT, factor, 1).sum(axis=1)[..., None]))


def errors(truth: Floats, estimate: Floats) -> tuple[float, float, float]:
    """RMSE, RMSE after the best scale, and the mean angle [deg] between RGB vectors."""
    scale = np.sum(truth * estimate) / max(float(np.sum(estimate**2)), 1e-12)
    lengths = np.linalg.norm(truth, axis=-1) * np.linalg.norm(estimate, axis=-1)
    cosine = np.sum(truth * estimate, axis=-1) / np.maximum(lengths, 1e-12)
    angle = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    return _rms(truth - estimate), _rms(truth - scale * estimate), float(angle.mean())


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


@dataclass(frozen=True)
class Views:
    """Crops with the light that was truly there: maps (HEIGHT, 2 HEIGHT, 3) in each crop's exposure and orientation."""

    scene: Scene
    crops: list[Crop]
    truth: list[Floats]
    panorama: NDArray[np.str_]


def views(data: Path, labels: Path, spec: ModelSpec) -> Views:
    """Paper-protocol crops of the `val` HDR panoramas whose sun is not clipped."""
    panoramas = [p for p in read_index(data, "val") if p.kind == "hdr" and p.sun == "visible"]
    scene = cameras(load_sources(panoramas, labels), "paper")
    crops = [take(source, camera, spec) for source, camera in scene.crops]
    truth = [
        pooled(rotate(source.levels[0], -camera.azimuth)) * crop.gain
        for (source, camera), crop in zip(scene.crops, crops, strict=True)
    ]
    return Views(scene, crops, truth, np.array([source.panorama.name for source, _ in scene.crops]))


def estimated(model: Model, scene: Scene) -> list[Floats]:
    """The maps that a network's answers render to."""
    crops = [take(source, camera, model.spec) for source, camera in scene.crops]
    said = [model.predict(place(tone_map(c.linear), model.spec)[None])[0] for c in crops]
    return [np.asarray(render(lighting_from(p), HEIGHT)) for p in said]


def mean_sky(labels: Sequence[Label]) -> Floats:
    """The mean over training skies, whose azimuths say nothing: the same all around."""
    skies = [render(_lighting(label), HEIGHT, sun=label.direct == "yes") for label in labels]
    return np.asarray(np.mean(skies, axis=0).mean(axis=1, keepdims=True).repeat(2 * HEIGHT, axis=1))


def constant_skies(labels: Sequence[Label]) -> list[Floats]:
    """Skies straight ahead at several elevations, with and without the disc, at the training panoramas' medians."""
    turbidity, exposure = (float(np.median([getattr(la, key) for la in labels])) for key in ("turbidity", "exposure"))
    middle = replace(_lighting(labels[0]), turbidity=turbidity, exposure=exposure, sun_azimuth=0.0)
    heights = range(15, 90, 15)
    return [render(replace(middle, sun_elevation=float(h)), HEIGHT, sun=sun) for h in heights for sun in (True, False)]


def _lighting(label: Label) -> Lighting:
    """A label as the record that renders it."""
    return Lighting(label.sun_azimuth, max(label.sun_elevation, 0.0), label.turbidity, label.exposure)


def relight(data: Path, labels: Path, models: Sequence[Path], out: Path) -> str:
    """A table in Markdown of the networks (ours first) and of constant skies; writes relight.png into `out`."""
    loaded = by_name(list(map(Model.load, models)))
    shown = views(data, labels, next(iter(loaded.values())).spec)
    truth = [picture(light) for light in shown.truth]
    pictures = {name: [picture(li) for li in estimated(model, shown.scene)] for name, model in loaded.items()}
    training = [
        la for la in labels_of(read_index(data, "train"), labels) if la.fit_ok and math.isfinite(la.sun_elevation)
    ]
    pictures["mean training sky"] = [picture(mean_sky(training))] * len(truth)
    constants = [picture(sky) for sky in constant_skies(training)]
    pictures["best constant sky"] = [min(constants, key=lambda p: _median_rmse(truth, p))] * len(truth)
    draw(shown, truth, pictures, out / "relight.png")
    scores = {n: np.array([errors(t, p) for t, p in zip(truth, ps, strict=True)]) for n, ps in pictures.items()}
    return report(scores, shown.panorama)


def _median_rmse(truth: Sequence[Floats], guess: Floats) -> float:
    return float(np.median([errors(t, guess)[0] for t in truth]))


def report(scores: dict[str, Floats], panorama: NDArray[np.str_]) -> str:
    """Medians of the scores (N, 3) by method, and the interval of ours less each over panoramas."""
    ours = next(iter(scores))
    rows = []
    for name, score in scores.items():
        row = [name]
        for column, decimals in enumerate((3, 3, 1)):
            row.append(f"{np.median(score[:, column]):.{decimals}f}")
            row.append("" if name == ours else _less(scores[ours][:, column], score[:, column], panorama, decimals))
        rows.append(row)
    title = (
        f"## Relighting: {len(panorama)} crops of {len(np.unique(panorama))} HDR panoramas\n\n"
        "Medians for a bumpy diffuse sphere on a plane, in the photo's linear values; ours less each, 95 % over "
        "panoramas. The best constant sky was chosen on these very crops."
    )
    return f"{title}\n\n" + table(["", "RMSE", "less", "scale-invariant RMSE", "less", "RGB angle [deg]", "less"], rows)


def _less(ours: Floats, theirs: Floats, units: NDArray[np.str_], decimals: int) -> str:
    low, high = difference_interval(ours, theirs, units)
    return f"{low:.{decimals}f} to {high:.{decimals}f}"


def draw(shown: Views, truth: Sequence[Floats], pictures: dict[str, list[Floats]], path: Path, rows: int = 6) -> None:
    """Side by side for panoramas that may be shown: the photo, the sphere under the true light, under each estimate.

    A row has one exposure, that of the true light.
    """
    first = [i for i, (source, _) in enumerate(shown.scene.crops) if "CC0" in source.panorama.licence]
    chosen = first[:: max(1, len(first) // rows)][:rows]
    lines = []
    for i in chosen:
        photo = Image.fromarray(tone_map(shown.crops[i].linear)).resize((SIZE * 4 // 3, SIZE))
        gain = SHOWN_WHITE / float(np.percentile(truth[i], 95))
        spheres = [tone_map(p * gain) for p in (truth[i], *(p[i] for p in pictures.values()))]
        lines.append(np.concatenate([np.asarray(photo), *spheres], axis=1))
    with replacing(path) as temporary:
        sheet = Image.fromarray(np.concatenate(lines, axis=0))
        sheet.resize((2 * sheet.width, 2 * sheet.height), Image.Resampling.BICUBIC).save(temporary, "PNG")

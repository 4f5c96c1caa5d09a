"""How near objects come to the truth when they are lit by an estimate.

The measures are those of Hold-Geoffroy et al. (CVPR 2017): RMSE, scale-invariant RMSE, and the angle between RGB
vectors.

A bumpy diffuse sphere stands on a plane; it casts a shadow, and light bounces once. A diffuse, a glossy and a mirror
ball are as a distant camera at azimuth 0 sees them. Light is linear, so one matrix for each takes a map of HEIGHT rows
to a picture.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from export.crops.crops import Crop, crop_panorama, load_sources
from export.data.labels import Label, read_labels_of
from export.data.panoramas import DataError, read_index
from export.evaluation.metrics import Names, difference_interval, format_interval, markdown_table
from export.evaluation.predictions import View, load_models, protocol_views
from lighting.color import tone_map
from lighting.decoding import lighting_from_prediction
from lighting.envmap.relighting import rotate_envmap
from lighting.envmap.render import render
from lighting.estimator import Estimator
from lighting.files import atomic_write
from lighting.geometry import Floats, direction, latlong_directions, latlong_solid_angle, ray_sphere
from lighting.model import Model
from lighting.photo.reader import photo_from_array
from lighting.prediction import ModelSpec
from lighting.records import Lighting

# The scene: its points, and the matrix that lights them.

HEIGHT = 64  # rows of the maps that light the scene
SIZE = 64  # pixels of the square picture
_HALF_WIDTH = 2.2  # of the view, in radii of the sphere
_VIEW_ELEVATION = -25.0  # deg: the scene is seen from above
SPHERE_ALBEDO, PLANE_ALBEDO = 0.8, 0.5
_BUMPS = ((7.0, 2.0, 3.0), (-4.0, 6.0, 5.0), (3.0, -8.0, 6.0), (9.0, 5.0, -4.0))  # wave vectors, per radius
_BUMP_HEIGHT = 0.018  # radii, of each wave


@lru_cache(maxsize=1)
def _transfer_matrix() -> NDArray[np.float32]:
    """Matrix (SIZE², 2 HEIGHT²) from a map's pixels to the radiance that the camera sees."""
    points, normals, smooth, albedo = _scene_points()
    rays = latlong_directions(HEIGHT).reshape(-1, 3)
    solid_angle = np.repeat(latlong_solid_angle(HEIGHT), 2 * HEIGHT)
    cosine = np.maximum(normals @ rays.T, 0) * (smooth @ rays.T > 0) * ~_shadowed(points, rays)
    return np.asarray(albedo[:, None] / np.pi * cosine * solid_angle, dtype=np.float32)


def _scene_points() -> tuple[Floats, Floats, Floats, Floats]:
    """The point that each pixel shows: positions (P, 3), bumpy and smooth normals (P, 3), albedo (P,).

    The unit sphere at the origin stands on the plane y = -1.
    """
    forward = direction(0.0, _VIEW_ELEVATION)
    right, up = np.array([1.0, 0.0, 0.0]), direction(0.0, _VIEW_ELEVATION + 90)
    steps = ((np.arange(SIZE) + 0.5) / SIZE * 2 - 1) * _HALF_WIDTH
    start = (steps[None, :, None] * right - steps[:, None, None] * up).reshape(-1, 3) - 10 * forward
    to_sphere = ray_sphere(start, forward, np.zeros(3))
    on_sphere = np.isfinite(to_sphere)
    distance = np.where(on_sphere, to_sphere, (-1 - start[:, 1]) / forward[1])
    points = start + distance[:, None] * forward
    smooth = np.where(on_sphere[:, None], points, [0.0, 1.0, 0.0])
    bumpy = np.where(on_sphere[:, None], _bumpy(points), smooth)
    return points, bumpy, smooth, np.where(on_sphere, SPHERE_ALBEDO, PLANE_ALBEDO)


def _bumpy(points: Floats) -> Floats:
    """Normals (P, 3) of the unit sphere with waves on it: the smooth ones minus the waves' tangential slope."""
    waves = np.array(_BUMPS)
    slope = _BUMP_HEIGHT * np.cos(points @ waves.T) @ waves
    normals = points - (slope - np.sum(slope * points, axis=1, keepdims=True) * points)
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def _shadowed(points: Floats, rays: Floats) -> NDArray[np.bool_]:
    """Which rays (R, 3) from points (P, 3) meet the sphere; one point at a time, for memory's sake."""
    return np.array([np.isfinite(ray_sphere(point, rays, np.zeros(3))) for point in points])


def relight_scene(light: Floats) -> Floats:
    """The scene (SIZE, SIZE, 3) under an environment map.

    Args:
        light: (H, 2H, 3) linear; HEIGHT divides H.
    """
    return np.asarray(_transfer_matrix() @ pool_map(light).reshape(-1, 3).astype(np.float32)).reshape(SIZE, SIZE, 3)


def pool_map(light: Floats) -> Floats:
    """A map at HEIGHT rows; means by solid angle, so that the sun keeps its power.

    Args:
        light: (H, 2H, 3) linear; HEIGHT divides H.
    """
    factor = light.shape[0] // HEIGHT
    weight = latlong_solid_angle(light.shape[0])[:, None, None]
    blocks = (light * weight).reshape(HEIGHT, factor, 2 * HEIGHT, factor, 3).sum(axis=(1, 3))
    return np.asarray(blocks / (factor * weight.reshape(HEIGHT, factor, 1).sum(axis=1)[..., None]))


# Relighting error: a sphere lit by the panorama itself and by the light estimated from a crop of it.

DRAWN = 6  # rows of the drawing
_WHITE = 0.9  # linear value at which the true picture's brightest parts are shown


def _errors(truth: Floats, estimate: Floats) -> tuple[float, float, float]:
    """RMSE, RMSE after the best scale, and the mean angle [deg] between RGB vectors."""
    scale = np.sum(truth * estimate) / max(float(np.sum(estimate**2)), 1e-12)
    return _rms(truth - estimate), _rms(truth - scale * estimate), float(rgb_angle(truth, estimate).mean())


def rgb_angle(a: Floats, b: Floats) -> Floats:
    """Angles (...) [deg] between RGB vectors; 90 where one is black.

    Args:
        a: (..., 3) linear.
        b: (..., 3) linear.
    """
    lengths = np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1)
    return np.asarray(np.degrees(np.arccos(np.clip(np.sum(a * b, axis=-1) / np.maximum(lengths, 1e-12), -1, 1))))


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


@dataclass(frozen=True)
class _LitCrops:
    """Crops with their true light: maps (HEIGHT, 2 HEIGHT, 3) in each crop's exposure and orientation."""

    views: list[View]
    crops: list[Crop]
    truth: list[Floats]
    panorama: Names


def _lit_crops(data: Path, labels: Path, spec: ModelSpec) -> _LitCrops:
    """Paper-protocol crops of the `val` HDR panoramas that show their sun; DataError if there are none."""
    panoramas = [p for p in read_index(data, "val") if p.kind == "hdr" and p.sun == "visible"]
    if not panoramas:
        raise DataError(f"{data} has no HDR panorama in `val` that shows its sun, so nothing can be relit.")
    views = protocol_views(load_sources(panoramas, labels), "paper")
    crops = [crop_panorama(source, camera, spec) for source, camera in views]
    maps = [pool_map(rotate_envmap(source.levels[0], -camera.azimuth)) for source, camera in views]
    truth = [one * crop.gain for one, crop in zip(maps, crops, strict=True)]
    return _LitCrops(views, crops, truth, np.array([source.panorama.name for source, _ in views]))


def _estimated_maps(model: Model, views: list[View]) -> list[Floats]:
    """The environment maps that a network's answers give."""
    crops = [crop_panorama(source, camera, model.spec) for source, camera in views]
    predictions = [Estimator(model).predict(photo_from_array(tone_map(c.linear))) for c in crops]
    return [np.asarray(render(lighting_from_prediction(p), HEIGHT)) for p in predictions]


def mean_training_sky(labels: Sequence[Label]) -> Floats:
    """The mean over training skies and over azimuth.

    Args:
        labels: of the skies, with their fits.
    """
    skies = [render(_lighting(label), HEIGHT, sun=label.direct == "yes") for label in labels]
    return np.asarray(np.mean(skies, axis=0).mean(axis=1, keepdims=True).repeat(2 * HEIGHT, axis=1))


def constant_skies(labels: Sequence[Label]) -> list[Floats]:
    """Skies of median turbidity and exposure: the sun ahead at several elevations, with and without its disc.

    Args:
        labels: of the training skies, with their fits.
    """
    turbidity, exposure = (float(np.median([getattr(la, key) for la in labels])) for key in ("turbidity", "exposure"))
    middle = replace(_lighting(labels[0]), turbidity=turbidity, exposure=exposure, sun_azimuth=0.0)
    heights = range(15, 90, 15)
    return [render(replace(middle, sun_elevation=float(h)), HEIGHT, sun=sun) for h in heights for sun in (True, False)]


def _lighting(label: Label) -> Lighting:
    """The lighting that a label describes."""
    return Lighting(label.sun_azimuth, max(label.sun_elevation, 0.0), label.turbidity, label.exposure)


def relight(data: Path, labels: Path, models: Sequence[Path], out: Path) -> str:
    """A table in Markdown of networks and of constant skies; writes relight.png.

    Args:
        data: folder of panoramas.
        labels: CSV file of labels.
        models: paths of networks, ours first.
        out: folder for the picture.
    """
    loaded = load_models(models)
    lit = _lit_crops(data, labels, next(iter(loaded.values())).spec)
    truth = [relight_scene(light) for light in lit.truth]
    pictures = {name: [relight_scene(li) for li in _estimated_maps(model, lit.views)] for name, model in loaded.items()}
    known = read_labels_of(read_index(data, "train"), labels)
    training = [la for la in known if la.fit_ok and math.isfinite(la.sun_elevation)]
    pictures["mean training sky"] = [relight_scene(mean_training_sky(training))] * len(truth)
    constants = [relight_scene(sky) for sky in constant_skies(training)]
    rmse = [float(np.median([_errors(t, sky)[0] for t in truth])) for sky in constants]
    pictures["best constant sky"] = [constants[int(np.argmin(rmse))]] * len(truth)
    _draw(lit, truth, pictures, out / "relight.png")
    scores = {n: np.array([_errors(t, p) for t, p in zip(truth, ps, strict=True)]) for n, ps in pictures.items()}
    return _relight_report(scores, lit.panorama)


def _relight_report(scores: dict[str, Floats], panorama: Names) -> str:
    """A table of the median scores (N, 3) by method, with the intervals of ours minus each."""
    ours = next(iter(scores))
    rows = []
    for name, score in scores.items():
        row = [name]
        for theirs, best, decimals in zip(score.T, scores[ours].T, (3, 3, 1), strict=True):
            less = "" if name == ours else format_interval(difference_interval(best, theirs, panorama), decimals)
            row += [f"{np.median(theirs):.{decimals}f}", less]
        rows.append(row)
    title = (
        f"## Relighting: {len(panorama)} crops of {len(np.unique(panorama))} HDR panoramas\n\n"
        "Medians for a bumpy diffuse sphere on a plane, in the photo's linear values; 95 % intervals over panoramas of "
        "our median minus each method's. The best constant sky was chosen on these very crops."
    )
    header = ["", "RMSE", "minus", "scale-invariant RMSE", "minus", "RGB angle [deg]", "minus"]
    return f"{title}\n\n{markdown_table(header, rows)}"


def _draw(lit: _LitCrops, truth: Sequence[Floats], pictures: dict[str, list[Floats]], path: Path) -> None:
    """Draw DRAWN rows for panoramas that may be shown: the photo, the sphere under the true light, under each estimate.

    Each row has the exposure that suits the true light. Nothing is drawn if none may be shown.
    """
    first = [i for i, (source, _) in enumerate(lit.views) if "CC0" in source.panorama.licence]
    if not first:
        return
    chosen = first[:: max(1, len(first) // DRAWN)][:DRAWN]
    lines = []
    for i in chosen:
        photo = Image.fromarray(tone_map(lit.crops[i].linear)).resize((SIZE * 4 // 3, SIZE))
        gain = _WHITE / float(np.percentile(truth[i], 95))
        spheres = [tone_map(p * gain) for p in (truth[i], *(p[i] for p in pictures.values()))]
        lines.append(np.concatenate([np.asarray(photo), *spheres], axis=1))
    with atomic_write(path) as temporary:
        sheet = Image.fromarray(np.concatenate(lines, axis=0))
        sheet.resize((2 * sheet.width, 2 * sheet.height), Image.Resampling.BICUBIC).save(temporary, "PNG")


# Four objects under any environment map, and how far two lights differ on each.

BALLS = ("diffuse", "glossy", "mirror")
OBJECTS = (*BALLS, "plane")
_GLOSSINESS = 60.0  # concentration of the glossy lobe, exp(_GLOSSINESS (cos - 1))

_PLANE_STEP = 5  # of the plane's pixels, of which every so many is looked at
_ACROSS = 24  # pixels of a ball's picture
_MIRROR = 1500.0  # concentration of the mirror's lobe, about one pixel of the map


@lru_cache(maxsize=4)
def _matrix(kind: str) -> NDArray[np.float32]:
    """Matrix (P, 2 HEIGHT²) from a map's pixels to what is seen of an object of OBJECTS, reflecting all light."""
    if kind == "plane":
        beside_ball = np.linalg.norm(_scene_points()[0], axis=1) > 1 + 1e-6
        return np.asarray(_transfer_matrix()[beside_ball][::_PLANE_STEP], dtype=np.float32)
    normals = _normals()
    rays = latlong_directions(HEIGHT).reshape(-1, 3)
    solid_angle = np.repeat(latlong_solid_angle(HEIGHT), 2 * HEIGHT)
    if kind == "diffuse":
        return np.asarray(np.maximum(normals @ rays.T, 0) * solid_angle / np.pi, dtype=np.float32)
    view = np.array([0.0, 0.0, -1.0])
    reflected = view - 2 * (normals @ view)[:, None] * normals
    sharpness = _GLOSSINESS if kind == "glossy" else _MIRROR
    weight = np.exp(sharpness * (reflected @ rays.T - 1)) * solid_angle
    return np.asarray(weight / weight.sum(axis=1, keepdims=True), dtype=np.float32)


def _normals() -> Floats:
    """Normals (P, 3) of the pixels of a ball that a camera looking along -Z sees."""
    steps = (np.arange(_ACROSS) + 0.5) / _ACROSS * 2 - 1
    x, y = (axis.ravel() for axis in np.meshgrid(steps, -steps))
    inside = x**2 + y**2 < 1
    x, y = x[inside], y[inside]
    return np.stack([x, y, np.sqrt(1 - x**2 - y**2)], axis=-1)


def render_object(kind: str, maps: Floats) -> Floats:
    """What is seen (N, P, 3) of an object under maps.

    Args:
        kind: of OBJECTS.
        maps: (N, HEIGHT, 2 HEIGHT, 3) linear.
    """
    flat = maps.reshape(len(maps), -1, 3).astype(np.float32)
    return np.stack([flat[..., channel] @ _matrix(kind).T for channel in range(3)], axis=-1)


def object_errors(truth: Floats, guess: Floats) -> Floats:
    """RMSE, RMSE after the best scale, both by the truth's RMS, and mean RGB angle [deg]: (N, 3).

    Args:
        truth: (N, P, 3) pictures.
        guess: (N, P, 3) pictures.
    """
    errors = np.array([_errors(t, g) for t, g in zip(truth, guess, strict=True)])
    size = np.maximum(np.sqrt(np.mean(truth**2, axis=(1, 2))), 1e-9)
    return np.asarray(errors / np.stack([size, size, np.ones(len(size))], axis=-1))

"""Relighting error: a sphere lit by the panorama itself and by the light estimated from a crop of it.

The measures are those of Hold-Geoffroy et al. (CVPR 2017): RMSE, scale-invariant RMSE, and the angle between RGB
vectors.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from PIL import Image

from export.crops import Crop, load_sources, take
from export.data import DataError, Label, labels_of, read_index
from export.evaluation.intervals import difference_interval
from export.evaluation.models import load_models
from export.evaluation.records import Names
from export.evaluation.sphere import HEIGHT, SIZE, picture, pooled
from export.evaluation.tables import interval, table
from export.evaluation.views import View, cameras
from lighting.colour import tone_map
from lighting.decoding import lighting_from
from lighting.envmap import render, rotate
from lighting.evidence import said_of
from lighting.files import replacing
from lighting.geometry import Floats
from lighting.model import Model
from lighting.photo import photo_of
from lighting.records import Lighting, ModelSpec

SHOWN = 6  # rows of the drawing
SHOWN_WHITE = 0.9  # linear value at which the true picture's brightest parts are shown


def errors(truth: Floats, estimate: Floats) -> tuple[float, float, float]:
    """RMSE, RMSE after the best scale, and the mean angle [deg] between RGB vectors."""
    scale = np.sum(truth * estimate) / max(float(np.sum(estimate**2)), 1e-12)
    return _rms(truth - estimate), _rms(truth - scale * estimate), float(colour_angle(truth, estimate).mean())


def colour_angle(a: Floats, b: Floats) -> Floats:
    """Angles (...) [deg] between RGB vectors (..., 3); 90 where one is black."""
    lengths = np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1)
    return np.asarray(np.degrees(np.arccos(np.clip(np.sum(a * b, axis=-1) / np.maximum(lengths, 1e-12), -1, 1))))


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


@dataclass(frozen=True)
class LitCrops:
    """Crops with their true light: maps (HEIGHT, 2 HEIGHT, 3) in each crop's exposure and orientation."""

    views: list[View]
    crops: list[Crop]
    truth: list[Floats]
    panorama: Names


def lit_crops(data: Path, labels: Path, spec: ModelSpec) -> LitCrops:
    """Paper-protocol crops of the `val` HDR panoramas that show their sun; DataError if there are none."""
    panoramas = [p for p in read_index(data, "val") if p.kind == "hdr" and p.sun == "visible"]
    if not panoramas:
        raise DataError(f"{data} has no HDR panorama in `val` that shows its sun, so nothing can be relit.")
    views = cameras(load_sources(panoramas, labels), "paper")
    crops = [take(source, camera, spec) for source, camera in views]
    truth = [
        pooled(rotate(source.levels[0], -camera.azimuth)) * crop.gain
        for (source, camera), crop in zip(views, crops, strict=True)
    ]
    return LitCrops(views, crops, truth, np.array([source.panorama.name for source, _ in views]))


def estimated(model: Model, views: list[View]) -> list[Floats]:
    """The environment maps that a network's answers give."""
    crops = [take(source, camera, model.spec) for source, camera in views]
    said = [said_of(model, photo_of(tone_map(c.linear))) for c in crops]
    return [np.asarray(render(lighting_from(p), HEIGHT)) for p in said]


def mean_sky(labels: Sequence[Label]) -> Floats:
    """The mean over training skies and over azimuth."""
    skies = [render(_lighting(label), HEIGHT, sun=label.direct == "yes") for label in labels]
    return np.asarray(np.mean(skies, axis=0).mean(axis=1, keepdims=True).repeat(2 * HEIGHT, axis=1))


def constant_skies(labels: Sequence[Label]) -> list[Floats]:
    """Skies of median turbidity and exposure: the sun ahead at several elevations, with and without its disc."""
    turbidity, exposure = (float(np.median([getattr(la, key) for la in labels])) for key in ("turbidity", "exposure"))
    middle = replace(_lighting(labels[0]), turbidity=turbidity, exposure=exposure, sun_azimuth=0.0)
    heights = range(15, 90, 15)
    return [render(replace(middle, sun_elevation=float(h)), HEIGHT, sun=sun) for h in heights for sun in (True, False)]


def _lighting(label: Label) -> Lighting:
    """The lighting that a label describes."""
    return Lighting(label.sun_azimuth, max(label.sun_elevation, 0.0), label.turbidity, label.exposure)


def relight(data: Path, labels: Path, models: Sequence[Path], out: Path) -> str:
    """A table in Markdown of the networks, ours first, and of constant skies; writes relight.png into `out`."""
    loaded = load_models(models)
    shown = lit_crops(data, labels, next(iter(loaded.values())).spec)
    truth = [picture(light) for light in shown.truth]
    pictures = {name: [picture(li) for li in estimated(model, shown.views)] for name, model in loaded.items()}
    training = [
        la for la in labels_of(read_index(data, "train"), labels) if la.fit_ok and math.isfinite(la.sun_elevation)
    ]
    pictures["mean training sky"] = [picture(mean_sky(training))] * len(truth)
    constants = [picture(sky) for sky in constant_skies(training)]
    pictures["best constant sky"] = [min(constants, key=lambda p: _median_rmse(truth, p))] * len(truth)
    draw(shown, truth, pictures, out / "relight.png")
    scores = {n: np.array([errors(t, p) for t, p in zip(truth, ps, strict=True)]) for n, ps in pictures.items()}
    return relight_report(scores, shown.panorama)


def _median_rmse(truth: Sequence[Floats], guess: Floats) -> float:
    return float(np.median([errors(t, guess)[0] for t in truth]))


def relight_report(scores: dict[str, Floats], panorama: Names) -> str:
    """A table of the median scores (N, 3) by method, with the intervals of ours minus each."""
    ours = next(iter(scores))
    rows = []
    for name, score in scores.items():
        row = [name]
        for theirs, best, decimals in zip(score.T, scores[ours].T, (3, 3, 1), strict=True):
            less = "" if name == ours else interval(difference_interval(best, theirs, panorama), decimals)
            row += [f"{np.median(theirs):.{decimals}f}", less]
        rows.append(row)
    title = (
        f"## Relighting: {len(panorama)} crops of {len(np.unique(panorama))} HDR panoramas\n\n"
        "Medians for a bumpy diffuse sphere on a plane, in the photo's linear values; 95 % intervals over panoramas of "
        "our median minus each method's. The best constant sky was chosen on these very crops."
    )
    header = ["", "RMSE", "minus", "scale-invariant RMSE", "minus", "RGB angle [deg]", "minus"]
    return f"{title}\n\n{table(header, rows)}"


def draw(shown: LitCrops, truth: Sequence[Floats], pictures: dict[str, list[Floats]], path: Path) -> None:
    """Draw SHOWN rows for panoramas that may be shown: the photo, the sphere under the true light, under each estimate.

    Each row has the exposure that suits the true light. Nothing is drawn if none may be shown.
    """
    first = [i for i, (source, _) in enumerate(shown.views) if "CC0" in source.panorama.licence]
    if not first:
        return
    chosen = first[:: max(1, len(first) // SHOWN)][:SHOWN]
    lines = []
    for i in chosen:
        photo = Image.fromarray(tone_map(shown.crops[i].linear)).resize((SIZE * 4 // 3, SIZE))
        gain = SHOWN_WHITE / float(np.percentile(truth[i], 95))
        spheres = [tone_map(p * gain) for p in (truth[i], *(p[i] for p in pictures.values()))]
        lines.append(np.concatenate([np.asarray(photo), *spheres], axis=1))
    with replacing(path) as temporary:
        sheet = Image.fromarray(np.concatenate(lines, axis=0))
        sheet.resize((2 * sheet.width, 2 * sheet.height), Image.Resampling.BICUBIC).save(temporary, "PNG")

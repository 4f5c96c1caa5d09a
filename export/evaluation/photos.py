"""Accuracy on ordinary photos whose true sun is known, all by the median over scenes."""

import csv
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from export.evaluation import suncompass
from export.evaluation.metrics import Floats, median
from export.evaluation.report import figures_table
from lighting.decoding import lighting_from
from lighting.geometry import angle_between, angles, direction, wrap_azimuth
from lighting.model import Model
from lighting.photo import Photo, read_photo, to_tensor

Seer = Callable[[Sequence[Photo]], Floats]  # photos to sun directions (N, 3)


def photo_seers(models: dict[str, Model], peer: suncompass.SunCompass | None, elevation: float) -> dict[str, Seer]:
    """Each method by its name; the peer's suns stand at one elevation [deg]."""
    seers: dict[str, Seer] = {name: partial(photo_suns, model) for name, model in models.items()}
    if peer:
        seers[suncompass.NAME] = lambda photos: suncompass.suns(peer, map(suncompass.photo_picture, photos), elevation)
    return seers


def photo_suns(model: Model, photos: Sequence[Photo]) -> Floats:
    """Directions (N, 3), decoded as users get them."""
    said = model.predict(np.concatenate([to_tensor(photo, model.spec) for photo in photos]))
    return np.array([lighting_from(p).sun_direction for p in said])


def photo_report(index: Path, seers: dict[str, Seer]) -> str:
    """Medians over scenes of the real photos that `photos.csv` lists with the sun's true direction."""
    with index.open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["sun_azimuth"]]
    truth = direction([float(r["sun_azimuth"]) for r in rows], [float(r["sun_elevation"]) for r in rows])
    scenes = np.array([r["group"] for r in rows])
    photos = [read_photo(index.parent / r["file"]) for r in rows]
    figures = {name: photo_figures(truth, see_photos(photos), scenes) for name, see_photos in seers.items()}
    title = f"## Real photos: median over {len(np.unique(scenes))} scenes ({len(rows)} photos) [deg]"
    return f"{title}\n\n{figures_table(figures)}"


def photo_figures(truth: Floats, sun: Floats, scenes: NDArray[np.str_]) -> dict[str, float]:
    """Errors of suns (N, 3), medians over scenes."""
    (azimuth, elevation), (true_azimuth, true_elevation) = angles(sun), angles(truth)
    errors = {
        "sun": angle_between(truth, sun),
        "azimuth": np.abs(wrap_azimuth(azimuth - true_azimuth)),
        "elevation": np.abs(elevation - true_elevation),
    }
    return {key: by_scene(error, scenes) for key, error in errors.items()}


def by_scene(error: Floats, scenes: NDArray[np.str_]) -> float:
    """Median over scenes of each scene's median."""
    return median(np.array([np.median(error[scenes == scene]) for scene in np.unique(scenes)]))

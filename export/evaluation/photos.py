"""Accuracy on ordinary photos whose true sun is known, as medians over scenes."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from export.data import read_table
from export.evaluation import suncompass
from export.evaluation.metrics import median
from export.evaluation.records import Names
from export.evaluation.tables import figures_table
from lighting.decoding import lighting_from
from lighting.geometry import Floats, angle_between, angles, direction, wrap_azimuth
from lighting.model import Model
from lighting.photo import Photo, read_photo, to_tensor

Method = Callable[[Sequence[Photo]], Floats]  # photos to sun directions (N, 3)

COLUMNS = ("file", "group", "sun_azimuth", "sun_elevation")


def photo_methods(models: dict[str, Model], peer: suncompass.Peer | None, elevation: float) -> dict[str, Method]:
    """Each method by its name; the peer's suns all have one elevation [deg]."""
    methods: dict[str, Method] = {name: partial(photo_suns, model) for name, model in models.items()}
    if peer:
        pictures = suncompass.photo_picture
        methods[suncompass.NAME] = lambda photos: suncompass.suns(peer, map(pictures, photos), elevation)
    return methods


def photo_suns(model: Model, photos: Sequence[Photo]) -> Floats:
    """Directions (N, 3), decoded as users get them."""
    said = model.predict(np.concatenate([to_tensor(photo, model.spec) for photo in photos]))
    return np.array([lighting_from(p).sun_direction for p in said])


def photo_report(index: Path, methods: dict[str, Method]) -> str:
    """Medians over scenes of the real photos that `photos.csv` lists with the sun's true direction."""
    rows = [row for row in read_table(index, COLUMNS) if row["sun_azimuth"]]
    truth = direction([float(r["sun_azimuth"]) for r in rows], [float(r["sun_elevation"]) for r in rows])
    scenes = np.array([r["group"] for r in rows])
    photos = [read_photo(index.parent / r["file"]) for r in rows]
    figures = {name: photo_figures(truth, method(photos), scenes) for name, method in methods.items()}
    title = f"## Real photos: median over {len(np.unique(scenes))} scenes ({len(rows)} photos) [deg]"
    return f"{title}\n\n{figures_table(figures)}"


def photo_figures(truth: Floats, sun: Floats, scenes: Names) -> dict[str, float]:
    """Errors of suns (N, 3), medians over scenes."""
    (azimuth, elevation), (true_azimuth, true_elevation) = angles(sun), angles(truth)
    errors = {
        "sun": angle_between(truth, sun),
        "azimuth": np.abs(wrap_azimuth(azimuth - true_azimuth)),
        "elevation": np.abs(elevation - true_elevation),
    }
    return {key: by_scene(error, scenes) for key, error in errors.items()}


def by_scene(error: Floats, scenes: Names) -> float:
    """Median over scenes of each scene's median."""
    return median(np.array([np.median(error[scenes == scene]) for scene in np.unique(scenes)]))

"""Accuracy on ordinary photos whose true sun is known, as medians over scenes."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from export.data import read_table
from export.evaluation.metrics import median, share
from export.evaluation.records import Bools, Names
from export.evaluation.tables import figures_table
from lighting.decoding import lighting_from
from lighting.evidence import said_of
from lighting.geometry import Floats, angle_between, angles, direction, wrap_azimuth
from lighting.model import Model
from lighting.photo import Photo, read_photo

COLUMNS = ("file", "group", "sun_azimuth", "sun_elevation")
HEIGHTS = ((-10, 10), (10, 20), (-10, 20), (20, 45), (45, 90))  # deg, bins of the true sun; refraction lifts some


def photo_suns(model: Model, photos: Sequence[Photo]) -> Floats:
    """Directions (N, 3), decoded as users get them."""
    return np.array([lighting_from(said_of(model, photo)).sun_direction for photo in photos])


def photo_report(index: Path, models: dict[str, Model]) -> str:
    """Tables of the real photos that `photos.csv` lists: medians over scenes, with direct sun and of all photos."""
    rows = [row for row in read_table(index, COLUMNS) if row["sun_elevation"]]
    elevation = np.array([float(r["sun_elevation"]) for r in rows])
    truth = direction([float(r["sun_azimuth"] or "nan") for r in rows], np.maximum(elevation, 0.0))
    scenes = np.array([r["group"] for r in rows])
    photos = [read_photo(index.parent / r["file"]) for r in rows]
    suns = {name: photo_suns(model, photos) for name, model in models.items()}
    direct = np.array([r.get("direct") == "yes" for r in rows])
    known = np.isfinite(truth[:, 0])
    parts = {"All that have an azimuth": known, "Direct sun": known & direct}
    sections = [
        f"{name}: {len(np.unique(scenes[chosen]))} scenes, {chosen.sum()} photos\n\n"
        + figures_table({m: photo_figures(truth[chosen], sun[chosen], scenes[chosen]) for m, sun in suns.items()})
        for name, chosen in parts.items()
        if chosen.any()
    ]
    if direct.any():
        sections.append(
            f"Elevation less the true one, direct sun, medians over scenes: {direct.sum()} photos\n\n"
            + figures_table({m: photo_bias(elevation, sun, scenes, direct) for m, sun in suns.items()})
        )
    return "\n\n".join(["## Real photos: medians over scenes [deg]", *sections])


def photo_bias(elevation: Floats, sun: Floats, scenes: Names, chosen: Bools) -> dict[str, float]:
    """Median over scenes of how much too high the chosen suns are, by true elevation (N,)."""
    off = angles(sun)[1] - elevation
    found = {}
    for low, high in HEIGHTS:
        here = chosen & (elevation >= low) & (elevation < high)
        found[f"{max(low, 0):g} to {high:g}°"] = by_scene(off[here], scenes[here]) if here.any() else float("nan")
    return found


def photo_figures(truth: Floats, sun: Floats, scenes: Names) -> dict[str, float]:
    """Errors of suns (N, 3), medians over scenes."""
    (azimuth, elevation), (true_azimuth, true_elevation) = angles(sun), angles(truth)
    error = angle_between(truth, sun)
    errors = {
        "sun": error,
        "azimuth": np.abs(wrap_azimuth(azimuth - true_azimuth)),
        "elevation": np.abs(elevation - true_elevation),
    }
    return {key: by_scene(value, scenes) for key, value in errors.items()} | {"photos < 45° %": share(error < 45)}


def by_scene(error: Floats, scenes: Names) -> float:
    """Median over scenes of each scene's median."""
    return median(np.array([np.median(error[scenes == scene]) for scene in np.unique(scenes)]))

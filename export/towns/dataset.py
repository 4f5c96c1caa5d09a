"""A folder of rendered places with exact truth, in the format of any other folder of panoramas, and its labels."""

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from tqdm import tqdm

from export.data.labels import Label, read_labels, write_labels
from export.data.panoramas import INDEX, write_index
from export.towns.mesh import Floats
from export.towns.path_trace import Place
from export.towns.place import place
from export.towns.sky import Sky, random_sky
from lighting.files import write_exr

LABELS = "labels.csv"
SAVE_EVERY = 20  # places
GROUND_RADIUS = 12.0  # m around the camera, where sunlight on the ground counts
GROUND_POINTS = 400
LIT, DIM = 0.25, 0.03  # shares of the sunlight from which direct light is "yes", and "partly"
TRUE_SKY = 0.5  # of the sunlight comes through: turbidity and exposure can be seen


@dataclass(frozen=True)
class Rendered:
    """A panorama of a place and what is true of it."""

    name: str
    radiance: Floats  # (H, 2H, 3) linear
    label: Label
    sun_visible: bool


def render_place(number: int, height: int) -> Rendered:
    """Place `number`, the same in every run."""
    rng = np.random.default_rng([8, number])
    sky = random_sky(rng)
    scene = Place(*place(rng), sky)
    while not scene.is_clear():
        scene = Place(*place(rng), sky)
    around = rng.uniform(-1, 1, (GROUND_POINTS, 3)) * [GROUND_RADIUS, 0, GROUND_RADIUS] + [0, 0.3, 0]
    lit = scene.sunlit(around) * sky.sunlight
    visible = scene.sees_the_sun() and sky.sunlight > TRUE_SKY
    name = f"town_{number:05d}"
    return Rendered(name, scene.panorama(height, 2 * number), _label(name, sky, lit), visible)


def _label(name: str, sky: Sky, lit: float) -> Label:
    nan = float("nan")
    seen = not sky.is_overcast
    true_sky = sky.sunlight > TRUE_SKY
    return Label(
        name=name,
        sun_azimuth=sky.lighting.sun_azimuth if seen else nan,
        sun_elevation=sky.lighting.sun_elevation if seen else nan,
        sun_uncertainty=1.0 if seen else nan,
        sun_source="given" if seen else "none",
        found_azimuth=nan,
        found_elevation=nan,
        turbidity=sky.lighting.turbidity if true_sky else nan,
        exposure=sky.lighting.exposure if true_sky else nan,
        fit_residual=0.0 if true_sky else nan,
        fit_ok=true_sky,
        direct="yes" if lit > LIT else "partly" if lit > DIM else "no",
    )


def synthesize(folder: Path, count: int, height: int) -> None:
    """Render places until the folder holds `count`; goes on where an earlier call stopped."""
    (folder / "panoramas").mkdir(parents=True, exist_ok=True)
    labels = read_labels(folder / LABELS) if (folder / LABELS).exists() else []
    rows = _read_rows(folder / INDEX)[: len(labels)]  # the index is written first: it may hold more
    for number in tqdm(range(len(labels), count), initial=len(labels), total=count, unit="place"):
        rendered = render_place(number, height)
        file = f"panoramas/{rendered.name}.exr"
        write_exr(folder / file, rendered.radiance)
        labels.append(rendered.label)
        rows.append(_row(rendered, file))
        if number + 1 == count or (number + 1) % SAVE_EVERY == 0:
            write_index(rows, folder)
            write_labels(labels, folder / LABELS)


def _row(rendered: Rendered, file: str) -> dict[str, str]:
    label = rendered.label
    sun = "none" if label.sun_source == "none" else "visible" if rendered.sun_visible else "inferred"
    angles = {"sun_azimuth": label.sun_azimuth, "sun_elevation": label.sun_elevation}
    return {
        "name": rendered.name,
        "file": file,
        "kind": "hdr",
        "place": rendered.name,
        "split": "train",
        "sun": sun,
        **{name: "" if sun == "none" else f"{angle:.3f}" for name, angle in angles.items()},
        "sun_uncertainty": "" if sun == "none" else "1",
        "direct": label.direct,
        "scene": "rendered",
        "label": "rendered",
        "licence": "CC0",
    }


def _read_rows(path: Path) -> list[dict[str, str]]:
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))

"""Panoramas for tests."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from export.crops.crops import Camera, Crop, Source
from export.data.labels import Label
from export.data.panoramas import Panorama
from export.evaluation.failures import Failure
from export.evaluation.metrics import Answers, Truth, answers_from_sun
from export.networks.outdoor import network_specs
from lighting.color import tone_map
from lighting.envmap.render import render
from lighting.geometry import angle_between, angles, direction, latlong_directions
from lighting.prediction import Prediction
from lighting.records import Lighting
from lighting.sun_grid import grid_directions
from tests.helpers.predictions import GRID, SPEC, grid_prediction, lobe_prediction

EXAMPLES_SPEC = network_specs("0")["outdoor"]


SUN = (40.0, 25.0)  # deg


def label(azimuth: float = SUN[0], elevation: float = SUN[1], *, ok: bool = True) -> Label:
    return Label("p", azimuth, elevation, 2.0, "given", azimuth, elevation, 3.0, 0.5, 0.1, ok, "yes")


def source(kind: str = "hdr", place: str = "a", sun: Label | None = None) -> Source:
    """A panorama whose radiance falls off around the sun, so that its brightest pixel is the sun."""
    near = angle_between(latlong_directions(256), direction(*SUN))
    picture = np.repeat(np.exp(-((near / 8) ** 2))[..., None] * 0.8 + 0.1, 3, axis=-1).astype(np.float32)
    levels = (tone_map(picture),) if kind == "ldr" else (picture,)
    return Source(Panorama("p", Path("p"), kind, place, "train"), levels, sun or label())


def brightest(crop: Crop) -> tuple[float, float]:
    y, x = np.unravel_index(np.argmax(crop.linear[..., 1]), crop.linear.shape[:2])
    return float(x) + 0.5, float(y) + 0.5


VIEWS = [Camera(0, 12.0, -7.0, 60.0, 4 / 3), Camera(0, -5.0, 9.0, 70.0, 3 / 4), Camera(0, 20.0, 0.0, 40.0, 16 / 9)]


def crop(camera: Camera, azimuth: float, elevation: float) -> Crop:
    """A gray picture of the size that the canvas holds."""
    height = round(EXAMPLES_SPEC.width / max(camera.aspect, 1.0))
    linear = np.full((height, round(height * camera.aspect), 3), 0.2, np.float32)
    return Crop(linear, camera, azimuth, elevation, 2.0, 1.0, 3.0, 0.5)


ROW = {"name": "a", "file": "a.png", "kind": "ldr", "place": "here", "split": "train"}


def write_index(folder: Path, *rows: dict[str, str]) -> Path:
    Image.new("RGB", (8, 4), (10, 20, 30)).save(folder / "a.png")
    lines = [",".join(rows[0]), *[",".join(row.values()) for row in rows]]
    (folder / "panoramas.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


EACH = 8


def truth_of(panoramas: int, elevation: float = 40.0, scored: bool = True) -> Truth:
    """Eight crops a panorama, whose suns stand 45 deg apart and `elevation` high; two panoramas a place."""
    count = panoramas * EACH
    azimuth = np.tile(np.arange(0, 360, 360 / EACH), panoramas)
    return Truth(
        panorama=np.repeat([f"p{i}" for i in range(panoramas)], EACH),
        place=np.repeat([f"place{i // 2}" for i in range(panoramas)], EACH),
        scored=np.full(count, scored),
        sun=direction(-azimuth, np.full(count, elevation)),
        camera=np.tile([0.0, 0.0, 50.0], (count, 1)),
        aspect=np.full(count, 4 / 3),
        visibility=np.ones(count),
        turbidity=np.full(count, 3.0),
        exposure=np.full(count, 0.1),
        in_view=np.full(count, "sky in view"),
    )


AZIMUTH = np.arange(0, 360, 360 / EACH)  # of a panorama's cameras


SPREAD = 10.46  # deg an axis, of a lobe of concentration 30


def erring(truth: Truth, shared: bool) -> list[Prediction]:
    """Calibrated networks, whose errors are independent or common to a panorama."""
    if shared:
        panorama = np.arange(len(truth.sun)) // EACH
        noise = SPREAD * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])[panorama % 4]
    else:
        noise = np.random.default_rng(1).normal(0, SPREAD, (len(truth.sun), 2))
    azimuth, elevation = angles(truth.sun)
    stretch = np.cos(np.radians(elevation))
    return [
        lobe_prediction(a + da / c, e + de, 30.0)
        for a, e, c, (da, de) in zip(azimuth, elevation, stretch, noise, strict=True)
    ]


def truth(azimuth: list[float], elevation: list[float]) -> Truth:
    n = len(azimuth)
    return Truth(
        panorama=np.array([f"p{i // 2}" for i in range(n)]),
        place=np.array([f"q{i // 4}" for i in range(n)]),
        scored=np.ones(n, bool),
        sun=direction(azimuth, elevation),
        camera=np.zeros((n, 3)),
        aspect=np.full(n, 4 / 3),
        visibility=np.ones(n),
        turbidity=np.full(n, 3.0),
        exposure=np.full(n, 1.0),
        in_view=np.full(n, "sky in view"),
    )


def said(azimuth: list[float], elevation: list[float], radius: float = 10.0) -> Answers:
    n = len(azimuth)
    full = np.full(n, radius)
    return answers_from_sun(
        direction(azimuth, elevation), radius_50=full / 2, radius_90=full, nll=np.arange(n, dtype=float)
    )


FAILURE = Failure(0, "p0", "sky in view", "yes", (10.0, 40.0), (90.0, 40.0), 12.0, 60.0, 80.0, 0.0)


def off_by(truth: Truth, azimuth: np.ndarray) -> Answers:
    """Answers with errors of azimuth alone."""
    true, elevation = angles(truth.sun)
    return answers_from_sun(direction(true + azimuth, elevation), radius_50=np.full(len(true), 15.0))


def rings(*probability: float) -> Prediction:
    """Four cells of unequal size: two low ones, two high ones that are 0.41 times as large."""
    spec = replace(SPEC, sun_grid="rings:2x2")
    return replace(grid_prediction(np.array(probability)), spec=spec)


def drawn(count: int, concentration: float, seed: int = 0) -> tuple[list[Prediction], np.ndarray]:
    """Distributions, and suns drawn from each."""
    rng = np.random.default_rng(seed)
    said = [lobe_prediction(rng.uniform(-180, 180), rng.uniform(20, 70), concentration) for _ in range(count)]
    cells = grid_directions(GRID)
    return said, np.array([cells[rng.choice(len(cells), p=p.sun_probability / p.sun_probability.sum())] for p in said])


# The light of an HDR panorama.

SUN_IRRADIANCE, SKY_IRRADIANCE, GROUND_COLOR = (20.0, 15.0, 9.0), (0.4, 0.5, 0.8), (0.12, 0.11, 0.1)
HDR_LIGHT = Lighting(
    70.0, 40.0, 3.0, 1.0, sun_irradiance=SUN_IRRADIANCE, sky_irradiance=SKY_IRRADIANCE, ground_color=GROUND_COLOR
)
HDR_PANORAMA = render(HDR_LIGHT, 256)

# A mesh as an OBJ file.

OCTAHEDRON = """v 1 0 0
v -1 0 0
v 0 1 0
v 0 -1 0
v 0 0 1
v 0 0 -1
f 1 3 5
f 3 2 5
f 2 4 5
f 4 1 5
f 3/1 1/1 6/1
f 2 3 6
f 4 2 6
f 1 4 6
"""

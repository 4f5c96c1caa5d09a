"""Truths, answers and predictions whose errors are known."""

from dataclasses import replace

import numpy as np

from export.evaluation.failures import Failure
from export.evaluation.records import Answers, Truth, answers
from lighting.geometry import angles, direction
from lighting.records import Prediction
from lighting.sun_grid import grid_directions
from tests.lighting.evidence.test_fusion import GRID, SPEC, lobe, prediction

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
        lobe(a + da / c, e + de, 30.0) for a, e, c, (da, de) in zip(azimuth, elevation, stretch, noise, strict=True)
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
    return answers(direction(azimuth, elevation), radius_50=full / 2, radius_90=full, nll=np.arange(n, dtype=float))


FAILURE = Failure(0, "p0", "sky in view", "yes", (10.0, 40.0), (90.0, 40.0), 12.0, 60.0, 80.0, 0.0)


def off_by(truth: Truth, azimuth: np.ndarray) -> Answers:
    """Answers with errors of azimuth alone."""
    true, elevation = angles(truth.sun)
    return answers(direction(true + azimuth, elevation), radius_50=np.full(len(true), 15.0))


def rings(*probability: float) -> Prediction:
    """Four cells of unequal size: two low ones, two high ones that are 0.41 times as large."""
    spec = replace(SPEC, sun_grid="rings:2x2")
    return replace(prediction(np.array(probability)), spec=spec)


def drawn(count: int, concentration: float, seed: int = 0) -> tuple[list[Prediction], np.ndarray]:
    """Distributions, and suns drawn from each."""
    rng = np.random.default_rng(seed)
    said = [lobe(rng.uniform(-180, 180), rng.uniform(20, 70), concentration) for _ in range(count)]
    cells = grid_directions(GRID)
    return said, np.array([cells[rng.choice(len(cells), p=p.sun_probability / p.sun_probability.sum())] for p in said])

"""Angles of a path against the cameras that made it."""

import numpy as np

from lighting.turns.upright import common_up, level, own_up
from lighting.video.path import path_of, smoothed
from tests.lighting.video.clips import orientation

TIME = np.arange(60) / 30.0
AZIMUTH, ELEVATION, ROLL = np.linspace(30, 250, 60), np.linspace(-20, 30, 60), np.linspace(-5, 8, 60)
TURNED = np.stack([orientation(*map(float, a)) for a in zip(AZIMUTH, ELEVATION, ROLL, strict=True)])
TURNED = TURNED @ TURNED[0].T
UPS = np.stack([own_up(float(e), float(r)) for e, r in zip(ELEVATION, ROLL, strict=True)])


def test_headings_pass_180_and_angles_are_exact() -> None:
    path = path_of(TIME, TURNED, np.ones(60, bool), level(common_up(TURNED, UPS)))
    np.testing.assert_allclose(path.heading, AZIMUTH - 30, atol=1e-9)
    np.testing.assert_allclose(path.elevation, ELEVATION, atol=1e-9)
    np.testing.assert_allclose(path.roll, ROLL, atol=1e-9)


def test_a_drone_that_looks_straight_down_turns_steadily() -> None:
    rng = np.random.default_rng(0)
    trembling = [orientation(*(rng.normal(0, 0.2, 3) * [0, 1, 1] + [a, -90.0, 0.0]).tolist()) for a in AZIMUTH]
    turned = np.stack(trembling)
    path = path_of(TIME, turned @ turned[0].T, np.ones(60, bool), level(turned[0][:, 1]))
    np.testing.assert_allclose(path.heading, AZIMUTH - 30, atol=1.0)
    np.testing.assert_allclose(path.roll, 0.0, atol=0.5)
    assert path.elevation.min() >= -90.0


def test_gaps_are_bridged_and_told() -> None:
    known = np.ones(60, bool)
    known[20:30] = False
    turned = TURNED.copy()
    turned[20:30] = np.eye(3)
    path = path_of(TIME, turned, known, level(common_up(TURNED, UPS)))
    np.testing.assert_allclose(path.heading, AZIMUTH - 30, atol=0.05)
    assert path.bridged.sum() == 10


def test_smoothing_keeps_a_parabola_and_calms_noise() -> None:
    time = np.sort(np.random.default_rng(0).uniform(0, 2, 60))  # a rate that varies
    parabola = 3 + 2 * time - 5 * time**2
    np.testing.assert_allclose(smoothed(time, parabola), parabola, atol=1e-8)
    noise = np.random.default_rng(1).normal(0, 1, 60)
    assert smoothed(TIME, noise).std() < 0.85 * noise.std()

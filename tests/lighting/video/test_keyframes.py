"""Rotations averaged, loops closed, paths smoothed."""

import numpy as np

from lighting.geometry import Floats
from lighting.registration.rotations import camera_up, consensus_up, leveling_rotation, rotation_about, rotation_vector
from lighting.video.keyframes import _average_rotations, _chain_orientations, _Link, make_camera_path, smooth_parabolic
from tests.helpers.clips import orientation

TRUE = np.stack([orientation(18.0 * i, 5.0 * np.sin(i)) for i in range(20)])
TRUE = TRUE @ TRUE[0].T


def errors(found: Floats) -> Floats:
    return np.array([np.degrees(np.linalg.norm(rotation_vector(f @ t.T))) for f, t in zip(found, TRUE, strict=True)])


def links(noise: float, seed: int = 0) -> list[_Link]:
    """The chain, each turn off by about `noise` [deg], with a bias to one side as trackers have."""
    rng = np.random.default_rng(seed)
    off = np.radians(rng.normal([0.0, noise, 0.0], noise, (20, 3)))
    return [_Link(i, i + 1, rotation_about(off[i]) @ TRUE[i + 1] @ TRUE[i].T) for i in range(19)]


def test_a_closed_loop_takes_the_drift_back() -> None:
    chain = links(0.2)
    drifted, part = _chain_orientations(20, chain)
    assert not part.any()
    assert errors(drifted)[-1] > 2.0
    closed = _average_rotations(drifted, [*chain, _Link(0, 19, TRUE[19] @ TRUE[0].T, 5.0)], np.arange(20) == 0)
    assert errors(closed).max() < 0.7 * errors(drifted).max()
    assert errors(closed)[-1] < 0.7


def test_a_false_loop_does_little_harm() -> None:
    chain = links(0.02)
    before, _ = _chain_orientations(20, chain)
    false = _Link(2, 12, rotation_about(np.array([0.0, 0.5, 0.0])) @ TRUE[12] @ TRUE[2].T, 0.5)
    after = _average_rotations(before, [*chain, false], np.arange(20) == 0)
    assert np.abs(errors(after) - errors(before)).max() < 0.5


def test_what_no_turn_connects_is_another_part() -> None:
    _, part = _chain_orientations(20, [link for link in links(0.0) if link.a != 9])
    assert part.tolist() == [0] * 10 + [10] * 10


TIME = np.arange(60) / 30.0
AZIMUTH, ELEVATION, ROLL = np.linspace(30, 250, 60), np.linspace(-20, 30, 60), np.linspace(-5, 8, 60)
TURNED = np.stack([orientation(*map(float, a)) for a in zip(AZIMUTH, ELEVATION, ROLL, strict=True)])
TURNED = TURNED @ TURNED[0].T
UPS = np.stack([camera_up(float(e), float(r)) for e, r in zip(ELEVATION, ROLL, strict=True)])


def test_headings_pass_180_and_angles_are_exact() -> None:
    path = make_camera_path(TIME, TURNED, np.ones(60, bool), leveling_rotation(consensus_up(TURNED, UPS)))
    np.testing.assert_allclose(path.heading, AZIMUTH - 30, atol=1e-9)
    np.testing.assert_allclose(path.elevation, ELEVATION, atol=1e-9)
    np.testing.assert_allclose(path.roll, ROLL, atol=1e-9)


def test_a_drone_that_looks_straight_down_turns_steadily() -> None:
    rng = np.random.default_rng(0)
    trembling = [orientation(*(rng.normal(0, 0.2, 3) * [0, 1, 1] + [a, -90.0, 0.0]).tolist()) for a in AZIMUTH]
    turned = np.stack(trembling)
    path = make_camera_path(TIME, turned @ turned[0].T, np.ones(60, bool), leveling_rotation(turned[0][:, 1]))
    np.testing.assert_allclose(path.heading, AZIMUTH - 30, atol=1.0)
    np.testing.assert_allclose(path.roll, 0.0, atol=0.5)
    assert path.elevation.min() >= -90.0


def test_gaps_are_bridged_and_told() -> None:
    known = np.ones(60, bool)
    known[20:30] = False
    turned = TURNED.copy()
    turned[20:30] = np.eye(3)
    path = make_camera_path(TIME, turned, known, leveling_rotation(consensus_up(TURNED, UPS)))
    np.testing.assert_allclose(path.heading, AZIMUTH - 30, atol=0.05)
    assert path.bridged.sum() == 10


def test_smoothing_keeps_a_parabola_and_calms_noise() -> None:
    time = np.sort(np.random.default_rng(0).uniform(0, 2, 60))  # a rate that varies
    parabola = 3 + 2 * time - 5 * time**2
    np.testing.assert_allclose(smooth_parabolic(time, parabola), parabola, atol=1e-8)
    noise = np.random.default_rng(1).normal(0, 1, 60)
    assert smooth_parabolic(TIME, noise).std() < 0.85 * noise.std()

"""Rotation averaging against turns that are known."""

import numpy as np

from lighting.geometry import Floats
from lighting.turns.rays import rotation_about, rotation_vector
from lighting.video.keyframes import Link, averaged, chained
from tests.lighting.video.clips import orientation

TRUE = np.stack([orientation(18.0 * i, 5.0 * np.sin(i)) for i in range(20)])
TRUE = TRUE @ TRUE[0].T


def errors(found: Floats) -> Floats:
    return np.array([np.degrees(np.linalg.norm(rotation_vector(f @ t.T))) for f, t in zip(found, TRUE, strict=True)])


def links(noise: float, seed: int = 0) -> list[Link]:
    """The chain, each turn off by about `noise` [deg], with a bias to one side as trackers have."""
    rng = np.random.default_rng(seed)
    off = np.radians(rng.normal([0.0, noise, 0.0], noise, (20, 3)))
    return [Link(i, i + 1, rotation_about(off[i]) @ TRUE[i + 1] @ TRUE[i].T) for i in range(19)]


def test_a_closed_loop_takes_the_drift_back() -> None:
    chain = links(0.2)
    drifted, part = chained(20, chain)
    assert not part.any()
    assert errors(drifted)[-1] > 2.0
    closed = averaged(drifted, [*chain, Link(0, 19, TRUE[19] @ TRUE[0].T, 5.0)], np.arange(20) == 0)
    assert errors(closed).max() < 0.7 * errors(drifted).max()
    assert errors(closed)[-1] < 0.7


def test_a_false_loop_does_little_harm() -> None:
    chain = links(0.02)
    before, _ = chained(20, chain)
    false = Link(2, 12, rotation_about(np.array([0.0, 0.5, 0.0])) @ TRUE[12] @ TRUE[2].T, 0.5)
    after = averaged(before, [*chain, false], np.arange(20) == 0)
    assert np.abs(errors(after) - errors(before)).max() < 0.5


def test_what_no_turn_connects_is_another_part() -> None:
    _, part = chained(20, [link for link in links(0.0) if link.a != 9])
    assert part.tolist() == [0] * 10 + [10] * 10

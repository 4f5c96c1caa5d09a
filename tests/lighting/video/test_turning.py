"""The turn of a frame against its keyframe, from points whose camera is known."""

import numpy as np
import pytest

from lighting.geometry import Floats
from lighting.turns import Matches, Turn
from lighting.turns.rays import focal_of, project
from lighting.turns.upright import own_axes
from lighting.video.lens import tells_lens
from lighting.video.turning import turning

SIZE = (640, 360)
PIXEL = 2.0 / float(np.hypot(*SIZE))
FOCAL = focal_of(45.0, *SIZE)
TURN = own_axes(4.0, 1.0, 0.5)


def matches(step: tuple[float, float, float], moving: float = 0.0, blur: float = 0.1) -> Matches:
    """120 points 3 to 30 m away, before and after a TURN and a step [m]; a share of them `moving`, noise in pixels."""
    rng = np.random.default_rng(0)
    distance = np.exp(rng.uniform(np.log(3), np.log(30), 120))[:, None]
    ahead = np.column_stack([rng.uniform(-0.45, 0.45, 120), rng.uniform(-0.25, 0.25, 120), -np.ones(120)]) * distance
    a, b = project(ahead, FOCAL), project((ahead - step) @ TURN.T, FOCAL)
    b[: round(120 * moving)] += PIXEL * np.array([25.0, 4.0])
    return Matches(a, b + rng.normal(0, blur * PIXEL, b.shape), PIXEL)


def error(found: Floats) -> float:
    """Deg."""
    return float(np.degrees(np.arccos(np.clip((np.trace(found @ TURN.T) - 1) / 2, -1, 1))))


@pytest.mark.parametrize("step", [(0.6, 0.0, 0.0), (0.1, 0.0, -0.8)])
def test_a_walk_does_not_turn_the_camera(step: tuple[float, float, float]) -> None:
    found = turning(matches(step), FOCAL, np.eye(3))
    assert error(found.rotation) < 0.15
    assert found.share > 0.9


def test_what_moves_is_outvoted() -> None:
    found = turning(matches((0.0, 0.0, 0.0), moving=0.4), FOCAL, np.eye(3))
    assert error(found.rotation) < 0.05
    assert found.share >= 0.58


def test_blur_is_no_walk() -> None:
    assert error(turning(matches((0.0, 0.0, 0.0), blur=2.0), FOCAL, np.eye(3)).rotation) < 0.3


@pytest.mark.parametrize(
    ("fov", "inliers", "translates", "told"),
    [(40.0, 90, False, True), (40.0, 20, False, False), (40.0, 90, True, True), (110.0, 90, True, False)],
)
def test_a_lens_is_told_by_clear_turns_only(fov: float, inliers: int, translates: bool, told: bool) -> None:
    turn = Turn(np.eye(3), np.eye(3), (fov, fov), 2.0, inliers, 100, translates)
    assert tells_lens(turn, 50.0) == told


def test_a_lens_is_not_told_by_a_zoom() -> None:
    assert not tells_lens(Turn(np.eye(3), np.eye(3), (40.0, 30.0), 1.0, 90, 100, zoomed=True), 50.0)

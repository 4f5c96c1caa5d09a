"""Points tracked, and the rotations and gains that follow."""

from datetime import timedelta

import numpy as np
import pytest

from lighting.fusion.user_input import UserInput
from lighting.geometry import Floats
from lighting.registration.features import Matches
from lighting.registration.rotations import camera_from_world, focal_from_fov, project_points, rotation_vector
from lighting.registration.two_view import RelativeRotation
from lighting.video.intrinsics import constrains_fov
from lighting.video.tracking import ClipMetadata, PointTracker, chain_gains, estimate_frame_rotation
from tests.helpers.clips import FOV, SIZE, Pixels, frames, look, orientation, pan, seen
from tests.helpers.predictions import METADATA, MORNING


def test_turns_are_followed_to_a_tenth_of_a_degree_over_several_keyframes() -> None:
    count, reach = 45, 40.0
    follower = PointTracker()
    guess: Floats = np.eye(3)
    known: dict[int, Floats] = {}
    share = np.linspace(0, 1, count)
    start = orientation(0.0, 0.0, 0.0)
    for frame, s in zip(frames(pan(count, reach)), share.tolist(), strict=True):
        step = follower.follow(frame)
        if step.is_start:
            known[step.key] = np.eye(3)
        found = estimate_frame_rotation(step.matches, focal_from_fov(FOV, *SIZE), guess)
        guess = found.rotation if step.next_key is None else np.eye(3)
        own = found.rotation @ known[step.key]
        if step.next_key is not None:
            known[step.next_key] = own
        true = orientation(reach * s, 3 * np.sin(3 * s), 2 * s) @ start.T
        assert np.degrees(np.linalg.norm(rotation_vector(own @ true.T))) < 0.15  # a pixel is 0.25 deg
    assert len(known) > 2
    assert step.stretch == 0


def test_gains_are_followed_and_do_not_disturb() -> None:
    follower = PointTracker()
    pictures = [look(0.3 * i, gain=1.0 - 0.02 * i) for i in range(12)]
    steps = [follower.follow(frame) for frame in frames(pictures)]
    assert {step.stretch for step in steps} == {0}
    assert steps[-1].gain == pytest.approx([0.78**2.3] * 3, rel=0.08)  # sRGB's curve is near a power of 2.3 there


def test_a_turn_is_no_gain() -> None:
    dots = np.full((512, 1024, 3), 150, np.uint8)  # dark dots look larger towards the picture's edge
    for x, y in np.random.default_rng(0).integers((0, 0), (1024, 512), (1500, 2)).tolist():
        dots[y : y + 3, x : x + 3] = 40
    follower = PointTracker()
    wide = [seen(dots, 0.0, 1.5 * i, fov=70.0) for i in range(15)]
    steps = [follower.follow(frame) for frame in frames(wide)]
    assert {step.stretch for step in steps} == {0}
    assert chain_gains(steps)[-1] == pytest.approx([1.0] * 3, rel=0.02)


def cuts(pictures: list[Pixels]) -> list[int]:
    follower = PointTracker()
    return [step.frame for frame in frames(pictures) if (step := follower.follow(frame)).is_start]


def test_a_cut_begins_a_new_stretch() -> None:
    assert cuts([*pan(8, 5.0), *pan(8, 5.0, seed=5)]) == [0, 8]


def test_black_frames_have_nothing_to_follow() -> None:
    black = np.zeros((180, 320, 3), np.uint8)
    assert cuts([black] * 4) == [0, 1, 2, 3]


def test_another_size_is_another_stretch() -> None:
    assert cuts([look(0.0), look(0.1), look(0.2)[:160], look(0.3)[:160]]) == [0, 2]


def test_a_still_picture_does_not_turn() -> None:
    follower = PointTracker()
    steps = [follower.follow(frame) for frame in frames([look(0.0)] * 10)]
    found = estimate_frame_rotation(steps[-1].matches, focal_from_fov(FOV, *SIZE), np.eye(3))
    assert np.degrees(np.linalg.norm(rotation_vector(found.rotation))) < 0.01
    assert {step.key for step in steps} == {0}


def test_a_thing_that_moves_is_outvoted() -> None:
    follower, thing = PointTracker(), np.random.default_rng(1).integers(0, 255, (10, 12, 3), dtype=np.uint8)
    pictures = []
    for i in range(12):
        picture = look(0.8 * i)
        picture[60:140, 20 + 9 * i : 116 + 9 * i] = thing.repeat(8, axis=0).repeat(8, axis=1)
        pictures.append(picture)
    steps = [follower.follow(frame) for frame in frames(pictures)]
    found = estimate_frame_rotation(steps[-1].matches, focal_from_fov(FOV, *SIZE), np.eye(3))
    true = orientation(8.8) @ orientation(0.0).T
    assert np.degrees(np.linalg.norm(rotation_vector(found.rotation @ true.T))) < 0.2


FRAME_SIZE = (640, 360)
PIXEL = 2.0 / float(np.hypot(*FRAME_SIZE))
FOCAL = focal_from_fov(45.0, *FRAME_SIZE)
TURN = camera_from_world(4.0, 1.0, 0.5)


def matches(step: tuple[float, float, float], moving: float = 0.0, blur: float = 0.1) -> Matches:
    """120 points 3 to 30 m away, before and after a TURN and a step [m]; a share of them `moving`, noise in pixels."""
    rng = np.random.default_rng(0)
    distance = np.exp(rng.uniform(np.log(3), np.log(30), 120))[:, None]
    ahead = np.column_stack([rng.uniform(-0.45, 0.45, 120), rng.uniform(-0.25, 0.25, 120), -np.ones(120)]) * distance
    a, b = project_points(ahead, FOCAL), project_points((ahead - step) @ TURN.T, FOCAL)
    b[: round(120 * moving)] += PIXEL * np.array([25.0, 4.0])
    return Matches(a, b + rng.normal(0, blur * PIXEL, b.shape), PIXEL)


def error(found: Floats) -> float:
    """Deg."""
    return float(np.degrees(np.arccos(np.clip((np.trace(found @ TURN.T) - 1) / 2, -1, 1))))


@pytest.mark.parametrize("step", [(0.6, 0.0, 0.0), (0.1, 0.0, -0.8)])
def test_a_walk_does_not_turn_the_camera(step: tuple[float, float, float]) -> None:
    found = estimate_frame_rotation(matches(step), FOCAL, np.eye(3))
    assert error(found.rotation) < 0.15
    assert found.share > 0.9


def test_what_moves_is_outvoted() -> None:
    found = estimate_frame_rotation(matches((0.0, 0.0, 0.0), moving=0.4), FOCAL, np.eye(3))
    assert error(found.rotation) < 0.05
    assert found.share >= 0.58


def test_blur_is_no_walk() -> None:
    assert error(estimate_frame_rotation(matches((0.0, 0.0, 0.0), blur=2.0), FOCAL, np.eye(3)).rotation) < 0.3


@pytest.mark.parametrize(
    ("fov", "inliers", "translates", "told"),
    [(40.0, 90, False, True), (40.0, 20, False, False), (40.0, 90, True, True), (110.0, 90, True, False)],
)
def test_a_lens_is_told_by_clear_turns_only(fov: float, inliers: int, translates: bool, told: bool) -> None:
    turn = RelativeRotation(np.eye(3), np.eye(3), (fov, fov), 2.0, inliers, 100, translates)
    assert constrains_fov(turn, 50.0) == told


def test_a_lens_is_not_told_by_a_zoom() -> None:
    assert not constrains_fov(RelativeRotation(np.eye(3), np.eye(3), (40.0, 30.0), 1.0, 90, 100, zoomed=True), 50.0)


def test_a_stated_heading_is_that_of_the_first_frame_and_the_gimbals_counts_later() -> None:
    clip = ClipMetadata(METADATA, user_input=UserInput(heading=10.0))
    assert clip.prior_at(0.0, 200.0).observations.heading == 10.0
    assert clip.prior_at(5.0, 200.0).observations.heading == 200.0
    assert clip.prior_at(5.0).observations.heading is None


def test_a_stated_offset_replaces_that_of_the_clip_and_says_so() -> None:
    prior = ClipMetadata(METADATA, user_input=UserInput(utc_offset=3.0)).prior_at(60.0)
    (instant,) = prior.instants.instants
    assert instant.utc_time == MORNING - timedelta(hours=1) + timedelta(minutes=1)
    assert instant.source == "user"
    assert "replaced the file's, +02:00" in prior.warnings[0]

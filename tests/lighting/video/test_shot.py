"""Shots: lens, path, sun and warnings."""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from lighting.errors import VideoError
from lighting.fusion.user_input import UserInput
from lighting.geometry import Floats
from lighting.model import Model
from lighting.registration.rotations import camera_up, consensus_up, leveling_rotation, rotation_about, rotation_vector
from lighting.video.intrinsics import smooth_parabolic
from lighting.video.metadata import Gimbal
from lighting.video.observation import observe_shots
from lighting.video.shot import Shot, _average_rotations, _chain_orientations, _Link, _make_camera_path, solve_shot
from lighting.video.tracking import ClipMetadata
from tests.helpers.clips import FOV, Pixels, frames, look, orientation, pan, panorama

BLACK = np.zeros((180, 320, 3), np.uint8)

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
    path = _make_camera_path(TIME, TURNED, np.ones(60, bool), leveling_rotation(consensus_up(TURNED, UPS)))
    np.testing.assert_allclose(path.heading, AZIMUTH - 30, atol=1e-9)
    np.testing.assert_allclose(path.elevation, ELEVATION, atol=1e-9)
    np.testing.assert_allclose(path.roll, ROLL, atol=1e-9)


def test_a_drone_that_looks_straight_down_turns_steadily() -> None:
    rng = np.random.default_rng(0)
    trembling = [orientation(*(rng.normal(0, 0.2, 3) * [0, 1, 1] + [a, -90.0, 0.0]).tolist()) for a in AZIMUTH]
    turned = np.stack(trembling)
    path = _make_camera_path(TIME, turned @ turned[0].T, np.ones(60, bool), leveling_rotation(turned[0][:, 1]))
    np.testing.assert_allclose(path.heading, AZIMUTH - 30, atol=1.0)
    np.testing.assert_allclose(path.roll, 0.0, atol=0.5)
    assert path.elevation.min() >= -90.0


def test_gaps_are_bridged_and_told() -> None:
    known = np.ones(60, bool)
    known[20:30] = False
    turned = TURNED.copy()
    turned[20:30] = np.eye(3)
    path = _make_camera_path(TIME, turned, known, leveling_rotation(consensus_up(TURNED, UPS)))
    np.testing.assert_allclose(path.heading, AZIMUTH - 30, atol=0.05)
    assert path.bridged.sum() == 10


def test_smoothing_keeps_a_parabola_and_calms_noise() -> None:
    time = np.sort(np.random.default_rng(0).uniform(0, 2, 60))  # a rate that varies
    parabola = 3 + 2 * time - 5 * time**2
    np.testing.assert_allclose(smooth_parabolic(time, parabola), parabola, atol=1e-8)
    noise = np.random.default_rng(1).normal(0, 1, 60)
    assert smooth_parabolic(TIME, noise).std() < 0.85 * noise.std()


@pytest.fixture(scope="module")
def model(network: Path) -> Model:
    return Model.load(network, threads=1)


def shots(pictures: list[Pixels], model: Model, around: ClipMetadata | None = None) -> list[Shot]:
    found = observe_shots(frames(pictures), model, 0.5)
    return [solve_shot(watched, around or ClipMetadata()) for watched in found]


def test_a_pan_tells_its_lens_and_its_headings(model: Model) -> None:
    (shot,) = shots(pan(40, 50.0), model)
    assert shot.vertical_fov == pytest.approx(FOV, abs=1.0)  # the network says 50
    assert shot.path.heading[-1] == pytest.approx(50.0, abs=2.0)  # the network's level is 4 deg off
    assert not shot.path.bridged.any()
    assert len(shot.frames) == 40


def test_a_gimbal_tells_the_level_and_north(model: Model) -> None:
    time = np.arange(36) / 30.0
    share = np.linspace(0, 1, 36)
    gimbal = Gimbal(time, 300.0 + 50.0 * share, 3.0 * np.sin(3.0 * share), 2.0 * share)
    (shot,) = shots(pan(36, 50.0), model, ClipMetadata(gimbal=gimbal))
    np.testing.assert_allclose(shot.path.heading, 50.0 * share, atol=0.7)
    np.testing.assert_allclose(shot.path.elevation, 3.0 * np.sin(3.0 * share), atol=0.3)
    assert shot.north == pytest.approx(300.0, abs=1.0)


def test_a_lens_that_is_given_stays(model: Model) -> None:
    (shot,) = shots(pan(20, 15.0), model, ClipMetadata(user_input=UserInput(vertical_fov=47.0)))
    assert (shot.vertical_fov, shot.fov_std) == (47.0, 0.0)


def test_a_cut_makes_two_shots_each_from_azimuth_0(model: Model) -> None:
    first, second = shots([*pan(25, 20.0), *pan(25, 20.0, seed=5)], model)
    assert first.frames.tolist() == list(range(25))
    assert second.frames.tolist() == list(range(25, 50))
    assert second.path.heading[0] == pytest.approx(0.0, abs=0.1)


def test_a_picture_of_another_size_begins_a_shot_with_its_own_lens(model: Model) -> None:
    narrow = [np.ascontiguousarray(picture[:, 100:220]) for picture in pan(25, 30.0)]
    first, second = shots([*pan(25, 30.0), *narrow], model)
    assert (len(first.frames), len(second.frames)) == (25, 25)
    assert first.vertical_fov == pytest.approx(FOV, abs=1.5)
    assert second.vertical_fov == pytest.approx(FOV, abs=1.5)


def test_black_frames_in_a_shot_are_bridged(model: Model) -> None:
    pictures = pan(40, 20.0)
    pictures[18:22] = [BLACK] * 4
    (shot,) = shots(pictures, model)
    assert 3 <= shot.path.bridged.sum() <= 6
    np.testing.assert_allclose(np.diff(shot.path.heading), 20.0 / 39, atol=0.3)


def test_a_still_clip_is_a_shot_that_does_not_turn(model: Model) -> None:
    (shot,) = shots([look(10.0)] * 20, model)
    assert np.ptp(shot.path.heading) < 0.05
    assert shot.fov_std > 3.0  # nothing but the network tells the lens


def test_one_frame_is_a_shot(model: Model) -> None:
    (shot,) = shots([look(10.0)], model)
    assert len(shot.frames) == 1


def test_a_dark_clip_says_so(model: Model) -> None:
    with pytest.raises(VideoError, match="bright enough"):
        shots([BLACK] * 10, model)


def test_night_that_falls_in_a_shot_ends_its_looks_alone(model: Model) -> None:
    """Civil twilight ends 15 s after the first of 30 frames, one a second."""
    dusk = UserInput(time=datetime(2024, 6, 1, 19, 47, 33, tzinfo=UTC), latitude=48.0, longitude=11.0, vertical_fov=FOV)
    (watched,) = observe_shots(frames(pan(30, 20.0), 1.0), model, 0.5)
    (begun,) = observe_shots(frames(pan(30, 20.0)[:15], 1.0), model, 0.5)
    shot, by_day = (solve_shot(one, ClipMetadata(user_input=dusk)) for one in (watched, begun))
    assert shot.prior.warnings[-1].startswith("By time and place it is night at 15.0 s")
    assert shot.prior.observations == by_day.prior.observations
    assert len(by_day.prior.warnings) == len(shot.prior.warnings) - 1
    assert "time+place" in shot.posterior.used
    assert shot.north == pytest.approx(by_day.north, abs=3.0)
    assert len(shot.frames) == 30


def test_exposure_is_followed_through_keyframes(model: Model) -> None:
    pictures = [look(1.0 * i, gain=1.0 - 0.01 * i) for i in range(31)]
    (shot,) = shots(pictures, model)
    assert shot.gains[-1] == pytest.approx([0.7**2.3] * 3, rel=0.12)  # sRGB is near a power of 2.3
    assert shot.gains[0] == pytest.approx([1.0] * 3)


def before_moving_things(speeds: Sequence[tuple[float, float]], top: int) -> list[Pixels]:
    """A place that stands still, and below `top` a thing beside the other, each with its own speed [pixels a frame]."""
    place, things = look(10.0), panorama(5)[100:500]
    width = 320 // len(speeds)
    pictures = []
    for i in range(40):
        picture = place.copy()
        for number, (right, down) in enumerate(speeds):
            row, column = top + 80 - round(down * i), number * width + 350 - round(right * i)
            picture[top:, number * width : (number + 1) * width] = things[
                row : row + 180 - top, column : column + width
            ]
        pictures.append(picture)
    return pictures


def test_points_that_obey_no_one_turn_are_told(model: Model) -> None:
    (shot,) = shots(before_moving_things([(2.0, 1.0), (-1.0, 1.5), (1.0, -2.0), (-2.0, -1.0)], 20), model)
    assert any("of the points agree" in warning for warning in shot.prior.warnings)


def test_points_of_a_thing_that_passes_are_told_by_the_lens_they_would_need(model: Model) -> None:
    (shot,) = shots(before_moving_things([(-3.0, 0.0)], 20), model)
    assert any("The points show a field of view" in warning for warning in shot.prior.warnings)


def test_a_pan_has_no_doubts(model: Model) -> None:
    (shot,) = shots(pan(30, 40.0), model)
    assert shot.prior.warnings == ()

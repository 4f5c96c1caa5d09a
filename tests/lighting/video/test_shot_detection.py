"""Where one picture fades into another one."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from lighting.geometry import Floats
from lighting.light_probe import LightProbe, main_light
from lighting.model import Model
from lighting.preview.drawing import text_width
from lighting.records import Lighting
from lighting.video.observation import observe_shots
from lighting.video.overlay import _draw_overlay, _fit_layout
from lighting.video.shot import FrameLight, Shot, solve_shot
from lighting.video.shot_detection import Dissolve, DissolveDetector, _is_mixture
from lighting.video.tracking import ClipMetadata
from tests.helpers.clips import Pixels, frames, look, pan

ALONE, MIXED = 45, 18  # frames, at 30 a second


def dissolving(mixed: int = MIXED, turn: float = 10.0) -> list[Pixels]:
    """A camera that turns by 20 deg in one place, and one that turns by another angle in another."""
    first, second = pan(ALONE + mixed, 20.0), pan(ALONE + mixed, turn, seed=5)
    share = (np.arange(mixed) + 1.0) / (mixed + 1.0)
    both = [
        np.round((1 - s) * a + s * b).astype(np.uint8)
        for s, a, b in zip(share.tolist(), first[ALONE:], second[:mixed], strict=True)
    ]
    return [*first[:ALONE], *both, *second[mixed:]]


def told(pictures: list[Pixels]) -> list[Dissolve]:
    dissolves = DissolveDetector()
    found = [dissolves.take(frame) for frame in frames(pictures)]
    return [dissolve for dissolve in (*found, dissolves.finish()) if dissolve is not None]


def shots(pictures: list[Pixels], model: Model) -> list[Shot]:
    return [solve_shot(watched, ClipMetadata()) for watched in observe_shots(frames(pictures), model, 0.5)]


@pytest.fixture(scope="module")
def model(network: Path) -> Model:
    return Model.load(network, threads=1)


@pytest.mark.parametrize("mixed", [9, 18, 30])
def test_a_dissolve_is_told_with_its_time(mixed: int) -> None:
    (dissolve,) = told(dissolving(mixed))
    assert dissolve.first == pytest.approx(ALONE / 30.0, abs=0.3)
    assert dissolve.last == pytest.approx((ALONE + mixed) / 30.0, abs=0.3)


def test_a_dissolve_between_cameras_that_turn_alike_is_told() -> None:
    assert len(told(dissolving(turn=20.0))) == 1


def test_a_pan_a_cut_and_an_exposure_that_changes_are_no_dissolves() -> None:
    assert told(pan(90, 60.0)) == []
    assert told([*pan(45, 20.0), *pan(45, 20.0, seed=5)]) == []
    assert told([look(0.5 * i, gain=1.0 - 0.01 * i) for i in range(60)]) == []


def test_a_place_that_fades_to_black_and_back_is_no_dissolve() -> None:
    gains = np.abs(np.linspace(-1.0, 1.0, 60)).tolist()
    assert told([look(0.3 * i, gain=g) for i, g in enumerate(gains)]) == []


def test_a_glare_that_comes_and_goes_is_no_dissolve() -> None:
    glare = np.linspace(0.0, 200.0, 320)[None, :, None]
    strength = np.clip(1.0 - np.abs(np.linspace(-1.5, 1.5, 60)), 0.0, 1.0).tolist()
    pictures = [np.clip(look(0.3 * i) + s * glare, 0, 255).astype(np.uint8) for i, s in enumerate(strength)]
    assert told(pictures) == []


def test_a_dissolve_makes_two_shots_and_its_own_frames_are_bridged(model: Model) -> None:
    first, second = shots(dissolving(), model)
    middle = ALONE + MIXED // 2
    assert len(first.frames) + len(second.frames) == 2 * ALONE + MIXED
    assert second.frames[0] == pytest.approx(middle, abs=4)
    assert first.path.bridged[ALONE + 3 :].all()
    assert second.path.bridged[: ALONE + MIXED - 3 - second.frames[0]].all()
    assert first.path.heading[ALONE - 6] == pytest.approx(20.0 * (ALONE - 6) / (ALONE + MIXED - 1), abs=1.5)
    turned = second.path.heading[-1] - second.path.heading[0]
    assert turned == pytest.approx(10.0 * ALONE / (ALONE + MIXED - 1), abs=2.0)
    np.testing.assert_allclose(second.gains[0], 1.0)


def test_what_the_network_sees_of_a_mixture_does_not_count(model: Model) -> None:
    for watched in observe_shots(frames(dissolving()), model, 0.1):
        assert watched.estimates
        assert not any(ALONE + 3 <= frame < ALONE + MIXED - 3 for frame in watched.estimates)


def test_a_mixture_has_one_share_throughout() -> None:
    rng = np.random.default_rng(0)
    first, second = rng.normal(0.0, 40.0, (2, 500))

    def mixed(share: float | Floats) -> bool:
        return _is_mixture(first, share * first + (1.0 - share) * second, second)

    assert mixed(0.5)
    assert mixed(0.3)
    assert not mixed(0.05)
    assert not mixed((rng.random(500) < 0.5).astype(float))  # part the one, part the other
    assert not _is_mixture(first, first + 5.0, first + 10.0)  # no two pictures


BEHIND = Lighting(sun_azimuth=-149.9, sun_elevation=68.3, turbidity=3.0, exposure=0.1, vertical_fov=50.0)


def words_of(width: int, height: int, balls: NDArray[np.float32]) -> Pixels:
    """Where (height, width) the words of a frame in a hurry differ from those of a slow one."""
    grey = np.full((height, width, 3), 110, np.uint8)
    probe = LightProbe(np.zeros((9, 3)), main_light(BEHIND))
    slow = FrameLight(1, 0, 0.4, replace(BEHIND, relative_heading=5.0), (1.0, 1.0, 1.0), False, probe)
    far = FrameLight(1, 0, 8888.8, replace(BEHIND, relative_heading=200.0), (1.0, 1.0, 1.0), True, probe)
    return np.asarray(np.any(_draw_overlay(grey, slow, balls) != _draw_overlay(grey, far, balls), axis=-1))


@pytest.mark.parametrize(("width", "height"), [(432, 768), (360, 640), (640, 360), (320, 180), (100, 200)])
def test_words_stand_inside_the_picture_and_beside_the_balls(width: int, height: int) -> None:
    balls = np.ones((round(0.25 * width), round(0.6 * width), 3), np.float32)
    rows, columns = np.nonzero(words_of(width, height, balls))
    assert columns.min() >= 4
    assert columns.max() <= width - 10
    below = _fit_layout(width, balls.shape[1]).below
    over_balls = (rows < height - below) & (rows >= height - below - balls.shape[0]) & (columns < 12 + balls.shape[1])
    assert not over_balls.any()
    assert rows.min() >= height - below  # all words are under the balls


def test_where_there_is_room_words_and_balls_share_a_line() -> None:
    layout = _fit_layout(768, 246)
    assert layout.lines == ((0, 1, 2),)
    assert layout.below == 12
    assert text_width("8888.8 s   sun -149.9°, 68.3° high   turned -160.0° (bridged)", layout.size) < 768 - 246 - 40

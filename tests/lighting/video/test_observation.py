"""One frame of a clip, as the network sees it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lighting.fusion.estimate import predict_photo
from lighting.fusion.user_input import UserInput
from lighting.model import Model
from lighting.photo.reader import photo_from_array
from lighting.video import observation
from lighting.video.observation import MIN_LOOK_INTERVAL, estimate_frame, observe_shots
from tests.conftest import scene
from tests.helpers.cameras import poles
from tests.helpers.clips import frames, look, pan


def sky_of(model: Model, pixels: np.ndarray) -> np.ndarray:
    light = estimate_frame(model, pixels).prediction.light
    assert light is not None
    return light.sky_irradiance


def test_a_frames_sky_gives_the_light_its_colour(lit_network: Path) -> None:
    model = Model.load(lit_network)
    unseen, blue, red = scene(320, 240) // 2, scene(320, 240), scene(320, 240)
    blue[:120], red[:120] = (100, 160, 240), (240, 160, 100)
    said = sky_of(model, unseen)
    assert said == pytest.approx([0.4, 0.5, 0.8])
    assert sky_of(model, blue)[2] / sky_of(model, blue)[0] > 1.1 * said[2] / said[0]
    assert sky_of(model, red)[2] / sky_of(model, red)[0] < 0.9 * said[2] / said[0]


def test_a_network_that_says_nothing_of_the_light_is_left_alone(network: Path) -> None:
    seen = estimate_frame(Model.load(network), scene(320, 240))
    assert seen.prediction.light is None
    assert seen.ground is None


def test_a_lens_that_is_known_enters_how_the_camera_was_held(network: Path) -> None:
    model, pixels = Model.load(network), poles(20.0, 0.0, 60.0)
    seen = estimate_frame(model, pixels, 60.0)
    assert seen.by_lens is not None
    assert estimate_frame(model, pixels).by_lens is None
    assert seen.prediction.camera_elevation == predict_photo(model, photo_from_array(pixels)).camera_elevation
    prior = predict_photo(model, photo_from_array(pixels), UserInput(vertical_fov=60.0)).camera_elevation
    assert seen.by_lens.prediction.camera_elevation == prior != seen.prediction.camera_elevation


def test_a_frames_ground_has_the_colour_that_it_shows(lit_network: Path) -> None:
    model = Model.load(lit_network)
    green = scene(320, 240)
    green[120:] = (60, 120, 40)
    ground = estimate_frame(model, green).ground
    assert ground is not None
    assert ground[1] > 2 * ground[0] > 2 * ground[2]


def looks_at(monkeypatch: pytest.MonkeyPatch, pictures: list[np.ndarray], rate: float) -> list[int]:
    """The frames that the network sees of a clip."""
    seen: list[int] = []
    monkeypatch.setattr(observation, "estimate_frame", lambda _, pixels, __: seen.append(int(pixels[0, 0, 0])))
    numbered = [picture.copy() for picture in pictures]
    for number, picture in enumerate(numbered):
        picture[0, 0] = number
    model: Any = None
    for _ in observe_shots(frames(numbered, rate), model):
        pass
    return seen


def test_frames_without_contrast_are_not_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    flat = [np.full((90, 160, 3), level, np.uint8) for level in (128, 60, 180, 250, 128)] * 4
    assert looks_at(monkeypatch, flat, 1.0) == []
    assert looks_at(monkeypatch, [*flat[:3], pan(1)[0]], 1.0) == [3]


def test_a_clip_in_which_nothing_can_be_followed_costs_no_look_a_frame(monkeypatch: pytest.MonkeyPatch) -> None:
    noise = np.random.default_rng(0).integers(0, 255, (60, 90, 160, 3), dtype=np.uint8)
    seen = looks_at(monkeypatch, list(noise), 60.0)
    assert 5 <= len(seen) <= 11
    assert np.diff(seen).min() >= 60 * MIN_LOOK_INTERVAL - 1e-6


def test_a_new_shot_is_looked_at_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    pictures = [look(0.0)] * 20 + [look(90.0, seed=1)] * 20
    assert next(n for n in looks_at(monkeypatch, pictures, 30.0) if n >= 20) <= 23

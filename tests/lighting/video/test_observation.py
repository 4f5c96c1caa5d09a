"""One frame of a clip, as the network sees it."""

from pathlib import Path

import numpy as np
import pytest

from lighting.fusion.estimate import predict_photo
from lighting.fusion.user_input import UserInput
from lighting.model import Model
from lighting.photo.reader import photo_from_array
from lighting.video.observation import estimate_frame
from tests.conftest import scene
from tests.helpers.cameras import poles


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

"""What the pixels of one photo say."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from lighting.decoding import best_guess
from lighting.evidence.given import Given
from lighting.evidence.said import said_of, upright
from lighting.geometry import Floats, Pinhole, angle_between, camera_axes, camera_pixel, direction
from lighting.model import Model
from lighting.photo import PhotoFacts, photo_of, to_tensor
from lighting.records import Prediction
from tests.lighting.evidence.test_calibration import poles
from tests.lighting.evidence.test_fusion import lobe

SIZE = (400, 300)


def sunny(elevation: float, azimuth: float, sun: float) -> Prediction:
    """A camera that is said to look 4 deg too high, with a sure sun."""
    return replace(lobe(azimuth, sun, 300.0), camera_elevation=elevation + 4.0, camera_roll=0.0, vertical_fov=50.0)


def with_glare(said: Prediction, azimuth: float, sun: float) -> NDArray[np.uint8]:
    """Poles seen by a level camera, and a white disc where the said camera has the sun."""
    pixels = poles(0.0, 0.0, 50.0, SIZE)
    camera = Pinhole(*SIZE, 50.0, 0.0, said.camera_elevation, 0.0)
    x, y = camera_pixel(direction(azimuth, sun), camera)
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]]
    pixels[np.hypot(rows - y, columns - x) < 16] = 255
    return pixels


@pytest.mark.parametrize("sun", [8.0, 14.0])
def test_a_sun_in_the_picture_stays_on_its_pixel_by_the_corrected_camera(sun: float) -> None:
    said = sunny(0.0, 10.0, sun)
    known = upright(said, with_glare(said, 10.0, sun))
    assert known.camera_elevation == pytest.approx(0.0, abs=1.0)
    before = camera_axes(0.0, said.camera_elevation, said.camera_roll) @ direction(10.0, sun)
    after = camera_axes(0.0, known.camera_elevation, known.camera_roll) @ seen_sun(known)
    assert np.degrees(np.arccos(np.clip(before @ after, -1, 1))) < 1.5
    assert angle_between(seen_sun(known), direction(10.0, sun - 4.0)) < 1.5
    assert known.sun_probability.sum() == pytest.approx(1.0, abs=1e-4)


def test_a_sun_outside_the_picture_stays_where_it_is() -> None:
    said = sunny(0.0, 170.0, 40.0)
    known = upright(said, poles(0.0, 0.0, 50.0, SIZE))
    assert known.camera_elevation == pytest.approx(0.0, abs=1.0)
    assert known.sun_probability is said.sun_probability


def test_a_network_s_answer_has_the_camera_by_the_straight_lines(network: Path) -> None:
    """And an empty frame keeps the network's own."""
    model = Model.load(network)
    photo = photo_of(poles(10.0, 0.0, 50.0, SIZE))
    alone = model.predict(to_tensor(photo, model.spec))[0]
    known = said_of(model, photo)
    assert known.camera_elevation == upright(alone, photo.pixels).camera_elevation != alone.camera_elevation
    empty = photo_of(np.full((60, 80, 3), 128, dtype=np.uint8))
    assert said_of(model, empty).camera_elevation == model.predict(to_tensor(empty, model.spec))[0].camera_elevation


def test_a_lens_of_the_file_or_of_the_user_enters_the_camera(network: Path) -> None:
    """The user's counts where both are known, and the file's not where it is not to be used."""
    model = Model.load(network)
    plain = photo_of(poles(20.0, 0.0, 60.0, SIZE))
    stated = replace(plain, facts=PhotoFacts(vertical_fov=60.0))
    alone = model.predict(to_tensor(plain, model.spec))[0]
    by_lens = {fov: upright(alone, plain.pixels, fov).camera_elevation for fov in (None, 60.0, 45.0)}
    assert len(set(by_lens.values())) == 3
    assert said_of(model, stated).camera_elevation == by_lens[60.0]
    assert said_of(model, stated, Given(vertical_fov=45.0)).camera_elevation == by_lens[45.0]
    assert said_of(model, stated, Given(use_exif=False)).camera_elevation == by_lens[None]


def seen_sun(said: Prediction) -> Floats:
    return best_guess(said.sun_probability, said.spec.sun_grid)

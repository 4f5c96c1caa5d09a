"""Brackets of skies that are known."""

from datetime import UTC, datetime

import numpy as np
import pytest

from export.probe.report import lighting_at
from export.probe.synthetic import TIMES, Camera, expose, gain_of, photograph
from lighting.probe.lens import lens_of
from lighting.probe.settings import Moment

RAMP = np.linspace(1e-4, 1.0, 300, dtype=np.float32).reshape(10, 10, 3)


def test_a_bracket_holds_rounded_values_that_clip() -> None:
    photos = expose(RAMP, Camera(8, 0.8, noise=False), np.random.default_rng(0))
    assert [photo.exposure for photo in photos] == list(TIMES)
    short, long = photos[0].pixels, photos[-1].pixels
    assert short.max() == pytest.approx(0.8)
    assert long.max() == 1
    np.testing.assert_allclose(255 * short, np.rint(255 * short), atol=1e-4)
    np.testing.assert_allclose(short, RAMP * gain_of(RAMP, Camera(8, 0.8)) * TIMES[0], atol=0.5 / 255 + 1e-6)


def test_noise_is_that_of_light_and_reading() -> None:
    even = np.full((60, 60, 3), 1.0, dtype=np.float32)
    (photo,) = expose(even, Camera(14, 0.5), np.random.default_rng(0), [1.0])
    assert photo.pixels.std() == pytest.approx(np.sqrt(25_000 + 9) / 50_000, rel=0.05)
    assert photo.pixels.mean() == pytest.approx(0.5, rel=1e-3)


def test_the_sun_stands_out_and_nothing_is_outside_the_lens() -> None:
    moment = Moment(datetime(2024, 6, 1, 9, tzinfo=UTC), 47.0, 8.0)
    picture = photograph(lighting_at(moment), lens_of("equidistant", 64, 64), np.eye(3))
    assert picture.max() > 1000 * np.median(picture[picture > 0])
    assert not picture[0, 0].any()

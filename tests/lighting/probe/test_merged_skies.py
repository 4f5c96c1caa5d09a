"""Brackets of known skies, and a real stack."""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from lighting.envmap.render import sun_light
from lighting.errors import ProbeError
from lighting.probe.alignment import yaw_rotation
from lighting.probe.bracket import make_bracket, read_bracket
from lighting.probe.develop import BracketSettings, Moment, make_probe
from lighting.probe.fisheye import make_lens
from lighting.probe.merging import measure_ratios
from tests.helpers.brackets import (
    BRACKET_TIMES,
    SKY_DAY,
    SKY_FILL,
    SKY_PLACE,
    BracketCamera,
    bracket_gain,
    clear_sky_at,
    expose_bracket,
    measure_bracket,
    photograph_sky,
    rotation_between,
)

RAMP = np.linspace(1e-4, 1.0, 300, dtype=np.float32).reshape(10, 10, 3)


def test_a_bracket_holds_rounded_values_that_clip() -> None:
    photos = expose_bracket(RAMP, BracketCamera(8, 0.8, noise=False), np.random.default_rng(0))
    assert [photo.exposure for photo in photos] == list(BRACKET_TIMES)
    short, long = photos[0].pixels, photos[-1].pixels
    assert short.max() == pytest.approx(0.8)
    assert long.max() == 1
    np.testing.assert_allclose(255 * short, np.rint(255 * short), atol=1e-4)
    np.testing.assert_allclose(
        short, RAMP * bracket_gain(RAMP, BracketCamera(8, 0.8)) * BRACKET_TIMES[0], atol=0.5 / 255 + 1e-6
    )


def test_noise_is_that_of_light_and_reading() -> None:
    even = np.full((60, 60, 3), 1.0, dtype=np.float32)
    (photo,) = expose_bracket(even, BracketCamera(14, 0.5), np.random.default_rng(0), [1.0])
    assert photo.pixels.std() == pytest.approx(np.sqrt(25_000 + 9) / 50_000, rel=0.05)
    assert photo.pixels.mean() == pytest.approx(0.5, rel=1e-3)


def test_the_sun_stands_out_and_nothing_is_outside_the_lens() -> None:
    moment = Moment(datetime(2024, 6, 1, 9, tzinfo=UTC), 47.0, 8.0)
    picture = photograph_sky(clear_sky_at(moment), make_lens("equidistant", 64, 64), np.eye(3))
    assert picture.max() > 1000 * np.median(picture[picture > 0])
    assert not picture[0, 0].any()


STACK = Path(__file__).parents[3].parent / "shared" / "stereo-data" / "fisheye_bracket"
ALPNACH = Moment(datetime(2018, 1, 29, 11, 9, 20, tzinfo=UTC), 46.94, 8.28)
ALPNACH_CIRCLE = ((149.5, 141.0), 132.5)  # center and radius, pixels, read off the longest exposure
MOMENT = Moment(SKY_DAY, *SKY_PLACE)
LENS = make_lens("equidistant", 400, 400)


each_depth = pytest.mark.parametrize(
    "bits", [8, *(pytest.param(bits, marks=pytest.mark.thorough) for bits in (12, 14))]
)


@each_depth
@pytest.mark.needs("scipy")
def test_skies_exposed_for_are_within_two_percent_and_their_clipped_sun_is_said(bits: int) -> None:
    got = measure_bracket(BracketCamera(bits, SKY_FILL), MOMENT, LENS, 40.0)
    assert got.sky < 0.02
    assert got.clipped
    assert got.rotation < 0.3


@each_depth
@pytest.mark.needs("scipy")
def test_suns_exposed_for_are_within_three_percent(bits: int) -> None:
    got = measure_bracket(BracketCamera(bits, 0.8), MOMENT, LENS, 200.0)
    assert not got.clipped
    assert got.sun < 0.03
    assert got.rotation < 0.3
    assert got.sky < 0.02
    assert got.sky < got.longest * (0.5 if bits == 8 else 1.05)  # the sky is then a few of 8 bits' steps above black
    assert (got.steps < 3) == (bits == 8)


def test_a_photographed_sun_has_its_power() -> None:
    lighting = clear_sky_at(MOMENT)
    picture = photograph_sky(lighting, LENS, yaw_rotation(0.0))
    probe = make_probe(
        make_bracket(expose_bracket(picture, BracketCamera(noise=False), np.random.default_rng(0))),
        MOMENT,
        BracketSettings(),
    )
    assert probe.spot is not None
    assert probe.spot.irradiance / bracket_gain(picture, BracketCamera()) == pytest.approx(
        sun_light(lighting)[0], rel=0.02
    )


def test_turns_are_measured() -> None:
    assert rotation_between(yaw_rotation(20.0), yaw_rotation(-10.0)) == pytest.approx(30.0)


@pytest.mark.skipif(not STACK.is_dir(), reason="the fisheye stack is not here")
def test_the_fisheye_stack_has_its_ratios_its_clipped_sun_and_its_lens_residual() -> None:
    bracket = read_bracket(sorted(STACK.glob("*_image.png")), "linear")
    ratios = [ratio.value for ratio in measure_ratios(bracket).ratios if ratio is not None]
    # From the sixth exposure on the camera's times follow a 1-2-5 series; the shorter ones show the sun alone.
    assert ratios[5:] == pytest.approx([2, 2, 2.5, 2.5, 4, 2.5, 2], rel=0.05)
    told = BracketSettings(center=ALPNACH_CIRCLE[0], radius=ALPNACH_CIRCLE[1], height=64)
    probe = make_probe(bracket, ALPNACH, told)
    assert "clipped in every exposure" in probe.warnings[0]
    assert probe.sun_error == pytest.approx(4.6, abs=1.0)
    with pytest.raises(ProbeError, match="only one"):
        read_bracket(sorted(STACK.glob("*_12_image.png")))

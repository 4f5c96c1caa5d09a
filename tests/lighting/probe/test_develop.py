"""Synthetic brackets from the exposures to the world's axes."""

from datetime import timedelta
from functools import partial

import numpy as np
import pytest

from export.reports.probe import (
    SKY_DAY,
    SKY_PLACE,
    BracketCamera,
    clear_sky_at,
    expose_bracket,
    photograph_sky,
    rotation_between,
)
from lighting.errors import ProbeError
from lighting.geometry import camera_axes
from lighting.probe.align import yaw_rotation
from lighting.probe.develop import Probe, make_probe, make_series
from lighting.probe.exposures import Bracket, bracket_of
from lighting.probe.lens import lens_of
from lighting.probe.settings import Moment, Settings

MOMENT = Moment(SKY_DAY, *SKY_PLACE)
SIDE = 200
SETTINGS = Settings(height=64)
TIMES = (1 / 8000, 1 / 90, 1.0)


def bracket(moment: Moment = MOMENT, fill: float = 0.8, tilt: float = 0.0, yaw: float = 40.0) -> Bracket:
    lens = lens_of("equidistant", SIDE, SIDE)
    picture = photograph_sky(clear_sky_at(moment), lens, rotation(tilt, yaw))
    return bracket_of(expose_bracket(picture, BracketCamera(14, fill), np.random.default_rng(0), TIMES))


def rotation(tilt: float, yaw: float) -> np.ndarray:
    return np.asarray(yaw_rotation(yaw) @ camera_axes(45.0, -tilt, 0.0).T @ camera_axes(45.0, 0.0, 0.0))


@pytest.fixture(scope="module")
def clipped() -> Probe:
    return make_probe(bracket(fill=8.0), MOMENT, SETTINGS)


def test_a_sun_that_is_not_clipped_needs_no_warning() -> None:
    probe = make_probe(bracket(), MOMENT, SETTINGS)
    assert not probe.warnings
    assert probe.alignment is not None
    assert rotation_between(probe.alignment.rotation, yaw_rotation(40.0)) < 0.3
    assert probe.off is not None
    assert probe.off < 0.5
    assert probe.image.shape == (64, 128, 3)


def test_a_clipped_sun_is_said(clipped: Probe) -> None:
    assert clipped.spot is not None
    assert clipped.spot.clipped
    assert "clipped in every exposure" in clipped.warnings[0]
    assert not clipped.estimated


def test_a_filled_sun_is_marked_as_estimated(clipped: Probe) -> None:
    probe = make_probe(bracket(fill=8.0), MOMENT, Settings(height=64, fill=True))
    assert probe.estimated
    assert "estimated by the model" in probe.warnings[0]
    assert probe.fit is not None
    assert probe.fit.turbidity == pytest.approx(3.0, abs=0.3)
    assert probe.spot is not None
    assert clipped.spot is not None
    assert (probe.spot.irradiance > 2 * clipped.spot.irradiance).all()


def test_a_filter_makes_everything_brighter_by_its_stops(clipped: Probe) -> None:
    filtered = make_probe(bracket(fill=8.0), MOMENT, Settings(height=64, nd=3.0))
    assert filtered.image == pytest.approx(8 * clipped.image, rel=1e-4)


def test_a_tilted_camera_is_said() -> None:
    probe = make_probe(bracket(tilt=6.0), MOMENT, SETTINGS)
    assert any("off the ephemeris" in warning for warning in probe.warnings)


def test_a_series_finds_tilt_and_yaw() -> None:
    moments = [Moment(SKY_DAY + timedelta(hours=hours), *SKY_PLACE) for hours in (0, 2, 4, 6)]
    readers = [partial(bracket, moment, 8.0, 6.0, -100.0) for moment in moments]
    probes = list(make_series(readers, moments, SETTINGS))
    alignment = probes[0].alignment
    assert alignment is not None
    assert (
        rotation_between(alignment.rotation, rotation(6.0, -100.0)) < 0.6
    )  # of pixels of 0.9 deg; finer pictures in the report
    assert all(probe.off is not None and probe.off < 0.5 for probe in probes)
    assert not any("stood" in warning for probe in probes for warning in probe.warnings)


def test_clocks_that_are_an_hour_off_are_said_to_look_like_a_tilt() -> None:
    moments = [Moment(SKY_DAY + timedelta(hours=hours), *SKY_PLACE) for hours in (0, 2, 4, 6)]
    wrong = [Moment(SKY_DAY + timedelta(hours=hours - 1), *SKY_PLACE) for hours in (0, 2, 4, 6)]
    probes = list(make_series([partial(bracket, moment, 8.0) for moment in moments], wrong, SETTINGS))
    assert all(any("stood 10 deg from how it is told" in w for w in probe.warnings) for probe in probes)


def test_night_and_skies_without_sun_are_refused() -> None:
    with pytest.raises(ProbeError, match="it is night"):
        make_probe(bracket(), Moment(SKY_DAY + timedelta(hours=14), *SKY_PLACE), SETTINGS)
    grey = bracket_of(
        expose_bracket(np.full((SIDE, SIDE, 3), 1.0, np.float32), BracketCamera(14), np.random.default_rng(0))
    )
    with pytest.raises(ProbeError, match="No sun is found"):
        make_probe(grey, MOMENT, SETTINGS)
    told = make_probe(grey, MOMENT, Settings(height=64, yaw=30.0))
    assert told.warnings == ("No sun is seen in this probe.",)

"""Probes: aligned by the sun, filled, written."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from lighting.envmap.render import render, sun_light
from lighting.errors import ProbeError
from lighting.files.exr import read_exr, read_exr_attributes
from lighting.geometry import angle_between, angles, camera_axes, direction, latlong_directions
from lighting.probe.alignment import align_by_sun, align_series, yaw_rotation
from lighting.probe.bracket import Bracket, make_bracket, probes_in
from lighting.probe.develop import (
    BracketSettings,
    Moment,
    Probe,
    _check_day,
    _fill_sun,
    make_probe,
    make_series,
    probe_output_path,
    write_probe,
)
from lighting.probe.fisheye import Lens, make_lens, project_to_lens
from lighting.probe.sun_detection import find_sun_blob
from lighting.records import Lighting
from tests.helpers.brackets import (
    SKY_DAY,
    SKY_PLACE,
    BracketCamera,
    clear_sky_at,
    expose_bracket,
    photograph_sky,
    rotation_between,
)

MORNING = Moment(SKY_DAY, *SKY_PLACE)
SIDE = 200
SETTINGS = BracketSettings(height=64)
TIMES = (1 / 8000, 1 / 90, 1.0)

LENS = make_lens("equidistant", 1000, 1000)
# The sun over a June day at 47 deg north, every one and a half hours.
SUNS = direction([80.0, 98.0, 122.0, 160.0, 208.0, 242.0, 264.0], [25.0, 40.0, 54.0, 65.0, 64.0, 51.0, 36.0])
ROTATION = yaw_rotation(70.0) @ camera_axes(45.0, -4.0, 0.0).T @ camera_axes(45.0, 0.0, 0.0)


def seen(lens: Lens, noise: float = 0.0) -> np.ndarray:
    """Pixels (N, 2) at which a camera of this lens shows the suns."""
    return project_to_lens(lens, SUNS @ ROTATION) + np.random.default_rng(4).normal(0, noise, (len(SUNS), 2))


def test_a_yaw_adds_to_azimuths() -> None:
    azimuth, elevation = angles(yaw_rotation(40.0) @ direction(10.0, 25.0))
    assert (azimuth, elevation) == pytest.approx((50.0, 25.0))


def test_one_sun_tells_the_yaw_and_how_wrong_the_elevation_is() -> None:
    alignment = align_by_sun(LENS, (100.0, 31.0), (150.0, 30.0))
    assert alignment.rotation == pytest.approx(yaw_rotation(50.0))
    assert alignment.residual == pytest.approx(1.0)
    assert alignment.tilt == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("fov", [170.0, 180.0, 195.0])
def test_suns_of_a_day_tell_tilt_lens_and_mirror_sense(fov: float, mirrored: bool) -> None:
    true = replace(LENS, fov=fov, mirrored=mirrored)
    alignment = align_series(LENS, seen(true, noise=0.3), SUNS)
    assert alignment.lens.mirrored is mirrored
    assert alignment.lens.fov == pytest.approx(fov, abs=1.0)
    assert alignment.tilt == pytest.approx(4.0, abs=0.3)
    moved = angle_between(direction([0, 90, 180], 45) @ alignment.rotation.T, direction([0, 90, 180], 45) @ ROTATION.T)
    assert moved.max() < 0.3
    assert alignment.residual < 0.1


def test_a_false_sun_is_left_out() -> None:
    pixels = seen(LENS)
    pixels[2] = (800.0, 800.0)
    alignment = align_series(LENS, pixels, SUNS)
    assert list(np.flatnonzero(~alignment.used)) == [2]
    assert alignment.tilt == pytest.approx(4.0, abs=0.2)


def test_few_suns_and_suns_close_together_are_refused() -> None:
    with pytest.raises(ProbeError, match="found in 2"):
        align_series(LENS, seen(LENS)[:2], SUNS[:2])
    near = direction([100.0, 102.0, 104.0], [40.0, 41.0, 42.0])
    with pytest.raises(ProbeError, match="15 deg"):
        align_series(LENS, project_to_lens(LENS, near), near)


def test_three_suns_leave_the_lens_as_told() -> None:
    alignment = align_series(LENS, seen(LENS)[:3], SUNS[:3])
    assert alignment.lens.fov == 180.0
    assert alignment.tilt == pytest.approx(4.0, abs=0.1)


AZIMUTH, ELEVATION = (grid.ravel() for grid in np.meshgrid(np.arange(0.0, 360.0, 30.0), [12.0, 33.0, 55.0, 75.0]))


def bracket(moment: Moment = MORNING, fill: float = 0.8, tilt: float = 0.0, yaw: float = 40.0) -> Bracket:
    lens = make_lens("equidistant", SIDE, SIDE)
    picture = photograph_sky(clear_sky_at(moment), lens, rotation(tilt, yaw))
    return make_bracket(expose_bracket(picture, BracketCamera(14, fill), np.random.default_rng(0), TIMES))


def rotation(tilt: float, yaw: float) -> np.ndarray:
    return np.asarray(yaw_rotation(yaw) @ camera_axes(45.0, -tilt, 0.0).T @ camera_axes(45.0, 0.0, 0.0))


@pytest.fixture(scope="module")
def clipped_probe() -> Probe:
    return make_probe(bracket(fill=8.0), MORNING, SETTINGS)


def test_a_sun_that_is_not_clipped_needs_no_warning() -> None:
    probe = make_probe(bracket(), MORNING, SETTINGS)
    assert not probe.warnings
    assert probe.alignment is not None
    assert rotation_between(probe.alignment.rotation, yaw_rotation(40.0)) < 0.3
    assert probe.sun_error is not None
    assert probe.sun_error < 0.5
    assert probe.image.shape == (64, 128, 3)


def test_a_clipped_sun_is_said(clipped_probe: Probe) -> None:
    assert clipped_probe.spot is not None
    assert clipped_probe.spot.clipped
    assert "clipped in every exposure" in clipped_probe.warnings[0]
    assert clipped_probe.fit is None


def test_a_filled_sun_is_marked_as_estimated(clipped_probe: Probe) -> None:
    probe = make_probe(bracket(fill=8.0), MORNING, BracketSettings(height=64, fill=True))
    assert probe.fit is not None
    assert "the sky around it tells" in probe.warnings[0]
    assert probe.fit is not None
    assert probe.fit.turbidity == pytest.approx(3.0, abs=0.3)
    assert probe.spot is not None
    assert clipped_probe.spot is not None
    assert (probe.spot.irradiance > 2 * clipped_probe.spot.irradiance).all()


def test_a_filter_makes_everything_brighter_by_its_stops(clipped_probe: Probe) -> None:
    filtered = make_probe(bracket(fill=8.0), MORNING, BracketSettings(height=64, nd=3.0))
    assert filtered.image == pytest.approx(8 * clipped_probe.image, rel=1e-4)


def test_a_tilted_camera_is_said() -> None:
    probe = make_probe(bracket(tilt=6.0), MORNING, SETTINGS)
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
    assert all(probe.sun_error is not None and probe.sun_error < 0.5 for probe in probes)
    assert not any("stood" in warning for probe in probes for warning in probe.warnings)


def test_clocks_that_are_an_hour_off_are_said_to_look_like_a_tilt() -> None:
    moments = [Moment(SKY_DAY + timedelta(hours=hours), *SKY_PLACE) for hours in (0, 2, 4, 6)]
    wrong = [Moment(SKY_DAY + timedelta(hours=hours - 1), *SKY_PLACE) for hours in (0, 2, 4, 6)]
    probes = list(make_series([partial(bracket, moment, 8.0) for moment in moments], wrong, SETTINGS))
    assert all(any("stood 10 deg from how it is told" in w for w in probe.warnings) for probe in probes)


def test_night_and_skies_without_sun_are_refused() -> None:
    with pytest.raises(ProbeError, match="it is night"):
        make_probe(bracket(), Moment(SKY_DAY + timedelta(hours=14), *SKY_PLACE), SETTINGS)
    grey = make_bracket(
        expose_bracket(np.full((SIDE, SIDE, 3), 1.0, np.float32), BracketCamera(14), np.random.default_rng(0))
    )
    with pytest.raises(ProbeError, match="No sun is found"):
        make_probe(grey, MORNING, SETTINGS)
    told = make_probe(grey, MORNING, BracketSettings(height=64, yaw=30.0))
    assert told.warnings == ("No sun is seen in this probe.",)


LIGHTING = Lighting(sun_azimuth=20.0, sun_elevation=35.0, turbidity=3.0, exposure=0.05)


def test_the_model_gives_the_light_back_that_was_clipped() -> None:
    whole = render(LIGHTING, 128, sun=True)
    cut = np.minimum(whole, 5.0)
    clipped = whole.max(axis=-1) > 5.0
    spot = find_sun_blob(cut, clipped)
    assert spot is not None
    filled, sun, fit = _fill_sun(cut, clipped, spot)
    assert fit.turbidity == pytest.approx(3.0, abs=0.1)
    assert sun.irradiance == pytest.approx(sun_light(LIGHTING)[0], rel=0.05)
    found = find_sun_blob(filled, np.zeros_like(clipped))
    assert found is not None
    assert found.irradiance == pytest.approx(sun_light(LIGHTING)[0], rel=0.05)
    far = latlong_directions(128) @ LIGHTING.sun_direction < 0.99
    assert filled[far] == pytest.approx(cut[far])


def test_a_sky_without_blue_cannot_tell() -> None:
    grey = np.where(latlong_directions(64)[..., 1:2] > 0, 0.5, 0.1).astype(np.float32).repeat(3, axis=-1)
    clipped = np.zeros((64, 128), bool)
    clipped[20:22, 60:62] = True
    grey[clipped] = 1000.0
    spot = find_sun_blob(grey, clipped)
    assert spot is not None
    with pytest.raises(ProbeError, match="too little clear sky"):
        _fill_sun(grey, clipped, spot)


NOON = Moment(datetime(2024, 6, 1, 12, tzinfo=UTC), 0.0, 0.0)


def test_numbers_that_are_not_finite_are_refused() -> None:
    with pytest.raises(ProbeError, match="lens"):
        BracketSettings(radius=float("nan"))
    with pytest.raises(ProbeError, match="place"):
        Moment(NOON.time, float("nan"), 8.0)


@pytest.mark.parametrize(
    "told", [{"nd": -1.0}, {"nd": 500.0}, {"camera_elevation": 100.0}, {"fov": 361.0}, {"radius": 0.0}]
)
def test_numbers_that_cannot_be_are_refused(told: dict[str, float]) -> None:
    """500 stops made a map of infinite radiance."""
    with pytest.raises(ProbeError, match="0"):
        BracketSettings(**told)  # type: ignore[arg-type]


def test_the_sun_of_a_june_noon_on_the_equator_is_in_the_north() -> None:
    azimuth, elevation = NOON.sun
    assert abs(azimuth) < 5
    assert elevation == pytest.approx(90 - 22.1, abs=0.3)  # the sun's declination on 1 June


def test_night_is_refused() -> None:
    _check_day(NOON)
    with pytest.raises(ProbeError, match="below the horizon: it is night"):
        _check_day(Moment(NOON.time + timedelta(hours=12), 0.0, 0.0))


def test_the_header_says_when_and_what_the_sun_rests_on(tmp_path: Path, clipped_probe: Probe) -> None:
    path = write_probe(clipped_probe, tmp_path / "a.exr")
    header = read_exr_attributes(path)
    assert header["lighting.time"] == "2024-06-01T09:00:00+00:00"
    assert header["capDate"] == "2024:06:01 09:00:00"
    assert (header["lighting.sun_azimuth"], header["lighting.sun_elevation"]) == pytest.approx(MORNING.sun, abs=1e-3)
    assert (header["lighting.sun_clipped"], header["lighting.sun_estimated"]) == (1, 0)
    assert "clipped" in header["comments"]
    assert not any("latitude" in name for name in header)
    np.testing.assert_allclose(read_exr(path)[0], clipped_probe.image, rtol=2.0**-14)  # as `zip` rounds


def test_a_folder_is_filled_in_the_layout(tmp_path: Path, clipped_probe: Probe) -> None:
    path = write_probe(clipped_probe, tmp_path / "sky")
    assert path == tmp_path / "sky/20240601/090000/envmap.exr"
    assert probes_in(tmp_path / "sky")[0].time == MORNING.time


def test_a_folder_that_cannot_be_made_is_said(tmp_path: Path, clipped_probe: Probe) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ProbeError, match="cannot be made"):
        write_probe(clipped_probe, tmp_path / "file")


def test_a_folder_stays_one_whatever_its_name(tmp_path: Path) -> None:
    (tmp_path / "sky.exr").mkdir()
    assert probe_output_path(tmp_path / "sky.exr", MORNING.time) == tmp_path / "sky.exr/20240601/090000/envmap.exr"
    assert probe_output_path(tmp_path / "probe.exr", MORNING.time) == tmp_path / "probe.exr"

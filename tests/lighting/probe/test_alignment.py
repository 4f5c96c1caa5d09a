"""The orientation of cameras by suns, and of scans by skies."""

from dataclasses import replace

import numpy as np
import pytest

from lighting.color import luminance
from lighting.errors import ProbeError
from lighting.geometry import angle_between, angles, camera_axes, direction
from lighting.probe.alignment import Scan, _fit_orientation, _log_errors, align_by_sun, align_series, yaw_rotation
from lighting.probe.fisheye import Lens, make_lens, project_to_lens
from lighting.sky.hosek_wilkie import sky_radiance

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
SCAN_SUNS = ((100.0, 40.0), (135.0, 60.0), (170.0, 68.0))


def scan(sun: tuple[float, float], sense: int, offset: float) -> Scan:
    """A sky of turbidity 3 as an instrument files it whose true azimuth is sense x filed + offset."""
    towards = direction(sense * AZIMUTH + offset, ELEVATION)
    return Scan(AZIMUTH, ELEVATION, luminance(sky_radiance(towards, direction(*sun), 3.0, 0.3)), sun)


@pytest.mark.parametrize(("sense", "offset"), [(1, 13.0), (-1, 13.0), (-1, -170.0)])
def test_sense_and_offset_of_a_day_come_back(sense: int, offset: float) -> None:
    found = _fit_orientation([scan(sun, sense, offset) for sun in SCAN_SUNS])
    assert found.sense == sense
    assert found.is_sure
    assert found.offset == pytest.approx(offset, abs=1.0)
    assert found.offsets == pytest.approx([offset] * 3, abs=1.5)


def test_one_moment_leaves_the_sense_open() -> None:
    found = _fit_orientation([scan(SCAN_SUNS[0], -1, 13.0)])
    assert not found.is_sure


def test_a_scale_is_no_error() -> None:
    values = np.array([1.0, 2.0, 4.0])
    assert _log_errors(7 * values, values) == pytest.approx([0, 0, 0])


def test_nothing_and_night_are_refused() -> None:
    with pytest.raises(ProbeError, match="no scan"):
        _fit_orientation([])
    with pytest.raises(ProbeError, match="below the horizon"):
        _fit_orientation([Scan(AZIMUTH, ELEVATION, AZIMUTH + 1, (100.0, -4.0))])

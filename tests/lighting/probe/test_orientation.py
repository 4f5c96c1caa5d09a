"""Scans of skies whose north is known."""

import numpy as np
import pytest

from lighting.colour import luminance
from lighting.errors import ProbeError
from lighting.geometry import direction
from lighting.probe.orientation import Scan, log_errors, orient
from lighting.sky.hosek_wilkie import sky_radiance

AZIMUTH, ELEVATION = (grid.ravel() for grid in np.meshgrid(np.arange(0.0, 360.0, 30.0), [12.0, 33.0, 55.0, 75.0]))
SUNS = ((100.0, 40.0), (135.0, 60.0), (170.0, 68.0))


def scan(sun: tuple[float, float], sense: int, offset: float) -> Scan:
    """A sky of turbidity 3 as an instrument files it whose true azimuth is sense x filed + offset."""
    towards = direction(sense * AZIMUTH + offset, ELEVATION)
    return Scan(AZIMUTH, ELEVATION, luminance(sky_radiance(towards, direction(*sun), 3.0, 0.3)), sun)


@pytest.mark.parametrize(("sense", "offset"), [(1, 13.0), (-1, 13.0), (-1, -170.0)])
def test_sense_and_offset_of_a_day_come_back(sense: int, offset: float) -> None:
    found = orient([scan(sun, sense, offset) for sun in SUNS])
    assert found.sense == sense
    assert found.sure
    assert found.offset == pytest.approx(offset, abs=1.0)
    assert found.offsets == pytest.approx([offset] * 3, abs=1.5)


def test_one_moment_leaves_the_sense_open() -> None:
    found = orient([scan(SUNS[0], -1, 13.0)])
    assert not found.sure


def test_a_scale_is_no_error() -> None:
    values = np.array([1.0, 2.0, 4.0])
    assert log_errors(7 * values, values) == pytest.approx([0, 0, 0])


def test_nothing_and_night_are_refused() -> None:
    with pytest.raises(ProbeError, match="no scan"):
        orient([])
    with pytest.raises(ProbeError, match="below the horizon"):
        orient([Scan(AZIMUTH, ELEVATION, AZIMUTH + 1, (100.0, -4.0))])

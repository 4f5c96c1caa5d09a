"""The sun's place against pvlib's whole SPA, and against what everybody knows."""

from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from pvlib import solarposition

from lighting.geometry import angle_between, direction, wrap_azimuth
from lighting.solar_position import sun_position

SUNSET = -0.8333  # deg: true elevation of the center when the upper edge appears on the horizon

LATITUDES = [*np.linspace(-90.0, 90.0, 19), -23.44, 23.44]


def instants(seed: int, count: int) -> NDArray[np.datetime64]:
    first, last = np.datetime64("1900-01-01", "s"), np.datetime64("2101-01-01", "s")
    seconds = np.random.default_rng(seed).integers(0, (last - first).astype(int), count)
    return first + seconds.astype("timedelta64[s]")


@pytest.mark.parametrize("delta_t", [None, 67.0])  # by the year, or what most people leave it at
@pytest.mark.parametrize("latitude", LATITUDES)
def test_agrees_with_pvlib_from_1900_to_2100(latitude: float, delta_t: float | None) -> None:
    times, longitude = instants(round(latitude * 10) + 1000, 400), 7.0 * latitude % 360 - 180
    whole = solarposition.get_solarposition(
        pd.DatetimeIndex(times, tz="UTC"), latitude, longitude, 0, pressure=101000, temperature=10, delta_t=delta_t
    )
    azimuth, elevation = sun_position(times, latitude, longitude)
    apparent = whole["apparent_elevation"].to_numpy()
    apart = angle_between(direction(azimuth, elevation), direction(whole["azimuth"], apparent))
    same_side = (elevation > SUNSET + 0.4) == (apparent > SUNSET + 0.4)  # of the step that refraction makes at SUNSET
    assert same_side.mean() > 0.99
    assert apart[same_side].max() < 0.0015
    assert np.abs(elevation - apparent)[same_side].max() < 0.001
    turned = np.abs(wrap_azimuth(azimuth - whole["azimuth"].to_numpy()))[np.abs(apparent) < 85]
    assert turned.max() < 0.02


@pytest.mark.parametrize(
    ("time", "latitude", "longitude", "azimuth", "elevation"),
    [
        ("2003-10-17T19:30:30", 39.742476, -105.1786, 194.34, 39.888),  # the example in NREL's report, near enough
        ("2020-03-20T12:07:20", 0.0, 0.0, None, 90.0),  # the equinox at noon on the equator
    ],
)
def test_known_places(time: str, latitude: float, longitude: float, azimuth: float | None, elevation: float) -> None:
    found = sun_position(np.datetime64(time), latitude, longitude)
    assert azimuth is None or found[0] == pytest.approx(azimuth, abs=0.02)
    assert found[1] == pytest.approx(elevation, abs=0.15 if azimuth is None else 0.02)


def test_the_sun_rises_in_the_east_and_is_south_at_noon() -> None:
    hours = np.datetime64("2024-03-20T00:00") + np.arange(6, 19, 6).astype("timedelta64[h]")
    azimuth, elevation = sun_position(hours, 48.0, 0.0)
    assert azimuth == pytest.approx([90, 180, 270], abs=3)
    assert elevation == pytest.approx([0, 42, 0], abs=2)


def test_places_and_times_broadcast() -> None:
    times = instants(3, 5)[:, None]
    azimuth, elevation = sun_position(times, np.array([-40.0, 0.0, 60.0]), 10.0)
    assert azimuth.shape == elevation.shape == (5, 3)
    assert elevation[2, 1] == sun_position(times[2, 0], 0.0, 10.0)[1]


def test_an_aware_datetime_counts_with_its_zone() -> None:
    there = datetime(2024, 6, 1, 14, 30, tzinfo=timezone(timedelta(hours=2)))
    for time in (there, there.astimezone(UTC)):
        assert sun_position(time, 48.0, 11.0) == sun_position(np.datetime64("2024-06-01T12:30"), 48.0, 11.0)


def test_refraction_lifts_the_low_sun_by_half_a_degree() -> None:
    minutes = np.datetime64("2024-03-20T05:00") + np.arange(120).astype("timedelta64[m]")
    elevation = sun_position(minutes, 0.0, 0.0)[1]
    steps = np.diff(elevation)
    rise = int(np.argmax(steps))
    assert 0.5 < steps[rise] - np.median(steps) < 0.8
    assert elevation[rise] < SUNSET < elevation[rise + 1]

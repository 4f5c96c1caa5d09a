"""Pixels times metadata: rings of known elevation, the compass's prior, the camera's heading."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from lighting.circular import HEADINGS, von_mises
from lighting.decoding import lighting_from
from lighting.errors import ParameterError
from lighting.evidence.fusion import GROSS_ERRORS, Evidence, fuse
from lighting.geometry import angle_between, angles, direction, wrap_azimuth
from lighting.records import ModelSpec, Prediction
from lighting.sun_grid import grid_directions, grid_solid_angle, smooth_density, soft_label

GRID = "fibonacci:1024"
SPEC = ModelSpec("test", "0", 32, 32, (0.5, 0.5, 0.5), (0.2, 0.2, 0.2), GRID)
UNIFORM = grid_solid_angle(GRID) / (2 * np.pi)

azimuths = st.floats(-180.0, 180.0)


def prediction(probability: NDArray[np.floating]) -> Prediction:
    return Prediction(SPEC, probability.astype(np.float32), 0.9, 3.0, 0.1, 2.0, 0.5, 50.0)


def lobe(azimuth: float, elevation: float, concentration: float = 40.0) -> Prediction:
    return prediction(soft_label(direction(azimuth, elevation), concentration, GRID))


def test_without_evidence_the_answer_is_that_of_the_pixels() -> None:
    said = lobe(40.0, 30.0)
    fused = fuse(said, Evidence())
    assert lighting_from(fused.prediction, fused.sun) == lighting_from(said)
    assert fused.probability is said.sun_probability
    assert fused.used == ("pixels",)
    assert fused.camera_heading is None
    assert fused.warnings == ()


def test_a_heading_alone_says_nothing_of_the_sun() -> None:
    fused = fuse(lobe(40.0, 30.0), Evidence(heading=10.0))
    assert fused.used == ("pixels",)
    assert fused.sun == fuse(lobe(40.0, 30.0), Evidence()).sun


@given(st.floats(0.0, 85.0), st.floats(0.0, 360.0), st.floats(0.0, 360.0))
def test_pixels_that_say_nothing_give_the_compass_back(elevation: float, compass: float, heading: float) -> None:
    evidence = Evidence(((elevation, compass),), heading, 12.0)
    fused = fuse(prediction(UNIFORM), evidence)
    bell = von_mises(HEADINGS - heading, 12.0)
    expected = (1 - GROSS_ERRORS) * bell / bell.sum() + GROSS_ERRORS / 360
    assert fused.camera_heading is not None
    assert fused.camera_heading.probability == pytest.approx(expected, rel=1e-4)
    assert abs(float(wrap_azimuth(fused.camera_heading.best - heading))) < 0.6
    assert fused.sun.elevation == pytest.approx(elevation, abs=1e-6)
    assert abs(float(wrap_azimuth(fused.sun.azimuth - (compass - heading)))) < 0.6


def test_a_uniform_sky_without_compass_is_even_along_the_ring() -> None:
    fused = fuse(prediction(UNIFORM), Evidence(((35.0, 200.0),)))
    assert fused.probability == pytest.approx(np.full(360, 1 / 360), rel=1e-5)


@given(azimuths, st.floats(10.0, 70.0), st.floats(0.0, 360.0))
def test_time_and_place_fix_the_elevation_and_the_pixels_the_azimuth(az: float, el: float, compass: float) -> None:
    fused = fuse(lobe(az, el), Evidence(((el + 5.0, compass),)))
    assert fused.sun.elevation == pytest.approx(el + 5.0, abs=1e-9)
    assert abs(float(wrap_azimuth(fused.sun.azimuth - az))) < 1.5
    assert fused.camera_heading is not None
    assert abs(float(wrap_azimuth(fused.camera_heading.best - (compass - az)))) < 1.5
    assert fused.used == ("pixels", "time+place")


@pytest.mark.parametrize("candidates", [((20.0, 80.0),), ((20.0, 80.0), (50.0, 130.0), (65.0, 200.0))])
def test_probability_sums_to_one_over_directions_of_the_candidates(candidates: tuple[tuple[float, float], ...]) -> None:
    fused = fuse(lobe(-100.0, 45.0), Evidence(candidates, 150.0))
    assert fused.probability.sum() == pytest.approx(1.0)
    assert fused.directions.shape == (360 * len(candidates), 3)
    assert np.unique(np.round(angles(fused.directions)[1], 6)) == pytest.approx([el for el, _ in candidates])
    assert fused.camera_heading is not None
    assert fused.camera_heading.probability.sum() == pytest.approx(1.0)


def test_pixels_choose_among_equally_likely_zones() -> None:
    fused = fuse(lobe(0.0, 50.0), Evidence(((10.0, 80.0), (50.0, 180.0), (25.0, 260.0))))
    assert fused.sun.elevation == pytest.approx(50.0, abs=2.0)
    assert fused.camera_heading is not None
    assert abs(float(wrap_azimuth(fused.camera_heading.best - 180.0))) < 3.0


def test_a_candidate_at_night_is_left_out() -> None:
    day, both = (Evidence(c) for c in (((30.0, 90.0),), ((-12.0, 20.0), (30.0, 90.0))))
    assert fuse(lobe(0.0, 30.0), both).probability == pytest.approx(fuse(lobe(0.0, 30.0), day).probability)


def test_night_alone_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"the sun is 3\.5° below the horizon"):
        fuse(lobe(0.0, 30.0), Evidence(((-3.5, 20.0), (-20.0, 300.0))))


def test_a_gross_compass_error_loses_against_sharp_pixels() -> None:
    sun = (40.0, 170.0)
    fused = fuse(lobe(0.0, 40.0, 150.0), Evidence((sun,), heading=350.0))
    assert abs(fused.sun.azimuth) < 3.0
    assert any("compass" in w for w in fused.warnings)


def test_the_compass_settles_which_of_two_modes_is_right() -> None:
    two = 0.6 * soft_label(direction(20.0, 40.0), 80.0, GRID) + 0.4 * soft_label(direction(160.0, 40.0), 80.0, GRID)
    fused = fuse(prediction(two), Evidence(((40.0, 180.0),), heading=10.0))
    assert abs(fused.sun.azimuth - 160.0) < 6.0
    assert fused.used == ("pixels", "time+place", "heading")


def test_the_focal_length_replaces_the_field_of_view_and_nothing_else() -> None:
    said = lobe(40.0, 30.0)
    fused = fuse(said, Evidence(vertical_fov=62.0))
    assert replace(fused.prediction, vertical_fov=50.0) == said
    assert fused.prediction.vertical_fov == 62.0
    assert fused.used == ("pixels", "focal length")


@given(azimuths, st.floats(10.0, 80.0), st.floats(5.0, 60.0))
def test_radii_hold_their_share_of_the_ring(az: float, el: float, spread: float) -> None:
    fused = fuse(prediction(UNIFORM), Evidence(((el, 0.0),), -az, spread))
    distance = angle_between(fused.directions, direction(fused.sun.azimuth, fused.sun.elevation))
    for share, radius in ((0.5, fused.sun.radius_50), (0.9, fused.sun.radius_90)):
        assert fused.probability[distance <= radius].sum() == pytest.approx(share, abs=0.04)


def test_smooth_density_of_a_uniform_sky_is_one_over_two_pi_down_to_the_horizon() -> None:
    everywhere = direction(np.arange(0, 360, 7.0), np.linspace(0, 90, 52))
    assert smooth_density(UNIFORM, everywhere, GRID) == pytest.approx(np.full(52, 1 / (2 * np.pi)), rel=1e-5)


def test_smooth_density_integrates_to_one() -> None:
    label = soft_label(direction(75.0, 35.0), 60.0, GRID)
    azimuth, elevation = np.arange(0.5, 360, 3.0), np.arange(0.5, 90, 1.0)
    density = smooth_density(label, direction(azimuth[None, :], elevation[:, None]), GRID)
    area = np.radians(3.0) * np.radians(1.0) * np.cos(np.radians(elevation))
    assert (density * area[:, None]).sum() == pytest.approx(1.0, abs=0.01)


def test_smooth_density_is_continuous_between_cells() -> None:
    label = soft_label(direction(0.0, 40.0), 80.0, GRID)
    along = smooth_density(label, direction(np.arange(-30, 30, 0.1), 40.0), GRID)
    assert np.abs(np.diff(along)).max() < 0.02 * along.max()
    assert angle_between(grid_directions(GRID)[0], [0.0, 1.0, 0.0]) < 4.5

"""Posterior of one photo: gravity, compass, ephemeris, visible sun."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lighting.decoding import lighting_from_prediction
from lighting.errors import ParameterError, warning_code
from lighting.fusion.estimate import build_estimate
from lighting.fusion.metadata_prior import observations_from_metadata
from lighting.fusion.multi_view import fuse_views
from lighting.fusion.single_view import (
    COMPASS_OUTLIER_RATE,
    Gravity,
    Observations,
    camera_elevation_std,
    fuse,
    fuse_gravity,
    fuse_single_view,
)
from lighting.fusion.user_input import UserInput
from lighting.geometry import Pinhole, angle_between, angles, camera_pixel, direction, wrap_azimuth
from lighting.photo.metadata import PhotoMetadata
from lighting.prediction import Prediction
from lighting.sun_grid import HEADINGS, grid_directions, smooth_density, soft_label, von_mises
from tests.helpers.predictions import GRID, UNIFORM, are_equal, grid_prediction, lobe_prediction

azimuths = st.floats(-180.0, 180.0)


def test_without_evidence_the_answer_is_that_of_the_pixels() -> None:
    predicted = lobe_prediction(40.0, 30.0)
    fused = fuse(predicted, Observations())
    assert lighting_from_prediction(fused.prediction, fused.sun) == lighting_from_prediction(predicted)
    assert fused.probability is predicted.sun_probability
    assert fused.used == ("pixels",)
    assert fused.camera_heading is None
    assert fused.warnings == ()


def test_a_heading_alone_says_nothing_of_the_sun() -> None:
    fused = fuse(lobe_prediction(40.0, 30.0), Observations(heading=10.0))
    assert fused.used == ("pixels",)
    assert fused.sun == fuse(lobe_prediction(40.0, 30.0), Observations()).sun


@given(st.floats(0.0, 85.0), st.floats(0.0, 360.0), st.floats(0.0, 360.0))
def test_pixels_that_say_nothing_give_the_compass_back(elevation: float, compass: float, heading: float) -> None:
    evidence = Observations(((elevation, compass),), heading, 12.0)
    fused = fuse(grid_prediction(UNIFORM), evidence)
    bell = von_mises(HEADINGS - heading, 12.0)
    expected = (1 - COMPASS_OUTLIER_RATE) * bell / bell.sum() + COMPASS_OUTLIER_RATE / 360
    assert fused.camera_heading is not None
    assert fused.camera_heading.probability == pytest.approx(expected, rel=1e-4)
    assert abs(float(wrap_azimuth(fused.camera_heading.best - heading))) < 0.6
    assert fused.sun.elevation == pytest.approx(elevation, abs=1e-6)
    assert abs(float(wrap_azimuth(fused.sun.azimuth - (compass - heading)))) < 0.6


def test_a_uniform_sky_without_compass_is_even_along_the_ring() -> None:
    fused = fuse(grid_prediction(UNIFORM), Observations(((35.0, 200.0),)))
    assert fused.probability == pytest.approx(np.full(360, 1 / 360), rel=1e-5)


@given(azimuths, st.floats(10.0, 70.0), st.floats(0.0, 360.0))
def test_time_and_place_fix_the_elevation_and_the_pixels_the_azimuth(az: float, el: float, compass: float) -> None:
    fused = fuse(lobe_prediction(az, el), Observations(((el + 5.0, compass),)))
    assert fused.sun.elevation == pytest.approx(el + 5.0, abs=1e-9)
    assert abs(float(wrap_azimuth(fused.sun.azimuth - az))) < 1.5
    assert fused.camera_heading is not None
    assert abs(float(wrap_azimuth(fused.camera_heading.best - (compass - az)))) < 1.5
    assert fused.used == ("pixels", "time+place")


@pytest.mark.parametrize("candidates", [((20.0, 80.0),), ((20.0, 80.0), (50.0, 130.0), (65.0, 200.0))])
def test_probability_sums_to_one_over_directions_of_the_candidates(candidates: tuple[tuple[float, float], ...]) -> None:
    fused = fuse(lobe_prediction(-100.0, 45.0), Observations(candidates, 150.0))
    assert fused.probability.sum() == pytest.approx(1.0)
    assert fused.directions.shape == (360 * len(candidates), 3)
    assert np.unique(np.round(angles(fused.directions)[1], 6)) == pytest.approx([el for el, _ in candidates])
    assert fused.camera_heading is not None
    assert fused.camera_heading.probability.sum() == pytest.approx(1.0)


def test_pixels_choose_among_equally_likely_zones() -> None:
    fused = fuse(lobe_prediction(0.0, 50.0), Observations(((10.0, 80.0), (50.0, 180.0), (25.0, 260.0))))
    assert fused.sun.elevation == pytest.approx(50.0, abs=2.0)
    assert fused.camera_heading is not None
    assert abs(float(wrap_azimuth(fused.camera_heading.best - 180.0))) < 3.0


def test_a_candidate_at_night_is_left_out() -> None:
    day, both = (Observations(c) for c in (((30.0, 90.0),), ((-12.0, 20.0), (30.0, 90.0))))
    assert fuse(lobe_prediction(0.0, 30.0), both).probability == pytest.approx(
        fuse(lobe_prediction(0.0, 30.0), day).probability
    )


def test_night_alone_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"the sun is 3\.5° below the horizon"):
        fuse(lobe_prediction(0.0, 30.0), Observations(((-3.5, 20.0), (-20.0, 300.0))))


def test_a_gross_compass_error_loses_against_sharp_pixels() -> None:
    sun = (40.0, 170.0)
    fused = fuse(lobe_prediction(0.0, 40.0, 150.0), Observations((sun,), heading=350.0))
    assert abs(fused.sun.azimuth) < 3.0
    assert any("compass" in w for w in fused.warnings)


def test_the_compass_settles_which_of_two_modes_is_right() -> None:
    two = 0.6 * soft_label(direction(20.0, 40.0), 80.0, GRID) + 0.4 * soft_label(direction(160.0, 40.0), 80.0, GRID)
    fused = fuse(grid_prediction(two), Observations(((40.0, 180.0),), heading=10.0))
    assert abs(fused.sun.azimuth - 160.0) < 6.0
    assert fused.used == ("pixels", "time+place", "heading")


def test_the_focal_length_replaces_the_field_of_view_and_nothing_else() -> None:
    predicted = lobe_prediction(40.0, 30.0)
    fused = fuse(predicted, Observations(vertical_fov=62.0))
    assert are_equal(replace(fused.prediction, vertical_fov=50.0), predicted)
    assert fused.prediction.vertical_fov == 62.0
    assert fused.used == ("pixels", "focal length")


@given(azimuths, st.floats(10.0, 80.0), st.floats(5.0, 60.0))
def test_radii_hold_their_share_of_the_ring(az: float, el: float, spread: float) -> None:
    fused = fuse(grid_prediction(UNIFORM), Observations(((el, 0.0),), -az, spread))
    distance = angle_between(fused.directions, direction(fused.sun.azimuth, fused.sun.elevation))
    for share, radius in ((0.5, fused.sun.radius_50), (0.9, fused.sun.radius_90)):
        inside, one_bin_further = (fused.probability[distance <= r].sum() for r in (radius, radius + 1.0))
        assert inside - 1e-9 <= share <= one_bin_further + 1e-9


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


PHONE = PhotoMetadata(
    camera_elevation=-6.0, camera_roll=5.0, gravity_source="accelerometer", gravity_spread=1.0, vertical_fov=53.0
)


def camera_prediction(elevation: float = 4.0, roll: float = -1.0) -> Prediction:
    return replace(grid_prediction(UNIFORM), camera_elevation=elevation, camera_roll=roll)


def warning_of(pixels: Prediction, gravity: Gravity) -> str | None:
    """The sentence about a gravity that the pixels contradict."""
    return next(iter(fuse_gravity(pixels, Observations(gravity=gravity)).warnings), None)


def fused_tilt(pixels: Prediction, gravity: Gravity) -> tuple[float, float]:
    """Elevation and roll by pixels and gravity."""
    fused = fuse_gravity(pixels, Observations(gravity=gravity))
    assert not fused.warnings
    return fused.prediction.camera_elevation, fused.prediction.camera_roll


def apart(above: float, aside: float = 0.0) -> str | None:
    return warning_of(camera_prediction(), Gravity(4.0 + above, -1.0 + aside, 1.0))


def test_both_are_weighted_by_their_errors() -> None:
    both = fused_tilt(camera_prediction(10.0, 6.0), Gravity(0.0, 0.0, 1.0))
    assert both == pytest.approx((10.0 * 1.0 / (1.0 + 3.5**2), 6.0 * 1.0 / (1.0 + 2.0**2)))
    assert fused_tilt(camera_prediction(10.0, 6.0), Gravity(0.0, None, 1.0)) == (both[0], 6.0)
    assert fused_tilt(camera_prediction(10.0, 6.0), Gravity(0.0, 0.0, 3.5))[0] == pytest.approx(5.0)
    assert fused_tilt(camera_prediction(0.0, 179.0), Gravity(0.0, -179.0, 2.0))[1] == pytest.approx(180.0)
    assert camera_elevation_std(None) == 3.5
    assert camera_elevation_std(Gravity(0.0, 0.0, 1.0)) == pytest.approx((1.0 + 3.5**-2.0) ** -0.5)


def test_a_steep_camera_has_no_roll_and_the_network_does_not_contradict_it() -> None:
    """It learnt elevations within 35 deg, and says as much as it can."""
    down = Gravity(-90.0, None, 1.0)
    assert warning_of(camera_prediction(-33.0, 8.0), down) is None
    elevation, roll = fused_tilt(camera_prediction(-33.0, 8.0), down)
    assert elevation == pytest.approx(-90.0, abs=0.5)
    assert roll == 0.0
    assert warning_of(camera_prediction(0.0), down) is not None
    assert fused_tilt(camera_prediction(-30.0), Gravity(-60.0, 20.0, 1.0)) == pytest.approx((-59.6, 15.8), abs=0.1)


@pytest.mark.parametrize(("above", "aside"), [(19.0, 0.0), (-19.0, 0.0), (0.0, 19.0), (13.0, 13.0)])
def test_what_chance_explains_is_no_contradiction(above: float, aside: float) -> None:
    assert apart(above, aside) is None


@pytest.mark.parametrize(("above", "aside"), [(21.0, 0.0), (-21.0, 0.0), (0.0, 91.0), (0.0, 180.0), (15.0, 15.0)])
def test_what_chance_does_not_explain_is_told_and_not_used(above: float, aside: float) -> None:
    gravity = Gravity(4.0 + above, -1.0 + aside, 1.0)
    pixels = camera_prediction()
    stood = fuse_gravity(pixels, Observations(gravity=gravity))
    assert stood.prediction is pixels
    assert stood.observations == Observations()
    fused = fuse(camera_prediction(), Observations(gravity=gravity))
    assert fused.used == ("pixels",)
    assert "was not used: the photo shows" in fused.warnings[0]
    assert warning_code(fused.warnings[0]) == "gravity-contradicted"
    assert fused.prediction.camera_elevation == 4.0


def test_the_sentence_names_both() -> None:
    assert apart(-40.0, 3.0) == "The file's camera elevation, 36° down, was not used: the photo shows 4° up."
    assert apart(3.0, -40.0) == "The file's camera roll, -41°, was not used: the photo shows -1°."
    said_alone = warning_of(camera_prediction(), Gravity(-36.0, None, 1.0)) or ""
    assert "36° down, was not used: the photo shows 4° up." in said_alone


def test_facts_become_evidence_and_the_record_says_so() -> None:
    found = observations_from_metadata(PHONE, UserInput())
    assert found.observations.gravity == Gravity(-6.0, 5.0, 1.0)
    light = build_estimate(fuse_single_view(camera_prediction(), found.observations), found).lighting
    assert light.evidence == ("pixels", "focal length", "gravity")
    assert light.camera_elevation == pytest.approx(-5.2, abs=0.1)
    assert light.camera_roll == pytest.approx(3.8, abs=0.1)
    assert light.warnings == ()


def test_the_pixels_alone_where_metadata_are_not_to_be_used() -> None:
    found = observations_from_metadata(PHONE, UserInput(metadata=False))
    assert found.observations.gravity is None
    light = build_estimate(fuse_single_view(camera_prediction(), found.observations), found).lighting
    assert replace(light, sun_candidates=()) == lighting_from_prediction(camera_prediction())


def test_a_sun_outside_the_picture_stays_where_it_is() -> None:
    behind = lobe_prediction(150.0, 30.0, 300.0)
    fused = fuse_single_view(behind, Observations(gravity=Gravity(-10.0, 5.0, 1.0)))
    assert fused.sun == fuse(behind, Observations()).sun
    assert fused.prediction.camera_elevation < -8.0


@pytest.mark.parametrize("sun", [(20.0, 15.0), (-15.0, 20.0), (0.0, 8.0)])
@pytest.mark.parametrize("gravity", [Gravity(-7.0, 9.0, 0.5), Gravity(14.0, None, 1.0)])
def test_a_sun_in_the_picture_keeps_its_pixel(sun: tuple[float, float], gravity: Gravity) -> None:
    shows = lobe_prediction(*sun, 300.0)

    def pixel(camera: Prediction, azimuth: float, elevation: float) -> Any:
        seen_by = Pinhole(400, 300, 50.0, 0.0, camera.camera_elevation, camera.camera_roll)
        return camera_pixel(direction(azimuth, elevation), seen_by)

    fused = fuse_single_view(shows, Observations(gravity=gravity))
    after = pixel(fused.prediction, fused.sun.azimuth, max(fused.sun.elevation, 0.1))
    there = pixel(shows, *sun)
    if sun[1] + fused.prediction.camera_elevation - shows.camera_elevation > 4.0:  # else the horizon holds it
        assert np.hypot(*(after - there)) < 12
    assert angle_between(direction(*sun), direction(fused.sun.azimuth, fused.sun.elevation)) > 3.0
    assert fused.probability.sum() == pytest.approx(1.0, abs=1e-5)


def test_gravity_leaves_the_ephemeris_little_to_tilt() -> None:
    shows = lobe_prediction(0.0, 15.0, 300.0)
    free, stated = (
        fuse_single_view(shows, Observations(((9.0, 200.0),), gravity=gravity))
        for gravity in (None, Gravity(shows.camera_elevation, shows.camera_roll, 1.0))
    )
    assert free.prediction.camera_elevation < shows.camera_elevation - 4.0
    assert shows.camera_elevation - 2.0 < stated.prediction.camera_elevation < shows.camera_elevation


def test_photos_together_use_it_each() -> None:
    evidence = [
        Observations(gravity=Gravity(-6.0, 5.0, 1.0)),
        Observations(),
        Observations(gravity=Gravity(4.0, 90.0, 1.0)),
    ]
    answers = fuse_views([camera_prediction()] * 3, evidence, [0.0, 30.0, 60.0])
    assert ["gravity" in a.used for a in answers] == [True, False, False]
    assert [round(a.prediction.camera_elevation, 1) for a in answers] == [-5.2, 4.0, 4.0]
    assert [len(a.warnings) for a in answers] == [0, 0, 1]

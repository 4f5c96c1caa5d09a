"""A sun that the picture shows."""

from dataclasses import replace

import numpy as np
import pytest

from lighting.fusion.single_view import Observations, fuse, fuse_single_view
from lighting.fusion.visible_sun import visible_sun
from lighting.geometry import Pinhole, angle_between, camera_pixel, direction
from lighting.prediction import Prediction
from tests.helpers.predictions import UNIFORM, are_equal, grid_prediction, lobe_prediction

AZIMUTH, ELEVATION = 20.0, 15.0


SHARP = 300.0  # concentration of a lobe of 3.3 deg


def seen(azimuth: float = AZIMUTH, elevation: float = ELEVATION) -> Prediction:
    """A photo with the sun in it, by a camera 2 deg up with a field of view of 50 deg."""
    return lobe_prediction(azimuth, elevation, SHARP)


def pixel(predicted: Prediction, sun: tuple[float, float], vertical_fov: float) -> np.ndarray:
    camera = Pinhole(400, 300, vertical_fov, 0.0, predicted.camera_elevation, predicted.camera_roll)
    return camera_pixel(direction(*sun), camera)


def test_only_a_sharp_sun_inside_the_picture_is_seen() -> None:
    assert visible_sun(seen()) is not None
    assert visible_sun(lobe_prediction(AZIMUTH, ELEVATION, 20.0)) is None  # too wide
    assert visible_sun(seen(elevation=45.0)) is None  # above the picture
    assert visible_sun(seen(azimuth=170.0)) is None  # behind the camera
    assert visible_sun(replace(seen(), sun_visibility=0.3)) is None


@pytest.mark.parametrize("vertical_fov", [40.0, 65.0])
def test_the_sun_keeps_its_pixel_through_another_lens(vertical_fov: float) -> None:
    predicted = seen()
    fused = fuse_single_view(predicted, Observations(vertical_fov=vertical_fov))
    before = pixel(predicted, (AZIMUTH, ELEVATION), 50.0)
    after = pixel(predicted, (fused.sun.azimuth, fused.sun.elevation), vertical_fov)
    assert np.hypot(*(after - before)) < 10
    assert fused.probability.sum() == pytest.approx(1.0, abs=1e-5)


def test_the_camera_is_tilted_towards_the_elevation_of_time_and_place() -> None:
    predicted = seen()
    fused = fuse_single_view(predicted, Observations(((ELEVATION - 6.0, 200.0),)))
    assert predicted.camera_elevation - 6.0 < fused.prediction.camera_elevation < predicted.camera_elevation - 4.0
    higher = fuse_single_view(predicted, Observations(((ELEVATION + 6.0, 200.0),)))
    assert higher.prediction.camera_elevation > predicted.camera_elevation + 4.0


@pytest.mark.parametrize("elevation", [0.5, 2.0, 5.0, 9.0])
def test_a_camera_that_is_right_stays_so_where_the_horizon_cuts_the_sun_s_probability(elevation: float) -> None:
    predicted = seen(elevation=elevation)
    fused = fuse_single_view(predicted, Observations(((elevation, 200.0),)))
    assert fused.prediction.camera_elevation == pytest.approx(predicted.camera_elevation, abs=1.0)


def test_the_mark_then_stands_near_the_seen_sun() -> None:
    """Both together: the focal length and the ephemeris."""
    predicted = seen()
    fused = fuse_single_view(predicted, Observations(((12.0, 200.0),), vertical_fov=62.0))
    before = pixel(predicted, (AZIMUTH, ELEVATION), 50.0)
    after = pixel(fused.prediction, (fused.sun.azimuth, fused.sun.elevation), 62.0)
    assert np.hypot(*(after - before)) < 12


@pytest.mark.parametrize("elevation", [40.0, 60.0])
def test_a_sun_of_another_place_does_not_tilt_the_camera(elevation: float) -> None:
    predicted = seen()
    assert (
        fuse_single_view(predicted, Observations(((elevation, 200.0),))).prediction.camera_elevation
        == predicted.camera_elevation
    )


def test_without_a_seen_sun_nothing_changes() -> None:
    evidence = Observations(((30.0, 200.0),), vertical_fov=65.0)
    for predicted in (
        grid_prediction(UNIFORM),
        lobe_prediction(AZIMUTH, ELEVATION, 20.0),
        lobe_prediction(150.0, 30.0, SHARP),
    ):
        one, other = fuse_single_view(predicted, evidence), fuse(predicted, evidence)
        assert are_equal(one.prediction, other.prediction)
        assert one.sun == other.sun
        assert angle_between(one.directions, other.directions).max() == 0


def test_a_sun_whose_pixel_is_not_white_is_not_moved_by_the_lens() -> None:
    """As where a thin cloud spreads it: the network then knows its direction by more than a pixel."""
    predicted, evidence = seen(), Observations(vertical_fov=65.0)
    grey = np.full((300, 400, 3), 120, np.uint8)
    x, y = pixel(predicted, (AZIMUTH, ELEVATION), 50.0)
    white = grey.copy()
    white[int(y) - 5 : int(y) + 6, int(x) - 5 : int(x) + 6] = 255
    assert fuse_single_view(predicted, evidence, grey).sun == fuse(predicted, evidence).sun
    assert (
        fuse_single_view(predicted, evidence, white).sun
        == fuse_single_view(predicted, evidence).sun
        != fuse(predicted, evidence).sun
    )

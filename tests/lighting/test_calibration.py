"""Camera from straight lines: edges of pictures, and the cameras that they choose."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from lighting.calibration import (
    LINES_SIDE,
    _edges_of,
    _Lines,
    calibrate_from_lines,
    lens_ratio,
    level_in_camera,
    shrink_to_gray,
    up_in_camera,
)
from lighting.geometry import Floats, Pinhole, camera_axes, camera_directions, direction
from lighting.prediction import Prediction
from tests.helpers.cameras import FINER, poles
from tests.helpers.predictions import are_equal, prediction

MAX_LEAN = 25.0  # deg


def camera_prediction(elevation: float, roll: float, fov: float = 50.0) -> Prediction:
    return replace(prediction(), camera_elevation=elevation, camera_roll=roll, vertical_fov=fov)


def calibrated(network: Prediction, pixels: NDArray[np.uint8], fov: float | None = None) -> Prediction:
    """The prediction with the camera by the lines of a picture (h, w, 3)."""
    return calibrate_from_lines(network, shrink_to_gray(pixels), fov)


def convergence(camera: Prediction) -> float:
    """One over the height [picture heights] in which verticals meet: all that they tell of elevation and lens."""
    half = np.tan(np.radians(camera.vertical_fov) / 2)
    return float(2 * half * np.tan(np.radians(camera.camera_elevation)))


@pytest.mark.parametrize(
    ("elevation", "roll"), [(0.0, 0.0), (12.0, 0.0), (-15.0, 2.0), (25.0, -8.0), (3.0, 6.0), (-30.0, 0.0)]
)
@pytest.mark.parametrize(("above", "aside"), [(4.0, 0.0), (-4.0, 1.0), (0.0, -1.5)])
def test_a_wrong_camera_is_put_where_verticals_are_upright(
    elevation: float, roll: float, above: float, aside: float
) -> None:
    known = calibrated(camera_prediction(elevation + above, roll + aside), poles(elevation, roll, 50.0))
    assert convergence(known) == pytest.approx(convergence(camera_prediction(elevation, roll)), abs=0.015)
    assert known.camera_roll == pytest.approx(roll, abs=0.4)
    assert abs(known.camera_elevation - elevation) <= 0.75 * abs(above) + 0.5
    assert known.vertical_fov == pytest.approx(50.0, abs=6.0)


@pytest.mark.parametrize(("size", "fov"), [((300, 400), 65.0), ((2 * LINES_SIDE, LINES_SIDE), 50.0), ((90, 60), 50.0)])
def test_portraits_large_and_small_pictures_are_read_alike(size: tuple[int, int], fov: float) -> None:
    known = calibrated(camera_prediction(6.0, 0.0, fov), poles(2.0, 0.0, fov, size))
    assert known.camera_elevation == pytest.approx(2.0, abs=1.0)


def test_verticals_of_a_level_camera_do_not_tell_the_lens_and_those_of_a_steep_one_do() -> None:
    level = calibrated(camera_prediction(0.0, 0.0, 44.0), poles(0.0, 0.0, 50.0)).vertical_fov
    steep = calibrated(camera_prediction(30.0, 0.0, 44.0), poles(30.0, 0.0, 50.0)).vertical_fov
    assert level == pytest.approx(44.0, abs=1.0)
    assert 45.5 < steep < 52.0


@pytest.mark.parametrize(("elevation", "fov"), [(20.0, 50.0), (-25.0, 60.0), (15.0, 40.0)])
@pytest.mark.parametrize("wrong", [0.85, 1.18])
def test_a_known_lens_brings_the_elevation_nearer_whatever_the_network_says_of_it(
    elevation: float, fov: float, wrong: float
) -> None:
    """Verticals tell elevation and lens together, so with either the other is told."""
    network, pixels = camera_prediction(elevation + 2.0, 0.0, wrong * fov), poles(elevation, 0.0, fov)
    unknown, known = (calibrated(network, pixels, lens) for lens in (None, fov))
    assert abs(known.camera_elevation - elevation) < abs(unknown.camera_elevation - elevation) + 0.1
    assert convergence(replace(known, vertical_fov=fov)) == pytest.approx(
        convergence(camera_prediction(elevation, 0.0, fov)), abs=0.02
    )
    assert known.vertical_fov == unknown.vertical_fov, "that of the pixels, to be compared"


def test_without_verticals_the_elevation_follows_the_lens_as_the_horizon_in_the_picture_has_it() -> None:
    blank = np.full((300, 400, 3), 120, dtype=np.uint8)
    for elevation in (20.0, -20.0):
        wider = calibrated(camera_prediction(elevation, 1.0, 50.0), blank, 60.0)
        assert 1.0 < abs(wider.camera_elevation) - 20.0 < 4.0
        assert wider.camera_roll == pytest.approx(1.0, abs=0.01)
        assert wider.vertical_fov == pytest.approx(50.0)
    level = calibrated(camera_prediction(0.0, 0.0, 50.0), blank, 60.0)
    assert level.camera_elevation == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(("by_network", "low", "high"), [(0.6, 0.0, 0.3), (2.5, 2.2, 2.8)])
def test_a_camera_that_may_be_level_is_and_one_that_is_rolled_stays(by_network: float, low: float, high: float) -> None:
    true_roll = 0.3 if by_network < 1.0 else 2.5
    known = calibrated(camera_prediction(5.0, by_network), poles(5.0, true_roll, 50.0))
    assert low <= known.camera_roll <= high


def test_a_lens_that_the_pixels_contradict_is_not_used() -> None:
    """As that of a photo that was cropped to a third."""
    network, pixels = camera_prediction(20.0, 0.0, 25.0), poles(20.0, 0.0, 25.0)
    assert are_equal(calibrated(network, pixels, 70.0), calibrated(network, pixels))


def test_a_picture_without_lines_leaves_the_camera_as_it_is() -> None:
    camera = camera_prediction(7.0, -2.0)
    for grey in (np.full((300, 400), 120), np.full((1, 1), 7)):
        pixels = np.repeat(grey[..., None], 3, axis=2).astype(np.uint8)
        assert calibrated(camera, pixels) is camera


def test_level_stripes_straight_ahead_do_not_tell_the_elevation() -> None:
    """A façade that the camera faces: its edges run level in the picture wherever the horizon lies."""
    rows = np.repeat(np.arange(300) // 20 % 2 * 60 + 90, 400).reshape(300, 400)
    known = calibrated(camera_prediction(7.0, 0.0), np.repeat(rows[..., None], 3, axis=2).astype(np.uint8))
    assert known.camera_elevation == pytest.approx(7.0, abs=0.3)
    assert known.vertical_fov == pytest.approx(50.0, abs=1.0)


def courtyard(elevation: float, fov: float, heading: float, size: tuple[int, int] = (400, 300)) -> NDArray[np.uint8]:
    """Four walls at right angles with level stripes, in a picture whose camera is not rolled; nothing is upright."""
    width, height = size
    camera = Pinhole(FINER * width, FINER * height, fov, heading, elevation, 0.0)
    x, y, z = np.moveaxis(camera_directions(camera), -1, 0)
    far = 1.0 / np.maximum(np.maximum(np.abs(x), np.abs(z)), 1e-9)
    shade = np.where(np.floor(4.0 * (y * far + 10.0)) % 2 == 0, 70.0, 160.0)
    grey = shade.reshape(height, FINER, width, FINER).mean(axis=(1, 3))
    return np.repeat(grey[..., None], 3, axis=2).round().astype(np.uint8)


@pytest.mark.parametrize("heading", [30.0, 45.0, 60.0])
@pytest.mark.parametrize(("elevation", "above"), [(0.0, 4.0), (10.0, -4.0), (-12.0, 3.0)])
def test_horizontals_bring_a_wrong_elevation_nearer(heading: float, elevation: float, above: float) -> None:
    known = calibrated(camera_prediction(elevation + above, 0.0, 60.0), courtyard(elevation, 60.0, heading))
    assert abs(known.camera_elevation - elevation) < 0.72 * abs(above)


@pytest.mark.parametrize("wrong", [0.85, 1.18])
def test_two_headings_at_right_angles_tell_the_lens(wrong: float) -> None:
    known = calibrated(camera_prediction(0.0, 0.0, wrong * 60.0), courtyard(0.0, 60.0, 40.0))
    assert abs(known.vertical_fov - 60.0) < 0.8 * abs(wrong * 60.0 - 60.0)


def test_one_leaning_pole_is_not_believed() -> None:
    """It may be a mast, a trunk or a person: the network's level camera stays nearly so."""
    y, x = np.mgrid[:300, :400].astype(float)
    pole = np.where(np.abs(x - 200 + 0.17 * (y - 150)) < 6, 60, 150)
    known = calibrated(camera_prediction(0.0, 0.0), np.repeat(pole[..., None], 3, axis=2).astype(np.uint8))
    assert abs(known.camera_roll) < 1.0
    assert abs(known.camera_elevation) < 1.0


def test_everything_else_stays() -> None:
    before = camera_prediction(4.0, 1.0)
    after = calibrated(before, poles(0.0, 0.0, 50.0))
    for name in ("spec", "sun_probability", "sun_visibility", "turbidity", "exposure", "light"):
        assert getattr(after, name) is getattr(before, name)


@given(st.floats(-180.0, 180.0), st.floats(-89.0, 89.0), st.floats(-180.0, 180.0))
def test_up_and_level_directions_are_those_of_the_cameras_axes(heading: float, elevation: float, roll: float) -> None:
    axes = camera_axes(0.0, elevation, roll)
    assert up_in_camera(elevation, roll) == pytest.approx(axes @ [0.0, 1.0, 0.0], abs=1e-9)
    level = level_in_camera(np.array(heading), np.array(elevation), roll)
    assert level == pytest.approx(axes @ direction(heading, 0.0), abs=1e-9)


FOCAL = 300.0  # pixels
LEVEL = up_in_camera(0.0, 0.0)


def bar(leaning: float, width: float = 40.0, size: int = 120) -> NDArray[np.uint8]:
    """A smooth bright bar through the middle of a gray picture, leaning to the right by an angle [deg]."""
    y, x = np.mgrid[:size, :size] - (size - 1) / 2
    angle = np.radians(leaning)
    across = x * np.cos(angle) + y * np.sin(angle)
    return np.asarray(80 + 100 * np.clip(width / 2 + 0.5 - np.abs(across), 0, 1), dtype=np.uint8)


def found(grey: NDArray[np.uint8], up: Floats = LEVEL) -> _Lines:
    return _edges_of(grey, up, FOCAL).upright


def turned(angle: Floats, expected: float) -> Floats:
    """How far lines at angles [deg] are from one at another, whichever way they are followed."""
    return np.asarray(np.abs((angle - expected + 90.0) % 180.0 - 90.0))


@pytest.mark.parametrize("leaning", [-17.0, -3.0, 0.0, 0.5, 9.0, 20.0])
def test_both_edges_of_a_bar_lean_as_it_does(leaning: float) -> None:
    lines = found(bar(leaning))
    longest = lines.longest(2)
    assert longest.angle == pytest.approx([leaning] * 2, abs=0.2)
    assert longest.middle[:, 1] == pytest.approx([0.0, 0.0], abs=0.01)
    assert np.sort(longest.middle[:, 0]) == pytest.approx(
        np.array([-20, 20]) / np.cos(np.radians(leaning)) / 120, abs=0.02
    )
    assert (longest.length > 110).all()


def test_what_leans_too_far_or_lies_is_no_vertical() -> None:
    assert len(found(bar(MAX_LEAN + 12.0)).length) == 0
    assert len(found(bar(90.0)).length) == 0


@pytest.mark.parametrize("leaning", [90.0, 80.0, 60.0, -45.0, -70.0, MAX_LEAN + 12.0])
def test_what_leans_further_is_found_apart(leaning: float) -> None:
    edges = _edges_of(bar(leaning), LEVEL, FOCAL)
    assert len(edges.upright.length) == 0
    longest = edges.other.longest(2)
    assert (turned(longest.angle, leaning) < 0.3).all()
    assert (longest.length > 100).all()


def test_a_corner_makes_two_edges() -> None:
    """Of a bright square, whose sides run both ways at 45 deg."""
    y, x = np.mgrid[:160, :160] - 79.5
    square = (80 + 100 * np.clip(50.5 - (np.abs(x) + np.abs(y)), 0, 1)).astype(np.uint8)
    sides = _edges_of(square, LEVEL, FOCAL).other.longest(4)
    assert sorted(np.minimum(turned(sides.angle, 45.0), turned(sides.angle, -45.0)) < 1.0) == [True] * 4
    assert sorted(turned(sides.angle, 45.0) < 5.0) == [False, False, True, True]


def test_a_rolled_camera_expects_leaning_edges() -> None:
    """A camera that is turned clockwise sees verticals turned counter-clockwise: they lean to the left."""
    turned = up_in_camera(0.0, 30.0)
    assert len(found(bar(30.0), turned).length) == 0
    assert found(bar(-30.0), turned).longest(2).angle == pytest.approx([-30.0] * 2, abs=0.2)


def test_a_camera_that_looks_up_expects_verticals_that_lean_inwards() -> None:
    """Beside the middle of the picture: to the right of it, they lean to the left."""
    grey = bar(-28.0)
    shifted = np.pad(grey, ((0, 0), (400, 0)), mode="edge")
    up = up_in_camera(40.0, 0.0)
    assert len(found(shifted, up).length) >= 2
    assert len(found(shifted[:, ::-1].copy(), up_in_camera(-40.0, 0.0)).length) == 0


def test_dark_beside_bright_is_another_edge_than_bright_beside_dark() -> None:
    """The two sides of a thin bright wire stay apart."""
    lines = found(bar(2.0, width=3.0))
    assert len(lines.length) == 2
    assert lines.angle == pytest.approx([2.0] * 2, abs=0.5)


def test_a_shade_is_no_edge() -> None:
    ramp = np.tile(np.linspace(0, 255, 20), (60, 1))
    assert len(found(ramp.astype(np.uint8)).length) == 0


@pytest.mark.parametrize("shape", [(1, 1), (1, 40), (40, 1), (2, 2), (30, 50)])
def test_a_blank_picture_of_any_size_has_no_edges(shape: tuple[int, int]) -> None:
    lines = found(np.full(shape, 90, dtype=np.uint8))
    assert len(lines.length) == len(lines.angle) == len(lines.middle) == 0


def test_the_longest_are_kept() -> None:
    lines = _Lines(np.arange(6.0).reshape(3, 2), np.array([1.0, 2.0, 3.0]), np.array([30.0, 10.0, 20.0]))
    assert sorted(lines.longest(2).angle) == [1.0, 3.0]
    assert lines.longest(3) is lines


def test_lens_ratio_is_that_of_focal_lengths_either_way_round() -> None:
    assert lens_ratio(90.0, 53.1301) == pytest.approx(2.0)
    assert lens_ratio(53.1301, 90.0) == pytest.approx(2.0)
    assert lens_ratio(40.0, 40.0) == 1.0

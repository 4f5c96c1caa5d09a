"""The vertical of several cameras, and angles about it."""

import numpy as np
import pytest

from lighting.turns.upright import angles_of, common_up, level, own_axes, own_up
from tests.lighting.turns.cameras import Camera

CAMERAS: list[Camera] = [(-170.0, 2.0, 0.0), (-140.0, -3.0, 1.5), (165.0, 4.0, -2.0)]
TURNED = np.array([own_axes(*c) @ own_axes(*CAMERAS[0]).T for c in CAMERAS])


def test_the_vertical_outvotes_one_wrong_camera() -> None:
    ups = [own_up(*tilt) for tilt in ((2.0, 0.0), (-3.0, 1.5), (30.0, 20.0))]
    up = common_up(TURNED, np.stack(ups))
    assert np.degrees(np.arccos(up @ own_axes(*CAMERAS[0])[:, 1])) < 1.0


def test_a_surer_camera_outvotes_two_that_agree() -> None:
    true = own_axes(*CAMERAS[0])[:, 1]
    ups = np.stack([own_up(*tilt) for tilt in ((2.0, 0.0), (4.0, 1.5), (11.0, -2.0))])  # the first is right
    assert np.degrees(np.arccos(common_up(TURNED, ups) @ true)) > 2.0
    assert np.degrees(np.arccos(common_up(TURNED, ups, np.array([6.0, 1.0, 1.0])) @ true)) < 0.5


def test_a_few_wrong_levels_do_not_tilt_the_rest() -> None:
    elevation, roll = np.linspace(-20, 30, 60), np.linspace(-5, 8, 60)
    axes = np.stack([own_axes(4.0 * i, e, r) for i, (e, r) in enumerate(zip(elevation, roll, strict=True))])
    ups = np.stack([own_up(e, r) for e, r in zip(elevation, roll, strict=True)])
    wrong = ups.copy()
    wrong[:8] = own_up(60.0, 40.0)
    turned = axes @ axes[0].T
    assert np.degrees(np.arccos(common_up(turned, ups) @ common_up(turned, wrong))) < 0.5


def test_a_camera_that_looks_straight_down_has_a_heading() -> None:
    axes = level(own_up(-90.0, 0.0))
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(axes) > 0.99


@pytest.mark.parametrize("elevation", [-90.0, -89.5, -88.0, -87.0, 0.0, 87.0, 88.0, 89.5, 90.0])
def test_azimuth_0_is_where_the_common_camera_points_however_steep_it_is(elevation: float) -> None:
    heading, said, roll = angles_of(np.eye(3)[None], level(own_up(elevation, 0.0)))
    assert said[0] == pytest.approx(elevation, abs=1e-4)
    assert (heading[0], roll[0]) == pytest.approx((0.0, 0.0), abs=1e-6)


@pytest.mark.parametrize("straight", [-90.0, 90.0])
def test_a_camera_that_looks_straight_down_turns_with_its_picture(straight: float) -> None:
    """Its axis trembles about the vertical; its picture turns steadily."""
    turn, tremble = np.linspace(0.0, 60.0, 31), np.radians(2.0) * np.random.default_rng(0).normal(0, 1, (31, 2))
    tilt = [np.array([[1, 0, -x], [0, 1, -y], [x, y, 1]]) for x, y in tremble]
    axes = np.stack([t @ own_axes(a, straight, 0.0) for t, a in zip(tilt, turn.tolist(), strict=True)])
    heading, elevation, roll = angles_of(axes / np.linalg.norm(axes, axis=2, keepdims=True), np.eye(3))
    np.testing.assert_allclose(heading, turn, atol=0.3)
    np.testing.assert_allclose(roll, 0.0, atol=0.3)
    assert np.abs(elevation).min() > 84.0

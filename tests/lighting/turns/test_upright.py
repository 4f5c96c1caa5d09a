"""The vertical of several cameras, and angles about it."""

import numpy as np
import pytest

from lighting.turns.upright import angles_of, common_up, level, own_axes, up_in_camera
from tests.lighting.turns.cameras import Camera

CAMERAS: list[Camera] = [(-170.0, 2.0, 0.0), (-140.0, -3.0, 1.5), (165.0, 4.0, -2.0)]
TURNED = np.array([own_axes(*c) @ own_axes(*CAMERAS[0]).T for c in CAMERAS])


def test_the_vertical_outvotes_one_wrong_camera() -> None:
    ups = [up_in_camera(*tilt) for tilt in ((2.0, 0.0), (-3.0, 1.5), (30.0, 20.0))]
    up = common_up(TURNED, np.stack(ups))
    assert np.degrees(np.arccos(up @ own_axes(*CAMERAS[0])[:, 1])) < 1.0


def test_a_few_wrong_levels_do_not_tilt_the_rest() -> None:
    elevation, roll = np.linspace(-20, 30, 60), np.linspace(-5, 8, 60)
    axes = np.stack([own_axes(4.0 * i, e, r) for i, (e, r) in enumerate(zip(elevation, roll, strict=True))])
    ups = np.stack([up_in_camera(e, r) for e, r in zip(elevation, roll, strict=True)])
    wrong = ups.copy()
    wrong[:8] = up_in_camera(60.0, 40.0)
    turned = axes @ axes[0].T
    assert np.degrees(np.arccos(common_up(turned, ups) @ common_up(turned, wrong))) < 0.5


def test_a_camera_that_looks_straight_down_has_a_heading() -> None:
    axes = level(up_in_camera(-90.0, 0.0))
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(axes) > 0.99


@pytest.mark.parametrize("elevation", [-90.0, -89.5, -88.0, -87.0, 0.0, 87.0, 88.0, 89.5, 90.0])
def test_azimuth_0_is_where_the_common_camera_points_however_steep_it_is(elevation: float) -> None:
    heading, said, roll = angles_of(np.eye(3)[None], level(up_in_camera(elevation, 0.0)))
    assert said[0] == pytest.approx(elevation, abs=1e-4)
    if abs(elevation) < 90.0:
        assert (heading[0], roll[0]) == pytest.approx((0.0, 0.0), abs=1e-6)

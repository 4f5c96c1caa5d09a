"""Lines on the sphere of directions: at their angle, closed, cut at the seam."""

import numpy as np
import pytest

from lighting.geometry import Pinhole, angle_between, camera_pixel
from lighting.preview.sphere_lines import _rim, frame_directions, pieces
from tests.previews import outdoors


@pytest.mark.parametrize("radius", [0.5, 30.0, 110.0])
def test_a_region_has_its_radius_all_around_the_sun(radius: float) -> None:
    lighting = outdoors(40.0, 20.0)
    rim = _rim(lighting, radius)
    np.testing.assert_allclose(angle_between(rim, lighting.sun_direction), radius, atol=1e-9)
    assert np.argmin(rim[:, 1]) in (0, 360)
    assert np.argmax(rim[:, 1]) == 180


def test_the_frame_runs_along_the_photos_border() -> None:
    lighting = outdoors(camera_elevation=7.0, camera_roll=3.0, vertical_fov=50.0)
    frame = frame_directions(lighting, 4 / 3)
    x, y = camera_pixel(frame, Pinhole(400, 300, 50.0, elevation=7.0, roll=3.0)).T
    on_border = np.minimum(np.minimum(x, 400 - x), np.minimum(y, 300 - y))
    np.testing.assert_allclose(on_border, 0.0, atol=1e-9)
    assert frame[0] == pytest.approx(frame[-1])


def test_a_line_is_cut_where_it_crosses_the_seam() -> None:
    line = np.array([[90.0, 1], [96, 2], [99, 3], [2, 4], [5, 5], [98, 6]])
    assert [len(piece) for piece in pieces(line, 100.0)] == [3, 2]  # a single point is no line

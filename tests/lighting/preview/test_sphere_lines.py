"""Lines on the sphere of directions: at their angle, closed, cut at the seam."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from lighting.drawing import text_width
from lighting.geometry import Pinhole, angle_between, camera_pixel
from lighting.preview.compass import _on_dome
from lighting.preview.sphere_lines import _rim, frame_directions, pieces, regions
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


@pytest.mark.parametrize("radii", [(7.0, 10.0), (13.0, 24.0), (20.0, 30.0)])
@pytest.mark.parametrize("azimuth", [-150.0, -91.0, -60.0, 0.0, 45.0, 80.0, 100.0, 179.0])
@pytest.mark.parametrize("elevation", [5.0, 40.0])
def test_the_shares_of_regions_do_not_cover_each_other(
    radii: tuple[float, float], azimuth: float, elevation: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: dict[str, NDArray[np.float64]] = {}
    monkeypatch.setattr(
        "lighting.preview.sphere_lines.write_inside",
        lambda picture, spot, share, size, colour: written.__setitem__(share, np.asarray(spot)),  # noqa: ARG005
    )
    lighting = replace(outdoors(azimuth, elevation), radius_50=radii[0], radius_90=radii[1])
    regions(Image.new("RGB", (480, 480)), lighting, lambda directions: _on_dome(directions, 480, 196))
    across, down = np.abs(written["50 %"] - written["90 %"])
    assert across >= text_width("90 %", 15) or down >= 15

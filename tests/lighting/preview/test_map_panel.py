"""The sun's regions on the environment map."""

import numpy as np
import pytest

from lighting.preview.layout import lay_out
from lighting.preview.map_panel import map_panel
from tests.previews import amber, outdoors, small_map


@pytest.mark.parametrize("radius", [0.0, 9.0, 60.0, 110.0, 179.0])
@pytest.mark.parametrize(("azimuth", "elevation"), [(180.0, 20.0), (0.0, 90.0), (-3.0, 0.0)])
def test_regions_of_any_size_and_place_are_drawn(radius: float, azimuth: float, elevation: float) -> None:
    lighting = outdoors(azimuth, elevation, radius_50=radius, radius_90=radius)
    box = lay_out(4 / 3, 9).envmap
    panel = np.asarray(map_panel(small_map(lighting), lighting, 4 / 3, box)).astype(np.int64)
    assert len(amber(panel)) > 30


def test_region_on_the_map_has_its_radius() -> None:
    lighting = outdoors(40.0, 20.0, radius_50=20.0)
    box = lay_out(4 / 3, 9).envmap
    rows, columns = amber(np.asarray(map_panel(small_map(lighting), lighting, 4 / 3, box)).astype(np.int64)).T
    half_width = np.degrees(np.arcsin(np.sin(np.radians(20.0)) / np.cos(np.radians(20.0))))
    assert rows.max() == pytest.approx(box.height / 2, abs=3)
    assert columns.max() == pytest.approx((0.5 + (40.0 + half_width) / 360) * box.width, abs=3)
    assert columns.min() == pytest.approx((0.5 + (40.0 - half_width) / 360) * box.width, abs=3)

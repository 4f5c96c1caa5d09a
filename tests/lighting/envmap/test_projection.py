"""Where a photo lies in a map."""

from dataclasses import replace

import numpy as np
import pytest

from lighting.envmap.projection import project_photo
from lighting.geometry import Pinhole, camera_pixel, latlong_directions
from tests.helpers.lights import stated_light

HEIGHT = 64
DARK = np.full((HEIGHT, 2 * HEIGHT, 3), 0.01, np.float32)


def halves() -> np.ndarray:
    """A picture whose left is red and whose right is blue."""
    picture = np.zeros((60, 80, 3), np.uint8)
    picture[:, :40, 0], picture[:, 40:, 2] = 200, 200
    return picture


@pytest.mark.parametrize(("elevation", "roll"), [(0.0, 0.0), (25.0, 10.0), (-30.0, -170.0), (89.0, 0.0)])
def test_the_window_is_where_the_camera_looks(elevation: float, roll: float) -> None:
    light = replace(stated_light(), camera_elevation=elevation, camera_roll=roll)
    seen = project_photo(light, halves(), HEIGHT)
    assert seen is not None
    weight = np.zeros((HEIGHT, 2 * HEIGHT))
    weight[seen.rows, seen.columns] = seen.whole.weight
    x, y = np.moveaxis(
        camera_pixel(latlong_directions(HEIGHT), Pinhole(80, 60, 50.0, elevation=elevation, roll=roll)), -1, 0
    )
    inside = (np.abs(x / 40 - 1) < 0.8) & (np.abs(y / 30 - 1) < 0.8)
    outside = ~((np.abs(x / 40 - 1) < 1) & (np.abs(y / 30 - 1) < 1))
    assert weight[inside].min() > 0.99
    assert weight[outside].max() == 0
    picture = np.zeros((HEIGHT, 2 * HEIGHT, 3))
    picture[seen.rows, seen.columns] = seen.whole.linear
    assert (picture[inside & (x < 36)][:, 0] > 0.4).all()
    assert (picture[inside & (x > 44)][:, 2] > 0.4).all()


def test_clipped_pixels_leave_the_brighter_map() -> None:
    seen = project_photo(stated_light(), np.full((60, 80, 3), 255, np.uint8), HEIGHT)
    assert seen is not None
    whole = seen.whole
    inside = whole.weight > 0.5
    assert whole.over(DARK + 5, 1.0).linear[inside] == pytest.approx(5.01)
    assert whole.over(DARK, 1.0).linear[inside] == pytest.approx(1.0)
    assert whole.over(DARK, 0.5).linear[inside] == pytest.approx(0.5)


def test_a_half_of_it_may_hold_none() -> None:
    seen = project_photo(replace(stated_light(), camera_elevation=60.0), halves(), HEIGHT)
    assert seen is not None
    assert not seen.reaches(slice(HEIGHT // 2 + 8, HEIGHT))
    (upper,) = seen.blocks(slice(0, HEIGHT // 2))
    assert upper.linear.shape[0] == upper.weight.shape[0] == upper.rows.stop - upper.rows.start

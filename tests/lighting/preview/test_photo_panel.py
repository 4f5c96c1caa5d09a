"""The horizon and the sun in the photo lie where geometry says."""

import numpy as np
import pytest
from numpy.typing import NDArray

from lighting.drawing import text_width
from lighting.geometry import Pinhole, camera_pixel, direction
from lighting.preview.layout import LETTERS, lay_out
from lighting.preview.photo_panel import photo_caption, photo_panel
from lighting.records import Lighting
from tests.previews import amber, outdoors, photo


def drawn(lighting: Lighting) -> NDArray[np.int64]:
    return np.asarray(photo_panel(photo(320, 240), lighting, lay_out(4 / 3, 9).photo)).astype(np.int64)


@pytest.mark.parametrize(("elevation", "roll"), [(12.0, 0.0), (-9.0, 0.0), (6.0, 8.0), (0.0, -10.0)])
def test_horizon_lies_where_geometry_says(elevation: float, roll: float) -> None:
    lighting = outdoors(camera_elevation=elevation, camera_roll=roll, vertical_fov=60.0)
    panel = drawn(lighting)
    height, width = panel.shape[:2]
    for azimuth in (-12.0, 0.0, 15.0):
        x, y = camera_pixel(direction(azimuth, 0.0), Pinhole(width, height, 60.0, elevation=elevation, roll=roll))
        column = panel[:, int(x)].min(axis=-1)
        white = np.flatnonzero(column > 200)
        assert abs(white.mean() + 0.5 - y) < 1.5


@pytest.mark.parametrize("elevation", [60.0, 90.0, -90.0])
def test_horizon_out_of_view_is_not_drawn(elevation: float) -> None:
    panel = drawn(outdoors(camera_elevation=elevation, vertical_fov=40.0, sun_visibility=0.1))
    assert panel.min(axis=-1).max() < 230  # the arrow is paler than the line


def test_sun_in_view_is_marked_at_its_place() -> None:
    panel = drawn(outdoors(15.0, 14.0, camera_elevation=5.0, vertical_fov=60.0))
    height, width = panel.shape[:2]
    expected = camera_pixel(direction(15.0, 14.0), Pinhole(width, height, 60.0, elevation=5.0))[::-1]
    np.testing.assert_allclose(amber(panel).mean(axis=0), expected, atol=1.5)


@pytest.mark.parametrize(("azimuth", "side"), [(70.0, 1), (-70.0, -1), (120.0, 1), (-165.0, -1)])
def test_arrow_points_to_the_side_of_a_sun_out_of_view(azimuth: float, side: int) -> None:
    panel = drawn(outdoors(azimuth, 20.0))
    offset = amber(panel)[:, 1] - panel.shape[1] / 2
    assert (np.sign(offset) == side).all()
    assert np.abs(offset).max() > panel.shape[1] / 2 - 30


@pytest.mark.parametrize(("azimuth", "side"), [(120.0, -1), (-165.0, 1)])
def test_the_horizons_name_is_not_where_the_arrow_is(azimuth: float, side: int) -> None:
    panel = drawn(outdoors(azimuth, 20.0))
    white = np.argwhere(panel.min(axis=-1) > 200)
    line = int(np.median(white[:, 0]))
    letters = white[white[:, 0] < line - 6]
    assert len(letters) > 50
    assert (np.sign(letters[:, 1] - panel.shape[1] / 2) == side).all()


@pytest.mark.parametrize("elevation", [-4.0, 4.0])
@pytest.mark.parametrize("azimuth", [120.0, -165.0])
def test_the_horizon_does_not_cross_the_words_beside_the_arrow(azimuth: float, elevation: float) -> None:
    """It passes the arrow at the distance of its words, above or below."""
    panel = drawn(outdoors(azimuth, 20.0, camera_elevation=elevation, vertical_fov=60.0))
    line = np.median(np.argwhere(panel.min(axis=-1) > 200)[:, 0])
    assert 15 < abs(line - panel.shape[0] / 2) < 45
    assert np.abs(amber(panel)[:, 0] - line).min() > 6


@pytest.mark.parametrize(
    ("elevation", "fov", "balls", "caption"),
    [
        (0.0, 50.0, True, "Photo, with its horizon and three balls in its light"),
        (0.0, 50.0, False, "Photo, with its horizon"),
        (4.5, 6.9, True, "Photo"),
        (90.0, 50.0, True, "Photo"),
        (-60.0, 40.0, True, "Photo, with three balls in its light"),
        (0.0, 1.0, False, "Photo, with its horizon"),
    ],
)
def test_the_caption_names_what_is_seen(elevation: float, fov: float, balls: bool, caption: str) -> None:
    assert photo_caption(Pinhole(400, 300, fov, elevation=elevation), 400, balls=balls) == caption


@pytest.mark.parametrize("aspect", [0.2, 0.5, 9 / 16, 2 / 3, 1.0, 3.0])
def test_the_caption_is_no_wider_than_the_panel(aspect: float) -> None:
    width = lay_out(aspect, 9).photo.width
    assert text_width(photo_caption(Pinhole(400, 300, 50.0), width, balls=True), LETTERS) <= width

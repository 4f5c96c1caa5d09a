"""What the preview shows, and where."""

from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from lighting.envmap import render
from lighting.geometry import camera_pixel, direction
from lighting.preview import picture as preview
from lighting.preview.picture import draw_preview
from lighting.records import Lighting
from lighting.sun_grid import grid_directions, soft_label

Floats = NDArray[np.floating[Any]]
Bytes = NDArray[np.uint8]

GRID = "fibonacci:256"
GREY = 110


def outdoors(azimuth: float = 150.0, elevation: float = 40.0, **others: Any) -> Lighting:
    return Lighting(azimuth, elevation, 3.0, 5.0, **others)


def photo(width: int, height: int) -> Bytes:
    return np.full((height, width, 3), GREY, dtype=np.uint8)


def draw(lighting: Lighting, width: int = 320, height: int = 240, probability: Floats | None = None) -> Bytes:
    even = np.full(256, 1 / 256)
    return draw_preview(
        photo(width, height), lighting, even if probability is None else probability, GRID, small_map(lighting)
    )


@lru_cache
def small_map(lighting: Lighting) -> NDArray[np.float32]:
    return render(lighting, 64)


def photo_panel(lighting: Lighting) -> NDArray[np.int64]:
    return np.asarray(preview._photo_panel(photo(320, 240), lighting, preview._plan(4 / 3, 9).photo)).astype(np.int64)


def part(picture: Bytes, name: str, aspect: float) -> NDArray[np.int64]:
    """The pixels of one panel."""
    box = getattr(preview._plan(aspect, 9), name)
    return picture[box.y : box.y + box.height, box.x : box.x + box.width].astype(np.int64)


@pytest.mark.parametrize(("elevation", "roll"), [(12.0, 0.0), (-9.0, 0.0), (6.0, 8.0), (0.0, -10.0)])
def test_horizon_lies_where_geometry_says(elevation: float, roll: float) -> None:
    lighting = outdoors(camera_elevation=elevation, camera_roll=roll, vertical_fov=60.0)
    panel = photo_panel(lighting)
    height, width = panel.shape[:2]
    for azimuth in (-12.0, 0.0, 15.0):
        x, y = camera_pixel(direction(azimuth, 0.0), width, height, 60.0, elevation=elevation, roll=roll)
        column = panel[:, int(x)].min(axis=-1)
        white = np.flatnonzero(column > 200)
        assert abs(white.mean() + 0.5 - y) < 1.5


def test_horizon_out_of_view_is_not_drawn() -> None:
    panel = photo_panel(outdoors(camera_elevation=60.0, vertical_fov=40.0, sun_visibility=0.1))
    assert panel.min(axis=-1).max() < 230  # the arrow is paler than the line


def amber(panel: NDArray[np.int64]) -> NDArray[np.intp]:
    """Rows and columns of the pixels in the sun's colour."""
    return np.argwhere(np.abs(panel - np.array(preview.SUN)).max(axis=-1) < 8)


def test_sun_in_view_is_marked_at_its_place() -> None:
    panel = photo_panel(outdoors(15.0, 14.0, camera_elevation=5.0, vertical_fov=60.0))
    height, width = panel.shape[:2]
    expected = camera_pixel(direction(15.0, 14.0), width, height, 60.0, elevation=5.0)[::-1]
    np.testing.assert_allclose(amber(panel).mean(axis=0), expected, atol=1.5)


@pytest.mark.parametrize(("azimuth", "side"), [(70.0, 1), (-70.0, -1), (120.0, 1), (-165.0, -1)])
def test_arrow_points_to_the_side_of_a_sun_out_of_view(azimuth: float, side: int) -> None:
    panel = photo_panel(outdoors(azimuth, 20.0))
    offset = amber(panel)[:, 1] - panel.shape[1] / 2
    assert (np.sign(offset) == side).all()
    assert np.abs(offset).max() > panel.shape[1] / 2 - 30


@pytest.mark.parametrize(("azimuth", "elevation"), [(60.0, 30.0), (-60.0, 30.0), (135.0, 20.0), (0.0, 60.0)])
def test_probability_peaks_at_its_place_on_the_compass(azimuth: float, elevation: float) -> None:
    cell = grid_directions(GRID)[np.argmax(grid_directions(GRID) @ direction(azimuth, elevation))]
    heat = np.asarray(preview._heat(soft_label(cell, 60.0, GRID), GRID)).astype(int)
    row, column = np.unravel_index(np.argmax(heat.sum(axis=-1)), heat.shape[:2])
    x, y = (column + 0.5) / heat.shape[1] * 2 - 1, (row + 0.5) / heat.shape[0] * 2 - 1
    reach = (90 - elevation) / 90
    expected = (reach * np.sin(np.radians(azimuth)), -reach * np.cos(np.radians(azimuth)))
    np.testing.assert_allclose((x, y), expected, atol=0.12)


@pytest.mark.parametrize("side", [-1, 1])
def test_compass_of_the_picture_is_warm_on_the_suns_side(side: int) -> None:
    lighting = outdoors(170.0, 80.0, sun_visibility=0.1)
    probability = soft_label(direction(side * 60.0, 35.0), 40.0, GRID)
    panel = part(draw(lighting, probability=probability), "compass", 4 / 3)
    warm = np.argwhere(panel[..., 0] - panel[..., 2] > 60) - np.array(panel.shape[:2]) / 2
    assert np.sign(warm[:, 1].mean()) == side
    assert warm[:, 0].mean() < 0


@pytest.mark.parametrize("layout", ["fibonacci:64", "fibonacci:2048", "rings:5x32"])
def test_density_integrates_to_one(layout: str) -> None:
    cells = grid_directions("fibonacci:4000").astype(np.float32)
    probability = soft_label(direction(20.0, 60.0), 12.0, layout).astype(np.float32)
    density = preview._density(cells, probability, layout)
    assert density.mean() * 2 * np.pi == pytest.approx(1.0, abs=0.04)


def test_even_probability_is_colder_than_a_sure_one() -> None:
    even = np.asarray(preview._heat(np.full(256, 1 / 256), GRID))
    sure = np.asarray(preview._heat(soft_label(direction(0.0, 50.0), 300.0, GRID), GRID))
    assert even.sum(axis=-1).max() < 0.7 * sure.sum(axis=-1).max()


@pytest.mark.parametrize(("width", "height"), [(640, 480), (480, 640), (640, 360), (1, 1), (900, 100), (30, 400)])
def test_any_shape_of_photo_has_its_place(width: int, height: int) -> None:
    picture = draw(outdoors(100.0, 30.0, radius_50=9.0, radius_90=30.0), width, height)
    assert picture.dtype == np.uint8
    assert picture.shape[1:] == (1600, 3)
    assert 1000 < len(picture) < 1600
    panel = part(picture, "photo", width / height)
    scale = min(panel.shape[1] / width, panel.shape[0] / height)
    shown = (np.abs(panel - GREY).max(axis=-1) < 3).sum()
    assert shown > 0.6 * width * height * scale**2
    assert (picture[:, -20:] == preview.BACKGROUND).all()


@pytest.mark.parametrize("aspect", [0.4, 0.75, 0.89, 0.9, 1.0, 4 / 3, 16 / 9, 3.0])
def test_panels_do_not_overlap(aspect: float) -> None:
    plan = preview._plan(aspect, 9)
    covered = np.zeros((plan.height, preview.WIDTH), dtype=int)
    for box in (plan.photo, plan.compass, plan.envmap, plan.spheres):
        assert min(box.width, box.height) > 300
        assert box.x + box.width <= preview.WIDTH - preview.MARGIN
        covered[box.y : box.y + box.height, box.x : box.x + box.width] += 1
    assert covered.max() == 1
    for x, y in plan.cells:
        assert not covered[y : y + 50, x : x + 120].any()
        assert y + 50 < plan.height
        assert x + 120 < preview.WIDTH


@pytest.mark.parametrize("radius", [0.0, 9.0, 60.0, 110.0, 179.0])
@pytest.mark.parametrize(("azimuth", "elevation"), [(180.0, 20.0), (0.0, 90.0), (-3.0, 0.0)])
def test_regions_of_any_size_and_place_are_drawn(radius: float, azimuth: float, elevation: float) -> None:
    lighting = outdoors(azimuth, elevation, radius_50=radius, radius_90=radius)
    box = preview._plan(4 / 3, 9).envmap
    panel = np.asarray(preview._map_panel(small_map(lighting), lighting, 4 / 3, box)).astype(np.int64)
    assert len(amber(panel)) > 30


def test_region_on_the_map_has_its_radius() -> None:
    lighting = outdoors(40.0, 20.0, radius_50=20.0)
    box = preview._plan(4 / 3, 9).envmap
    rows, columns = amber(np.asarray(preview._map_panel(small_map(lighting), lighting, 4 / 3, box)).astype(np.int64)).T
    half_width = np.degrees(np.arcsin(np.sin(np.radians(20.0)) / np.cos(np.radians(20.0))))
    assert rows.max() == pytest.approx(box.height / 2, abs=3)
    assert columns.max() == pytest.approx((0.5 + (40.0 + half_width) / 360) * box.width, abs=3)
    assert columns.min() == pytest.approx((0.5 + (40.0 - half_width) / 360) * box.width, abs=3)


def test_sun_is_marked_at_its_place_on_the_compass() -> None:
    size = 500
    panel = np.asarray(preview._compass_panel(outdoors(70.0, 30.0), np.full(256, 1 / 256), GRID, 4 / 3, size))
    spot = (amber(panel.astype(np.int64)).mean(axis=0) - size / 2) / (size / 2 - 44)
    reach = (90 - 30) / 90
    expected = (-reach * np.cos(np.radians(70.0)), reach * np.sin(np.radians(70.0)))
    np.testing.assert_allclose(spot, expected, atol=0.02)


@pytest.mark.parametrize(
    ("azimuth", "words"),
    [
        (-41.2, "41° left"),
        (33.0, "33° right"),
        (0.3, "straight ahead"),
        (179.8, "straight behind"),
        (120.0, "120° right (behind)"),
    ],
)
def test_azimuth_in_words(azimuth: float, words: str) -> None:
    assert preview._azimuth_words(azimuth) == words


def test_numbers_say_which_way_the_camera_looks() -> None:
    values = dict(preview._numbers(outdoors(camera_elevation=-3.14, camera_roll=-0.04, radius_50=9.5, radius_90=131.0)))
    assert values["Camera elevation"] == "3.1° down"
    assert values["Camera roll"] == "0.0°"
    assert values["50 % / 90 % within"] == "9.5° / 131°"


@pytest.mark.parametrize(("visibility", "gold"), [(0.9, True), (0.1, False)])
def test_headline_is_in_the_suns_colour_only_with_direct_sun(visibility: float, gold: bool) -> None:
    canvas = Image.new("RGB", (preview.WIDTH, 140))
    preview._headline(canvas, outdoors(sun_visibility=visibility))
    assert (len(amber(np.asarray(canvas).astype(np.int64))) > 100) == gold


def test_shoulder_keeps_dark_values_and_order() -> None:
    ramp = np.repeat(np.linspace(0, 4, 400, dtype=np.float32)[None, :, None], 3, axis=-1)
    shown = preview.display(ramp)[0, :, 0].astype(int)
    assert (np.diff(shown) >= 0).all()
    np.testing.assert_allclose(shown[1:50], 255 * (1.055 * ramp[0, 1:50, 0] ** (1 / 2.4) - 0.055), atol=1)
    assert shown[100] < 255

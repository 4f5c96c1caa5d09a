"""What the whole preview shows, and where."""

from io import BytesIO

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from lighting.drawing import BACKGROUND
from lighting.envmap import render
from lighting.geometry import Floats, direction
from lighting.preview import draw_preview, preview_png
from lighting.preview.layout import CAPTION, WARNING, lay_out
from lighting.preview.picture import MAP_HEIGHT
from lighting.records import Lighting
from lighting.sun_grid import soft_label
from tests.previews import GREY, GRID, Bytes, estimate, outdoors, photo, small_map


def draw(lighting: Lighting, width: int = 320, height: int = 240, probability: Floats | None = None) -> Bytes:
    return draw_preview(photo(width, height), estimate(lighting, probability), small_map(lighting))


def part(picture: Bytes, name: str, aspect: float) -> NDArray[np.int64]:
    """The pixels of one panel."""
    box = getattr(lay_out(aspect, 9), name)
    return picture[box.y : box.y + box.height, box.x : box.x + box.width].astype(np.int64)


@pytest.mark.parametrize("side", [-1, 1])
def test_compass_of_the_picture_is_warm_on_the_suns_side(side: int) -> None:
    lighting = outdoors(170.0, 80.0, sun_visibility=0.1)
    probability = soft_label(direction(side * 60.0, 35.0), 40.0, GRID)
    panel = part(draw(lighting, probability=probability), "compass", 4 / 3)
    warm = np.argwhere(panel[..., 0] - panel[..., 2] > 60) - np.array(panel.shape[:2]) / 2
    assert np.sign(warm[:, 1].mean()) == side
    assert warm[:, 0].mean() < 0


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
    assert (picture[:, -20:] == np.array(BACKGROUND)).all()


@pytest.mark.parametrize(("width", "height"), [(640, 480), (480, 640)])
def test_warnings_move_the_panels_down_and_change_nothing_else(width: int, height: int) -> None:
    plain = draw(outdoors(100.0, 30.0), width, height)
    warned = draw(outdoors(100.0, 30.0, warnings=("The photo may be cropped.",)), width, height)
    top = lay_out(width / height, 9).photo.y - CAPTION
    assert np.array_equal(warned[top + WARNING :], plain[top:])
    assert np.array_equal(warned[: top - WARNING], plain[: top - WARNING])
    assert (warned[top - WARNING : top + WARNING] != np.array(BACKGROUND)).any()


def test_the_file_holds_the_drawing_with_the_lights_own_map() -> None:
    answer = estimate(outdoors(100.0, 30.0))
    expected = draw_preview(photo(320, 240), answer, render(answer.lighting, MAP_HEIGHT))
    with Image.open(BytesIO(preview_png(photo(320, 240), answer))) as picture:
        assert picture.format == "PNG"
        assert np.array_equal(np.asarray(picture), expected)

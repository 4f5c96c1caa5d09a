"""What the network looks at, on a photo whose sun is in the picture, and on a network that sees nothing."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import export.evaluation.occlusion as occlusion
from export.evaluation.occlusion import draw_occlusion, occlusion_map, write_occlusion
from lighting.model import Model
from lighting.photo.reader import read_photo

EXAMPLES = Path(__file__).parents[3] / "examples"


def test_a_sun_in_the_picture_is_what_the_network_looks_at(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(occlusion, "_STEP", 24)  # a quarter of the covers
    added = occlusion_map(Model.load(), read_photo(EXAMPLES / "railway_field.jpg"))
    height, width = added.shape
    y, x = np.unravel_index(np.argmax(added), added.shape)
    assert abs(x / width - 0.78) < 0.1  # where the glare is
    assert abs(y / height - 0.25) < 0.12
    assert np.abs(added[height // 2 :, : width // 2]).max() < 0.3 * added.max()


def test_several_photos_become_one_picture(network: Path, tmp_path: Path) -> None:
    path = EXAMPLES / "railway_field.jpg"
    write_occlusion(Model.load(network), [path, path], tmp_path / "two.jpg")
    with Image.open(tmp_path / "two.jpg") as picture:
        assert picture.size == (800, 300)


def test_parts_for_the_answer_are_orange_and_parts_against_it_blue() -> None:
    photo = np.full((60, 90, 3), 128, np.uint8)
    added = np.zeros((20, 30))
    added[:, :10], added[:, 20:] = 0.5, -0.5
    picture = draw_occlusion(photo, added).astype(int)
    assert picture[30, 10, 0] > picture[30, 10, 2] + 100
    assert picture[30, 80, 2] > picture[30, 80, 0] + 100
    assert np.ptp(picture[30, 45]) < 8

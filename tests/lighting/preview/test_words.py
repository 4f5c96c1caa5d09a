"""What the preview says in words."""

import numpy as np
import pytest
from PIL import Image

from lighting.preview.layout import WIDTH
from lighting.preview.words import _azimuth_words, draw_headline, numbers_of
from tests.previews import amber, outdoors


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
    assert _azimuth_words(azimuth) == words


def test_numbers_say_which_way_the_camera_looks() -> None:
    values = dict(numbers_of(outdoors(camera_elevation=-3.14, camera_roll=-0.04, radius_50=9.5, radius_90=131.0)))
    assert values["Camera elevation"] == "3.1° down"
    assert values["Camera roll"] == "0.0°"
    assert values["50 % / 90 % within"] == "9.5° / 131°"


@pytest.mark.parametrize(("azimuth", "words"), [(-0.2, "ahead"), (179.9, "behind"), (-120.0, "120° left")])
def test_numbers_fit_their_column(azimuth: float, words: str) -> None:
    assert dict(numbers_of(outdoors(azimuth)))["Sun azimuth"] == words


def test_a_level_camera_looks_neither_down_nor_turned() -> None:
    values = dict(numbers_of(outdoors(camera_elevation=-0.04, camera_roll=-0.04)))
    assert (values["Camera elevation"], values["Camera roll"]) == ("0.0° up", "0.0°")


@pytest.mark.parametrize(("visibility", "gold"), [(0.9, True), (0.1, False)])
def test_headline_is_in_the_suns_colour_only_with_direct_sun(visibility: float, gold: bool) -> None:
    canvas = Image.new("RGB", (WIDTH, 140))
    draw_headline(canvas, outdoors(sun_visibility=visibility))
    assert (len(amber(np.asarray(canvas).astype(np.int64))) > 100) == gold

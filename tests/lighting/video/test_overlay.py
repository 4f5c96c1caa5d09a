"""Where text and balls are drawn in a preview film."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from lighting.light_probe import LightProbe, main_light
from lighting.preview.drawing import text_width
from lighting.records import Lighting
from lighting.video.overlay import _fit_layout, draw_overlay
from lighting.video.shot import FrameLight
from tests.helpers.clips import Pixels

BEHIND = Lighting(sun_azimuth=-149.9, sun_elevation=68.3, turbidity=3.0, exposure=0.1, vertical_fov=50.0)


def words_of(width: int, height: int, balls: NDArray[np.float32]) -> Pixels:
    """Where (height, width) the words of a frame in a hurry differ from those of a slow one."""
    grey = np.full((height, width, 3), 110, np.uint8)
    probe = LightProbe(np.zeros((9, 3)), main_light(BEHIND))
    slow = FrameLight(1, 0, 0.4, replace(BEHIND, relative_heading=5.0), (1.0, 1.0, 1.0), False, probe)
    far = FrameLight(1, 0, 8888.8, replace(BEHIND, relative_heading=200.0), (1.0, 1.0, 1.0), True, probe)
    return np.asarray(np.any(draw_overlay(grey, slow, balls) != draw_overlay(grey, far, balls), axis=-1))


@pytest.mark.parametrize(("width", "height"), [(432, 768), (360, 640), (640, 360), (320, 180), (100, 200)])
def test_words_stand_inside_the_picture_and_beside_the_balls(width: int, height: int) -> None:
    balls = np.ones((round(0.25 * width), round(0.6 * width), 3), np.float32)
    rows, columns = np.nonzero(words_of(width, height, balls))
    assert columns.min() >= 4
    assert columns.max() <= width - 10
    below = _fit_layout(width, balls.shape[1]).below
    over_balls = (rows < height - below) & (rows >= height - below - balls.shape[0]) & (columns < 12 + balls.shape[1])
    assert not over_balls.any()
    assert rows.min() >= height - below  # all words are under the balls


def test_where_there_is_room_words_and_balls_share_a_line() -> None:
    layout = _fit_layout(768, 246)
    assert layout.lines == ((0, 1, 2),)
    assert layout.below == 12
    assert text_width("8888.8 s   sun -149.9°, 68.3° high   turned -160.0° (bridged)", layout.size) < 768 - 246 - 40

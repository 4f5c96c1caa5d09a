"""Clips that dissolve from one place into another."""

from dataclasses import replace

import numpy as np
import pytest

from export.video.dissolves import ALONE, Dissolved, _is_divided
from export.video.sequences import RATE, Pixels, Sequenced
from tests.export.video.test_evaluate import pan

pytest.importorskip("cv2")

GREY, WHITE = (np.full((180, 320, 3), value, np.uint8) for value in (100, 200))
FIRST, LAST = round(ALONE * RATE), round((ALONE + 0.5) * RATE)


def still(picture: Pixels) -> Sequenced:
    """A clip of one picture."""
    return replace(pan(), picture=lambda _: picture)


def test_a_dissolve_shows_one_place_then_both_then_the_other() -> None:
    clip = Dissolved(still(GREY), still(WHITE), 0.5)
    frames = list(clip.frames())
    level = np.array([frame.pixels[0, 0, 0] for frame in frames])
    assert (level[:FIRST] == 100).all()
    assert (level[LAST:] == 200).all()
    assert (np.diff(level[FIRST - 1 : LAST + 1].astype(int)) > 0).all()
    assert level[(FIRST + LAST) // 2] == pytest.approx(150, abs=5)
    assert frames[(FIRST + LAST) // 2].time == pytest.approx(clip.middle, abs=1 / RATE)
    assert len(frames) == FIRST + LAST


def test_a_pan_alone_is_not_divided() -> None:
    assert not _is_divided(pan())

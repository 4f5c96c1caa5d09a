"""Lines, marks and text, by the pixels that they cover."""

import numpy as np
import pytest
from PIL import Image

from lighting.preview.drawing import (
    PALE,
    SUN,
    TextStyle,
    display_srgb,
    draw_arrow_head,
    draw_lines,
    draw_suns,
    draw_text,
    draw_text_inside,
    rounded_mask,
    sun_mark_color,
)
from tests.helpers.scenes import outdoors


def canvas() -> Image.Image:
    return Image.new("RGB", (120, 80), (0, 0, 0))


def ink_in(picture: Image.Image) -> tuple[float, float]:
    """Center (x, y) of all that was drawn, and that something was."""
    weight = np.asarray(picture).astype(float).sum(axis=-1)
    assert weight.sum() > 0
    y, x = np.indices(weight.shape) + 0.5
    return float((x * weight).sum() / weight.sum()), float((y * weight).sum() / weight.sum())


def test_stroke_is_centred_on_its_line_and_as_wide_as_told() -> None:
    picture = canvas()
    draw_lines(picture, [np.array([[10.0, 40.5], [110.0, 40.5]])], (255, 255, 255), 3)
    column = np.asarray(picture)[:, 60, 0] / 255
    assert column.sum() == pytest.approx(3, abs=0.4)
    assert ink_in(picture)[1] == pytest.approx(40.5, abs=0.5)


def test_opacity_scales_the_ink() -> None:
    picture = canvas()
    draw_lines(picture, [np.array([[10.0, 40.0], [110.0, 40.0]])], (200, 100, 0), 6, 0.5)
    assert np.asarray(picture)[40, 60] == pytest.approx([100, 50, 0], abs=2)


def test_sun_mark_is_centred() -> None:
    picture = canvas()
    draw_suns(picture, [(70.0, 30.0)], (255, 255, 255), 6)
    assert ink_in(picture) == pytest.approx((70, 30), abs=0.6)


def test_arrow_head_lies_behind_its_tip() -> None:
    picture = canvas()
    draw_arrow_head(picture, np.array([100.0, 40.0]), np.array([1.0, 0.0]), (255, 255, 255))
    columns = np.flatnonzero(np.asarray(picture).sum(axis=(0, 2)))
    assert columns.max() <= 100
    assert columns.min() >= 76


@pytest.mark.parametrize("spot", [(-500.0, 40.0), (500.0, 40.0), (60.0, -99.0), (60.0, 999.0), (60.0, 40.0)])
def test_text_told_to_stand_outside_is_moved_inside(spot: tuple[float, float]) -> None:
    there, wanted = canvas(), canvas()
    draw_text_inside(there, spot, "50 %", 15, (255, 255, 255))
    draw_text_inside(wanted, (60.0, 40.0), "50 %", 15, (255, 255, 255))
    assert np.asarray(there).sum() == pytest.approx(np.asarray(wanted).sum(), rel=0.02)


def test_rounded_mask_cuts_only_the_corners() -> None:
    mask = np.asarray(rounded_mask((60, 40), 10))
    assert mask.shape == (40, 60)
    assert mask[0, 0] == 0
    assert mask[0, 30] == mask[20, 0] == mask[20, 30] == 255


def test_a_shaded_text_stands_in_a_dark_rim() -> None:
    plain, shaded = (Image.new("RGB", (120, 80), (200, 200, 200)) for _ in range(2))
    draw_text(plain, (60.0, 40.0), "sun", TextStyle(20, (255, 255, 255), anchor="mm"))
    draw_text(shaded, (60.0, 40.0), "sun", TextStyle(20, (255, 255, 255), anchor="mm", shaded=True))
    assert np.asarray(plain).min() == 200
    assert np.asarray(shaded).min() < 100
    assert np.asarray(shaded).max() == 255


def test_shoulder_keeps_dark_values_and_order() -> None:
    ramp = np.repeat(np.linspace(0, 4, 400, dtype=np.float32)[None, :, None], 3, axis=-1)
    shown = display_srgb(ramp)[0, :, 0].astype(int)
    assert (np.diff(shown) >= 0).all()
    np.testing.assert_allclose(shown[1:50], 255 * (1.055 * ramp[0, 1:50, 0] ** (1 / 2.4) - 0.055), atol=1)
    assert shown[100] < 255


def test_a_sun_that_does_not_shine_is_pale() -> None:
    assert sun_mark_color(outdoors(sun_visibility=0.9)) == SUN
    assert sun_mark_color(outdoors(sun_visibility=0.1)) == PALE

"""The display curve, and the sun's two colours."""

import numpy as np

from lighting.drawing.palette import PALE, SUN, display, sun_colour
from tests.previews import outdoors


def test_shoulder_keeps_dark_values_and_order() -> None:
    ramp = np.repeat(np.linspace(0, 4, 400, dtype=np.float32)[None, :, None], 3, axis=-1)
    shown = display(ramp)[0, :, 0].astype(int)
    assert (np.diff(shown) >= 0).all()
    np.testing.assert_allclose(shown[1:50], 255 * (1.055 * ramp[0, 1:50, 0] ** (1 / 2.4) - 0.055), atol=1)
    assert shown[100] < 255


def test_a_sun_that_does_not_shine_is_pale() -> None:
    assert sun_colour(outdoors(sun_visibility=0.9)) == SUN
    assert sun_colour(outdoors(sun_visibility=0.1)) == PALE

"""Other tools' frames and lamps."""

import numpy as np
import pytest

from lighting.scene.axes import colour_and_strength, to_z_up


def test_z_up_keeps_right_handedness() -> None:
    right, up, forward = to_z_up(np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0, -1.0]]))
    assert np.cross(right, forward) == pytest.approx(up)
    assert up == pytest.approx([0, 0, 1])
    assert forward == pytest.approx([0, 1, 0])


def test_colour_and_strength_multiply_to_the_irradiance() -> None:
    colour, strength = colour_and_strength(np.array([2.0, 8.0, 4.0]))
    assert colour.tolist() == [0.25, 1.0, 0.5]
    assert strength == 8.0
    assert colour_and_strength(np.zeros(3))[1] == 0.0
    assert colour_and_strength(np.zeros(3))[0].tolist() == [1.0, 1.0, 1.0]

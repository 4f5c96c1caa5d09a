"""Where rays meet boxes and balls."""

import numpy as np

from export.data.boxes_and_balls import Things, blocked
from lighting.geometry import direction


def test_a_box_and_a_ball_cast_shadows_away_from_the_sun() -> None:
    box = np.array([[4.0, 0.0, -1.0]]), np.array([[6.0, 10.0, 1.0]]), np.full((1, 3), 0.5)
    ball = np.array([[0.0, 3.0, 20.0]]), np.array([2.0]), np.full((1, 3), 0.5)
    points = np.array([[0.0, 0.0, 0.0], [8.0, 0.0, 0.0], [0.0, 0.0, 5.0], [-3.0, 1.3, 20.0], [3.0, 1.3, 20.0]])
    hidden = blocked(points, direction(90.0, 30.0), Things(*box, *ball))
    assert hidden.tolist() == [True, False, False, True, False]

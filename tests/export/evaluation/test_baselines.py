"""Answers that look at no pixel."""

import numpy as np

from export.evaluation.baselines import best_constant
from lighting.geometry import angle_between, direction


def test_the_best_constant_beats_other_constants() -> None:
    elevation = np.array([70.0, 75.0, 80.0])
    suns = direction(np.linspace(-180, 180, 72, endpoint=False)[:, None], elevation)
    best = np.median(angle_between(suns, direction(0.0, best_constant(elevation))))
    assert all(
        best <= np.median(angle_between(suns, direction(30.0, other))) + 1e-9 for other in (0.0, 40.0, 75.0, 90.0)
    )

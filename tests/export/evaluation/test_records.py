"""Truths and answers of crops."""

import numpy as np

from export.evaluation.metrics import sun_error
from export.evaluation.records import select
from tests.export.evaluation.examples import said, truth


def test_select_keeps_the_chosen_crops_of_every_field() -> None:
    t = truth([0.0, 10.0, 20.0], [0.0, 0.0, 0.0])
    chosen = select(t, np.array([False, True, True]))
    assert chosen.panorama.tolist() == ["p0", "p1"]
    np.testing.assert_allclose(sun_error(chosen, said([0.0, 0.0], [0.0, 0.0])), [10.0, 20.0], atol=1e-9)

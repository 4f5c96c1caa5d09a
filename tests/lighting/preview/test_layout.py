"""Every part has its place."""

import numpy as np
import pytest

from lighting.preview.layout import MARGIN, WIDTH, lay_out


@pytest.mark.parametrize("warnings", [0, 3])
@pytest.mark.parametrize("aspect", [0.4, 0.75, 0.89, 0.9, 1.0, 4 / 3, 16 / 9, 3.0])
def test_panels_do_not_overlap(aspect: float, warnings: int) -> None:
    plan = lay_out(aspect, 9, warnings)
    covered = np.zeros((plan.height, WIDTH), dtype=np.int64)
    for box in (plan.photo, plan.compass, plan.envmap, plan.spheres):
        assert min(box.width, box.height) > 300
        assert box.x + box.width <= WIDTH - MARGIN
        covered[box.y : box.y + box.height, box.x : box.x + box.width] += 1
    assert covered.max() == 1
    for x, y in plan.cells:
        assert not covered[y : y + 50, x : x + 120].any()
        assert y + 50 < plan.height
        assert x + 120 < WIDTH

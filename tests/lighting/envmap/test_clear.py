"""Clear skies, painted with a table that belongs to each."""

import numpy as np
import pytest

from lighting.envmap.clear import clear_irradiance, lobe_table, paint_clear
from lighting.envmap.maps import irradiance_of, row_levels
from tests.lighting.envmap.test_render import lighting


def test_a_painted_sky_has_the_models_irradiance() -> None:
    light = lighting()
    lobe = lobe_table(light)
    upper = np.empty((128, 512, 3), np.float32)
    paint_clear(upper, light, lobe)
    assert irradiance_of(row_levels(256)[:128], upper) == pytest.approx(clear_irradiance(light, lobe), rel=1e-3)


def test_a_table_is_that_of_its_own_sky() -> None:
    first, other = lobe_table(lighting()), lobe_table(lighting(turbidity=8.0))
    assert not np.array_equal(first, other)
    assert np.array_equal(lobe_table(lighting()), first)
    with pytest.raises(ValueError, match="read-only"):
        other[0, 0] = 1.0

"""One view's distribution as another camera has it, and over elevations."""

import numpy as np
import pytest

from lighting.evidence.distributions import elevation_density, seen_from
from tests.lighting.evidence.test_fusion import GRID, UNIFORM, lobe, prediction


def test_a_turned_camera_sees_the_sun_turned_the_other_way() -> None:
    turned = seen_from(lobe(50.0, 40.0).sun_probability, 30.0, GRID)
    there = lobe(20.0, 40.0).sun_probability
    assert np.corrcoef(turned, there)[0, 1] > 0.98


def test_the_elevations_density_is_flat_for_a_flat_sky_and_peaks_at_the_sun() -> None:
    elevation = np.arange(0.0, 91.0, 5.0)
    assert elevation_density(prediction(UNIFORM), elevation) == pytest.approx(1 / (2 * np.pi), rel=1e-5)
    assert elevation[elevation_density(lobe(10.0, 35.0, 100.0), elevation).argmax()] == 35.0

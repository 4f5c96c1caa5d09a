"""The likelihood of paths of the sun."""

import numpy as np
import pytest

from lighting.errors import ParameterError
from lighting.evidence.path import Paths, follow, likeness
from lighting.geometry import wrap_azimuth
from tests.lighting.evidence.test_fusion import UNIFORM, lobe, prediction

SUNS = [(110.0, 30.0), (180.0, 55.0), (250.0, 30.0)]  # compass azimuth, elevation
HOURS = np.array([0.0, 4.0, 8.0])


def paths(*elevations: float) -> Paths:
    """Hypotheses that raise all suns by some degrees."""
    elevation = np.array([[e + off for _, e in SUNS] for off in elevations])
    return Paths(elevation, np.tile([a for a, _ in SUNS], (len(elevations), 1)), np.ones(len(elevations)))


def test_the_true_path_and_heading_win() -> None:
    turns = np.array([0.0, 30.0, -40.0])
    said = [lobe(a - 70.0 - t, e) for (a, e), t in zip(SUNS, turns, strict=True)]
    found = follow(said, turns, HOURS, paths(-15.0, 0.0, 15.0))
    assert int(np.argmax(found.probability)) == 1
    assert abs(float(wrap_azimuth(found.heading.best - 70.0))) < 1.0


def test_pixels_that_say_nothing_give_the_prior_back() -> None:
    given = paths(-5.0, 5.0)
    weighted = Paths(given.elevation, given.azimuth, np.array([1.0, 3.0]))
    found = follow([prediction(UNIFORM)] * 3, np.zeros(3), HOURS, weighted)
    assert found.probability == pytest.approx([0.25, 0.75], abs=0.01)
    assert found.heading.radius_50 == pytest.approx(90.0, abs=2.0)


def test_a_path_below_the_horizon_is_no_path() -> None:
    said = [prediction(UNIFORM)] * 3
    assert follow(said, np.zeros(3), HOURS, paths(-40.0, 0.0)).probability == pytest.approx([0.0, 1.0])
    with pytest.raises(ParameterError, match="below the horizon"):
        follow(said, np.zeros(3), HOURS, paths(-60.0))


def test_light_is_alike_for_as_long_as_the_sun_stays() -> None:
    found = likeness(np.array([0.0, 0.0, 2.0]))
    assert found[0] == pytest.approx([1.0, 1.0, np.exp(-1.0)])

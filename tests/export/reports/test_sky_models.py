"""Skies are compared with panoramas of one of the models."""

from functools import partial

import numpy as np
import pytest

from export.reports.sky_models import _compare, _format_errors, _hosek_wilkie, _Truth
from lighting.geometry import direction, latlong_directions
from lighting.sky.prague import prague_radiance

SUN = direction(30.0, 20.0)


def truth(turbidity: float, elevation: float = 20.0, balance: tuple[float, ...] = (5.0, 5.0, 5.0)) -> _Truth:
    """A sky of the Prague model in another exposure and white balance."""
    sun = direction(30.0, elevation)
    return _Truth(sun, elevation, prague_radiance(latlong_directions(64)[:32], sun, turbidity) * balance)


def test_exposure_and_white_balance_do_not_count() -> None:
    errors = _compare(truth(6.0, balance=(7.0, 5.0, 3.0)), partial(prague_radiance, turbidity=6.0))
    assert (errors.color, errors.faces) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert errors.brightness < 0.01  # luminance weighs colours that are no longer the same


def test_another_turbidity_counts() -> None:
    near, far = (_compare(truth(6.0), partial(prague_radiance, turbidity=t)) for t in (7.0, 10.0))
    assert 0 < near.brightness < far.brightness
    assert 0 < near.faces < far.faces


def test_the_table_has_a_row_for_each_turbidity_and_the_best_of_each_picture() -> None:
    text = _format_errors([truth(4.0), truth(6.0), truth(6.0, elevation=5.0)])
    assert "Suns at 0 to 10°: 1 pictures" in text
    assert "Suns at 10 to 25°: 2 pictures" in text
    assert "Suns at 25 to 90°" not in text
    assert text.count("Prague, best turbidity of each picture | 0.000 | 0.000 | 0.000 |") == 2
    assert text.count("Hosek-Wilkie, turbidity") == 18


def test_hosek_and_wilkie_have_the_same_ground() -> None:
    up = np.array([[0.0, 1.0, 0.0]])
    assert _hosek_wilkie(up, SUN, 3.0).shape == (1, 3)
    assert _hosek_wilkie(up, SUN, 3.0)[0, 2] > _hosek_wilkie(up, SUN, 3.0)[0, 0]

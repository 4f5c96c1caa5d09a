"""Figures that a hand calculation gives too."""

import numpy as np
import pytest

from export.evaluation.metrics import (
    Answers,
    Truth,
    answers,
    auc,
    azimuth_error,
    bootstrap,
    difference_interval,
    elevation_error,
    select,
    sun_error,
    sun_figures,
)
from lighting.geometry import direction


def truth(azimuth: list[float], elevation: list[float]) -> Truth:
    n = len(azimuth)
    return Truth(
        panorama=np.array([f"p{i // 2}" for i in range(n)]),
        place=np.array([f"q{i // 4}" for i in range(n)]),
        scored=np.ones(n, bool),
        sun=direction(azimuth, elevation),
        camera=np.zeros((n, 3)),
        visibility=np.ones(n),
        turbidity=np.full(n, 3.0),
        exposure=np.full(n, 1.0),
        in_view=np.full(n, "sky in view"),
    )


def said(azimuth: list[float], elevation: list[float], radius: float = 10.0) -> Answers:
    n = len(azimuth)
    full = np.full(n, radius)
    return answers(direction(azimuth, elevation), radius_50=full / 2, radius_90=full, nll=np.arange(n, dtype=float))


def test_errors_cross_the_seam_with_their_sign() -> None:
    t, s = truth([170.0, -170.0], [30.0, 30.0]), said([-170.0, 170.0], [20.0, 45.0])
    np.testing.assert_allclose(azimuth_error(t, s), [20.0, -20.0], atol=1e-9)
    np.testing.assert_allclose(elevation_error(t, s), [-10.0, 15.0], atol=1e-9)


def test_sun_figures_of_four_known_errors() -> None:
    t = truth([0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0])
    figures = sun_figures(t, said([4.0, 8.0, 40.0, 180.0], [0.0, 0.0, 0.0, 0.0]))
    assert figures["median"] == pytest.approx(24.0)
    assert figures["< 22.5° %"] == 50.0
    assert figures["< 45° %"] == 75.0
    assert figures["flips %"] == 25.0
    assert figures["in 50 % region"] == 25.0
    assert figures["in 90 % region"] == 50.0
    assert figures["NLL"] == pytest.approx(1.5)


def test_auc_counts_ties_half() -> None:
    score = np.array([0.1, 0.4, 0.4, 0.9])
    assert auc(score, np.array([False, False, True, True])) == pytest.approx(0.875)
    assert np.isnan(auc(score, np.zeros(4, bool)))


def test_bootstrap_draws_whole_units() -> None:
    """Crops of one panorama are no independent evidence: a hundred copies of each do not narrow the interval."""
    value = np.random.default_rng(1).normal(0, 1, 30)
    units = np.array([f"u{i}" for i in range(30)])
    once = bootstrap(units, lambda i: float(value[i].mean()))
    many = np.repeat(value, 100)
    repeated = bootstrap(np.repeat(units, 100), lambda i: float(many[i].mean()))
    assert once[0] < value.mean() < once[1]
    np.testing.assert_allclose(repeated, once, atol=1e-9)
    assert once[1] - once[0] == pytest.approx(2 * 1.96 / np.sqrt(30), rel=0.3)


def test_difference_interval_is_below_zero_for_the_better() -> None:
    rng = np.random.default_rng(2)
    units = np.repeat([f"u{i}" for i in range(40)], 5)
    worse = rng.uniform(10, 60, 200)
    assert difference_interval(worse - 5, worse, units)[1] < 0
    low, high = difference_interval(rng.permutation(worse), worse, units)
    assert low < 0 < high


def test_select_keeps_the_chosen_crops_of_every_field() -> None:
    t = truth([0.0, 10.0, 20.0], [0.0, 0.0, 0.0])
    chosen = select(t, np.array([False, True, True]))
    assert chosen.panorama.tolist() == ["p0", "p1"]
    np.testing.assert_allclose(sun_error(chosen, said([0.0, 0.0], [0.0, 0.0])), [10.0, 20.0], atol=1e-9)

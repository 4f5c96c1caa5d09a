"""The discrete sky: cells, targets, decoding."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lighting.errors import ModelError
from lighting.geometry import angle_between, angles, direction, wrap_azimuth
from lighting.sun_grid import (
    HEADINGS,
    bayes_direction,
    blur_headings,
    circular_correlation,
    circular_mode,
    credible_radii,
    grid_directions,
    grid_solid_angle,
    heading_from_probability,
    likeliest_suns,
    nearest_cell_density,
    soft_label,
    splat_to_grid,
    von_mises,
    weighted_median,
)

FINE = "fibonacci:1024"


CVPR = "rings:5x32"


CONCENTRATION = 80.0


azimuths = st.floats(-180.0, 180.0)


elevations = st.floats(0.0, 90.0)


@pytest.mark.parametrize("layout", [FINE, CVPR, "fibonacci:1", "rings:1x1", "rings:3x8"])
def test_cells_are_unit_vectors_of_the_upper_hemisphere_that_cover_it(layout: str) -> None:
    cells = grid_directions(layout)
    assert np.linalg.norm(cells, axis=1) == pytest.approx(1.0)
    assert (cells[:, 1] > 0).all()
    assert grid_solid_angle(layout).sum() == pytest.approx(2 * np.pi)
    assert len(grid_solid_angle(layout)) == len(cells)


def test_fibonacci_cells_are_evenly_spread() -> None:
    cells = grid_directions(FINE)
    nearest = np.sort(angle_between(cells[:, None], cells[None]), axis=1)[:, 1]
    side = np.degrees(np.sqrt(2 * np.pi / len(cells)))
    assert nearest.min() > 0.7 * side
    assert nearest.max() < 1.3 * side


def test_rings_are_the_bins_of_cvpr_2017() -> None:
    azimuth, elevation = angles(grid_directions(CVPR).reshape(5, 32, 3))
    assert elevation[:, 0] == pytest.approx([9.0, 27.0, 45.0, 63.0, 81.0])
    assert np.diff(azimuth[0]) == pytest.approx(360.0 / 32)
    assert azimuth[0, 0] == pytest.approx(-180.0 + 360.0 / 64)


@pytest.mark.parametrize("size", ["", ":", ":0", ":-3", ":3x3", ":a", ":1.5", ":1x2x3"])
@pytest.mark.parametrize("kind", ["fibonacci", "healpix", ""])
def test_unknown_layouts_are_refused_by_name(kind: str, size: str) -> None:
    with pytest.raises(ModelError, match=f"'{kind}{size}' is not known"):
        grid_directions(kind + size)


@pytest.mark.parametrize("size", ["5", "0x5", "5x0", "-1x4", "1x2x3", "ax3"])
def test_rings_need_two_counts(size: str) -> None:
    with pytest.raises(ModelError, match=f"'rings:{size}' is not known"):
        grid_directions(f"rings:{size}")


@given(azimuths, elevations, st.floats(0.0, 2000.0))
def test_soft_label_is_a_distribution_that_peaks_at_the_nearest_cell(az: float, el: float, kappa: float) -> None:
    sun = direction(az, el)
    label = soft_label(sun, kappa, FINE)
    assert label.sum() == pytest.approx(1.0)
    assert (label >= 0).all()
    assert label[np.argmax(grid_directions(FINE) @ sun)] == label.max()


def test_soft_label_of_a_batch_takes_a_concentration_for_each() -> None:
    suns = direction([10.0, -120.0], [30.0, 60.0])
    batch = soft_label(suns, np.array([20.0, 300.0]), CVPR)
    assert batch.shape == (2, 160)
    assert batch[1] == pytest.approx(soft_label(suns[1], 300.0, CVPR))
    assert batch[1].max() > batch[0].max()


def test_no_concentration_means_the_cells_share_by_solid_angle() -> None:
    assert soft_label(direction(0.0, 45.0), 0.0, CVPR) == pytest.approx(grid_solid_angle(CVPR) / (2 * np.pi))


@given(azimuths, st.floats(25.0, 90.0))
def test_radii_are_those_of_the_von_mises_fisher_lobe(az: float, el: float) -> None:
    """A share s of a lobe of concentration k lies within acos(1 + log(1 - s) / k): 7.55 and 13.78 deg here."""
    sun = direction(az, el)
    label = soft_label(sun, CONCENTRATION, FINE)
    assert credible_radii(label, grid_directions(FINE), sun) == pytest.approx([7.55, 13.78], abs=1.2)


@given(azimuths, elevations, st.lists(st.floats(0.0, 1.0), min_size=2, max_size=5))
def test_radii_grow_with_the_share(az: float, el: float, shares: list[float]) -> None:
    label = soft_label(direction(az, el), 20.0, FINE)
    found = credible_radii(label, grid_directions(FINE), direction(0.0, 45.0), sorted(shares))
    assert found == sorted(found)
    assert found[0] >= 0.0
    assert found[-1] <= 180.0


def test_density_integrates_to_one_and_is_highest_at_the_sun() -> None:
    sun = direction(60.0, 35.0)
    label = soft_label(sun, CONCENTRATION, CVPR)
    at_cells = np.array([float(nearest_cell_density(label, cell, CVPR)) for cell in grid_directions(CVPR)])
    assert at_cells @ grid_solid_angle(CVPR) == pytest.approx(1.0)
    assert at_cells.max() == nearest_cell_density(label, sun, CVPR)


def test_density_of_a_uniform_sky_is_one_over_two_pi() -> None:
    uniform = grid_solid_angle(CVPR) / (2 * np.pi)
    assert nearest_cell_density(uniform, direction(-77.0, 12.0), CVPR) == pytest.approx(1 / (2 * np.pi))


def test_a_ring_over_the_cells() -> None:
    ring = direction(np.arange(0.0, 360.0), 40.0)
    cells = splat_to_grid(np.full(360, 1 / 360), ring, FINE)
    assert cells.sum() == pytest.approx(1.0)
    elevation = angles(grid_directions(FINE))[1]
    assert cells[np.abs(elevation - 40.0) < 10.0].sum() > 0.95


def test_cells_over_their_own_cells_stay() -> None:
    probability = np.random.default_rng(0).dirichlet(np.ones(24))
    np.testing.assert_array_equal(splat_to_grid(probability, grid_directions("rings:3x8"), "rings:3x8"), probability)


angles_ = st.floats(0.0, 360.0)


def bell(center: float, spread: float) -> np.ndarray:
    curve = von_mises(HEADINGS - center, spread)
    return np.asarray(curve / curve.sum())


def test_a_narrow_von_mises_is_a_normal_curve() -> None:
    offset = np.array([0.0, 2.0, 5.0])
    assert von_mises(offset, 5.0) == pytest.approx(np.exp(-0.5 * (offset / 5.0) ** 2), rel=2e-3)


@given(angles_, st.floats(4.0, 30.0))
def test_a_heading_is_the_middle_of_its_bell(center: float, spread: float) -> None:
    found = heading_from_probability(bell(center, spread))
    assert abs(float(wrap_azimuth(found.best - center))) < 0.5
    assert 0.0 <= found.best < 360.0


def test_radii_of_a_heading_are_the_quantiles_of_its_bell() -> None:
    found = heading_from_probability(bell(123.0, 10.0))
    assert found.radius_50 == pytest.approx(6.745, abs=0.6)
    assert found.radius_90 == pytest.approx(16.45, abs=0.6)


def test_the_stronger_mode_wins_and_the_other_does_not_pull() -> None:
    assert circular_mode(HEADINGS, 0.6 * bell(350.0, 6.0) + 0.4 * bell(170.0, 6.0)) == pytest.approx(-10.0, abs=0.1)


def test_two_blurs_are_one_of_their_hypotenuse() -> None:
    assert blur_headings(bell(50.0, 6.0), 8.0) == pytest.approx(bell(50.0, 10.0), abs=2e-4)


def test_correlation_finds_the_turn_between_two() -> None:
    product = circular_correlation(bell(70.0, 5.0), bell(40.0, 5.0))
    assert product.argmax() == 30
    assert product.sum() == pytest.approx(1.0)


def test_a_weighted_median_is_where_half_of_the_weight_lies() -> None:
    weight = np.array([3.0, 1.0, 1.0, 1.0])
    assert weighted_median(np.array([9.0, 1.0, 2.0, 3.0]), weight) == 3.0
    assert weighted_median(np.array([1.0, 9.0, 8.0, 7.0]), weight) == 1.0
    assert np.isnan(weighted_median(np.empty(0), np.empty(0)))


@given(azimuths, st.floats(15.0, 90.0))
def test_the_fine_grid_gives_the_sun_back_within_half_a_degree(az: float, el: float) -> None:
    sun = direction(az, el)
    assert angle_between(bayes_direction(soft_label(sun, CONCENTRATION, FINE), FINE), sun) < 0.5


@given(azimuths, elevations)
def test_the_fine_grid_gives_a_low_sun_back_within_six_degrees(az: float, el: float) -> None:
    """Cells end at the horizon, so the mean around a low sun lies above it."""
    sun = direction(az, el)
    assert angle_between(bayes_direction(soft_label(sun, CONCENTRATION, FINE), FINE), sun) < 6.0


def test_the_best_guess_follows_the_stronger_of_two_modes() -> None:
    left, right = direction(-90.0, 40.0), direction(90.0, 40.0)
    p = 0.6 * soft_label(left, CONCENTRATION, FINE) + 0.4 * soft_label(right, CONCENTRATION, FINE)
    assert angle_between(bayes_direction(p, FINE), left) < 0.5


def test_the_best_guess_prefers_a_broad_mode_to_one_stray_cell() -> None:
    sun = direction(30.0, 50.0)
    p = soft_label(sun, CONCENTRATION, FINE)
    p[np.argmin(grid_directions(FINE) @ sun)] = 1.1 * p.max()
    assert angle_between(bayes_direction(p, FINE), sun) < 0.5


def test_two_modes_side_by_side_outweigh_a_single_one_opposite() -> None:
    """The single mode is the strongest, but more suns lie on the other side."""
    modes = [direction(az, 40.0) for az in (-60.0, -20.0, 140.0)]
    p = np.average([soft_label(mode, CONCENTRATION, FINE) for mode in modes], axis=0, weights=(0.32, 0.3, 0.38))
    assert angle_between(bayes_direction(p, FINE), modes[0]) < 35.0


def test_errors_beyond_a_bound_count_alike() -> None:
    """By the mean error the strongest mode would lose to two far away from it, either of which is weaker."""
    modes = [direction(az, 20.0) for az in (0.0, 110.0, 155.0)]
    p = np.average([soft_label(mode, CONCENTRATION, FINE) for mode in modes], axis=0, weights=(0.42, 0.29, 0.29))
    assert angle_between(bayes_direction(p, FINE), modes[0]) < 6.0


@pytest.mark.parametrize("apart", [34.0, 38.0, 60.0])
def test_the_best_guess_is_not_in_the_gap_between_two_sharp_modes(apart: float) -> None:
    modes = direction(np.array([-apart / 2, apart / 2]), 20.0)
    p = soft_label(modes, math.radians(2.0) ** -2, FINE).mean(axis=0)
    assert min(angle_between(bayes_direction(p, FINE), modes)) < 6.0


def test_a_few_cells_with_all_probability_are_answered_by_one_of_them() -> None:
    p = np.zeros(1024, np.float32)
    p[[140, 316, 724]] = 0.287, 0.383, 0.330
    assert min(angle_between(bayes_direction(p, FINE), grid_directions(FINE)[[140, 316, 724]])) < 0.01


@given(st.floats(20.0, 60.0))
def test_the_best_guess_is_where_suns_are_likely(el: float) -> None:
    """With every azimuth as likely, the direction that errs least would be the zenith, where no sun is."""
    ring = soft_label(direction(np.arange(-180.0, 180.0, 2.0), np.full(180, el)), CONCENTRATION, FINE).mean(axis=0)
    assert abs(float(angles(bayes_direction(ring, FINE))[1]) - el) < 6.0


@pytest.mark.parametrize(("spread", "low", "high"), [(4.0, 74.5, 75.5), (12.0, 70.0, 75.0), (30.0, 55.0, 65.0)])
def test_a_broad_answer_high_in_the_sky_is_lowered(spread: float, low: float, high: float) -> None:
    broad = soft_label(direction(40.0, 75.0), math.radians(spread) ** -2, FINE)
    assert low < float(angles(bayes_direction(broad, FINE))[1]) < high


@pytest.mark.parametrize("elevation", [0.0, 2.0, 5.0, 10.0, 40.0])
def test_a_sun_near_the_horizon_stands_as_low_as_networks_are_trained_to_say(elevation: float) -> None:
    """Half of the lobe around a sun on the horizon is cut off, which lifts its mean by 3.2 deg."""
    lobes = soft_label(direction(np.arange(-180.0, 180.0, 20.0), elevation), math.radians(4.0) ** -2, FINE)
    found = [float(angles(bayes_direction(lobe, FINE))[1]) for lobe in lobes]
    assert np.mean(found) == pytest.approx(elevation, abs=0.5)


def test_the_likeliest_suns_are_far_apart_and_share_the_probability() -> None:
    cells, suns = grid_directions(FINE), direction([0.0, 90.0, 180.0, -90.0], [30.0] * 4)
    p = np.array([0.5, 0.3, 0.17, 0.03]) @ soft_label(suns, 200.0, FINE)
    found, shares = likeliest_suns(suns[0], p, cells, FINE)
    assert len(found) == 3
    assert angle_between(found, suns[:3]).max() < 12.5
    assert shares.sum() == pytest.approx(1.0)
    assert shares[:2] == pytest.approx([0.51, 0.32], abs=0.03)
    between = angle_between(found[:, None], found[None])[np.triu_indices(3, 1)]
    assert between.min() >= 40.0


def test_a_sure_distribution_has_one_likely_sun() -> None:
    sun = direction(20.0, 40.0)
    found, shares = likeliest_suns(sun, soft_label(sun, 300.0, FINE), grid_directions(FINE), FINE)
    assert found == pytest.approx(sun[None])
    assert shares == pytest.approx([1.0])


def test_likely_suns_of_a_known_elevation_have_it() -> None:
    ring = direction(np.arange(360.0), 35.0)
    weight = von_mises(np.arange(360.0) - 10.0, 8.0) + 0.6 * von_mises(np.arange(360.0) - 150.0, 8.0)
    cells = splat_to_grid(weight / weight.sum(), ring, FINE)
    found, _ = likeliest_suns(ring[10], cells, ring, FINE)
    assert angles(found)[1] == pytest.approx([35.0, 35.0])
    assert angles(found)[0] == pytest.approx([10.0, 150.0], abs=8.0)

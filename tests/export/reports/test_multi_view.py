"""The correlation of views by their overlap, on views whose truth is known."""

import numpy as np
import pytest

from export.evaluation.metrics import clustered_error
from export.reports.multi_view import (
    VIEW_COUNTS,
    VIEWS_EACH,
    _deal_groups,
    _PanoramaViews,
    cross_fit_correlation,
    fit_correlation,
    group_kinds,
    region_coverage,
)
from lighting.fusion.likelihood import rotate_density
from lighting.geometry import Floats, direction
from tests.lighting.fusion.test_single_view import GRID, fusion_lobe

SUN = direction(20.0, 40.0)


def views(number: int, error: Floats) -> _PanoramaViews:
    """Views in all directions whose suns are off by `error` (VIEWS,) [deg] in azimuth."""
    azimuth = np.linspace(-180, 180, VIEWS_EACH, endpoint=False)
    said = [fusion_lobe(20.0 + e - a, 40.0, 30.0) for e, a in zip(error, azimuth, strict=True)]
    density = [rotate_density(p.sun_probability, -a, GRID) for p, a in zip(said, azimuth, strict=True)]
    return _PanoramaViews(np.log(np.maximum(density, 1e-12)), azimuth, said, SUN, f"{number} place")


@pytest.fixture(scope="module")
def alike() -> list[_PanoramaViews]:
    """Panoramas all of whose views err alike."""
    return [views(k, np.full(VIEWS_EACH, error)) for k, error in enumerate((-25.0, 8.0, 25.0))]


@pytest.fixture(scope="module")
def apart() -> list[_PanoramaViews]:
    """Panoramas each of whose views errs by itself."""
    rng = np.random.default_rng(0)
    return [views(k, rng.normal(0, 14, VIEWS_EACH)) for k in range(3)]


def test_views_that_err_alike_correlate_more_than_others(
    alike: list[_PanoramaViews], apart: list[_PanoramaViews]
) -> None:
    assert fit_correlation(alike)["far"] > fit_correlation(apart)["far"]
    assert fit_correlation(apart)["far"] <= 0.05


def test_groups_are_of_the_size_asked_for(apart: list[_PanoramaViews]) -> None:
    for size in VIEW_COUNTS:
        for kind in group_kinds(size):
            dealt = _deal_groups(apart, size, kind)
            assert all(len(set(part.tolist())) == size for _, part in dealt)


def test_coverage_counts_the_truth_inside_the_regions(apart: list[_PanoramaViews]) -> None:
    row = region_coverage(apart, 1, group_kinds(1)[0])
    assert row["under 45° [%]"] > 90.0
    assert 0.0 <= row["in 50 % region [%]"] <= row["in 90 % region [%]"] <= 100.0


def test_each_half_of_the_places_is_tested_on_the_other(apart: list[_PanoramaViews]) -> None:
    found = cross_fit_correlation(apart)
    assert len(found) == 2
    for row in found.values():
        assert row["NLL"] <= row["NLL, as shipped"]
        assert np.isfinite(row["NLL of the other half"])


def test_places_with_one_answer_each_have_a_standard_error(alike: list[_PanoramaViews]) -> None:
    row = region_coverage(alike, VIEWS_EACH, group_kinds(VIEWS_EACH)[0])
    inside = row["in 50 % region [%]"] / 100
    assert row["+- of that"] == pytest.approx(100 * np.sqrt(inside * (1 - inside) / 3))


def test_places_that_go_together_make_a_share_less_sure() -> None:
    hit = np.array([True, True, False, False])
    apart, in_pairs = np.array(["a", "b", "c", "d"]), np.array(["a", "a", "b", "b"])
    assert clustered_error(hit, apart) == pytest.approx(0.25)
    assert clustered_error(hit, in_pairs) == pytest.approx(0.5**1.5)
    assert clustered_error(hit, np.array(["a"] * 4)) == pytest.approx(0.0)

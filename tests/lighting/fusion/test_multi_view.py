"""Posterior of several photos: frames, pooling on the grid and on rings, warnings."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lighting.errors import ParameterError
from lighting.fusion.multi_view import _frames, fuse_views
from lighting.fusion.pooling import (
    SUN_CORRELATION,
    Correlation,
    _overlap,
    effective_weights,
    elevation_density,
    pool_log_likelihoods,
    pooling_exponent,
    rotate_density,
)
from lighting.fusion.single_view import Observations, Posterior, fuse
from lighting.geometry import Floats, direction, wrap_azimuth
from lighting.prediction import Prediction
from lighting.registration.photo_set import RegisteredView
from tests.helpers.predictions import GRID, UNIFORM, grid_prediction, lobe_prediction

ELEVATION_CORRELATION = 0.6  # of two photos of one place
RELATIVE_HEADING_STD = 10.0  # deg

NOTHING = [Observations()] * 3
COMPASS = [Observations(heading=h) for h in (350.0, 20.0, 90.0)]


def test_a_turned_camera_sees_the_sun_turned_the_other_way() -> None:
    turned = rotate_density(lobe_prediction(50.0, 40.0).sun_probability, 30.0, GRID)
    there = lobe_prediction(20.0, 40.0).sun_probability
    assert np.corrcoef(turned, there)[0, 1] > 0.98


def test_the_elevations_density_is_flat_for_a_flat_sky_and_peaks_at_the_sun() -> None:
    elevation = np.arange(0.0, 91.0, 5.0)
    assert elevation_density(grid_prediction(UNIFORM), elevation) == pytest.approx(1 / (2 * np.pi), rel=1e-5)
    assert elevation[elevation_density(lobe_prediction(10.0, 35.0, 100.0), elevation).argmax()] == 35.0


FOV = np.array([50.0, 50.0, 50.0])


def ahead(*headings: float) -> Floats:
    return direction(np.array(headings), 0.0)


def test_views_that_share_nothing_count_as_the_best_linear_mean_says() -> None:
    """For equal correlations c the weights of the best linear unbiased mean are 1 / (1 + (n - 1) c)."""
    found = effective_weights(ahead(0.0, 120.0, 240.0), FOV, Correlation(0.2, 0.0))
    matrix = np.full((3, 3), 0.2) + 0.8 * np.eye(3)
    assert found == pytest.approx(np.linalg.solve(matrix, np.ones(3)))


def test_one_view_twice_counts_once() -> None:
    found = effective_weights(ahead(0.0, 0.0, 180.0), FOV, Correlation(0.0, 0.0))
    assert found == pytest.approx([0.5, 0.5, 1.0])


def test_the_errors_of_views_correlate_by_the_square_of_what_they_share() -> None:
    """Two views with half in common correlate by a quarter, on top of what views without overlap do."""
    found = effective_weights(ahead(0.0, 31.25), FOV[:2], Correlation(0.2, 0.0))
    assert found == pytest.approx([1 / (1 + 0.2 + 0.8 / 4)] * 2)


def test_the_same_view_under_another_sun_counts_more() -> None:
    same = effective_weights(ahead(0.0, 0.0, 0.0), FOV, SUN_CORRELATION)
    other = effective_weights(ahead(0.0, 0.0, 0.0), FOV, SUN_CORRELATION, np.full((3, 3), 0.2))
    assert (other > same).all()


def test_a_view_that_is_hardly_there_takes_little_from_the_others() -> None:
    found = effective_weights(ahead(0.0, 0.0, 180.0), FOV, Correlation(0.0, 0.0), present=np.array([1.0, 0.1, 1.0]))
    assert found == pytest.approx([1 / 1.1, 0.1 / 2.0, 1.0])


def test_one_view_says_what_it_says_however_often_all_are_misled() -> None:
    density = np.array([1.0, 2.0, 5.0])
    for twice in (1, 2):
        found = pool_log_likelihoods(
            np.log(np.tile(density, (twice, 1))), np.full(twice, 1.0 / twice), Correlation(0.0, 0.3)
        )
        assert found == pytest.approx(density / 8.0)


def test_where_all_may_be_misled_no_number_of_views_makes_the_sun_certain() -> None:
    """Fifty views that count in full leave every cell the share that one view gives it, times the share of cases."""
    density = np.array([1.0, 3.0])
    log = np.log(np.tile(density, (50, 1)))
    assert pool_log_likelihoods(log, np.ones(50), Correlation(0.0, 0.0))[0] < 1e-20
    assert pool_log_likelihoods(log, np.ones(50), Correlation(0.0, 0.1))[0] == pytest.approx(0.1 * 0.25)


def test_cells_count_by_their_area() -> None:
    log = np.log(np.array([[1.0, 1.0], [4.0, 1.0]]))
    found = pool_log_likelihoods(log, np.array([0.5, 0.5]), Correlation(0.0, 0.0), area=np.array([1.0, 3.0]))
    assert found == pytest.approx([0.4, 0.6])


def test_overlap_falls_from_one_to_nothing() -> None:
    found = _overlap(ahead(0.0, 31.25, 62.5), FOV)[0]
    assert found == pytest.approx([1.0, 0.5, 0.0], abs=1e-9)


def test_correlated_photos_count_as_fewer() -> None:
    assert pooling_exponent(1, ELEVATION_CORRELATION) == 1.0
    assert pooling_exponent(4, 0.0) == 1.0
    assert pooling_exponent(4, 1.0) == 0.25
    assert 8 * pooling_exponent(8, ELEVATION_CORRELATION) < 1 / ELEVATION_CORRELATION


def placed(*groups: int) -> list[RegisteredView]:
    return [RegisteredView(g, 10.0 * i, 0.3, 0.0, 0.0, 50.0) for i, g in enumerate(groups)]


def test_headings_win_over_everything() -> None:
    found = _frames(COMPASS, [1.0, 2.0, 3.0], placed(0, 0, 0))
    assert found.heading.tolist() == [1.0, 2.0, 3.0]
    assert not found.heading_std.any()
    assert found.source is None


def test_matches_win_over_the_compass_where_they_connect_all() -> None:
    found = _frames(COMPASS, None, placed(0, 0, 0))
    assert found.heading.tolist() == [0.0, 10.0, 20.0]
    assert found.source == "turns"


def test_the_compass_joins_groups_that_matches_leave_apart() -> None:
    found = _frames(COMPASS, None, placed(0, 0, 1))
    assert not found.group.any()
    assert found.heading - found.heading[0] == pytest.approx([0.0, 10.0, 90.0], abs=10.0)
    assert found.heading[1] - found.heading[0] == pytest.approx(10.0)
    assert found.heading_std[2] == pytest.approx(np.hypot(0.3, RELATIVE_HEADING_STD))
    assert found.heading_std[:2] == pytest.approx([np.hypot(0.3, RELATIVE_HEADING_STD / np.sqrt(2))] * 2)


def test_without_any_each_photo_is_alone() -> None:
    for found in (_frames(NOTHING, None), _frames(NOTHING, None, placed(0, 1, 2))):
        assert found.group.tolist() == [0, 1, 2]
        assert found.heading_of_first(1) is None


def test_headings_must_be_as_many_as_photos() -> None:
    with pytest.raises(ParameterError, match="3 photos need 3 headings, not 2"):
        _frames(NOTHING, [0.0, 1.0])


@pytest.mark.parametrize("heading", [float("nan"), np.float32("inf"), None, "90"])
def test_a_heading_that_is_no_number_is_named(heading: Any) -> None:
    with pytest.raises(ParameterError, match=r"A heading must be a finite number, not .*\."):
        _frames(NOTHING, [0.0, heading, 90.0])


TOGETHER_NOTHING = Observations()
TURNS = (0.0, 90.0, 200.0)


def views(sun: float, turns: tuple[float, ...], concentration: float = 20.0) -> list[Prediction]:
    """What cameras at headings `turns` see of a sun 40 deg high at compass azimuth `sun`."""
    return [lobe_prediction(sun - turn, 40.0, concentration) for turn in turns]


def azimuth_errors(answers: tuple[Posterior, ...], sun: float, turns: tuple[float, ...]) -> list[float]:
    return [abs(float(wrap_azimuth(a.sun.azimuth - (sun - t)))) for a, t in zip(answers, turns, strict=True)]


@pytest.mark.parametrize("suns", [(), ((38.0, 60.0),)])
@pytest.mark.parametrize("headings", [None, TURNS])
def test_the_order_of_the_photos_does_not_matter(
    suns: tuple[tuple[float, float], ...], headings: tuple[float, ...] | None
) -> None:
    predicted = [
        lobe_prediction(50.0, 35.0, 10.0),
        lobe_prediction(-60.0, 45.0, 30.0),
        lobe_prediction(-120.0, 40.0, 5.0),
    ]
    evidence = [Observations(suns)] * 3
    order = [2, 0, 1]
    there = fuse_views(predicted, evidence, headings)
    back = fuse_views([predicted[i] for i in order], evidence, [headings[i] for i in order] if headings else None)
    for i, j in enumerate(order):
        assert back[i].probability == pytest.approx(there[j].probability, abs=1e-9)


def test_known_headings_bring_the_suns_into_one_frame_and_narrow_them() -> None:
    predicted = views(60.0, TURNS)
    answers = fuse_views(predicted, [TOGETHER_NOTHING] * 3, TURNS)
    assert max(azimuth_errors(answers, 60.0, TURNS)) < 2.0
    assert all(
        a.sun.radius_90 < fuse(p, TOGETHER_NOTHING).sun.radius_90 for a, p in zip(answers, predicted, strict=True)
    )
    assert answers[0].used == ("pixels", "other photos")


def test_turns_by_matches_serve_nearly_as_well_as_exact_ones() -> None:
    predicted = views(60.0, TURNS)
    exact = fuse_views(predicted, [TOGETHER_NOTHING] * 3, TURNS)
    matched = fuse_views(predicted, [TOGETHER_NOTHING] * 3, None, together_placed((0, 0, 0)))
    for a, b in zip(matched, exact, strict=True):
        assert abs(float(wrap_azimuth(a.sun.azimuth - b.sun.azimuth))) < 0.3
        assert a.used == ("pixels", "turns", "other photos")


def test_a_photo_that_no_match_connects_says_so() -> None:
    answers = fuse_views(views(60.0, TURNS), [TOGETHER_NOTHING] * 3, None, together_placed((0, 0, 1)))
    assert [a.used for a in answers] == [("pixels", "turns", "other photos")] * 2 + [("pixels", "other photos")]
    assert [len(a.warnings) for a in answers] == [0, 0, 1]


def test_photos_that_overlap_and_not_with_the_first_say_that_their_turn_from_it_is_inferred() -> None:
    alone, *others = fuse_views(views(60.0, TURNS), [TOGETHER_NOTHING] * 3, None, together_placed((0, 1, 1)))
    assert "no other photo: only light" in alone.warnings[0]
    for answer in others:
        assert "turns" in answer.used
        (warning,) = answer.warnings
        assert "does not overlap the first photo: only light" in warning


def test_a_photo_that_lies_on_its_side_says_so() -> None:
    """Its network takes it for upright, the others show that it is not; one a little askew is no matter."""
    where = together_placed((0, 0, 0))
    askew = [where[0], replace(where[1], camera_roll=89.0), replace(where[2], camera_roll=12.0)]
    answers = fuse_views(views(60.0, TURNS), [TOGETHER_NOTHING] * 3, None, askew)
    assert [len(a.warnings) for a in answers] == [0, 1, 0]
    assert "up is 89° off that of the others" in answers[1].warnings[0]


def together_placed(groups: tuple[int, ...]) -> list[RegisteredView]:
    """Photos at TURNS, as matches would turn them in these groups."""
    first = {g: TURNS[groups.index(g)] for g in groups}
    return [RegisteredView(g, t - first[g], 0.3, 0.0, 0.0, 50.0) for g, t in zip(groups, TURNS, strict=True)]


def test_a_photo_that_sees_nothing_leaves_the_others_their_answer() -> None:
    answers = fuse_views([lobe_prediction(30.0, 40.0), grid_prediction(UNIFORM)], [TOGETHER_NOTHING] * 2, [0.0, 100.0])
    assert azimuth_errors(answers, 30.0, (0.0, 100.0)) == pytest.approx([0.0, 0.0], abs=1.0)


def test_exact_headings_beat_compasses_that_disagree() -> None:
    compasses = [Observations(heading=h) for h in (0.0, 10.0, 20.0)]
    answers = fuse_views(views(60.0, TURNS), compasses, TURNS)
    assert max(azimuth_errors(answers, 60.0, TURNS)) < 2.0


def test_compass_headings_of_all_serve_as_relative_headings() -> None:
    """All are wrong by the same 70 deg, which does not matter between them."""
    answers = fuse_views(views(60.0, TURNS), [Observations(heading=(t + 70.0) % 360) for t in TURNS])
    assert max(azimuth_errors(answers, 60.0, TURNS)) < 2.0
    assert answers[0].used == ("pixels", "heading", "other photos")
    exact = fuse_views(views(60.0, TURNS), [TOGETHER_NOTHING] * 3, TURNS)
    assert answers[0].sun.radius_90 > exact[0].sun.radius_90


@pytest.mark.parametrize("suns", [(), ((40.0, 60.0),)])
def test_one_gross_compass_error_is_outvoted(suns: tuple[tuple[float, float], ...]) -> None:
    turns = (0.0, 50.0, 100.0, 150.0)
    evidence = [Observations(suns, heading) for heading in (0.0, 50.0, 100.0, 330.0)]
    answers = fuse_views(views(60.0, turns, 40.0), evidence)
    assert max(azimuth_errors(answers[:3], 60.0, turns[:3])) < 4.0


def test_unknown_headings_share_the_elevation_and_are_inferred() -> None:
    predicted = [lobe_prediction(-100.0, 50.0, 60.0), lobe_prediction(20.0, 30.0, 60.0)]
    answers = fuse_views(predicted, [TOGETHER_NOTHING] * 2)
    assert [a.sun.elevation for a in answers] == pytest.approx([40.0, 40.0], abs=2.5)
    assert [a.sun.azimuth for a in answers] == pytest.approx([-100.0, 20.0], abs=2.0)
    assert answers[1].relative_heading is not None
    assert answers[1].relative_heading.best == pytest.approx(240.0, abs=2.0)
    assert answers[1].camera_heading is None


def test_turbidity_and_exposure_are_shared() -> None:
    first, second = (
        replace(lobe_prediction(0.0, 40.0), turbidity=2.0),
        replace(lobe_prediction(0.0, 40.0), turbidity=8.0, exposure=0.4),
    )
    for answer in fuse_views([first, second], [TOGETHER_NOTHING] * 2):
        assert answer.prediction.turbidity == pytest.approx(4.0)
        assert answer.prediction.exposure == pytest.approx(0.2)


def test_the_fields_of_view_and_warnings_stay_each_photos_own() -> None:
    evidence = [Observations(vertical_fov=20.0), TOGETHER_NOTHING]
    answers = fuse_views([lobe_prediction(0.0, 40.0)] * 2, evidence, [0.0, 0.0])
    assert [a.prediction.vertical_fov for a in answers] == [20.0, 50.0]
    assert [len(a.warnings) for a in answers] == [1, 0]


def test_with_time_and_place_the_group_has_one_heading() -> None:
    sun = (40.0, 60.0)
    answers = fuse_views(views(60.0, TURNS), [Observations((sun,))] * 3, TURNS)
    assert max(azimuth_errors(answers, 60.0, TURNS)) < 1.5
    assert [a.sun.elevation for a in answers] == pytest.approx([40.0] * 3)
    headings = [a.camera_heading.best for a in answers if a.camera_heading]
    assert [abs(float(wrap_azimuth(h - t))) for h, t in zip(headings, TURNS, strict=True)] == pytest.approx(
        [0] * 3, abs=1.5
    )


def test_a_time_lapse_follows_the_suns_motion() -> None:
    """A still camera at heading 30 sees two sides of the sky, one of them wrong; only the true one moves as the sun."""
    suns = [(30.0, 90.0), (50.0, 130.0), (55.0, 190.0), (35.0, 250.0)]
    predicted = []
    for elevation, compass in suns:
        both = (
            lobe_prediction(compass - 30.0, elevation, 60.0).sun_probability
            + lobe_prediction(-75.0, elevation, 60.0).sun_probability
        )
        predicted.append(grid_prediction(both / 2))
    answers = fuse_views(predicted, [Observations((sun,)) for sun in suns], [0.0] * 4)
    for answer in answers:
        assert answer.camera_heading is not None
        assert answer.camera_heading.best == pytest.approx(30.0, abs=2.0)
    alone = fuse(predicted[0], Observations((suns[0],))).camera_heading
    assert alone is not None
    assert alone.radius_90 > 90.0 > 20.0 > answers[0].camera_heading.radius_90  # type: ignore[union-attr]


def test_a_zone_must_fit_all_photos() -> None:
    """Both zones fit the first photo, and only the second zone fits the other."""
    first, second = ((20.0, 100.0), (60.0, 180.0)), ((85.0, 110.0), (45.0, 200.0))
    between = replace(
        lobe_prediction(0.0, 20.0, 60.0),
        sun_probability=0.5 * (lobe_prediction(0, 20, 60).sun_probability + lobe_prediction(0, 60, 60).sun_probability),
    )
    answers = fuse_views([between, lobe_prediction(0.0, 45.0, 60.0)], [Observations(first), Observations(second)])
    assert answers[0].sun.elevation == pytest.approx(60.0, abs=3.0)
    assert answers[1].sun.elevation == pytest.approx(45.0, abs=2.0)


def test_a_photo_without_time_takes_that_of_the_others() -> None:
    answers = fuse_views([lobe_prediction(0.0, 40.0)] * 2, [TOGETHER_NOTHING, Observations(((33.0, 90.0),))])
    assert [a.sun.elevation for a in answers] == pytest.approx([33.0, 33.0])


def test_a_zone_at_night_in_one_photo_is_out_in_all() -> None:
    evidence = [Observations(((-5.0, 80.0), (30.0, 120.0))), Observations(((10.0, 90.0), (45.0, 150.0)))]
    answers = fuse_views([lobe_prediction(0.0, 10.0, 60.0)] * 2, evidence)
    assert [a.sun.elevation for a in answers] == pytest.approx([30.0, 45.0])


@pytest.mark.parametrize(
    ("evidence", "headings", "sentence"),
    [
        ([TOGETHER_NOTHING, TOGETHER_NOTHING], [0.0], "2 photos need 2 headings, not 1"),
        ([Observations(((30.0, 90.0),)), Observations(((30.0, 90.0), (20.0, 70.0)))], None, "must all have a zone"),
        (
            [Observations(((30.0, 90.0), (-2.0, 70.0))), Observations(((-2.0, 90.0), (30.0, 70.0)))],
            None,
            "below the horizon",
        ),
    ],
)
def test_what_contradicts_itself_is_refused(
    evidence: list[Observations], headings: list[float] | None, sentence: str
) -> None:
    with pytest.raises(ParameterError, match=sentence) as refused:
        fuse_views([lobe_prediction(0.0, 40.0)] * 2, evidence, headings)
    assert refused.value.field == (None if headings is None else "headings")  # no single option says the others

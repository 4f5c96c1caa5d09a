"""Pairs of cameras that rotate, move or zoom: what their matches tell."""

from dataclasses import replace

import numpy as np
import pytest

from lighting.geometry import Floats
from lighting.registration.features import Matches, detect_features, match_features
from lighting.registration.rotations import (
    camera_from_world,
    focal_from_fov,
    fov_from_focal,
    project_points,
    rays_through,
    rotation_vector,
)
from lighting.registration.two_view import (
    RelativeRotation,
    _epipolar_inliers,
    _estimate_zoom,
    _PairFit,
    _sampson,
    essential_motion,
    estimate_rotation,
)
from tests.helpers.cameras import PIXEL, SIZE, Camera, matches, picture, relative_rotation, texture

pytestmark = pytest.mark.needs("cv2")
A, B, STEP = (0.0, 2.0, 0.0), (20.0, -1.0, 1.0), (0.8, 0.0, -1.0)
FOCAL = focal_from_fov(50.0, *SIZE)


def test_matches_obey_the_turn_in_spite_of_another_exposure() -> None:
    a, b = (0.0, 3.0, 1.0), (25.0, -2.0, -2.0)
    sphere = texture()
    matched = match_features(
        detect_features(picture(sphere, a, 50.0)), detect_features(picture(sphere, b, 50.0, gain=0.7))
    )
    focal = focal_from_fov(50.0, *SIZE)
    errors = np.linalg.norm(
        project_points(rays_through(matched.a, focal) @ relative_rotation(a, b).T, focal) - matched.b, axis=1
    )
    assert len(matched) > 50
    assert np.mean(errors < 3 * matched.pixel) > 0.9


def test_true_motion_leaves_matches_on_their_lines() -> None:
    translation = camera_from_world(*B) @ (-np.array(STEP) / np.linalg.norm(STEP))
    exact = matches(A, B, 50.0, step=STEP, noise_std=0.0)
    assert np.abs(_sampson(exact, (FOCAL, FOCAL), relative_rotation(A, B), translation, 1.0)).max() < 1e-9


def test_the_turn_and_the_way_are_found() -> None:
    matched = matches(A, B, 50.0, step=STEP)
    estimated = essential_motion(matched, (FOCAL, FOCAL), [1.0], 1e6)
    assert estimated is not None
    assert estimated.translation is not None
    assert np.degrees(np.linalg.norm(rotation_vector(estimated.rotation @ relative_rotation(A, B).T))) < 0.3
    way = camera_from_world(*B) @ (-np.array(STEP) / np.linalg.norm(STEP))
    assert abs(estimated.translation @ way) > np.cos(np.radians(3.0))


def test_wrong_matches_do_not_obey() -> None:
    matched = matches(A, B, 50.0, step=STEP, wrong=0.3)
    assert np.count_nonzero(_epipolar_inliers(matched)) == pytest.approx(0.7 * len(matched), rel=0.15)


LOOK_A, LOOK_B = (40.0, 4.0, 1.5), (72.0, -3.0, -2.0)


def error_of(estimated: RelativeRotation | None, a: Camera, b: Camera) -> float:
    """Deg between what was found and the truth."""
    assert estimated is not None
    return float(np.degrees(np.linalg.norm(rotation_vector(estimated.rotation @ relative_rotation(a, b).T))))


@pytest.mark.parametrize("wrong", [0.0, 0.4])
@pytest.mark.parametrize("fov", [40.0, 65.0])
def test_turn_and_lens_are_found_from_far_points(fov: float, wrong: float) -> None:
    """Four hundred points with 0.3 pixels of noise know the turn to a few hundredths of a degree."""
    estimated = estimate_rotation(matches(LOOK_A, LOOK_B, fov, wrong=wrong, near=300.0), SIZE, SIZE)
    assert error_of(estimated, LOOK_A, LOOK_B) < 0.15
    assert estimated is not None
    assert estimated.vertical_fov == pytest.approx((fov, fov), abs=0.3)
    assert not estimated.translates


def test_the_error_it_says_is_the_error_it_makes() -> None:
    """Over ten draws the whole error is about what the covariance expects."""
    ratios = []
    for seed in range(10):
        estimated = estimate_rotation(matches(LOOK_A, LOOK_B, 50.0, noise_std=1.0, near=300.0, seed=seed), SIZE, SIZE)
        assert estimated is not None
        error = np.degrees(rotation_vector(relative_rotation(LOOK_A, LOOK_B) @ estimated.rotation.T))
        ratios.append(float(error @ np.linalg.solve(estimated.covariance, error)))
    assert 0.3 < np.mean(ratios) / 3 < 1.7  # chi-squared of three axes; the covariance is a little generous


def test_a_lens_that_is_given_stays() -> None:
    estimated = estimate_rotation(matches(LOOK_A, LOOK_B, 50.0, near=300.0), SIZE, SIZE, (50.0, 50.0))
    assert error_of(estimated, LOOK_A, LOOK_B) < 0.1
    assert estimated is not None
    assert estimated.vertical_fov == pytest.approx((50.0, 50.0), abs=1e-3)
    assert estimated.fov_std < 1e-3


def test_a_wrong_guess_of_the_lens_is_corrected() -> None:
    estimated = estimate_rotation(matches(LOOK_A, LOOK_B, 50.0, near=300.0), SIZE, SIZE, (57.0, 57.0), 7.0)
    assert estimated is not None
    assert estimated.vertical_fov[0] == pytest.approx(50.0, abs=0.3)


@pytest.mark.parametrize("fovs", [(None, None), (55.0, 55.0)])
def test_a_walk_among_near_things_is_told_from_a_turn(fovs: tuple[float | None, float | None]) -> None:
    matched = matches(LOOK_A, LOOK_B, 50.0, step=(1.5, 0.1, -0.7), wrong=0.2)
    estimated = estimate_rotation(matched, SIZE, SIZE, fovs, 0.0 if fovs[0] is None else 7.0)
    assert error_of(estimated, LOOK_A, LOOK_B) < 1.0
    assert estimated is not None
    assert estimated.translates


def test_matches_at_random_say_nothing() -> None:
    rng = np.random.default_rng(3)
    points: Floats = rng.uniform(-0.6, 0.6, (2, 200, 2))
    assert estimate_rotation(Matches(points[0], points[1], 0.0025), SIZE, SIZE) is None


def test_few_matches_say_nothing() -> None:
    matched = matches(LOOK_A, LOOK_B, 50.0, near=300.0)
    assert estimate_rotation(replace(matched, a=matched.a[:8], b=matched.b[:8]), SIZE, SIZE) is None


def test_pictures_that_overlap_have_a_turn_and_others_none() -> None:
    sphere = texture()
    a, b, behind = (detect_features(picture(sphere, camera, 50.0)) for camera in (LOOK_A, LOOK_B, (220.0, 0.0, 0.0)))
    estimated = estimate_rotation(match_features(a, b), a.size, b.size)
    assert error_of(estimated, LOOK_A, LOOK_B) < 0.3
    assert estimate_rotation(match_features(a, behind), a.size, behind.size) is None


def test_a_picture_and_itself_are_not_turned() -> None:
    features = detect_features(picture(texture(), LOOK_A, 50.0))
    estimated = estimate_rotation(match_features(features, features), features.size, features.size, (50.0, None))
    assert error_of(estimated, LOOK_A, LOOK_A) < 0.01


ZOOMED_A, ZOOMED_B = (0.0, 2.0, 0.0), (12.0, -1.0, 1.5)
WIDE, TELE = 52.0, 28.0  # deg
GUESS = focal_from_fov(45.0, *SIZE)
ZOOMS = [0.6, 1.0, 1.6]


def matched(second: float, noise: float = 0.3, count: int = 300) -> Matches:
    """What two cameras at one point see, the second through another lens."""
    rng = np.random.default_rng(2)
    half = np.array(SIZE) / np.hypot(*SIZE)
    b = rng.uniform(-half, half, (5 * count, 2))
    a = project_points(
        rays_through(b, focal_from_fov(second, *SIZE)) @ relative_rotation(ZOOMED_A, ZOOMED_B),
        focal_from_fov(WIDE, *SIZE),
    )
    inside = np.all(np.abs(a) < half, axis=1)
    first, other = (p[inside][:count] + rng.normal(0, noise * PIXEL, (count, 2)) for p in (a, b))
    return Matches(first, other, PIXEL)


def estimated(second: float, noise: float = 0.3) -> _PairFit:
    return _estimate_zoom(matched(second, noise), (GUESS, GUESS), ZOOMS, 1.0)


def test_a_zoom_is_found_with_its_turn() -> None:
    answer = estimated(TELE)
    assert np.degrees(np.linalg.norm(rotation_vector(answer.rotation @ relative_rotation(ZOOMED_A, ZOOMED_B).T))) < 0.1
    assert answer.focal == pytest.approx((focal_from_fov(WIDE, *SIZE), focal_from_fov(TELE, *SIZE)), rel=0.01)
    assert answer.inliers.mean() > 0.99


def test_the_first_lens_is_as_sure_as_it_says() -> None:
    answer = estimated(TELE, noise=0.6)
    error_of = np.log(answer.focal[0] / focal_from_fov(WIDE, *SIZE))
    assert abs(error_of) < 4.0 * np.sqrt(2.0 * answer.covariance[3, 3])
    assert np.sqrt(answer.covariance[3, 3]) < 0.01


def test_one_lens_is_no_zoom() -> None:
    answer = estimated(WIDE)
    assert answer.focal[1] / answer.focal[0] == pytest.approx(1.0, abs=2e-3)
    pair = estimate_rotation(matched(WIDE), SIZE, SIZE, (45.0, 45.0), 7.0)
    assert pair is not None
    assert not pair.zoomed
    assert not pair.translates


@pytest.mark.parametrize("ratio", [1.03, 1.05, 1.06, 1.08])
@pytest.mark.parametrize(("fovs", "std"), [((45.0, 45.0), 7.0), ((None, None), 0.0)])
def test_a_small_zoom_is_no_walk(ratio: float, fovs: tuple[float | None, float | None], std: float) -> None:
    """Focal lengths a few percent apart: matches leave one lens, and a walk would turn the pair wrongly."""
    second = fov_from_focal(ratio * focal_from_fov(WIDE, *SIZE), *SIZE)
    answer = estimate_rotation(matched(second), SIZE, SIZE, fovs, std)
    assert answer is not None
    assert not answer.translates
    assert error_of(answer, ZOOMED_A, ZOOMED_B) < 0.2


def test_a_pair_is_given_both_lenses() -> None:
    answer = estimate_rotation(matched(TELE), SIZE, SIZE, (45.0, 45.0), 7.0)
    assert answer is not None
    assert answer.zoomed
    assert not answer.translates
    assert answer.vertical_fov == pytest.approx((WIDE, TELE), abs=0.5)


def test_a_lens_that_is_known_was_not_zoomed() -> None:
    answer = estimate_rotation(matched(TELE), SIZE, SIZE, (45.0, 45.0), 0.5)
    assert answer is not None
    assert not answer.zoomed


def test_who_walks_does_not_zoom() -> None:
    answer = estimate_rotation(matches(ZOOMED_A, ZOOMED_B, WIDE, step=(0.3, 0.0, -0.9)), SIZE, SIZE, (45.0, 45.0), 7.0)
    assert answer is not None
    assert answer.translates
    assert not answer.zoomed

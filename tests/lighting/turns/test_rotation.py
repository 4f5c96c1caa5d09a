"""Turns from matches whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from lighting.geometry import Floats
from lighting.turns import Matches, Turn, features, relative_rotation, rotation_of
from lighting.turns.rays import rotation_vector
from tests.lighting.turns.cameras import SIZE, Camera, matches, picture, texture, turn

pytest.importorskip("cv2")
A, B = (40.0, 4.0, 1.5), (72.0, -3.0, -2.0)


def off(found: Turn | None, a: Camera, b: Camera) -> float:
    """Deg between what was found and the truth."""
    assert found is not None
    return float(np.degrees(np.linalg.norm(rotation_vector(found.rotation @ turn(a, b).T))))


@pytest.mark.parametrize("wrong", [0.0, 0.4])
@pytest.mark.parametrize("fov", [40.0, 65.0])
def test_turn_and_lens_are_found_from_far_points(fov: float, wrong: float) -> None:
    """Four hundred points with 0.3 pixels of noise know the turn to a few hundredths of a degree."""
    found = rotation_of(matches(A, B, fov, wrong=wrong, near=300.0), SIZE, SIZE)
    assert off(found, A, B) < 0.15
    assert found is not None
    assert found.vertical_fov == pytest.approx((fov, fov), abs=0.3)
    assert not found.translates


def test_the_error_it_says_is_the_error_it_makes() -> None:
    """Over ten draws the whole error is about what the covariance expects."""
    ratios = []
    for seed in range(10):
        found = rotation_of(matches(A, B, 50.0, noise=1.0, near=300.0, seed=seed), SIZE, SIZE)
        assert found is not None
        error = np.degrees(rotation_vector(turn(A, B) @ found.rotation.T))
        ratios.append(float(error @ np.linalg.solve(found.covariance, error)))
    assert 0.3 < np.mean(ratios) / 3 < 1.7  # chi-squared of three axes; the covariance is a little generous


def test_a_lens_that_is_given_stays() -> None:
    found = rotation_of(matches(A, B, 50.0, near=300.0), SIZE, SIZE, (50.0, 50.0))
    assert off(found, A, B) < 0.1
    assert found is not None
    assert found.vertical_fov == pytest.approx((50.0, 50.0), abs=1e-3)
    assert found.fov_sigma < 1e-3


def test_a_wrong_guess_of_the_lens_is_corrected() -> None:
    found = rotation_of(matches(A, B, 50.0, near=300.0), SIZE, SIZE, (57.0, 57.0), 7.0)
    assert found is not None
    assert found.vertical_fov[0] == pytest.approx(50.0, abs=0.3)


@pytest.mark.parametrize("fovs", [(None, None), (55.0, 55.0)])
def test_a_walk_among_near_things_is_told_from_a_turn(fovs: tuple[float | None, float | None]) -> None:
    seen = matches(A, B, 50.0, step=(1.5, 0.1, -0.7), wrong=0.2)
    found = rotation_of(seen, SIZE, SIZE, fovs, 0.0 if fovs[0] is None else 7.0)
    assert off(found, A, B) < 1.0
    assert found is not None
    assert found.translates


def test_matches_at_random_say_nothing() -> None:
    rng = np.random.default_rng(3)
    points: Floats = rng.uniform(-0.6, 0.6, (2, 200, 2))
    assert rotation_of(Matches(points[0], points[1], 0.0025), SIZE, SIZE) is None


def test_few_matches_say_nothing() -> None:
    seen = matches(A, B, 50.0, near=300.0)
    assert rotation_of(replace(seen, a=seen.a[:8], b=seen.b[:8]), SIZE, SIZE) is None


def test_pictures_that_overlap_have_a_turn_and_others_none() -> None:
    sphere = texture()
    a, b, behind = (features(picture(sphere, camera, 50.0)) for camera in (A, B, (220.0, 0.0, 0.0)))
    found = relative_rotation(a, b)
    assert off(found, A, B) < 0.3
    assert relative_rotation(a, behind) is None


def test_a_picture_and_itself_are_not_turned() -> None:
    own = features(picture(texture(), A, 50.0))
    found = relative_rotation(own, own, 50.0)
    assert off(found, A, A) < 0.01

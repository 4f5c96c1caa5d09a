"""A lens that was zoomed between two photos."""

import numpy as np
import pytest

from lighting.turns.match import Matches
from lighting.turns.rays import focal_of, project, rays, rotation_vector
from lighting.turns.rotation import rotation_of
from lighting.turns.zoomed import Zoomed, zoomed
from tests.lighting.turns.cameras import PIXEL, SIZE, matches, turn

A, B = (0.0, 2.0, 0.0), (12.0, -1.0, 1.5)
WIDE, TELE = 52.0, 28.0  # deg
GUESS = focal_of(45.0, *SIZE)
ZOOMS = [0.6, 1.0, 1.6]


def seen(second: float, noise: float = 0.3, count: int = 300) -> Matches:
    """What two cameras at one point see, the second through another lens."""
    rng = np.random.default_rng(2)
    half = np.array(SIZE) / np.hypot(*SIZE)
    b = rng.uniform(-half, half, (5 * count, 2))
    a = project(rays(b, focal_of(second, *SIZE)) @ turn(A, B), focal_of(WIDE, *SIZE))
    inside = np.all(np.abs(a) < half, axis=1)
    first, other = (p[inside][:count] + rng.normal(0, noise * PIXEL, (count, 2)) for p in (a, b))
    return Matches(first, other, PIXEL)


def found(second: float, noise: float = 0.3) -> Zoomed | None:
    return zoomed(seen(second, noise), (GUESS, GUESS), ZOOMS, 1.0)


def test_a_zoom_is_found_with_its_turn() -> None:
    answer = found(TELE)
    assert answer is not None
    assert np.degrees(np.linalg.norm(rotation_vector(answer.rotation @ turn(A, B).T))) < 0.1
    assert answer.focal == pytest.approx((focal_of(WIDE, *SIZE), focal_of(TELE, *SIZE)), rel=0.01)
    assert answer.inliers.mean() > 0.99


def test_the_first_lens_is_as_sure_as_it_says() -> None:
    answer = found(TELE, noise=0.6)
    assert answer is not None
    off = np.log(answer.focal[0] / focal_of(WIDE, *SIZE))
    assert abs(off) < 4.0 * np.sqrt(2.0 * answer.covariance[3, 3])
    assert np.sqrt(answer.covariance[3, 3]) < 0.01


def test_one_lens_is_no_zoom() -> None:
    assert found(WIDE) is None


def test_a_pair_is_given_both_lenses() -> None:
    pytest.importorskip("cv2")
    answer = rotation_of(seen(TELE), SIZE, SIZE, (45.0, 45.0), 7.0)
    assert answer is not None
    assert answer.zoomed
    assert not answer.translates
    assert answer.vertical_fov == pytest.approx((WIDE, TELE), abs=0.5)


def test_a_lens_that_is_known_was_not_zoomed() -> None:
    pytest.importorskip("cv2")
    answer = rotation_of(seen(TELE), SIZE, SIZE, (45.0, 45.0), 0.5)
    assert answer is not None
    assert not answer.zoomed


def test_who_walks_does_not_zoom() -> None:
    pytest.importorskip("cv2")
    answer = rotation_of(matches(A, B, WIDE, step=(0.3, 0.0, -0.9)), SIZE, SIZE, (45.0, 45.0), 7.0)
    assert answer is not None
    assert answer.translates
    assert not answer.zoomed

"""Maps of normals, and the turbidity of a day."""

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from lighting.errors import PhotoError
from lighting.stereo.light_vectors import clear_skies, gray_skies
from lighting.stereo.normal_network import Network, NormalFeatures
from lighting.stereo.normal_search import Pose
from lighting.stereo.output import _check_sun_moves
from lighting.stereo.solver import (
    NormalMap,
    Session,
    _shared_residual,
    apply_network,
    fit_turbidity,
    raise_error,
    solve_normals,
)
from tests.helpers.skies import angles, ball, june_suns, photos


@pytest.mark.parametrize("truth", [2.4, 5.5])
def test_it_finds_what_the_photos_were_made_with(truth: float) -> None:
    normals, mask, _ = ball(32)
    images = photos(normals, mask, gray_skies(clear_skies(june_suns(), truth, height=32)), Pose())

    def session(turbidity: float) -> Session:
        return Session(images, mask, gray_skies(clear_skies(june_suns(), turbidity, height=16)), Pose())

    # noise of 1 % and coarse skies; an error of 2 is what bends normals by degrees
    assert abs(fit_turbidity(session) - truth) < 1.0


def session(noise: float = 0.01) -> Session:
    normals, mask, _ = ball(24)
    skies = gray_skies(clear_skies(june_suns(), height=16))
    return Session(photos(normals, mask, skies, Pose(), noise), mask, skies, Pose())


def test_a_ball_in_june() -> None:
    given = session()
    found = solve_normals(given)
    normals, mask, _ = ball(24)
    assert np.median(angles(found.normal[mask], normals[mask])) < 4
    assert not found.normal[~mask].any()
    assert not found.network.any()
    assert 0.009 < found.noise < 0.02


def test_noise_is_measured_in_shares_of_the_brightest_pixel() -> None:
    much, little = (solve_normals(session(noise), noise=1e-3).noise for noise in (0.03, 0.005))
    assert much == pytest.approx(0.03, rel=0.35)
    assert much > 2 * little


class Fixed:
    """A network that always answers the same."""

    def __init__(self, error: float) -> None:
        self.error = error

    def predict(self, planes: NormalFeatures) -> tuple[Any, Any]:
        shape = planes.shared.shape[1:]
        return np.full((*shape, 3), 7.0, np.float32), np.full(shape, self.error, np.float32)


@pytest.mark.parametrize(("error", "taken"), [(1.0, True), (9.0, False), (11.0, False)])
def test_a_network_is_believed_where_it_is_clearly_the_surer(error: float, taken: bool) -> None:
    mask = np.array([[True, False]])
    flat = np.zeros((1, 2), np.float32)
    found = NormalMap(mask, np.zeros((1, 2, 3), np.float32), flat[..., None], flat + 10, flat, ~mask & mask, 0.01)
    planes = NormalFeatures(np.zeros((3, 6, 1, 2), np.float32), np.zeros((15, 1, 2), np.float32))
    both = apply_network(found, cast("Network", Fixed(error)), planes)
    assert both.network.tolist() == [[taken, False]]
    assert (both.normal[0, 0] == (7 if taken else 0)).all()
    assert both.error[0, 0] == (error if taken else 10)
    assert not both.normal[0, 1].any()


def test_empty_masks_black_photos_and_equal_suns_are_refused() -> None:
    given = session()
    with pytest.raises(PhotoError, match="no pixel"):
        solve_normals(Session(given.images, np.zeros_like(given.mask), given.skies, given.pose))
    with pytest.raises(PhotoError, match="black"):
        solve_normals(Session(0 * given.images, given.mask, given.skies, given.pose))
    with pytest.raises(PhotoError, match="same place"):
        _check_sun_moves(given.skies.at(np.array([2, 2, 2])))


def test_noise_shares_nothing_with_its_neighbours_and_a_wrong_model_does() -> None:
    mask = np.zeros((60, 60), bool)
    mask[5:50, 8:55] = True
    noise = np.random.default_rng(0).normal(0, 0.02, (60, 60, 8)).astype(np.float32) * mask[..., None]
    assert np.median(_shared_residual(noise, mask)[mask]) < 0.002
    alike = np.linspace(-1, 1, 8, dtype=np.float32) * mask[..., None]
    alike *= 0.02 * np.sqrt(5 / np.sum(np.linspace(-1, 1, 8) ** 2))  # 0.02 for each of 8 - 3 degrees of freedom
    shared = _shared_residual(noise + alike, mask)
    assert np.median(shared[mask]) == pytest.approx(0.02, rel=0.1)
    assert not shared[~mask].any()


def test_photos_that_darken_without_a_word_raise_what_is_expected() -> None:
    given = session()
    normals, mask, _ = ball(24)
    fading = np.linspace(1, 0.5, len(given.images), dtype=np.float32)[:, None, None, None]
    plain, faded = solve_normals(given), solve_normals(replace(given, images=given.images * fading))
    off = np.median(angles(faded.normal[mask], normals[mask]))
    assert off > 20
    assert np.median(faded.misfit[mask]) > 3 * np.median(plain.misfit[mask])
    assert np.median(faded.error[mask]) > np.median(plain.error[mask]) + 5


def test_errors_add_as_independent_ones_do_and_end_at_a_right_angle() -> None:
    mask = np.array([[True, True, False]])
    flat = np.zeros((1, 3), np.float32)
    found = NormalMap(mask, np.zeros((1, 3, 3), np.float32), flat[..., None], flat + 3, flat, mask & ~mask, 0.01)
    assert raise_error(found, np.array([[4.0, 200.0, 4.0]])).error.tolist() == [[5.0, 90.0, 0.0]]

"""Maps of normals, and the turbidity of a day."""

from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from lighting.errors import ModelError, PhotoError
from lighting.stereo.light_vectors import Skies, clear_skies, gray_skies
from lighting.stereo.output import _check_sun_moves
from lighting.stereo.solver import (
    BY_IMAGE,
    SHARED,
    Network,
    NormalFeatures,
    NormalMap,
    Pose,
    Session,
    _axes,
    _make_shadow_candidates,
    _multiply_in_rows,
    _packaged_network,
    _search_with_shadows,
    _session_noise,
    _shadow_patterns,
    _shared_residual,
    apply_network,
    camera_to_world,
    fit_turbidity,
    make_candidates,
    normal_features,
    raise_error,
    sample_visible_normals,
    search_normals,
    solve_normals,
    world_to_camera,
)
from tests.helpers.skies import angles, ball, june_suns, photos


def test_a_camera_that_looks_north_has_south_towards_it() -> None:
    np.testing.assert_allclose(_axes(Pose()), np.eye(3), atol=1e-12)
    np.testing.assert_allclose(camera_to_world([0, 0, 1], Pose(heading=90)), [-1, 0, 0], atol=1e-12)
    vectors = sample_visible_normals(50)
    np.testing.assert_allclose(
        world_to_camera(camera_to_world(vectors, Pose(30, 20, 10)), Pose(30, 20, 10)), vectors, atol=1e-6
    )


def test_visible_normals_are_unit_vectors_spread_evenly() -> None:
    normals = sample_visible_normals(3000)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, rtol=1e-6)
    np.testing.assert_allclose(normals.mean(axis=0), [0, 0, 0.5], atol=2e-3)  # the centroid of half a sphere


def lights(directions: NDArray[Any]) -> Skies:
    """Distant lights of irradiance pi under a dark sky, in the frame of a camera that looks north."""
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    dark = np.zeros((len(unit), 4, 8, 1), dtype=np.float32)
    return Skies(dark, unit, np.full((len(unit), 1), np.pi))


def facing(count: int, least: float = 0.5) -> NDArray[np.float32]:
    normals = sample_visible_normals(2 * count)
    return normals[normals[:, 2] > least][:count]


def test_three_lights_at_right_angles_give_exact_normals_and_albedo() -> None:
    skies = lights(np.array([[1.0, 0, 1], [-0.5, 0.866, 1], [-0.5, -0.866, 1]]))
    truth = facing(200, 0.85)
    images = 0.4 * np.maximum(truth @ skies.sun_direction.T, 0)[..., None].astype(np.float32)
    answer = search_normals(images, make_candidates(skies, Pose()), noise=1e-3)
    assert angles(answer.normal, truth).max() < 0.1  # linear in the normal, so one step of least squares ends it
    np.testing.assert_allclose(answer.albedo[:, 0], 0.4, rtol=1e-2)
    assert answer.residual.max() < 2e-3


def test_lights_in_one_plane_tell_only_how_a_normal_leans_within_it() -> None:
    turn = np.radians([-50.0, -20, 10, 40])
    skies = lights(np.stack([np.sin(turn), np.zeros(4), np.cos(turn)], axis=1))  # all in y = 0
    truth = np.array([[0.1, 0.6, 0.8], [0.3, -0.5, 0.866]], dtype=np.float32)
    images = np.maximum(truth @ skies.sun_direction.T, 0)[..., None].astype(np.float32)
    answer = search_normals(images, make_candidates(skies, Pose()), noise=0.05)
    lean, true_lean = (np.degrees(np.arctan2(n[:, 0], n[:, 2])) for n in (answer.normal, truth))
    np.testing.assert_allclose(lean, true_lean, atol=2.0)
    assert (answer.error > 15).all()  # the rest of the normal is unknown, and the answer says so
    np.testing.assert_allclose(answer.mean[:, 1], 0, atol=0.1)  # up or down: both alike


def test_a_clear_day_in_june_and_what_it_expects_to_err() -> None:
    skies = gray_skies(clear_skies(june_suns()))
    truth = sample_visible_normals(800)[400:]
    light = make_candidates(skies, Pose(), 800).light[400:]
    images = np.maximum(np.einsum("ktjc,kj->ktc", light, truth), 0)
    noise = 0.01 * float(images.max())
    images += np.random.default_rng(0).normal(0, noise, images.shape).astype(np.float32)
    answer = search_normals(images.astype(np.float32), make_candidates(skies, Pose()), noise)
    error = angles(answer.normal, truth)
    assert np.median(error) < 4
    assert 0.5 < answer.error.mean() / error.mean() < 2  # calibrated on average


def test_products_a_few_rows_at_a_time_are_the_whole_product() -> None:
    rng = np.random.default_rng(0)
    for rows in (0, 1, 9, 40):
        left, right = (rng.normal(size=size).astype(np.float32) for size in ((rows, 8), (8, 3000)))
        np.testing.assert_allclose(_multiply_in_rows(left, right), left @ right, atol=1e-4)


def test_a_shadow_in_the_morning_is_found() -> None:
    skies = gray_skies(clear_skies(june_suns()))
    truth = np.array([[0.0, 0.5, 0.866], [0.3, 0.3, 0.9]], dtype=np.float32)
    truth /= np.linalg.norm(truth, axis=1, keepdims=True)
    sunny, shade = make_candidates(skies, Pose(), 3000), _make_shadow_candidates(skies, Pose())
    assert shade is not None
    nearest = (truth @ shade.normals[:700].T).argmax(axis=1)
    hidden = next(row for row, lit in enumerate(_shadow_patterns(8)) if (~lit).sum() == 3 and not lit[0])
    rows = hidden * 700 + nearest
    images = 0.5 * np.swapaxes(shade.brightness[:, rows], 0, 1).swapaxes(1, 2)
    noise = 0.01 * float(images.max())
    plain = search_normals(images, sunny, noise)
    found = _search_with_shadows(images, sunny, shade, noise)
    assert angles(plain.normal, shade.normals[rows]).min() > 8
    assert angles(found.normal, shade.normals[rows]).max() < 3
    assert (found.residual < plain.residual).all()


def test_patterns_leave_three_photos_in_the_sun() -> None:
    lit = _shadow_patterns(8)
    assert lit[0].all()
    assert len(lit) == 11
    assert lit.sum(axis=1).min() == 3
    assert _make_shadow_candidates(gray_skies(clear_skies(june_suns()[:3])), Pose()) is None


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
    assert _session_noise(session(0.03)) == pytest.approx(0.03, rel=0.35)
    assert _session_noise(session(0.03)) > 2 * _session_noise(session(0.005))


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
    found = NormalMap(mask, np.zeros((1, 2, 3), np.float32), flat[..., None], flat + 10, flat, flat, ~mask & mask, 0.01)
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
    found = NormalMap(mask, np.zeros((1, 3, 3), np.float32), flat[..., None], flat + 3, flat, flat, mask & ~mask, 0.01)
    assert raise_error(found, np.array([[4.0, 200.0, 4.0]])).error.tolist() == [[5.0, 90.0, 0.0]]


def test_planes_hold_the_photos_the_suns_and_the_search_inside_the_mask_alone() -> None:
    normals, mask, _ = ball(24)
    skies = gray_skies(clear_skies(june_suns(), height=16))
    pixels = np.moveaxis(photos(normals, mask, skies, Pose()), 0, -2)[mask]
    answer = search_normals(pixels, make_candidates(skies, Pose(), 300), 0.01)
    suns = world_to_camera(skies.sun_direction, Pose())
    planes = normal_features(pixels, mask, suns, answer, 0.01)
    assert planes.by_image.shape == (8, BY_IMAGE, 24, 24)
    assert planes.shared.shape == (SHARED, 24, 24)
    assert not planes.by_image[..., ~mask].any()
    assert not planes.shared[:, ~mask].any()
    np.testing.assert_array_equal(planes.shared[-1], mask)
    np.testing.assert_allclose(planes.shared[:3, mask].T, answer.normal)
    np.testing.assert_allclose(planes.by_image[:, 3:][..., mask], np.repeat(suns[..., None], mask.sum(), -1), rtol=1e-6)
    np.testing.assert_allclose((planes.by_image[:, 0, mask] ** 2).mean(axis=0), 1, rtol=1e-3)  # free of albedo


def test_planes_are_the_same_in_any_unit_of_the_photos() -> None:
    normals, mask, _ = ball(16)
    skies = gray_skies(clear_skies(june_suns(), height=16))
    pixels = np.moveaxis(photos(normals, mask, skies, Pose()), 0, -2)[mask]
    table, suns = make_candidates(skies, Pose(), 300), world_to_camera(skies.sun_direction, Pose())
    one, two = (
        normal_features(s * pixels, mask, suns, search_normals(s * pixels, table, s * 0.01), s * 0.01) for s in (1, 4)
    )
    np.testing.assert_allclose(one.shared, two.shared, atol=1e-3)
    np.testing.assert_allclose(one.by_image, two.by_image, atol=1e-3)


def planes(images: int, height: int, width: int) -> NormalFeatures:
    rng = np.random.default_rng(0)
    shared = rng.normal(0, 0.3, (SHARED, height, width)).astype(np.float32)
    shared[9:] = np.abs(shared[9:])  # the residual, spread and so on are not negative
    shared[-1] = 1
    return NormalFeatures(rng.normal(0, 0.3, (images, BY_IMAGE, height, width)).astype(np.float32), shared)


def test_it_is_small() -> None:
    assert _packaged_network().stat().st_size < 5e6


@pytest.mark.parametrize(("images", "height", "width"), [(8, 40, 40), (3, 33, 61), (12, 24, 450)])
def test_unit_normals_of_any_size_and_number(images: int, height: int, width: int) -> None:
    normal, error = Network.load(threads=1).predict(planes(images, height, width))
    assert normal.shape == (height, width, 3)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=-1), 1, rtol=1e-4)
    assert (error > 0).all()


def test_the_order_of_the_images_does_not_matter() -> None:
    given, network = planes(6, 32, 32), Network.load(threads=1)
    turned = NormalFeatures(given.by_image[::-1].copy(), given.shared)
    np.testing.assert_allclose(network.predict(given)[0], network.predict(turned)[0], atol=1e-4)


def test_tiles_answer_as_the_whole_away_from_borders() -> None:
    given, network = planes(4, 24, 800), Network.load(threads=1)
    whole = network._tile(given, (slice(0, 24), slice(0, 800)))[0]
    # what lies beyond the margin of 48 pixels moves a normal by little
    assert np.abs(network.predict(given)[0] - whole).mean() < 0.02


def test_another_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.onnx").write_bytes(b"x")
    with pytest.raises(ModelError, match="not an ONNX network"):
        Network.load(tmp_path / "a.onnx")

"""The search of normals, and the camera's frame."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.stereo.light_vectors import Skies, clear_skies, gray_skies
from lighting.stereo.normal_search import (
    Pose,
    _multiply_in_rows,
    _shadow_patterns,
    camera_to_world,
    make_candidates,
    make_shadow_candidates,
    sample_visible_normals,
    search_normals,
    search_with_shadows,
    world_to_camera,
)
from tests.helpers.skies import angles, june_suns


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
    sunny, shade = make_candidates(skies, Pose(), 3000), make_shadow_candidates(skies, Pose())
    assert shade is not None
    nearest = (truth @ shade.normals[:700].T).argmax(axis=1)
    hidden = next(row for row, lit in enumerate(_shadow_patterns(8)) if (~lit).sum() == 3 and not lit[0])
    rows = hidden * 700 + nearest
    images = 0.5 * np.swapaxes(shade.brightness[:, rows], 0, 1).swapaxes(1, 2)
    noise = 0.01 * float(images.max())
    plain = search_normals(images, sunny, noise)
    found = search_with_shadows(images, sunny, shade, noise)
    assert angles(plain.normal, shade.normals[rows]).min() > 8
    assert angles(found.normal, shade.normals[rows]).max() < 3
    assert (found.residual < plain.residual).all()


def test_patterns_leave_three_photos_in_the_sun() -> None:
    lit = _shadow_patterns(8)
    assert lit[0].all()
    assert len(lit) == 11
    assert lit.sum(axis=1).min() == 3
    assert make_shadow_candidates(gray_skies(clear_skies(june_suns()[:3])), Pose()) is None


def test_a_camera_that_looks_north_has_south_towards_it() -> None:
    np.testing.assert_allclose(camera_to_world(np.eye(3), Pose()), np.eye(3), atol=1e-12)
    np.testing.assert_allclose(camera_to_world([0, 0, 1], Pose(heading=90)), [-1, 0, 0], atol=1e-12)
    vectors = sample_visible_normals(50)
    np.testing.assert_allclose(
        world_to_camera(camera_to_world(vectors, Pose(30, 20, 10)), Pose(30, 20, 10)), vectors, atol=1e-6
    )


def test_visible_normals_are_unit_vectors_spread_evenly() -> None:
    normals = sample_visible_normals(3000)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, rtol=1e-6)
    np.testing.assert_allclose(normals.mean(axis=0), [0, 0, 0.5], atol=2e-3)  # the centroid of half a sphere

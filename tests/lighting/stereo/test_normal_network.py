"""The network of normals, and the planes that it sees."""

from pathlib import Path

import numpy as np
import pytest

from lighting.checksum import DATA_FOLDER
from lighting.errors import ModelError
from lighting.onnx_session import packaged_network
from lighting.stereo.light_vectors import clear_skies, gray_skies
from lighting.stereo.normal_network import BY_IMAGE, SHARED, Network, NormalFeatures, normal_features
from lighting.stereo.normal_search import Pose, make_candidates, search_normals, world_to_camera
from tests.helpers.skies import ball, june_suns, photos


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
    assert packaged_network(DATA_FOLDER, "normals").stat().st_size < 5e6


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

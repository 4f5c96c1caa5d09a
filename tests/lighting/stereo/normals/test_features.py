"""The planes that the network of normals sees."""

import numpy as np

from lighting.stereo.days import in_grey
from lighting.stereo.normals.features import BY_IMAGE, SHARED, features
from lighting.stereo.normals.frame import Pose, to_camera
from lighting.stereo.normals.search import candidates, search
from lighting.stereo.skies import clear_skies
from tests.lighting.stereo.sphere import ball, june_suns, photos


def test_planes_hold_the_photos_the_suns_and_the_search_inside_the_mask_alone() -> None:
    normals, mask, _ = ball(24)
    skies = in_grey(clear_skies(june_suns(), height=16))
    pixels = np.moveaxis(photos(normals, mask, skies, Pose()), 0, -2)[mask]
    answer = search(pixels, candidates(skies, Pose(), 300), 0.01)
    suns = to_camera(skies.sun_direction, Pose())
    planes = features(pixels, mask, suns, answer, 0.01)
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
    skies = in_grey(clear_skies(june_suns(), height=16))
    pixels = np.moveaxis(photos(normals, mask, skies, Pose()), 0, -2)[mask]
    table, suns = candidates(skies, Pose(), 300), to_camera(skies.sun_direction, Pose())
    one, two = (features(s * pixels, mask, suns, search(s * pixels, table, s * 0.01), s * 0.01) for s in (1, 4))
    np.testing.assert_allclose(one.shared, two.shared, atol=1e-3)
    np.testing.assert_allclose(one.by_image, two.by_image, atol=1e-3)

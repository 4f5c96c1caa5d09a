"""Features and matches of pictures of a textured sphere."""

import sys

import numpy as np
import pytest

from lighting.errors import MissingExtraError
from lighting.registration.features import (
    detect_features,
    has_opencv,
    import_opencv,
    match_features,
    resize_to,
    to_centered,
)
from lighting.registration.rotations import focal_from_fov, project_points, rays_through
from tests.helpers.cameras import SIZE, picture, relative_rotation, texture

pytest.importorskip("cv2")
FLAT = np.full((480, 640, 3), 128, np.uint8)


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


def test_a_flat_picture_has_no_features_and_no_matches() -> None:
    flat = detect_features(FLAT)
    assert len(flat.points) == 0
    assert len(match_features(flat, flat)) == 0


def test_a_picture_and_itself_match_point_by_point() -> None:
    features = detect_features(picture(texture(), (0.0, 0.0, 0.0), 50.0))
    matched = match_features(features, features)
    assert len(matched) > 100
    assert matched.a == pytest.approx(matched.b)


def test_large_pictures_are_shrunk() -> None:
    large = np.repeat(np.repeat(picture(texture(), (0.0, 0.0, 0.0), 50.0), 3, axis=0), 3, axis=1)
    assert (detect_features(large).width, detect_features(large).height) == (1024, 768)


def test_points_are_counted_from_the_centre_up_and_right() -> None:
    corners = np.array([[-0.5, -0.5], [639.5, 479.5], [319.5, 239.5]])
    assert to_centered(corners, 640, 480) == pytest.approx(np.array([[-0.8, 0.6], [0.8, -0.6], [0.0, 0.0]]))


def test_without_opencv_one_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    assert has_opencv()
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(MissingExtraError, match=r"outdoor-lighting\[all\]"):
        import_opencv()


def test_small_pictures_keep_their_size() -> None:
    small = np.arange(12, dtype=np.uint8).reshape(3, 4)
    assert np.array_equal(resize_to(small, 4), small)

"""Features of pictures, and those that match."""

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
from tests.helpers.cameras import picture, texture

pytestmark = pytest.mark.needs("cv2")
FLAT = np.full((480, 640, 3), 128, np.uint8)


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

"""Kinds of places by what the network tells."""

from pathlib import Path

import numpy as np
import pytest

from lighting.envmap.detail_library import load_detail_library
from lighting.envmap.place_kinds import KIND_FEATURES, PLACE_KINDS, kind_features, kind_probability
from lighting.estimator import Estimator
from lighting.photo.reader import read_photo
from lighting.prediction import SurfaceClass

EXAMPLES = Path(__file__).parents[3] / "examples"


def flat_segments(surface: SurfaceClass) -> np.ndarray:
    segments = np.zeros((12, 9, len(SurfaceClass)), np.float32)
    segments[..., list(SurfaceClass).index(surface)] = 1
    return segments


def test_features_are_rows_of_classes_and_rings_of_light() -> None:
    around = np.ones((12, 24, 3), np.float32)
    around[:2] = (1.0, 1.0, 2.0)
    features = kind_features(flat_segments(SurfaceClass.WATER), around)
    assert features.shape == (KIND_FEATURES,)
    shares, gray, colors = np.split(features, [4 * len(SurfaceClass), KIND_FEATURES - 12])
    assert shares.sum() == 4  # one class in each part
    assert gray.sum() == pytest.approx(0)
    assert gray[0] > gray[1]  # the blue ring is brighter, and bluer
    np.testing.assert_allclose(colors.reshape(6, 2)[0], (0.0, np.log(2.0)), atol=0.03)
    np.testing.assert_allclose(colors.reshape(6, 2)[1:], 0.0, atol=1e-9)


def test_the_scale_of_what_is_around_does_not_matter() -> None:
    around = np.random.default_rng(0).uniform(0.1, 1, (12, 24, 3)).astype(np.float32)
    one, other = (kind_features(flat_segments(SurfaceClass.SKY), around * np.float32(k)) for k in (1, 8))
    np.testing.assert_allclose(one, other, atol=1e-5)


def test_probabilities_are_those_of_a_softmax() -> None:
    weights = np.zeros((KIND_FEATURES + 1, len(PLACE_KINDS)))
    weights[0, 1], weights[-1, 2] = np.log(2.0), np.log(5.0)
    features = np.zeros(KIND_FEATURES)
    features[0] = 1
    np.testing.assert_allclose(kind_probability(features, weights), np.array([1, 2, 5, 1, 1, 1, 1, 1]) / 13)


@pytest.mark.parametrize(
    ("example", "kind"),
    [("beach_evening", "shore"), ("venice_alley", "city"), ("meadow_edge", "meadow"), ("snow_field", "snow")],
)
def test_examples_are_of_their_kinds(example: str, kind: str) -> None:
    context = Estimator()(read_photo(EXAMPLES / f"{example}.jpg")).context()
    assert context is not None
    assert context.segments is not None
    assert context.coarse_panorama is not None
    features = kind_features(context.segments, context.coarse_panorama)
    likely = kind_probability(features, load_detail_library().kind_weights)
    assert PLACE_KINDS[int(likely.argmax())] == kind

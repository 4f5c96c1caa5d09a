"""The network of what photos show."""

from pathlib import Path

import numpy as np
import pytest

from lighting.errors import ModelError, PhotoError
from lighting.photo.reader import read_photo
from lighting.segmentation import Segmenter, SurfaceClass, class_share, packaged_segmenter, pixel_share

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(("size", "shape"), [((120, 160), (18, 24)), ((160, 120), (24, 18)), ((32, 256), (18, 24))])
def test_each_cell_has_probabilities(size: tuple[int, int], shape: tuple[int, int]) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (*size, 3), dtype=np.uint8)
    segments = packaged_segmenter()(pixels)
    assert segments.shape == (*shape, len(SurfaceClass))
    assert segments.sum(axis=2) == pytest.approx(1.0, abs=1e-4)
    assert segments.min() >= 0.0


def test_an_example_shows_sky_over_ground() -> None:
    segments = packaged_segmenter()(read_photo(ROOT / "examples" / "wide_street.jpg").pixels)
    rows = len(segments)
    assert class_share(segments[: rows // 5], SurfaceClass.SKY).mean() > 0.5
    assert class_share(segments[-rows // 5 :], SurfaceClass.GROUND).mean() > 0.7


def test_shares_add_up_and_are_enlarged_smoothly() -> None:
    segments = np.zeros((2, 2, 10), dtype=np.float32)
    segments[..., SurfaceClass.PERSON], segments[..., SurfaceClass.VEHICLE] = 0.25, 0.5
    both = class_share(segments, SurfaceClass.PERSON, SurfaceClass.VEHICLE)
    assert both.tolist() == [[0.75, 0.75], [0.75, 0.75]]
    segments = np.zeros((1, 2, 10), dtype=np.float32)
    segments[0, 1, SurfaceClass.WATER] = 1.0
    enlarged = pixel_share(segments, 8, 3, SurfaceClass.WATER)
    assert enlarged.shape == (3, 8)
    assert (np.diff(enlarged[0]) >= 0).all()


def test_what_is_no_network_or_no_photo_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ModelError):
        Segmenter(tmp_path / "missing.onnx")
    with pytest.raises(ModelError, match="is no network that says what photos show"):
        Segmenter(next((ROOT / "lighting" / "data").glob("normals-*.onnx")))
    with pytest.raises(PhotoError):
        packaged_segmenter()(np.zeros((4, 4), dtype=np.uint8))

"""The network of normals that ships: its size, its answer at any size and number of images, what is not one."""

from pathlib import Path

import numpy as np
import pytest

from lighting.errors import ModelError
from lighting.stereo.normals.features import BY_IMAGE, SHARED, Features
from lighting.stereo.normals.network import Network, packaged_network


def planes(images: int, height: int, width: int) -> Features:
    rng = np.random.default_rng(0)
    shared = rng.normal(0, 0.3, (SHARED, height, width)).astype(np.float32)
    shared[9:] = np.abs(shared[9:])  # the residual, spread and so on are not negative
    shared[-1] = 1
    return Features(rng.normal(0, 0.3, (images, BY_IMAGE, height, width)).astype(np.float32), shared)


def test_it_is_small() -> None:
    assert packaged_network().stat().st_size < 5e6


@pytest.mark.parametrize(("images", "height", "width"), [(8, 40, 40), (3, 33, 61), (12, 24, 450)])
def test_unit_normals_of_any_size_and_number(images: int, height: int, width: int) -> None:
    normal, error = Network.load(threads=1).predict(planes(images, height, width))
    assert normal.shape == (height, width, 3)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=-1), 1, rtol=1e-4)
    assert (error > 0).all()


def test_the_order_of_the_images_does_not_matter() -> None:
    given, network = planes(6, 32, 32), Network.load(threads=1)
    turned = Features(given.by_image[::-1].copy(), given.shared)
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

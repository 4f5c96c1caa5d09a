"""The network that improves a search's normals.

Its inputs: `by_image`, float32 (1, T, BY_IMAGE, H, W), and `shared`, float32 (1, SHARED, H, W), T any number of images
of a day, H and W multiples of 8. Its outputs: `normal`, float32 (1, 3, H, W), unit vectors in the camera frame, and
`error`, float32 (1, 1, H, W), their expected angle to the truth [rad].
"""

from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lighting.checksum import DATA_FOLDER
from lighting.errors import ModelError
from lighting.onnx_session import OnnxSession, create_session, packaged_network
from lighting.stereo.normal_search import Image, SearchResult

BY_IMAGE = 6  # planes of each image: relative brightness, difference to the search's fit, cosine to the sun, sun x y z
SHARED = 15  # planes of the search: best, mean and other normal, residual, odds, spread, brightness, noise, mask
_LARGE_DIFFERENCE = 0.05  # of the mean brightness, what counts as a large difference
_TILE, _MARGIN = 384, 48  # pixels that are answered at once, and that the network sees beyond them
_SIZE_MULTIPLE = 8  # pixels, of the sizes that the network takes


@dataclass(frozen=True)
class NormalFeatures:
    """Planes of a picture."""

    by_image: Image
    """(T, BY_IMAGE, H, W)."""
    shared: Image
    """(SHARED, H, W)."""


def normal_features(
    images: Image, mask: NDArray[np.bool_], suns: NDArray[np.floating], search: SearchResult, noise: float
) -> NormalFeatures:
    """Make the planes that the network sees; 0 outside the mask.

    Args:
        images: (P, T, C) brightnesses of the mask's pixels.
        mask: (H, W).
        suns: (T, 3) unit vectors in the camera frame.
        search: what the search says of the pixels.
        noise: standard deviation of the brightnesses, in their unit.
    """
    brightness = images.mean(axis=2)
    size = np.sqrt(np.mean(brightness**2, axis=1)) + np.float32(1e-9)
    by_image = np.zeros((images.shape[1], BY_IMAGE, *mask.shape), dtype=np.float32)
    by_image[:, 0, mask] = (brightness / size[:, None]).T
    by_image[:, 1, mask] = np.tanh(search.difference / (_LARGE_DIFFERENCE * size[:, None])).T
    by_image[:, 2, mask] = suns.astype(np.float32) @ search.normal.T
    by_image[:, 3:][..., mask] = suns[:, :, None]
    shared = np.zeros((SHARED, *mask.shape), dtype=np.float32)
    residual, odds, spread = np.log1p(search.residual / noise), np.tanh(search.log_odds / 4), search.error_rms / 30
    brightness = np.clip(np.log(size / np.median(size)), -3, 3)
    numbers = (residual, odds, spread, brightness, np.clip(np.log(noise / size), -8, 0) / 4, np.ones_like(size))
    vectors = (search.normal.T, search.mean.T, search.other.T)
    shared[:, mask] = np.concatenate([*vectors, np.stack(numbers)])
    return NormalFeatures(by_image, shared)


class Network:
    """A loaded network."""

    def __init__(self, session: OnnxSession) -> None:
        self.session = session

    @classmethod
    def load(cls, path: Path | None = None, threads: int = 0) -> "Network":
        """Load a network.

        Args:
            path: an ONNX file; None is the one in this package.
            threads: of onnxruntime; 0 lets it choose.

        Raises:
            ModelError: the file is not a network of normals of this version.
        """
        file = packaged_network(DATA_FOLDER, "normals") if path is None else path
        session = create_session(file, threads)
        if {port.name: port.shape[-3] for port in session.get_inputs()} != {"by_image": BY_IMAGE, "shared": SHARED}:
            raise ModelError(f"{file} is not a network of normals of this version.")
        return cls(session)

    def predict(self, features: NormalFeatures) -> tuple[Image, Image]:
        """Predict normals (H, W, 3) and expected errors (H, W) [deg], tile by tile.

        Args:
            features: of one day.

        Raises:
            ModelError: the network fails.
        """
        height, width = features.shared.shape[1:]
        normal, error = np.zeros((height, width, 3), np.float32), np.zeros((height, width), np.float32)
        for top, left in product(range(0, height, _TILE), range(0, width, _TILE)):
            tile = slice(top, min(top + _TILE, height)), slice(left, min(left + _TILE, width))
            if features.shared[-1][tile].any():
                normal[tile], error[tile] = self._tile(features, tile)
        return normal, error

    def _tile(self, features: NormalFeatures, tile: tuple[slice, slice]) -> tuple[Image, Image]:
        starts, ends = [max(0, part.start - _MARGIN) for part in tile], [part.stop + _MARGIN for part in tile]
        rows, columns = map(slice, starts, ends)
        by_image, shared = (_pad_planes(every[..., rows, columns]) for every in (features.by_image, features.shared))
        try:
            normal, error = self.session.run(("normal", "error"), {"by_image": by_image[None], "shared": shared[None]})
        except Exception as failure:  # onnxruntime's errors share no public base class
            raise ModelError(f"The network of normals failed: {failure}.") from failure
        core = tuple(slice(part.start - start, part.stop - start) for part, start in zip(tile, starts, strict=True))
        return np.moveaxis(normal[0], 0, -1)[core], np.degrees(error[0, 0])[core]


def _pad_planes(planes: Image) -> Image:
    """Planes (..., H, W) with zeros below and to the right up to sizes that the network takes."""
    missing = [-side % _SIZE_MULTIPLE for side in planes.shape[-2:]]
    return np.pad(planes, [(0, 0)] * (planes.ndim - 2) + [(0, more) for more in missing])

"""Features of a photo by SIFT [1], and those that match between two photos.

OpenCV is in the extra `all`; without it every function here that needs it raises MissingExtraError.

References:
    [1] Lowe, "Distinctive image features from scale-invariant keypoints", IJCV 2004.
    [2] Arandjelovic and Zisserman, "Three things everyone should know to improve object retrieval", CVPR 2012.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import lighting.geometry as geometry
from lighting.errors import require_extra
from lighting.geometry import Floats

MATCH_SIDE = 1024  # pixels of the longer side in which features are sought
_MAX_FEATURES = 3000  # kept of a photo, the strongest
_EQUALIZATION_LIMIT = 3.0  # limit of the local equalisation before features are sought
_MIN_CONTRAST = 0.005  # contrast of a feature, in SIFT's unit
_MAX_DISTANCE_RATIO = 0.8  # of the distances to the nearest and the next feature, below which a match counts


@dataclass(frozen=True, eq=False)
class Features:
    """A photo's features: their points and what they look like."""

    points: Floats
    """(N, 2) from the photo's center, x right, y up, in units of half its diagonal."""
    descriptors: NDArray[np.float32]
    """(N, 128) of length 1; roots of SIFT's values [2]."""
    width: int
    """Pixels of the picture in which they were sought."""
    height: int
    """Rows of the picture, pixels."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.width, self.height

    @property
    def pixel(self) -> float:
        """One pixel in units of half the diagonal."""
        return 2.0 / float(np.hypot(self.width, self.height))


@dataclass(frozen=True, eq=False)
class Matches:
    """Pairs of points that look alike, the surest first."""

    a: Floats
    """(M, 2) in the first photo, as Features.points."""
    b: Floats
    """(M, 2) in the second."""
    pixel: float
    """The coarser photo's pixel in units of half its diagonal."""

    def __len__(self) -> int:
        return len(self.a)


def import_opencv() -> Any:
    """The module cv2; MissingExtraError where it is not installed."""
    return require_extra("cv2", "Turns between photos need OpenCV", "all")


def has_opencv() -> bool:
    """Whether OpenCV is installed, without importing it."""
    from importlib.util import find_spec

    return find_spec("cv2") is not None


def detect_features(
    pixels: NDArray[np.uint8], max_side: int = MATCH_SIDE, max_features: int = _MAX_FEATURES
) -> Features:
    """The features of a photo.

    Args:
        pixels: (H, W, 3) sRGB or (H, W) gray, upright.
        max_side: pixels of the longer side in which they are sought.
        max_features: kept, the strongest.
    """
    cv2 = import_opencv()
    gray = resize_to(pixels if pixels.ndim == 2 else cv2.cvtColor(pixels, cv2.COLOR_RGB2GRAY), max_side)
    height, width = gray.shape
    even = cv2.createCLAHE(_EQUALIZATION_LIMIT, (8, 8)).apply(gray)  # shade has features too
    keypoints, descriptors = cv2.SIFT_create(max_features, contrastThreshold=_MIN_CONTRAST).detectAndCompute(even, None)
    if descriptors is None:
        return Features(np.empty((0, 2)), np.empty((0, 128), np.float32), width, height)
    corner = np.array([k.pt for k in keypoints], dtype=np.float64)
    total = np.maximum(descriptors.sum(axis=1, keepdims=True), 1e-12)
    roots = np.asarray(np.sqrt(descriptors / total), dtype=np.float32)
    return Features(to_centered(corner, width, height), roots, width, height)


def resize_to(gray: NDArray[np.uint8], max_side: int) -> NDArray[np.uint8]:
    """A gray picture, made smaller if its longer side has more than `max_side` pixels.

    Args:
        gray: (H, W) pixels.
        max_side: pixels of the longer side.
    """
    cv2 = import_opencv()
    height, width = gray.shape
    size = geometry.shrink_size(width, height, max_side)
    if size == (width, height):
        return np.ascontiguousarray(gray)
    return np.asarray(cv2.resize(gray, size, interpolation=cv2.INTER_AREA))


def to_centered(corner: Floats, width: int, height: int) -> Floats:
    """Points (N, 2) as Features has them.

    Args:
        corner: (N, 2) pixels of OpenCV, whose first has its center at (0, 0).
        width: pixels.
        height: pixels.
    """
    offset = corner + 0.5 - np.array([0.5 * width, 0.5 * height])
    return np.asarray(offset * np.array([1.0, -1.0]) * (2.0 / np.hypot(width, height)))


def match_features(a: Features, b: Features) -> Matches:
    """The features that are each other's nearest, clearly nearer than the next.

    Args:
        a: of the first photo.
        b: of the second.
    """
    pixel = max(a.pixel, b.pixel)
    if min(len(a.points), len(b.points)) < 2:
        return Matches(np.empty((0, 2)), np.empty((0, 2)), pixel)
    likeness = a.descriptors @ b.descriptors.T
    forward, backward = np.argmax(likeness, axis=1), np.argmax(likeness, axis=0)
    distance = np.sqrt(np.maximum(2.0 - 2.0 * np.partition(likeness, -2, axis=1)[:, -2:], 0.0))
    quality = distance[:, 1] / np.maximum(distance[:, 0], 1e-9)
    index = np.arange(len(a.points))
    kept = index[(backward[forward] == index) & (quality < _MAX_DISTANCE_RATIO)]
    kept = kept[np.argsort(quality[kept], kind="stable")]
    first, second = a.points[kept], b.points[forward[kept]]
    _, distinct = np.unique(np.round(np.hstack([first, second]) / pixel), axis=0, return_index=True)
    distinct.sort()  # SIFT gives one point several orientations; they are one witness
    return Matches(first[distinct], second[distinct], pixel)

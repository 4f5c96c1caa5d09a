"""An outside peer: `suncompass` 0.0.1 from PyPI (MIT, Hugo Hadfield), a ResNet-18 that estimates the sun's azimuth.

Pictures get the package's own preparation: the middle 300 x 300 pixels, shrunk to 224. They arrive here with 300 pixels
along the shorter side, so that this window covers as much of them as possible.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from export.crops import take
from export.evaluation.views import View
from lighting.colour import tone_map
from lighting.geometry import Floats, direction
from lighting.photo import Photo, fit_size
from lighting.records import ModelSpec

Peer = Callable[[Iterable[NDArray[np.float32]]], Floats]  # windows (3, 224, 224) to forward and left (N, 2)

PACKAGE, VERSION = "suncompass", "0.0.1"
NAME = f"{PACKAGE} {VERSION} (azimuth only)"
NOTE = (
    f"{PACKAGE} gives no elevation: its suns get the median elevation of the training suns, like those of the random "
    "azimuth."
)
WINDOW = 300  # pixels, the square that the package cuts out of the middle of a picture
INPUT = 224  # pixels, its size for the network


def load() -> Peer:
    """The peer with the installed package's weights; ModelError if they are not installed."""
    from export.evaluation.suncompass_network import load_peer

    return load_peer(PACKAGE, VERSION)


def suns(peer: Peer, pictures: Iterable[NDArray[np.uint8]], elevation: float) -> Floats:
    """Sun directions (N, 3) in pictures (h, w, 3) of at least 300 pixels each way, all at one elevation [deg]."""
    return direction(azimuth(peer(map(window, pictures))), elevation)


def azimuth(parts: Floats) -> Floats:
    """Azimuth [deg] (N,), positive to the right, of forward and left (N, 2)."""
    return np.asarray(np.degrees(np.arctan2(-parts[:, 1], parts[:, 0])))


def window(picture: NDArray[np.uint8]) -> NDArray[np.float32]:
    """The middle of a picture as (3, 224, 224) in [0, 1]."""
    height, width = picture.shape[:2]
    left, top = round((width - WINDOW) / 2), round((height - WINDOW) / 2)
    middle = Image.fromarray(picture).crop((left, top, left + WINDOW, top + WINDOW))
    small = middle.resize((INPUT, INPUT), Image.Resampling.BILINEAR)
    return np.asarray(small, dtype=np.float32).transpose(2, 0, 1) / np.float32(255)


def crop_pictures(views: Sequence[View]) -> Iterator[NDArray[np.uint8]]:
    """The pictures that cameras take, sized for `window`."""
    return (tone_map(take(source, camera, canvas(camera.aspect)).linear) for source, camera in views)


def photo_picture(photo: Photo) -> NDArray[np.uint8]:
    """A photo, sized for `window`."""
    size = fit_size(photo.width, photo.height, canvas(photo.width / photo.height))
    return np.asarray(Image.fromarray(photo.pixels).resize(size, Image.Resampling.BICUBIC, reducing_gap=3.0))


def canvas(aspect: float) -> ModelSpec:
    """A canvas that pictures of this aspect ratio fill with 300 pixels along their shorter side."""
    width, height = round(WINDOW * max(aspect, 1.0)), round(WINDOW * max(1 / aspect, 1.0))
    return ModelSpec(PACKAGE, VERSION, width, height, mean=(0, 0, 0), std=(1, 1, 1), sun_grid="")

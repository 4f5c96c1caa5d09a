"""What each part of a photo shows: ground, water, plants, buildings, vehicles, people, sky; by a small network.

The network is an ONNX file of its own beside the one that estimates the light. It takes the photo stretched to
INPUT_SIZE, and its cells are CELL_PIXELS of that wide: 24 x 18 for a landscape photo, 18 x 24 for an upright one.
"""

from enum import IntEnum
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.color import check_pixels
from lighting.errors import ModelError
from lighting.onnx_session import create_session, describe_onnx_error, packaged_network

Segments = NDArray[np.float32]  # (R, C, classes) probabilities of SurfaceClass in the cells of a photo, rows from above

INPUT_SIZE = (384, 288)  # pixels of the input's longer and shorter side
CELL_PIXELS = 16  # of the input, each way
_NAME = "segments"  # of the network's file


class SurfaceClass(IntEnum):
    """What a cell shows, in the order of the network's output."""

    GROUND = 0  # firm and level, and so near that cells are places
    UNEVEN = 1  # slope, steps, boulders, tall grass
    WATER = 2
    PLANTS = 3
    BUILDING = 4  # or wall, fence, bridge
    VEHICLE = 5
    PERSON = 6  # or animal
    OBJECT = 7
    FAR_TERRAIN = 8
    SKY = 9


THINGS = (  # that stand on the ground, in front of what is behind them
    SurfaceClass.PLANTS,
    SurfaceClass.BUILDING,
    SurfaceClass.VEHICLE,
    SurfaceClass.PERSON,
    SurfaceClass.OBJECT,
    SurfaceClass.SKY,
)


class Segmenter:
    """A loaded network; one may be shared by several threads."""

    def __init__(self, file: Path) -> None:
        """Read the network in a file.

        Args:
            file: the ONNX file.

        Raises:
            ModelError: the file is missing, damaged, or of another layout.
        """
        # A run takes 8 ms: more threads would wait for each other, and an arena of 14 MB saves half a millisecond.
        self._session = create_session(file, threads=1, arena=False)
        shape = [port.shape[-1] for port in self._session.get_outputs()]
        if [port.name for port in self._session.get_inputs()] != ["photo"] or shape != [len(SurfaceClass)]:
            raise ModelError(f"{file} is no network that says what photos show.")

    def __call__(self, photo: NDArray[np.uint8]) -> Segments:
        """Return the probabilities of what each cell of a photo shows.

        Args:
            photo: (h, w, 3) sRGB, upright.

        Raises:
            PhotoError: for what is no photo's pixels.
            ModelError: the network fails.
        """
        pixels = check_pixels(photo)
        size = INPUT_SIZE if pixels.shape[1] >= pixels.shape[0] else INPUT_SIZE[::-1]
        stretched = Image.fromarray(pixels).resize(size, Image.Resampling.BOX, reducing_gap=2.0)
        return self._run(np.asarray(stretched)[None])

    def _run(self, batch: NDArray[np.uint8]) -> Segments:
        try:
            outputs: list[NDArray[np.float32]] = self._session.run(None, {"photo": batch})
        except Exception as error:  # onnxruntime's errors share no public base class
            raise ModelError(f"The network failed: {describe_onnx_error(error)}") from error
        segments: Segments = outputs[0][0]
        return segments


@lru_cache(maxsize=1)
def packaged_segmenter() -> Segmenter:
    """Return the network in this package, loaded once in a process.

    Raises:
        ModelError: there is not exactly one.
    """
    return Segmenter(packaged_network(Path(__file__).parent / "data", _NAME))


def class_share(segments: Segments, *classes: SurfaceClass) -> NDArray[np.float32]:
    """Return the probability (R, C) that cells show one of some classes.

    Args:
        segments: of a photo.
        classes: one or more.
    """
    return np.asarray(segments[..., list(classes)].sum(axis=-1))


def pixel_share(segments: Segments, width: int, height: int, *classes: SurfaceClass) -> NDArray[np.float32]:
    """Return `class_share` for the pixels (h, w) of a picture, linear between the cells' middles.

    Args:
        segments: of the whole picture.
        width: of the picture, pixels.
        height: of the picture, pixels.
        classes: one or more.
    """
    cells = Image.fromarray(class_share(segments, *classes))
    return np.asarray(cells.resize((width, height), Image.Resampling.BILINEAR))

"""A picture that PyAV decoded as it is to be shown: upright, its pixels square, as sRGB.

Rotation and mirror flags make it upright, non-square pixels are stretched, 10-bit HLG and PQ are read by their curves.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.sizes import shrunk
from lighting.video.transfer import CURVES, to_srgb

_AREA, _FULL_CHROMA = 0x20, 0x2000  # flags of libswscale
_HOW = {  # by the form that is asked for
    "rgb24": _AREA | _FULL_CHROMA,  # else what is reduced is 2 levels too dark
    "rgb48le": _AREA,  # exact; with both flags, 4:2:0 that keeps its width turns blue
}
_HD = 720  # rows from which a picture that names no colour matrix is taken for one of BT.709


def shown_size(picture: Any, stretch: float) -> tuple[int, int]:
    """Width and height of a decoded picture as it is to be shown: pixels made square, turned upright."""
    width, height = max(1, round(picture.width * stretch)), picture.height
    return (height, width) if _lies(_placing(picture)) else (width, height)


def upright(picture: Any, side: int, stretch: float = 1.0) -> NDArray[np.uint8]:
    """sRGB (h, w, 3) of a decoded picture, its longer side at most `side` pixels."""
    width, height = max(1, round(picture.width * stretch)), picture.height
    curve = CURVES.get(int(picture.color_trc))
    pixels = _resized(picture, *shrunk(width, height, side), "rgb24" if curve is None else "rgb48le")
    pixels = pixels if curve is None else to_srgb(pixels, curve, int(picture.color_primaries))
    return _placed(pixels, _placing(picture))


def _placing(picture: Any) -> NDArray[np.int32]:
    """The container's matrix (2, 2) by which to show the picture: its rows are where right and down go, as (x, y)."""
    said = picture.side_data.get("DISPLAYMATRIX")
    if said is None:
        return np.eye(2, dtype=np.int32)
    return np.frombuffer(bytes(said), np.int32).reshape(3, 3)[:2, :2]


def _lies(placing: NDArray[np.int32]) -> bool:
    """Whether the picture's rows are to be shown as columns."""
    return bool(np.abs(placing[0, 1]) > np.abs(placing[0, 0]))


def _placed(pixels: NDArray[np.uint8], placing: NDArray[np.int32]) -> NDArray[np.uint8]:
    """Pixels (h, w, 3) turned by whole quarters, and mirrored, as a matrix of `_placing` says."""
    lies = _lies(placing)
    (right, down) = (placing[1, 0], placing[0, 1]) if lies else (placing[0, 0], placing[1, 1])
    shown = pixels.transpose(1, 0, 2) if lies else pixels
    return np.ascontiguousarray(shown[:: -1 if down < 0 else 1, :: -1 if right < 0 else 1])


def _resized(picture: Any, width: int, height: int, form: str) -> NDArray[Any]:
    matrix = int(picture.colorspace)
    named = matrix if matrix in (1, 4, 5, 6, 7, 9) else 1 if picture.height >= _HD else 5
    small = picture.reformat(
        width=width, height=height, format=form, src_colorspace=named, dst_colorspace=named, interpolation=_HOW[form]
    )
    return np.asarray(small.to_ndarray())

"""A panorama of the library of detail in a map, and what is coarse in it, which comes from the network instead."""

import io
from copy import copy
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pictures
from PIL import ImageEnhance, WebPImagePlugin

from lighting.color import SRGB_LINEAR
from lighting.envmap.detail_library import DETAIL_ROWS, LOG_OFFSET, DetailChoice, load_detail_library
from lighting.envmap.latlong import Image, blur_cells, column_blocks, shrink_envmap

_COARSE_DEG = 30.0  # standard deviation: what is coarser comes from the network


@dataclass(frozen=True, eq=False)
class _DetailPicture:
    """A panorama of the library, as wide as a map but not as high, before it is rotated."""

    picture: Pictures.Image
    """sRGB, of as many columns as the map."""
    height: int
    """Rows of the map, H."""
    rotation: int
    """Columns of the map by which it is rotated to the right, 0 to 2H."""

    def columns(self, columns: slice, rows: slice | None = None) -> NDArray[np.uint8]:
        """Some columns (R, C, 3) of the map.

        Args:
            columns: of the map.
            rows: of the map; None: all.
        """
        rows = slice(0, self.height) if rows is None else rows
        start, stop, width = columns.start - self.rotation, columns.stop - self.rotation, 2 * self.height
        if start < 0 < stop:
            return np.concatenate([self._part(start + width, width, rows), self._part(0, stop, rows)], axis=1)
        return self._part(start + width, stop + width, rows) if start < 0 else self._part(start, stop, rows)

    def _part(self, start: int, stop: int, rows: slice) -> NDArray[np.uint8]:
        """Some columns (R, C, 3), counted before it is rotated, of some rows of the map."""
        count = self.picture.height
        part = self.picture.crop((start, 0, stop, count))
        top, bottom = (row * count / self.height for row in (rows.start, rows.stop))
        size = part.width, rows.stop - rows.start
        return np.asarray(part.resize(size, _kernel(count, self.height), (0, top, part.width, bottom)))


def detail_picture(choice: DetailChoice, height: int) -> _DetailPicture:
    """The chosen panorama.

    Args:
        choice: of the library.
        height: rows of the map.
    """
    data = io.BytesIO(load_detail_library().read_picture(choice.index))
    with WebPImagePlugin.WebPImageFile(data) as file:  # Image.open would load the plugins of all formats
        picture = file.convert("RGB")
    if choice.saturation < 1:
        picture = ImageEnhance.Color(picture).enhance(choice.saturation)
    if choice.flipped:
        picture = picture.transpose(Pictures.Transpose.FLIP_LEFT_RIGHT)
    wide = picture.resize((2 * height, picture.height), _kernel(picture.height, height))
    return _DetailPicture(wide, height, round(choice.yaw / 360.0 * 2 * height) % (2 * height))


def _kernel(rows: int, height: int) -> Pictures.Resampling:
    """By what a picture of so many rows gets the height of a map."""
    return Pictures.Resampling.BICUBIC if height > rows else Pictures.Resampling.BOX


class LibraryDetail:
    """A panorama of the library over what is coarse in it."""

    def __init__(self, choice: DetailChoice, height: int) -> None:
        self.height, blocks = height, column_blocks(height)
        self._choice, self._picture = choice, detail_picture(choice, height)
        self._kept = self._picture.columns(blocks[0]) if len(blocks) == 1 else None
        reduced = np.concatenate([_reduce(self.pixels(part, 0, height), height, part) for part in blocks], axis=1)
        coarse = _coarse_colors(reduced)
        self.gains = np.exp(-coarse)
        """(R, 2R, 3) factors that take what is coarse out of it."""
        self.color = np.exp(coarse - coarse.mean(axis=2, keepdims=True))
        """(R, 2R, 3) of what is coarse in it, of mean logarithm 0."""

    def taller(self, height: int) -> Self:
        """Return the same of a map of more rows.

        Args:
            height: rows.
        """
        taller = copy(self)
        taller.height, taller._picture, taller._kept = height, detail_picture(self._choice, height), None
        return taller

    def pixels(self, columns: slice, first: int, count: int) -> NDArray[np.uint8]:
        """Some columns (R, C, 3) of the panorama, sRGB.

        Args:
            columns: of a map of as many rows.
            first: of its rows.
            count: of them, R.
        """
        rows = slice(first, first + count)
        return self._picture.columns(columns, rows) if self._kept is None else self._kept[rows, columns]


def _coarse_colors(picture: NDArray[np.uint8]) -> Image:
    """What is coarse in a picture (H, 2H, 3): logarithms (R, 2R, 3), as bright as its mean logarithm.

    Their color is that of the mean light. So what is bright in the picture, as the sky between leaves, gets the color
    of the map, and what is dark keeps its own.
    """
    brightness = blur_cells(shrink_envmap(np.log(SRGB_LINEAR + LOG_OFFSET).take(picture), DETAIL_ROWS), _COARSE_DEG)
    linear = shrink_envmap(SRGB_LINEAR.take(picture), DETAIL_ROWS)
    color = np.log(blur_cells(linear, _COARSE_DEG) + LOG_OFFSET)
    color += brightness.mean(axis=2, keepdims=True) - color.mean(axis=2, keepdims=True)
    return np.asarray(color, dtype=np.float32)


def _reduce(pixels: NDArray[np.uint8], height: int, columns: slice) -> NDArray[np.uint8]:
    """Some columns (H, C, 3) of a picture (H, 2H, 3) at a quarter of its pixels or so, for its cells."""
    step = max(1, height // (4 * DETAIL_ROWS))
    rest = (height // step) * step
    first = columns.start + (step // 2 - columns.start) % step  # of the columns that count
    last = min(columns.stop, 2 * rest)
    return pixels[step // 2 : rest : step, first - columns.start : max(last - columns.start, 0) : step].copy()

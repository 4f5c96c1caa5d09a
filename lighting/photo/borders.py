"""Borders about a photo: bars, frames, screenshots, blurred copies, stereo pairs; and collages.

A border is a plain background, or one of rows (or columns) that a program has drawn: a blurred copy of the photo, or a
gradient. On a plain background the pictures are found by recursive XY cuts [1]: rows and columns of background part
the blocks, among them texts and buttons. A block is a picture where straight edges part it from the background.

A sky of one color ends at no straight edge, or at one that is not as straight as a picture's; so it is kept.

References:
    [1] Nagy and Seth, Hierarchical Representation of Optically Scanned Documents, ICPR 1984.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.geometry import Floats, shrink_size
from lighting.photo.picture_checks import has_seams, median_of_rows, stereo_half, true_share

_Bytes = NDArray[np.uint8]
_Mask = NDArray[np.bool_]

_Kind = TypeVar("_Kind", bound=np.generic)
_SIDE = 512  # pixels along the longer side of the picture that is searched
_MIN_SIDE = 64  # pixels of the shorter side, under which an edge is too short to tell
_TOLERANCE = 14  # gray levels in any channel by which a background's pixels differ, noise of JPEG included
_STEP = 24  # gray levels that part a picture from its background
_GAP_SHARE = 0.97  # of a row's pixels that are background where nothing is drawn
_EDGE_SHARE = 0.5  # of a picture's outermost pixels that differ from the background
_FRAME_SHARE = 0.7  # of the same, on all sides, where no side of the whole is background
_REACH = 2  # pixels within which an edge lies, blurred by the reduction and by JPEG
_FAR = 7  # pixels from an edge, where a horizon differs yet more from the sky
_STEEPNESS = 0.78  # of the difference so far, that an edge makes within its reach
_MAX_BORDERS = 4  # one inside another
_MAX_FADE = 2.5  # widths of a frame beside, up to which a side that fades into it belongs to it
_MIN_DRAWN, _MIN_TEXT_GAP = 12, 4  # pixels of a text, and between it and a picture
_MAX_DEPTH = 6  # of cuts within cuts
_SIDES = 4
_MIN_AREA = 0.04  # of the whole, of a picture
_MIN_BORDER = 0.006  # of a side, under which nothing is cut off
_SMOOTH_BEND = 4  # gray levels, second difference of neighbors up to which a blurred copy or a gradient is smooth
_SMOOTH_JUMP = 6  # gray levels, of its end
_EDGE_SHARE_BELOW_TEXT = 0.8  # of a row's pixels that change where a photo begins below a text on a smooth bar
_GRADIENT_FITS, _GRADIENT_SHARE = 3, 0.95  # to bars, and of their pixels that lie on the gradient
_MAX_TEXT_SHARE = 0.08  # of the height, of a line of text on a smooth bar
_SMOOTH_SHARE = 0.95  # of a row's pixels that do
_COPY_SIDE = 48  # pixels, at which a blurred copy is compared
_COPY_CORRELATION = 0.5
_MAX_GAIN_RATIO = 1.6  # of one bar's brightness by that of the copy to another's
_SHADE = 4  # gray levels
_MIN_SHADES, _MIN_SHADE_SHARE = 6, 0.005  # of a photo's pixels in each of them
_COLLAGE_RATIO = 6.0  # of areas, up to which the largest and the second picture are equals


@dataclass(frozen=True, eq=False, repr=False)
class Rectangle:
    """A part of a picture, in shares of its width and height."""

    left: float
    """Of the left edge, 0 to 1 of the picture's width."""
    top: float
    """Of the upper edge, 0 to 1 of the picture's height."""
    right: float
    """Of the right edge, 0 to 1 of the picture's width."""
    bottom: float
    """Of the lower edge, 0 to 1 of the picture's height."""

    def pixels(self, width: int, height: int) -> tuple[int, int, int, int]:
        """Left, top, right and bottom in whole pixels, within the part.

        Args:
            width: of the picture, pixels.
            height: of the picture, pixels.
        """
        left, top = math.ceil(self.left * width - 1e-6), math.ceil(self.top * height - 1e-6)
        return left, top, math.floor(self.right * width + 1e-6), math.floor(self.bottom * height + 1e-6)


@dataclass(frozen=True, eq=False, repr=False)
class Layout:
    """How a picture is made up."""

    photo: Rectangle | None = None
    """Of several like it, or inside a border; None: the whole picture."""
    is_collage: bool = False
    """Whether the picture shows several photos."""
    is_stereo_pair: bool = False
    """Whether the picture shows one view for each eye."""


class _Box(NamedTuple):
    """A part of the searched picture, in pixels."""

    left: int
    top: int
    right: int
    bottom: int

    @property
    def area(self) -> int:
        return (self.right - self.left) * (self.bottom - self.top)

    def margins(self, whole: "_Box") -> list[int]:
        """Pixels from the sides of a whole: at the left, top, right and bottom."""
        return [abs(side - end) for side, end in zip(self, whole, strict=True)]

    def part(self, left: int, top: int, right: int, bottom: int) -> "_Box":
        """A part of this part, by its place in it."""
        return _Box(self.left + left, self.top + top, self.left + right, self.top + bottom)

    def of(self, values: NDArray[_Kind]) -> NDArray[_Kind]:
        """The part's values."""
        return values[self.top : self.bottom, self.left : self.right]


def find_layout(pixels: _Bytes) -> Layout:
    """Find the photo inside a border, and whether a picture is a collage; thumbnails are not searched.

    Args:
        pixels: (h, w, 3) sRGB.
    """
    image = Image.fromarray(pixels)
    size = shrink_size(*image.size, _SIDE)
    if min(size) < _MIN_SIDE:
        return Layout()
    reduced = image.resize(size, Image.Resampling.BOX)
    small, gray = (np.asarray(one).astype(np.int16) for one in (reduced, reduced.convert("L")))
    whole = _Box(0, 0, *size)
    half = _stereo_half(gray, whole)
    box = half or whole
    for _ in range(_MAX_BORDERS):
        pictures = _pictures_on_background(small, box)
        if not pictures or (len(pictures) == 1 and pictures[0].margins(box).count(0) == 3):  # a smooth bar may be plain
            pictures = _picture_among_smooth_bars(small, gray, box) or pictures
        if len(pictures) > 1:
            return Layout(is_collage=True)
        if not pictures:
            break
        box = pictures[0]
    if half is None and box != whole and (half := _stereo_half(gray, box)) is not None:
        box = half
    elif _has_shades(small, box) and has_seams(box.of(gray)):
        return Layout(is_collage=True)
    if box == whole:
        return Layout()
    (width, height), inset = size, int(size != image.size)  # a line that the reduction mixed of border and photo
    left, top = (edge + inset * (edge > 0) for edge in (box.left, box.top))
    right, bottom = box.right - inset * (box.right < width), box.bottom - inset * (box.bottom < height)
    photo = Rectangle(left / width, top / height, right / width, bottom / height)
    return Layout(photo, is_stereo_pair=half is not None)


def _stereo_half(gray: NDArray[np.int16], box: _Box) -> _Box | None:
    """The half that counts of a stereo pair; None of others."""
    half = stereo_half(box.of(gray))
    return None if half is None else box.part(0, 0, half[1], half[0])


# Pictures on a plain background.


def _pictures_on_background(pixels: NDArray[np.int16], box: _Box) -> list[_Box]:
    """The pictures inside a box, by the first background that shows any; none where it has no border and no gaps."""
    for color, is_border in _background_colors(pixels, box):
        red, green, blue = (np.abs(pixels[..., channel] - color[channel]) for channel in range(3))
        difference = np.maximum(np.maximum(red, green), blue)
        background = difference <= _TOLERANCE
        blocks = [_refine(background, block) for block in _cut(background, box, 0)]
        large = [block for block in blocks if block.area >= _MIN_AREA * box.area]
        pictures = [found for block in large if (found := _as_picture(difference, box, block)) is not None]
        pictures = [one for one in pictures if _has_shades(pixels, one)]
        if not pictures:
            continue
        pictures.sort(key=lambda one: -one.area)
        equals = [one for one in pictures if one.area * _COLLAGE_RATIO >= pictures[0].area]
        if len(equals) > 1:
            return equals
        is_free = is_border or _is_framed(difference, box, pictures[0])
        if is_free and _is_smaller(pictures[0], box):
            return pictures[:1]
    return []


def _is_framed(difference: NDArray[np.int16], box: _Box, picture: _Box) -> bool:
    """Whether a background that is no side's, as between the bars of a window, lies around a picture on all sides."""
    jumps = (_edge_jump(difference, box, picture, side) for side in range(4))
    return min(picture.margins(box)) > 1 and min(jumps) >= _FRAME_SHARE


def _has_shades(pixels: NDArray[np.int16], box: _Box) -> bool:
    """Whether a part has as many shades as any photo, not the few of a drawing or of a plain area."""
    levels = np.bincount(box.of(pixels)[::2, ::2, 1].ravel() // _SHADE, minlength=1)
    return int((levels >= _MIN_SHADE_SHARE * levels.sum()).sum()) >= _MIN_SHADES


def _is_smaller(inner: _Box, outer: _Box) -> bool:
    """Whether a border is wide enough to count."""
    left, top, right, bottom = inner.margins(outer)
    across, along = (_MIN_BORDER * (outer.right - outer.left), _MIN_BORDER * (outer.bottom - outer.top))
    return max(left, right) > max(across, 1.0) or max(top, bottom) > max(along, 1.0)


def _background_colors(pixels: NDArray[np.int16], box: _Box) -> Iterator[tuple[NDArray[np.int16], bool]]:
    """The different colors (3,) of a box's sides and of plain lines across it; whether it is that of a side."""
    part = box.of(pixels)
    across = part.swapaxes(0, 1)
    rows, columns = (
        _plain_colors(np.stack([one[0], one[-1], *_plain_lines(one)]).swapaxes(1, 2)) for one in (part, across)
    )
    colors: list[NDArray[np.int16]] = []
    for number, color in enumerate([*rows[:2], *columns[:2], *rows[2:], *columns[2:]]):
        if color is not None and all(np.abs(color - other).max() > _TOLERANCE // 2 for other in colors):
            colors.append(color)
            yield color, number < _SIDES


def _plain_colors(lines: NDArray[np.int16]) -> list[NDArray[np.int16] | None]:
    """The color (3,) of each line (N, 3, P) of pixels; None where it has several."""
    colors = median_of_rows(lines).astype(np.int16)
    is_plain = true_share(np.abs(lines - colors[..., None]).max(axis=1) <= _TOLERANCE, 1) >= _GAP_SHARE
    return [color if plain else None for color, plain in zip(colors, is_plain, strict=True)]


def _plain_lines(part: NDArray[np.int16]) -> Iterator[NDArray[np.int16]]:
    """The plainest rows in the first, the middle and the last third, where the gaps of a collage may lie."""
    green = part[:, ::4, 1]
    spread, start = green.max(axis=1) - green.min(axis=1), 0
    for third in np.array_split(spread, 3):
        if len(third):
            yield part[start + int(third.argmin())]
        start += len(third)


def _cut(background: _Mask, box: _Box, depth: int) -> list[_Box]:
    """The blocks inside a box that rows and columns of background part."""
    part = box.of(background)
    rows, columns = (_runs(true_share(part, axis) < _GAP_SHARE) for axis in (1, 0))
    boxes = [
        box.part(left, top, right, bottom)
        for top, bottom in rows
        for left, right in (columns if len(rows) == 1 else [(0, box.right - box.left)])
    ]
    if boxes == [box] or depth >= _MAX_DEPTH:
        return boxes
    return [leaf for one in boxes if one.area >= _MIN_AREA * part.size / 4 for leaf in _cut(background, one, depth + 1)]


def _runs(values: _Mask) -> list[tuple[int, int]]:
    """Beginnings and ends of the runs of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], values, [False]]).astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _refine(background: _Mask, box: _Box) -> _Box:
    """The block without the noise that JPEG leaves beside its edges."""
    part = box.of(background)
    (top, bottom), (left, right) = (_inner_run(true_share(part, axis)) for axis in (1, 0))
    return box.part(left, top, right, bottom)


def _inner_run(shares: Floats) -> tuple[int, int]:
    """The lines between the first and the last that are drawn on, if these lie near the ends."""
    end, reach = len(shares), max(4, len(shares) // 40)
    drawn = np.flatnonzero(shares < 1 - _EDGE_SHARE).tolist() or [0, end - 1]
    return drawn[0] if drawn[0] <= reach else 0, drawn[-1] + 1 if end - 1 - drawn[-1] <= reach else end


def _as_picture(difference: NDArray[np.int16], whole: _Box, block: _Box) -> _Box | None:
    """The block if straight edges part it from the background wherever it does not end with the whole; else None.

    One side may fade into the background, as a white sky does into white. A frame is as wide there as beside, a bar as
    wide as the opposite one, and opposite a foot with a text there is none.
    """
    margins = block.margins(whole)
    jumps = [_edge_jump(difference, whole, block, side) if margins[side] > 1 else 1.0 for side in range(4)]
    for side in range(2):
        if abs(margins[side] - margins[side + 2]) <= _REACH:  # equal bars confirm each other, about a dark picture too
            jumps[side] = jumps[side + 2] = 2 * min(jumps[side], jumps[side + 2])
    weak = [side for side in range(4) if jumps[side] < _EDGE_SHARE]
    if not weak:
        return block
    if len(weak) > 1 or not any(margins[side] > 1 for side in range(4) if side not in weak):
        return None
    side, beside = weak[0], sorted((margins[weak[0] - 1], margins[(weak[0] + 1) % 4]))
    opposite = margins[side - 2]
    if _is_drawn_on(difference, whole, side, margins[side]):
        pass  # texts or buttons: a screenshot, whose picture has no place of its own
    elif beside[0] > 1 and beside[1] <= 2 * beside[0] and opposite > 1 and margins[side] <= _MAX_FADE * beside[1]:
        margins[side] = min(margins[side], sum(beside) // 2)
    elif _is_drawn_on(difference, whole, (side + 2) % 4, opposite):
        margins[side] = 0
    else:
        margins[side] = min(margins[side], opposite)
    left, top, right, bottom = margins
    return _Box(whole.left + left, whole.top + top, whole.right - right, whole.bottom - bottom)


def _is_drawn_on(difference: NDArray[np.int16], whole: _Box, side: int, margin: int) -> bool:
    """Whether the strip between a block's side and the whole's holds texts or buttons, apart from the block."""
    differs = _turn(whole.of(difference), side)[: max(0, margin)] >= _STEP
    plain: _Mask = ~np.asarray(differs.any(axis=1))
    gaps = [end for begin, end in _runs(plain) if end - begin >= _MIN_TEXT_GAP]
    return bool(gaps) and int(differs[: max(gaps)].sum()) > _MIN_DRAWN


def _edge_jump(difference: NDArray[np.int16], whole: _Box, block: _Box, side: int) -> float:
    """By how much more of a line differs from the background just inside than just outside of a block's side.

    Sides are left, top, right and bottom. A horizon below a white sky is less straight than a picture's edge.
    """
    differs = _turn(difference, side) >= _STEP
    whole, block = (_turn_box(box, side, *difference.shape) for box in (whole, block))
    lines = true_share(differs[:, block.left : block.right], 1)
    outside, inside = lines[max(whole.top, block.top - _REACH)], lines[min(block.top + 1, len(lines) - 1)]
    far, deep = lines[max(whole.top, block.top - _FAR) : block.top - 1], lines[block.top + 1 : block.top + _FAR]
    steep = inside - outside >= _STEEPNESS * (deep.max(initial=inside) - far.min(initial=outside))
    return float(inside - outside) if steep else 0.0


def _turn(values: NDArray[np.int16], side: int) -> NDArray[np.int16]:
    """The values (h, w) with that side on top."""
    values = values.T if side % 2 == 0 else values
    return values[::-1] if side >= 2 else values


def _turn_box(box: _Box, side: int, height: int, width: int) -> _Box:
    box, height = (_Box(box.top, box.left, box.bottom, box.right), width) if side % 2 == 0 else (box, height)
    return _Box(box.left, height - box.bottom, box.right, height - box.top) if side >= 2 else box


# Bars that a program has drawn: blurred copies, gradients, shadows.


def _picture_among_smooth_bars(pixels: NDArray[np.int16], gray: NDArray[np.int16], box: _Box) -> list[_Box]:
    """The picture between smooth bars, at two opposite sides or at all; none without."""
    part = box.of(pixels)
    rows, columns = _smooth_bars(box.of(gray)), _smooth_bars(box.of(gray).T)
    if rows is None and columns is None:
        return []
    top, bottom = rows or (0, part.shape[0])
    left, right = columns or (0, part.shape[1])
    found = _Box(left, top, right, bottom)
    if found.area < _MIN_AREA * box.area or not _has_shades(part, found):
        return []
    both_ways = rows is not None and columns is not None
    is_framed = both_ways or _is_gradient(part, found) or _is_blurred_copy(part, found)
    return [box.part(*found)] if is_framed else []


def _smooth_bars(gray: NDArray[np.int16]) -> tuple[int, int] | None:
    """First and last row, exclusive, of what lies between smooth bars at top and bottom; None without both."""
    height = len(gray)
    if height < 8 * _REACH:
        return None
    top, bottom = _end_of_smooth_bar(gray), _end_of_smooth_bar(gray[::-1])
    return (top, height - bottom) if top and bottom and top + bottom < height else None


def _end_of_smooth_bar(gray: NDArray[np.int16]) -> int:
    """The row at which a straight edge ends a bar of smooth rows at the top; 0 without."""
    if not _are_smooth(gray[: 2 * _REACH + 2]).all():  # as of most photos
        return 0
    runs = _runs(~_are_smooth(gray))
    first, reach = runs[0][0] if runs else 0, max(3 * _REACH, len(gray) // 32)  # rows within which an edge lies
    for begin, end in runs:  # lines of text, until the photo begins
        rows = np.arange(max(2, begin + 1 - _REACH), min(begin + 1 + reach, len(gray) - 1))
        share = (np.abs(gray[rows + 1] - gray[rows - 2]) > _SMOOTH_JUMP).mean(axis=1)
        if share.max(initial=0.0) >= (_EDGE_SHARE if begin == first else _EDGE_SHARE_BELOW_TEXT):
            return int(rows[share.argmax()])
        if end - begin > _MAX_TEXT_SHARE * len(gray):
            return 0
    return 0


def _are_smooth(gray: NDArray[np.int16]) -> _Mask:
    """Whether each row, but the first and the last, bends little to any side."""
    bent = [true_share(np.abs(np.diff(gray, n=2, axis=axis)) <= _SMOOTH_BEND, 1) for axis in (0, 1)]
    return np.asarray(np.minimum(bent[0], bent[1][1:-1]) >= _SMOOTH_SHARE)


def _is_gradient(part: NDArray[np.int16], inner: _Box) -> bool:
    """Whether a quadratic function of the position gives the bars' colors."""
    height, width = part.shape[:2]
    y, x = (values.ravel() for values in np.mgrid[:height:4, :width:4])
    outside = (y < inner.top - 2) | (y > inner.bottom + 1) | (x < inner.left - 2) | (x > inner.right + 1)
    u, v = x[outside] / width, y[outside] / height
    if len(u) < 32:
        return False
    terms = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=1)
    colors = part[y[outside], x[outside]].astype(np.float64)
    fits = np.ones(len(colors), dtype=bool)
    for _ in range(_GRADIENT_FITS):  # texts on the bars are left out
        if np.count_nonzero(fits) < len(colors) // 2:
            return False
        fitted = terms @ np.linalg.lstsq(terms[fits], colors[fits], rcond=None)[0]
        fits = np.abs(fitted - colors).max(axis=1) <= _TOLERANCE // 2
    return bool(fits.mean() >= _GRADIENT_SHARE)


def _is_blurred_copy(part: NDArray[np.int16], inner: _Box) -> bool:
    """Whether the bars show the inner picture enlarged to fill the whole, alike darkened, as far as blur leaves it."""
    height, width = part.shape[:2]
    image = Image.fromarray(part.astype(np.uint8)).convert("L")
    scale = max(width / (inner.right - inner.left), height / (inner.bottom - inner.top))
    half_width, half_height = 0.5 * width / scale, 0.5 * height / scale
    x, y = 0.5 * (inner.left + inner.right), 0.5 * (inner.top + inner.bottom)
    source = (x - half_width, y - half_height, x + half_width, y + half_height)
    size = (_COPY_SIDE, _COPY_SIDE)
    actual = np.asarray(image.resize(size, Image.Resampling.BOX), dtype=np.float64)
    copied = np.asarray(image.resize(size, Image.Resampling.BOX, box=source), dtype=np.float64)
    rows, columns = np.mgrid[:_COPY_SIDE, :_COPY_SIDE]
    rows, columns = (rows + 0.5) / _COPY_SIDE * height, (columns + 0.5) / _COPY_SIDE * width
    margin = 0.5 * max(height, width) / _COPY_SIDE
    bars = [rows < inner.top - margin, rows > inner.bottom + margin]
    bars += [columns < inner.left - margin, columns > inner.right + margin]
    outside = np.logical_or.reduce(bars)
    a, b = actual[outside], copied[outside]
    if len(a) < 8 or min(a.std(), b.std()) < 1.0:
        return False
    gains = [(actual[bar].mean() + _STEP) / (copied[bar].mean() + _STEP) for bar in bars if bar.any()]
    if max(gains) > _MAX_GAIN_RATIO * min(gains):  # a sky and a band of another color below
        return False
    return float(np.corrcoef(a, b)[0, 1]) >= _COPY_CORRELATION

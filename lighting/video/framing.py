"""What stands still in a clip while its picture moves: borders, and lettering burnt into it.

Borders are those of photos (photo/borders.py), where most of some frames agree on them. Lettering is found as
watermarks are [1], by the gradients that stay where they are: nearly all frames have there what is their median. A
straight horizon stays, too, while the camera pans along it; so there must be gradients of every direction.

References:
    [1] Dekel, Rubinstein, Liu and Freeman, On the Effectiveness of Visible Watermarks, CVPR 2017.
"""

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.color import Curve, luminance
from lighting.errors import CodedWarning, WarningCode
from lighting.geometry import Floats, shrink_size
from lighting.photo.borders import Layout, Rectangle, find_layout
from lighting.photo.reader import MAX_ASPECT, MIN_SIDE, describe_layout
from lighting.registration.features import import_opencv

Pixels = NDArray[np.uint8]

SAMPLE_SIDE = 512  # pixels of the longer side of the frames that are compared
MIN_SAMPLE_LEVEL = 40  # gray levels that a frame reaches which is not black

_SOFT_LINES = 1  # of a compared frame along a border, which reduction and shared chroma mix of it and the picture
_SAME_EDGE = 0.02  # of a side, by which a border's edges may differ from frame to frame
_MIN_FRAMED_SHARE = 0.3  # of the frames that have a border, from which a changing one is told
_MIN_OVERLAY_SAMPLES = 4  # frames that differ, below which nothing is said to stand still
_MIN_CHANGE = 4.0  # gray levels, mean difference of frames that differ
_MIN_GRADIENT = 8.0  # gray levels from pixel to pixel that count as contrast
_MIN_LIKENESS = 0.5  # of the median gradient that a frame has of it, to count as alike
_MIN_ALIKE = 0.9  # of the frames that are alike, where a gradient stays
_MIN_CORNER = 0.15  # of the staying gradients' energy that lies across their main direction
_WINDOW = 9  # pixels, within which gradients have every direction
_FILLED_FROM = 3  # pixels about a covered one, of which it is filled
_STREAM_INTERVAL = 0.5  # s between the frames of a stream that are compared
_MAX_STREAM_SAMPLES = 6
_MARGIN = 3  # pixels about what stands still that are covered with it
_MIN_OVERLAY_SHARE = 0.008  # of the picture that lettering covers
_MAX_STILL_SHARE = 0.85  # of what has contrast, from which the camera stands still
_DOUBTFUL_SHARE = 0.5  # the same, from which too little is left of the world
_LOG_RANGES = (0.06, 0.78), (0.03, 0.66)  # blackest and whitest signals of logarithmic pictures
_MAX_CHROMA = 0.26  # of them; 1 of 752 photos is as flat and as pale
_CHANGING = "Some frames have a border, others none or another one: all were used whole."
_OVERLAY = "Lettering stands still in the picture and covers {:.0f} % of it: it was left out."
_UNCUT = CodedWarning("The frames have a border, which is taken for the world: cut it off first.", WarningCode.BORDER)
_FLAT = CodedWarning("The frames look logarithmic: undo their camera's curve first.", WarningCode.CURVE)
_MOSTLY_STILL = "Most of what stands out in the picture stands still while the rest moves: headings may be off."


@dataclass(frozen=True, eq=False)
class ClipForm:
    """How a clip's pictures become frames, and what of the upright picture is the world."""

    curve: Curve | None = None
    """By which they are coded; None: as each picture says."""
    crop: Rectangle | None = None
    """The picture inside a border; None: all of it."""
    overlay: NDArray[np.bool_] | None = None
    """(h, w) of the cropped picture, where lettering covers it; None: nowhere."""
    warnings: tuple[CodedWarning, ...] = ()
    """Sentences for people."""


def find_framing(samples: Sequence[Pixels], size: tuple[int, int], curve: Curve | None) -> ClipForm:
    """Find a clip's border and the lettering in it.

    Args:
        samples: (h, w, 3) sRGB each, frames of the clip, of one size.
        size: width and height of the clip's upright picture, pixels.
        curve: by which the clip is coded; None: as each picture says.
    """
    crop, warnings = _find_border(samples, size)
    if crop is not None:
        left, top, right, bottom = crop.pixels(samples[0].shape[1], samples[0].shape[0])
        samples = [sample[top:bottom, left:right] for sample in samples]
    overlay, doubts = _find_overlay(samples)
    return ClipForm(curve, crop, overlay, (*warnings, *doubts))


def _find_border(samples: Sequence[Pixels], size: tuple[int, int]) -> tuple[Rectangle | None, tuple[CodedWarning, ...]]:
    """The picture inside a border, where most frames agree on it, and what is to be said of it."""
    layouts = [find_layout(sample) for sample in samples]
    if 2 * sum(layout.is_collage for layout in layouts) > len(layouts):
        return None, tuple(describe_layout(Layout(is_collage=True), *size))
    framed = [layout for layout in layouts if layout.photo is not None]
    if not framed:
        return None, ()
    edges = np.array([astuple(layout.photo) for layout in framed if layout.photo is not None])
    agreeing = np.abs(edges - np.median(edges, axis=0)).max(axis=1) <= _SAME_EDGE
    if 2 * np.count_nonzero(agreeing) <= len(samples):
        often = len(framed) >= max(2.0, _MIN_FRAMED_SHARE * len(samples))
        return None, (CodedWarning(_CHANGING),) if often else ()
    start, end = edges[agreeing, :2].min(axis=0), edges[agreeing, 2:].max(axis=0)  # a dark frame may hide an edge
    line = _SOFT_LINES / np.array(samples[0].shape[1::-1])
    crop = Rectangle(*np.where(start > 0, start + line, 0.0).tolist(), *np.where(end < 1, end - line, 1.0).tolist())
    x, y, x_end, y_end = crop.pixels(*size)
    width, height = x_end - x, y_end - y
    if min(width, height) < MIN_SIDE or max(width, height) > MAX_ASPECT * min(width, height):
        return None, ()
    is_stereo_pair = 2 * sum(layout.is_stereo_pair for layout in framed) > len(framed)
    return crop, tuple(describe_layout(Layout(crop, is_stereo_pair=is_stereo_pair), width, height, "picture"))


def _find_overlay(samples: Sequence[Pixels]) -> tuple[NDArray[np.bool_] | None, tuple[CodedWarning, ...]]:
    """Where (h, w) lettering stands still before a world that moves, and what is to be said of it."""
    grays = _differing([luminance(sample).astype(np.float32) for sample in samples])
    if len(grays) < _MIN_OVERLAY_SAMPLES:
        return None, ()
    across, down = (np.stack([np.gradient(gray, axis=axis) for gray in grays]) for axis in (1, 0))
    middle = np.median(across, axis=0), np.median(down, axis=0)
    size = np.hypot(*middle)
    along, aside = middle[0] * across + middle[1] * down, middle[0] * down - middle[1] * across
    alike = (along >= _MIN_LIKENESS * size**2) & (_MIN_LIKENESS * along <= size**2)
    alike &= np.abs(aside) <= _MIN_LIKENESS * size**2
    staying = (size >= _MIN_GRADIENT) & (alike.mean(axis=0) >= _MIN_ALIKE)
    contrast = float(np.mean(np.hypot(across, down) >= _MIN_GRADIENT))
    share = float(np.mean(staying)) / max(contrast, 1e-6)
    if share >= _MAX_STILL_SHARE:
        return None, ()
    found = staying & _has_corners(*(np.where(staying, part, 0.0) for part in middle))
    square = np.ones((2 * _MARGIN + 1, 2 * _MARGIN + 1), np.uint8)
    covered = np.asarray(import_opencv().dilate(found.astype(np.uint8), square), dtype=bool)
    if (area := float(covered.mean())) < _MIN_OVERLAY_SHARE:
        return None, ()
    sentences = [_OVERLAY.format(100.0 * area)] + [_MOSTLY_STILL] * (share >= _DOUBTFUL_SHARE)
    return covered, tuple(CodedWarning(sentence, WarningCode.OVERLAY) for sentence in sentences)


def fill_overlay(pixels: Pixels, overlay: NDArray[np.bool_] | None) -> Pixels:
    """Fill what covers a frame from around.

    Args:
        pixels: (h, w, 3) sRGB.
        overlay: of any size, where it is covered; None: nowhere.
    """
    if overlay is None:
        return pixels
    cv2 = import_opencv()
    height, width = pixels.shape[:2]
    mask = cv2.resize(overlay.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST)
    return np.asarray(cv2.inpaint(pixels, mask, _FILLED_FROM, cv2.INPAINT_TELEA))


class StreamFraming:
    """What of a stream's frames is the world, found as they come; memory is constant."""

    warnings: tuple[CodedWarning, ...] = ()
    """Sentences about the frames so far."""

    def __init__(self) -> None:
        """Begin a stream."""
        self._samples: list[Pixels] = []
        self._overlay: NDArray[np.bool_] | None = None
        self._due = -math.inf

    def fill(self, pixels: Pixels, time: float) -> Pixels:
        """Return the next frame without the lettering that has stood still in a few that differ.

        Args:
            pixels: (h, w, 3) sRGB.
            time: s.
        """
        if time >= self._due:
            self._due = time + _STREAM_INTERVAL
            self._look(pixels)
        return fill_overlay(pixels, self._overlay)

    def _look(self, pixels: Pixels) -> None:
        """Compare a frame with earlier ones; none counts while the camera stands, nor a black one."""
        cv2 = import_opencv()
        height, width = pixels.shape[:2]
        size = shrink_size(width, height, SAMPLE_SIDE // 2)
        sample = np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA))
        kept = [s for s in self._samples if s.shape == sample.shape][1 - _MAX_STREAM_SAMPLES :]
        stands = bool(kept) and float(cv2.absdiff(kept[-1], sample).mean()) < _MIN_CHANGE
        if stands or sample.max() <= MIN_SAMPLE_LEVEL:
            return
        self._samples = [*kept, sample]
        crop, told = _find_border(self._samples, (width, height))
        self._overlay, doubts = _find_overlay(self._samples)
        flat = len(self._samples) >= _MIN_OVERLAY_SAMPLES and looks_logarithmic(self._samples)
        self.warnings = (*((_UNCUT,) if crop else told), *doubts, *((_FLAT,) if flat else ()))


def _differing(grays: Sequence[NDArray[np.float32]]) -> list[NDArray[np.float32]]:
    """The frames (h, w) that differ from those before them: while the camera stands, everything stays."""
    kept: list[NDArray[np.float32]] = []
    for gray in grays:
        if all(float(np.abs(gray - other)[::2, ::2].mean()) >= _MIN_CHANGE for other in kept):
            kept.append(gray)
    return kept


def _has_corners(across: Floats, down: Floats) -> NDArray[np.bool_]:
    """Where (h, w) gradients about a pixel have every direction, by the eigenvalues of their structure tensor."""
    cv2, window = import_opencv(), (_WINDOW, _WINDOW)
    products = (across * across, down * down, across * down)
    xx, yy, xy = (np.asarray(cv2.blur(product, window, borderType=cv2.BORDER_CONSTANT)) for product in products)
    total, difference = xx + yy, np.hypot(xx - yy, 2.0 * xy)
    return np.asarray(total - difference >= _MIN_CORNER * np.maximum(total + difference, 1e-6))


def looks_logarithmic(samples: Sequence[Pixels]) -> bool:
    """Tell whether a clip looks as if a camera's logarithm was not undone: neither dark nor bright, and pale.

    Args:
        samples: (h, w, 3) each, frames of the clip as they are coded.
    """
    pixels = np.concatenate([sample[::4, ::4].reshape(-1, 3) for sample in samples]) / np.float32(255.0)
    darkest, brightest = np.percentile(luminance(pixels), [0.5, 99.5])
    chroma = np.percentile(pixels.max(axis=1) - pixels.min(axis=1), 95)
    is_flat = any(low <= darkest and brightest <= high for low, high in _LOG_RANGES)
    return bool(is_flat and chroma <= _MAX_CHROMA)

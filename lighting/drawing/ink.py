"""Antialiased lines, marks and text: Pillow draws them as an enlarged mask, which is then reduced."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image, ImageDraw, ImageFont

from lighting.drawing.palette import BLACK, Colour
from lighting.geometry import Floats

Point = tuple[float, float]

_FINE = 3  # supersampling
_SHADE = 0.45  # opacity of the dark background of marks and outlined text


def ink(
    picture: Image.Image, colour: Colour, opacity: float, paint: Callable[[ImageDraw.ImageDraw, int], None]
) -> None:
    """Colour `picture` through a mask; `paint(draw, scale)` draws the mask in white, enlarged by `scale`."""
    mask = Image.new("L", (picture.width * _FINE, picture.height * _FINE))
    paint(ImageDraw.Draw(mask), _FINE)
    small = mask.reduce(_FINE)
    picture.paste(colour, mask=small if opacity == 1 else small.point([round(value * opacity) for value in range(256)]))


def stroke(picture: Image.Image, lines: Sequence[Floats], colour: Colour, width: float, opacity: float = 1.0) -> None:
    """Draw open lines, each (N, 2) pixels; one without a pixel is not drawn."""

    def paint(draw: ImageDraw.ImageDraw, scale: int) -> None:
        for line in filter(len, lines):
            draw.line(_scaled(line, scale), fill=255, width=round(width * scale), joint="curve")

    ink(picture, colour, opacity, paint)


def shaded_stroke(picture: Image.Image, lines: Sequence[Floats], colour: Colour, width: float) -> None:
    """Draw lines with a soft dark rim, visible on any background."""
    stroke(picture, lines, BLACK, width + 2.5, _SHADE)
    stroke(picture, lines, colour, width)


def polygon(picture: Image.Image, corners: ArrayLike, colour: Colour, opacity: float = 1.0) -> None:
    """Fill the polygon with these corners (N, 2)."""
    ink(picture, colour, opacity, lambda draw, scale: draw.polygon(_scaled(corners, scale), fill=255))


def sun_marks(picture: Image.Image, spots: ArrayLike, colour: Colour, size: float) -> None:
    """Draw a small sun at each spot (N, 2): a disc of radius `size` with eight rays, on a soft dark background."""
    turn = np.arange(8) * np.pi / 4
    rays = np.stack([np.cos(turn), np.sin(turn)], axis=-1)[:, None] * np.array([[1.6], [2.3]]) * size

    def paint(grow: float) -> Callable[[ImageDraw.ImageDraw, int], None]:
        def suns(draw: ImageDraw.ImageDraw, scale: int) -> None:
            for spot in np.asarray(spots):
                for ray in rays:
                    draw.line(_scaled(spot + ray, scale), fill=255, width=round((size / 3 + 2 * grow) * scale))
                draw.circle(_scaled([spot], scale)[0], (size + grow) * scale, fill=255)

        return suns

    ink(picture, BLACK, _SHADE, paint(2.0))
    ink(picture, colour, 1.0, paint(0.0))


def arrow_head(picture: Image.Image, tip: Floats, towards: Floats, colour: Colour) -> None:
    """Draw an arrow head 22 pixels long with its tip at `tip` (2,), pointing along the unit vector `towards` (2,)."""
    side = np.array([-towards[1], towards[0]])
    for grow, ground, opacity in ((3.0, BLACK, _SHADE), (0.0, colour, 1.0)):
        back, wing = (22 + grow) * towards, (12 + 1.5 * grow) * side
        polygon(
            picture, [tip + grow * towards, tip - back + wing, tip - 16 * towards, tip - back - wing], ground, opacity
        )


def rounded(size: tuple[int, int], radius: int) -> Image.Image:
    """Mask of a rectangle with rounded corners."""
    mask = Image.new("L", (size[0] * _FINE, size[1] * _FINE))
    corner = (mask.width - 1, mask.height - 1)
    ImageDraw.Draw(mask).rounded_rectangle((0, 0, *corner), radius * _FINE, fill=255)
    return mask.reduce(_FINE)


@dataclass(frozen=True)
class Style:
    """How a text looks."""

    size: int  # pixels
    colour: Colour
    anchor: str = "la"  # of Pillow: which point of the text lies on its spot
    shaded: bool = False  # with a soft dark rim, readable on any background


def write(picture: Image.Image, spot: Point, text: str, style: Style) -> None:
    """Write text at `spot`."""
    font, anchor = _font(style.size), style.anchor
    if style.shaded:
        rim = Image.new("L", picture.size)
        ImageDraw.Draw(rim).text(spot, text, font=font, fill=255, anchor=anchor, stroke_width=2)
        picture.paste(BLACK, mask=rim.point([round(value * 0.6) for value in range(256)]))
    ImageDraw.Draw(picture).text(spot, text, font=font, fill=style.colour, anchor=anchor)


def text_width(text: str, size: int) -> float:
    """Pixels from a text's left end to its right one."""
    return _font(size).getlength(text)


def write_inside(picture: Image.Image, spot: ArrayLike, text: str, size: int, colour: Colour) -> None:
    """Write shaded text centred at `spot` (2,), moved as far as needed to lie inside the picture."""
    left, top, right, bottom = _font(size).getbbox(text, anchor="mm")
    x, y = np.asarray(spot, dtype=np.float64)
    inside = (min(max(x, 8 - left), picture.width - 8 - right), min(max(y, 8 - top), picture.height - 8 - bottom))
    write(picture, inside, text, Style(size, colour, anchor="mm", shaded=True))


def _scaled(points: ArrayLike, scale: int) -> list[Point]:
    return [(float(x) * scale, float(y) * scale) for x, y in np.asarray(points)]


@lru_cache(maxsize=16)
def _font(size: int) -> ImageFont.FreeTypeFont:
    font = ImageFont.load_default(size)
    assert isinstance(font, ImageFont.FreeTypeFont)  # Pillow's wheels bring FreeType
    return font

"""Lines, text and marks on pictures for people: the palette, the photo's horizon and its sun.

Pillow draws antialiased ink as an enlarged mask, which is then reduced.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageDraw, ImageFont

from lighting.color import srgb_bytes
from lighting.envmap.projection import photo_camera
from lighting.geometry import Floats, Pinhole, camera_axes, camera_pixel, direction
from lighting.records import Lighting

Srgb = tuple[int, int, int]  # 8-bit sRGB

BLACK: Srgb = (0, 0, 0)
BACKGROUND: Srgb = (21, 24, 30)
PANEL: Srgb = (30, 34, 42)
TEXT: Srgb = (235, 237, 240)
MUTED: Srgb = (150, 157, 168)
LINE: Srgb = (96, 104, 118)
WHITE: Srgb = (255, 255, 255)
SUN: Srgb = (255, 196, 70)
PALE: Srgb = (208, 213, 221)  # the sun where it does not shine
HEAT = np.array([[30, 34, 42], [54, 56, 92], [132, 70, 104], [222, 116, 72], [255, 212, 116]])  # low to high density

Point = tuple[float, float]

_SUPERSAMPLING = 3
_SHADE_OPACITY = 0.45  # of the dark background of marks and outlined text
_LABEL_REACH = 52  # pixels within which the horizon may cross the words beside an arrow
_CORNER = math.radians(10.0)
_SHOULDER = 0.6  # linear value above which the display curve bends instead of clipping


def sun_mark_color(lighting: Lighting) -> Srgb:
    """The color of the sun's marks.

    Args:
        lighting: tells whether the sun shines.
    """
    return SUN if lighting.sun_shines else PALE


def display_srgb(linear: NDArray[np.float32]) -> NDArray[np.uint8]:
    """8-bit sRGB of linear values, with a shoulder in place of a hard clip.

    Args:
        linear: (H, W, 3) linear Rec.709, 1 is white.
    """
    over = np.maximum(linear - _SHOULDER, 0) / np.float32(1 - _SHOULDER)
    return srgb_bytes(np.minimum(linear, _SHOULDER) + np.float32(1 - _SHOULDER) * (1 - np.exp(-over)))


def _paint_mask(
    picture: Image.Image, color: Srgb, opacity: float, paint: Callable[[ImageDraw.ImageDraw, int], None]
) -> None:
    """Color `picture` through a mask; `paint(draw, scale)` draws the mask in white, enlarged by `scale`."""
    mask = Image.new("L", (picture.width * _SUPERSAMPLING, picture.height * _SUPERSAMPLING))
    paint(ImageDraw.Draw(mask), _SUPERSAMPLING)
    if (painted := mask.getbbox()) is None:
        return
    scale = _SUPERSAMPLING
    left, top, right, bottom = (
        painted[0] // scale,
        painted[1] // scale,
        -(-painted[2] // scale),
        -(-painted[3] // scale),
    )
    small = mask.reduce(scale, (scale * left, scale * top, scale * right, scale * bottom))
    box = (left, top, right, bottom)
    picture.paste(color, box, small if opacity == 1 else small.point([round(value * opacity) for value in range(256)]))


def _find_corners(line: Floats) -> list[int]:
    """The inner points of a line (N, 2) at which it turns by more than _CORNER."""
    steps = np.diff(line, axis=0)
    along = np.sum(steps[:-1] * steps[1:], axis=1)
    lengths = np.linalg.norm(steps, axis=1)
    return [int(n) + 1 for n in np.flatnonzero(along < math.cos(_CORNER) * lengths[:-1] * lengths[1:])]


def draw_lines(picture: Image.Image, lines: Sequence[Floats], color: Srgb, width: float, opacity: float = 1.0) -> None:
    """Draw open lines; one without a pixel is not drawn.

    Args:
        picture: drawn on in place.
        lines: (N, 2) pixels each.
        color: 8-bit sRGB.
        width: pixels.
        opacity: 0 to 1.
    """

    def paint(draw: ImageDraw.ImageDraw, scale: int) -> None:
        for line in filter(len, lines):
            draw.line(_scaled(line, scale), fill=255, width=round(width * scale))
            for corner in _find_corners(line):  # Pillow's joints cost more than lines, and show at corners alone
                draw.line(_scaled(line[corner - 1 : corner + 2], scale), 255, round(width * scale), joint="curve")

    _paint_mask(picture, color, opacity, paint)


def draw_outlined_lines(picture: Image.Image, lines: Sequence[Floats], color: Srgb, width: float) -> None:
    """Draw lines with a soft dark rim, visible on any background.

    Args:
        picture: drawn on in place.
        lines: (N, 2) pixels each.
        color: 8-bit sRGB.
        width: pixels, without the rim.
    """
    draw_lines(picture, lines, BLACK, width + 2.5, _SHADE_OPACITY)
    draw_lines(picture, lines, color, width)


def draw_polygon(picture: Image.Image, corners: ArrayLike, color: Srgb, opacity: float = 1.0) -> None:
    """Fill a polygon.

    Args:
        picture: drawn on in place.
        corners: (N, 2) pixels.
        color: 8-bit sRGB.
        opacity: 0 to 1.
    """
    _paint_mask(picture, color, opacity, lambda draw, scale: draw.polygon(_scaled(corners, scale), fill=255))


def draw_suns(picture: Image.Image, spots: ArrayLike, color: Srgb, size: float) -> None:
    """Draw small suns: a disc with eight rays each, on a soft dark background.

    Args:
        picture: drawn on in place.
        spots: (N, 2) pixels of their centers.
        color: 8-bit sRGB.
        size: radius of the disc in pixels.
    """
    angle = np.arange(8) * np.pi / 4
    rays = np.stack([np.cos(angle), np.sin(angle)], axis=-1)[:, None] * np.array([[1.6], [2.3]]) * size

    def paint(grow: float) -> Callable[[ImageDraw.ImageDraw, int], None]:
        def suns(draw: ImageDraw.ImageDraw, scale: int) -> None:
            for spot in np.asarray(spots):
                for ray in rays:
                    draw.line(_scaled(spot + ray, scale), fill=255, width=round((size / 3 + 2 * grow) * scale))
                draw.circle(_scaled([spot], scale)[0], (size + grow) * scale, fill=255)

        return suns

    _paint_mask(picture, BLACK, _SHADE_OPACITY, paint(2.0))
    _paint_mask(picture, color, 1.0, paint(0.0))


def draw_arrow_head(picture: Image.Image, tip: Floats, heading: Floats, color: Srgb) -> None:
    """Draw an arrow head 22 pixels long.

    Args:
        picture: drawn on in place.
        tip: (2,) pixels.
        heading: (2,) unit vector, where it points.
        color: 8-bit sRGB.
    """
    side = np.array([-heading[1], heading[0]])
    for grow, ground, opacity in ((3.0, BLACK, _SHADE_OPACITY), (0.0, color, 1.0)):
        back, wing = (22 + grow) * heading, (12 + 1.5 * grow) * side
        corners = [tip + grow * heading, tip - back + wing, tip - 16 * heading, tip - back - wing]
        draw_polygon(picture, corners, ground, opacity)


def rounded_mask(size: tuple[int, int], radius: int) -> Image.Image:
    """A mask of a rectangle with rounded corners.

    Args:
        size: width and height in pixels.
        radius: of the corners, in pixels.
    """
    mask = Image.new("L", (size[0] * _SUPERSAMPLING, size[1] * _SUPERSAMPLING))
    corner = (mask.width - 1, mask.height - 1)
    ImageDraw.Draw(mask).rounded_rectangle((0, 0, *corner), radius * _SUPERSAMPLING, fill=255)
    return mask.reduce(_SUPERSAMPLING)


@dataclass(frozen=True)
class TextStyle:
    """How a text looks."""

    size: int
    """Size, pixels."""
    color: Srgb
    """sRGB, 0 to 255."""
    anchor: str = "la"
    """Of Pillow: which point of the text lies on its spot."""
    shaded: bool = False
    """With a soft dark rim, readable on any background."""


def draw_text(picture: Image.Image, spot: Point, text: str, style: TextStyle) -> None:
    """Write a text.

    Args:
        picture: drawn on in place.
        spot: (x, y) pixels, where the style's anchor lies.
        text: one line.
        style: size, color and anchor.
    """
    font, anchor = _font(style.size), style.anchor
    if style.shaded:
        rim = Image.new("L", picture.size)
        ImageDraw.Draw(rim).text(spot, text, font=font, fill=255, anchor=anchor, stroke_width=2)
        picture.paste(BLACK, mask=rim.point([round(value * 0.6) for value in range(256)]))
    ImageDraw.Draw(picture).text(spot, text, font=font, fill=style.color, anchor=anchor)


def text_width(text: str, size: int) -> float:
    """Pixels from a text's left end to its right one.

    Args:
        text: one line.
        size: of its letters, in pixels.
    """
    return _font(size).getlength(text)


def draw_text_inside(picture: Image.Image, spot: ArrayLike, text: str, size: int, color: Srgb) -> None:
    """Write a shaded text, moved as far as needed to lie inside the picture.

    Args:
        picture: drawn on in place.
        spot: (2,) pixels of its center.
        text: one line.
        size: of its letters, in pixels.
        color: 8-bit sRGB.
    """
    left, top, right, bottom = _font(size).getbbox(text, anchor="mm")
    x, y = np.asarray(spot, dtype=np.float64)
    inside = (min(max(x, 8 - left), picture.width - 8 - right), min(max(y, 8 - top), picture.height - 8 - bottom))
    draw_text(picture, inside, text, TextStyle(size, color, anchor="mm", shaded=True))


def _scaled(points: ArrayLike, scale: int) -> list[Point]:
    return [(float(x) * scale, float(y) * scale) for x, y in np.asarray(points)]


@lru_cache(maxsize=16)
def _font(size: int) -> ImageFont.FreeTypeFont:
    font = ImageFont.load_default(size)
    assert isinstance(font, ImageFont.FreeTypeFont)  # Pillow's wheels bring FreeType
    return font


def draw_horizon(picture: Image.Image, lighting: Lighting) -> None:
    """Draw the horizon as a thin line, if it is in view; its name is on the side without the sun.

    Args:
        picture: the photo, drawn on in place.
        lighting: the camera, and where the sun is.
    """
    line = horizon_pixels(photo_camera(lighting, *picture.size))
    draw_outlined_lines(picture, [line], WHITE, 2)
    inside = line[(line[:, 0] > 0) & (line[:, 0] < picture.width)]
    if len(inside):
        left = lighting.sun_direction[0] >= 0.0
        x, y = (12, float(inside[0, 1])) if left else (picture.width - 12, float(inside[-1, 1]))
        if 30 < y < picture.height:
            draw_text(picture, (x, y - 8), "horizon", TextStyle(17, WHITE, anchor="ls" if left else "rs", shaded=True))


def draw_sun(picture: Image.Image, lighting: Lighting) -> None:
    """Mark the sun if it is in the picture, else draw an arrow at the edge that points to it.

    Args:
        picture: the photo, drawn on in place.
        lighting: the camera, and where the sun is.
    """
    color, camera = sun_mark_color(lighting), photo_camera(lighting, *picture.size)
    sun = _camera_pixels(lighting.sun_direction[None], camera)
    if len(sun) and 0 <= sun[0, 0] < picture.width and 0 <= sun[0, 1] < picture.height:
        draw_suns(picture, sun, color, 9)
        return
    right, up, forward = camera_axes(0.0, lighting.camera_elevation, lighting.camera_roll) @ lighting.sun_direction
    outward = np.array([right, -up] if forward > 0 else [1.0 if right > 0 else -1.0, 0.0])
    outward /= max(float(np.hypot(*outward)), 1e-9)
    middle = np.array([picture.width, picture.height]) / 2
    tip = middle + outward * np.min((middle - 14) / np.maximum(np.abs(outward), 1e-9))
    draw_arrow_head(picture, tip, outward, color)
    label = tip - outward * 16 + [0, 30 if _is_free_below(tip, horizon_pixels(camera), picture.height) else -30]
    draw_text_inside(picture, label, "sun" if forward > 0 else "sun behind", 18, color)


def horizon_pixels(camera: Pinhole) -> Floats:
    """Pixels (N, 2) of the horizon, from left to right unless the camera is upside down.

    Args:
        camera: of the picture.
    """
    return _camera_pixels(direction(np.linspace(-80.0, 80.0, 65), 0.0), camera)


def _camera_pixels(directions: Floats, camera: Pinhole) -> Floats:
    pixels = camera_pixel(directions, camera)
    return pixels[~np.isnan(pixels[:, 0])]


def _is_free_below(tip: Floats, horizon: Floats, height: int) -> bool:
    """Whether an arrow's words go below its tip (2,): on the side that a horizon (N, 2) near it does not cross."""
    order = np.argsort(horizon[:, 0])
    drop = float(np.interp(tip[0], *horizon[order].T)) - tip[1] if len(horizon) else np.inf
    return bool(drop < 0 if abs(drop) < _LABEL_REACH else tip[1] < height / 2)

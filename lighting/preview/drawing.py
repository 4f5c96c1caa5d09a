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
_DISPLAYED_AT_ONCE = 1 << 16  # values, few enough for the processor's cache
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
        linear: (..., 3) linear Rec.709, 1 is white.
    """
    shown, flat = np.empty(linear.size, np.uint8), linear.reshape(-1)
    for start in range(0, len(flat), _DISPLAYED_AT_ONCE):
        part = slice(start, start + _DISPLAYED_AT_ONCE)
        over = np.maximum(flat[part] - _SHOULDER, 0) / np.float32(1 - _SHOULDER)
        bent = np.minimum(flat[part], _SHOULDER) + np.float32(1 - _SHOULDER) * (1 - np.exp(-over))
        shown[part] = srgb_bytes(bent)
    return shown.reshape(linear.shape)


_ToMask = Callable[[ArrayLike], list[Point]]  # where points (N, 2) of a picture lie in a mask


def _paint_mask(
    picture: Image.Image,
    color: Srgb,
    opacity: float,
    points: ArrayLike,
    reach: float,
    paint: Callable[[ImageDraw.ImageDraw, _ToMask], None],
) -> None:
    """Color `picture` through a mask of what lies within a reach [pixels] of points (N, 2); `paint` draws in white."""
    scale, x, y = _SUPERSAMPLING, *np.asarray(points, dtype=np.float64).reshape(-1, 2).T
    if not x.size:
        return
    left, top = max(0, math.floor(x.min() - reach)), max(0, math.floor(y.min() - reach))
    right, bottom = min(picture.width, math.ceil(x.max() + reach)), min(picture.height, math.ceil(y.max() + reach))
    if left >= right or top >= bottom:
        return
    mask = Image.new("L", ((right - left) * scale, (bottom - top) * scale))

    def to_mask(line: ArrayLike) -> list[Point]:
        return [(float(x) * scale - left * scale, float(y) * scale - top * scale) for x, y in np.asarray(line)]

    paint(ImageDraw.Draw(mask), to_mask)
    small = mask.reduce(scale)
    small = small if opacity == 1 else small.point(_fade(opacity))
    picture.paste(color, (left, top), small)


@lru_cache(maxsize=16)
def _fade(opacity: float) -> list[int]:
    """What is left of each of the 256 values of a mask."""
    return [round(value * opacity) for value in range(256)]


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

    thickness, drawn = round(width * _SUPERSAMPLING), [line for line in lines if len(line)]

    def paint(draw: ImageDraw.ImageDraw, to_mask: _ToMask) -> None:
        for line in drawn:
            draw.line(to_mask(line), fill=255, width=thickness)
            for corner in _find_corners(line):  # Pillow's joints cost more than lines, and show at corners alone
                draw.line(to_mask(line[corner - 1 : corner + 2]), 255, thickness, joint="curve")

    if drawn:
        _paint_mask(picture, color, opacity, np.concatenate(drawn), width + 2, paint)


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
    _paint_mask(picture, color, opacity, corners, 2, lambda draw, to_mask: draw.polygon(to_mask(corners), fill=255))


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

    def paint(grow: float) -> Callable[[ImageDraw.ImageDraw, _ToMask], None]:
        thickness = round((size / 3 + 2 * grow) * _SUPERSAMPLING)

        def suns(draw: ImageDraw.ImageDraw, to_mask: _ToMask) -> None:
            for spot in np.asarray(spots):
                for ray in rays:
                    draw.line(to_mask(spot + ray), fill=255, width=thickness)
                draw.circle(to_mask([spot])[0], (size + grow) * _SUPERSAMPLING, fill=255)

        return suns

    _paint_mask(picture, BLACK, _SHADE_OPACITY, spots, 4 * size, paint(2.0))
    _paint_mask(picture, color, 1.0, spots, 4 * size, paint(0.0))


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
    scale = _SUPERSAMPLING
    part = (min(size[0], 2 * radius + 2), min(size[1], 2 * radius + 2))  # with nothing but the corners
    corners = Image.new("L", (part[0] * scale, part[1] * scale))
    last = (corners.width - 1, corners.height - 1)
    ImageDraw.Draw(corners).rounded_rectangle((0, 0, *last), radius * scale, fill=255)
    small, mask = corners.reduce(scale), Image.new("L", size, 255)
    for x, left in ((0, 0), (size[0] - radius, part[0] - radius)):
        for y, top in ((0, 0), (size[1] - radius, part[1] - radius)):
            mask.paste(small.crop((left, top, left + radius, top + radius)), (x, y))
    return mask


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
        box = font.getbbox(text, anchor=anchor, stroke_width=2)
        left, top = max(0, math.floor(spot[0] + box[0]) - 2), max(0, math.floor(spot[1] + box[1]) - 2)
        right, bottom = (math.ceil(start + end) + 2 for start, end in zip(spot, box[2:], strict=True))
        rim = Image.new("L", (max(0, min(right, picture.width) - left), max(0, min(bottom, picture.height) - top)))
        inside = (spot[0] - left, spot[1] - top)
        ImageDraw.Draw(rim).text(inside, text, font=font, fill=255, anchor=anchor, stroke_width=2)
        picture.paste(BLACK, (left, top), rim.point(_fade(0.6)))
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
    horizon = horizon_pixels(camera)
    order, drop = np.argsort(horizon[:, 0]), np.inf
    if len(horizon):
        drop = float(np.interp(tip[0], *horizon[order].T)) - tip[1]
    below = drop < 0 if abs(drop) < _LABEL_REACH else tip[1] < picture.height / 2  # where no horizon crosses the words
    label = tip - outward * 16 + [0, 30 if below else -30]
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

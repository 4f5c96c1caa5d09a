"""Colours of pictures for people, and how linear light is shown in them."""

import numpy as np
from numpy.typing import NDArray

from lighting.colour import tone_map
from lighting.records import Lighting

Colour = tuple[int, int, int]  # 8-bit sRGB

BLACK: Colour = (0, 0, 0)
BACKGROUND: Colour = (21, 24, 30)
PANEL: Colour = (30, 34, 42)
TEXT: Colour = (235, 237, 240)
MUTED: Colour = (150, 157, 168)
LINE: Colour = (96, 104, 118)
WHITE: Colour = (255, 255, 255)
SUN: Colour = (255, 196, 70)
PALE: Colour = (208, 213, 221)  # the sun where it does not shine
HEAT = np.array([[30, 34, 42], [54, 56, 92], [132, 70, 104], [222, 116, 72], [255, 212, 116]])  # low to high density

_SHOULDER = 0.6  # linear value above which the display curve bends instead of clipping


def sun_colour(lighting: Lighting) -> Colour:
    """The colour of the sun's marks."""
    return SUN if lighting.sun_shines else PALE


def display(linear: NDArray[np.float32]) -> NDArray[np.uint8]:
    """8-bit sRGB of the photo's linear values, with a shoulder in place of a hard clip."""
    over = np.maximum(linear - _SHOULDER, 0) / np.float32(1 - _SHOULDER)
    return tone_map(np.minimum(linear, _SHOULDER) + (1 - _SHOULDER) * (1 - np.exp(-over)))

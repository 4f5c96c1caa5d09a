"""A picture of a photo's light for people."""

from lighting.preview.picture import MAP_HEIGHT, PHOTO_SIDE, draw_preview
from lighting.preview.png import preview_png

__all__ = ["MAP_HEIGHT", "PHOTO_SIDE", "draw_preview", "preview_png"]

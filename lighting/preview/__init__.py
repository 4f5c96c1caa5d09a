"""A picture of a photo's light for people."""

from lighting.preview.picture import PHOTO_SIDE, draw_preview, preview_png

__all__ = ["PHOTO_SIDE", "draw_preview", "preview_png"]

"""The panel that shows the photo, with its horizon and the sun."""

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.drawing import PANEL, draw_horizon, draw_sun, horizon_pixels, text_width
from lighting.geometry import Pinhole
from lighting.preview.layout import LETTERS, Box
from lighting.records import Lighting
from lighting.sizes import fitting
from lighting.spheres import Stage, has_ground, with_balls


def photo_panel(photo: NDArray[np.uint8], lighting: Lighting, box: Box, stage: Stage | None = None) -> Image.Image:
    """The photo with its horizon and the sun, and with the balls of a stage on its ground if one is given."""
    panel = Image.new("RGB", (box.width, box.height), PANEL)
    height, width = photo.shape[:2]
    size = fitting(width, height, box.width, box.height)
    picture = Image.fromarray(photo).resize(size, Image.Resampling.LANCZOS, reducing_gap=2.0)
    picture = picture if stage is None else with_balls(picture, lighting, stage)
    draw_horizon(picture, lighting)
    draw_sun(picture, lighting)
    panel.paste(picture, ((box.width - size[0]) // 2, (box.height - size[1]) // 2))
    return panel


def photo_caption(camera: Pinhole, width: int, *, balls: bool) -> str:
    """What the panel shows in a photo of this camera, in words that fit its width.

    `balls` says whether it draws them where there is ground.
    """
    horizon = ["its horizon"] if _shows_horizon(camera) else []
    if not (balls and has_ground(camera)):
        return _caption(horizon)
    long, short = (_caption([*horizon, words]) for words in ("three balls in its light", "three balls"))
    return long if text_width(long, LETTERS) <= width else short


def _caption(shown: list[str]) -> str:
    return f"Photo, with {' and '.join(shown)}" if shown else "Photo"


def _shows_horizon(camera: Pinhole) -> bool:
    x, y = horizon_pixels(camera).T
    order = np.argsort(x)
    edges = np.interp([0.0, camera.width], x[order], y[order]) if len(x) else np.array([np.inf])
    return bool(edges.min() < camera.height and edges.max() > 0)

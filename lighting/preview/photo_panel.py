"""The panel that shows the photo, with its horizon and the sun."""

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.envmap import camera_of
from lighting.geometry import Floats, Pinhole, camera_axes, camera_pixel, direction
from lighting.preview.in_photo import ball_centres, with_balls
from lighting.preview.ink import Style, arrow_head, shaded_stroke, sun_marks, text_width, write, write_inside
from lighting.preview.layout import LETTERS, Box
from lighting.preview.palette import PANEL, WHITE, sun_colour
from lighting.preview.shading import Stage
from lighting.records import Lighting
from lighting.sizes import fitting

_NEAR = 52  # pixels within which the horizon may cross the words beside an arrow


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
    shown = ["its horizon"] if _shows_horizon(camera) else []
    shown += ["three balls in its light"] if balls and ball_centres(camera) is not None else []
    caption = f"Photo, with {' and '.join(shown)}" if shown else "Photo"
    return caption if text_width(caption, LETTERS) <= width else caption.removesuffix(" in its light")


def _shows_horizon(camera: Pinhole) -> bool:
    x, y = _horizon(camera).T
    order = np.argsort(x)
    edges = np.interp([0.0, camera.width], x[order], y[order]) if len(x) else np.array([np.inf])
    return bool(edges.min() < camera.height and edges.max() > 0)


def draw_horizon(picture: Image.Image, lighting: Lighting) -> None:
    """Draw the horizon as a thin line with a soft shadow, if it is in view; its name is on the side without the sun."""
    line = _horizon(camera_of(lighting, *picture.size))
    shaded_stroke(picture, [line], WHITE, 2)
    inside = line[(line[:, 0] > 0) & (line[:, 0] < picture.width)]
    if len(inside):
        left = lighting.sun_direction[0] >= 0.0
        x, y = (12, float(inside[0, 1])) if left else (picture.width - 12, float(inside[-1, 1]))
        if 30 < y < picture.height:
            write(picture, (x, y - 8), "horizon", Style(17, WHITE, anchor="ls" if left else "rs", shaded=True))


def _horizon(camera: Pinhole) -> Floats:
    """Pixels (N, 2) of the horizon, from left to right where the camera does not stand on its head."""
    return _camera_pixels(direction(np.linspace(-80.0, 80.0, 65), 0.0), camera)


def _camera_pixels(directions: Floats, camera: Pinhole) -> Floats:
    pixels = camera_pixel(directions, camera)
    return pixels[~np.isnan(pixels[:, 0])]


def draw_sun(picture: Image.Image, lighting: Lighting) -> None:
    """Mark the sun if it is in the picture, else draw an arrow at the edge that points towards it."""
    colour, camera = sun_colour(lighting), camera_of(lighting, *picture.size)
    seen = _camera_pixels(lighting.sun_direction[None], camera)
    if len(seen) and 0 <= seen[0, 0] < picture.width and 0 <= seen[0, 1] < picture.height:
        sun_marks(picture, seen, colour, 9)
        return
    right, up, forward = camera_axes(0.0, lighting.camera_elevation, lighting.camera_roll) @ lighting.sun_direction
    away = np.array([right, -up] if forward > 0 else [1.0 if right > 0 else -1.0, 0.0])
    away /= max(float(np.hypot(*away)), 1e-9)
    middle = np.array([picture.width, picture.height]) / 2
    tip = middle + away * np.min((middle - 14) / np.maximum(np.abs(away), 1e-9))
    arrow_head(picture, tip, away, colour)
    label = tip - away * 16 + [0, 30 if _is_free_below(tip, _horizon(camera), picture.height) else -30]
    write_inside(picture, label, "sun" if forward > 0 else "sun behind", 18, colour)


def _is_free_below(tip: Floats, horizon: Floats, height: int) -> bool:
    """Whether an arrow's words go below its tip (2,): on the side that a horizon (N, 2) near it does not cross."""
    order = np.argsort(horizon[:, 0])
    drop = float(np.interp(tip[0], *horizon[order].T)) - tip[1] if len(horizon) else np.inf
    return bool(drop < 0 if abs(drop) < _NEAR else tip[1] < height / 2)

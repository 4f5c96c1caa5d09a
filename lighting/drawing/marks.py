"""The photo's horizon and its sun, marked on the photo."""

import numpy as np
from PIL import Image

from lighting.drawing.ink import Style, arrow_head, shaded_stroke, sun_marks, write, write_inside
from lighting.drawing.palette import WHITE, sun_colour
from lighting.envmap import camera_of
from lighting.geometry import Floats, Pinhole, camera_axes, camera_pixel, direction
from lighting.records import Lighting

_NEAR = 52  # pixels within which the horizon may cross the words beside an arrow


def draw_horizon(picture: Image.Image, lighting: Lighting) -> None:
    """Draw the horizon as a thin line with a soft shadow, if it is in view; its name is on the side without the sun."""
    line = horizon_pixels(camera_of(lighting, *picture.size))
    shaded_stroke(picture, [line], WHITE, 2)
    inside = line[(line[:, 0] > 0) & (line[:, 0] < picture.width)]
    if len(inside):
        left = lighting.sun_direction[0] >= 0.0
        x, y = (12, float(inside[0, 1])) if left else (picture.width - 12, float(inside[-1, 1]))
        if 30 < y < picture.height:
            write(picture, (x, y - 8), "horizon", Style(17, WHITE, anchor="ls" if left else "rs", shaded=True))


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
    label = tip - away * 16 + [0, 30 if _is_free_below(tip, horizon_pixels(camera), picture.height) else -30]
    write_inside(picture, label, "sun" if forward > 0 else "sun behind", 18, colour)


def horizon_pixels(camera: Pinhole) -> Floats:
    """Pixels (N, 2) of the horizon, from left to right where the camera does not stand on its head."""
    return _camera_pixels(direction(np.linspace(-80.0, 80.0, 65), 0.0), camera)


def _camera_pixels(directions: Floats, camera: Pinhole) -> Floats:
    pixels = camera_pixel(directions, camera)
    return pixels[~np.isnan(pixels[:, 0])]


def _is_free_below(tip: Floats, horizon: Floats, height: int) -> bool:
    """Whether an arrow's words go below its tip (2,): on the side that a horizon (N, 2) near it does not cross."""
    order = np.argsort(horizon[:, 0])
    drop = float(np.interp(tip[0], *horizon[order].T)) - tip[1] if len(horizon) else np.inf
    return bool(drop < 0 if abs(drop) < _NEAR else tip[1] < height / 2)

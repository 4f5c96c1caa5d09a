"""Lines on the sphere of directions: the sun's regions and the photo's frame."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from PIL import Image

from lighting.geometry import Floats, camera_axes
from lighting.preview import drawing
from lighting.preview.drawing import (
    draw_text_inside,
)
from lighting.records import Lighting

_SHARE_LETTERS = 15  # pixels, size of a region's share


def draw_regions(picture: Image.Image, lighting: Lighting, pixels: Callable[[Floats], Floats]) -> None:
    """Draw and label the circles around the sun that hold 50 % and 90 % of the probability.

    Args:
        picture: to draw on.
        lighting: the sun and its radii.
        pixels: takes directions (N, 3) to pixels (N, 2) of the picture.
    """
    color = drawing.sun_mark_color(lighting)
    labels: list[tuple[str, Floats]] = []
    for radius, share, width in ((lighting.radius_50, "50 %", 2.5), (lighting.radius_90, "90 %", 1.5)):
        rim = circle_around_sun(lighting, radius)
        if radius <= 0 or rim[180, 1] <= 0:
            continue
        line = pixels(rim[rim[:, 1] > -0.02])
        drawing.draw_outlined_lines(picture, list(split_at_seam(line, picture.width)), color, width)
        outwards = pixels(rim[180]) - pixels(circle_around_sun(lighting, 0.98 * radius)[180])
        outwards = outwards / np.hypot(*outwards)
        spot = pixels(rim[180]) + 14 * outwards
        labels.append((share, _avoid_overlap([other for _, other in labels], spot, outwards)))
    for share, spot in labels:
        draw_text_inside(picture, spot, share, _SHARE_LETTERS, color)


def _avoid_overlap(others: Sequence[Floats], spot: Floats, outwards: Floats) -> Floats:
    """The spot (2,) of a share, moved along `outwards` as far as needed to cover none of the others."""
    room = np.array([drawing.text_width("90 %", _SHARE_LETTERS) + 6, _SHARE_LETTERS + 4])
    for other in others:
        lacking = room - (spot - other) * np.sign(outwards)
        if np.all(np.abs(spot - other) < room):
            spot = spot + outwards * float(np.min(lacking / np.maximum(np.abs(outwards), 1e-6)))
    return spot


def circle_around_sun(lighting: Lighting, radius: float) -> Floats:
    """Return directions (361, 3) around the sun: from the lowest (index 0) over the highest (180) and back.

    Args:
        lighting: with the sun.
        radius: deg.
    """
    right, up, sun = camera_axes(lighting.sun_azimuth, lighting.sun_elevation, 0.0)
    angle = np.linspace(0.0, 2 * np.pi, 361)[:, None]
    across = np.sin(angle) * right - np.cos(angle) * up
    return np.asarray(np.cos(np.radians(radius)) * sun + np.sin(np.radians(radius)) * across)


def frame_directions(lighting: Lighting, aspect: float) -> Floats:
    """Return directions (N, 3) through the photo's border, a closed loop.

    Args:
        lighting: with the camera.
        aspect: the photo's width / height.
    """
    y = np.tan(np.radians(lighting.vertical_fov) / 2)
    x, side = aspect * y, np.linspace(-1.0, 1.0, 48)
    one = np.ones_like(side)
    border = np.concatenate([np.stack(p, axis=-1) for p in ((side, one), (one, -side), (-side, -one), (-one, side))])
    right, up, forward = camera_axes(0.0, lighting.camera_elevation, lighting.camera_roll)
    return np.asarray(x * border[:, :1] * right + y * border[:, 1:] * up + forward)


def split_at_seam(line: Floats, width: float) -> Iterator[Floats]:
    """Yield the parts of a line, cut where it jumps by more than half the picture's width, as it does at the seam.

    Args:
        line: (N, 2) pixels.
        width: of the picture, pixels.
    """
    jumps = np.flatnonzero(np.abs(np.diff(line[:, 0])) > width / 2) + 1
    yield from (piece for piece in np.split(line, jumps) if len(piece) > 1)

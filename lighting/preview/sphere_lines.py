"""Lines on the sphere of directions: the sun's regions and the photo's frame."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from PIL import Image

from lighting.drawing import shaded_stroke, sun_colour, text_width, write_inside
from lighting.geometry import Floats, camera_axes
from lighting.records import Lighting

_LETTERS = 15  # pixels, size of a share


def regions(picture: Image.Image, lighting: Lighting, pixels: Callable[[Floats], Floats]) -> None:
    """Draw and label the circles around the sun that hold 50 % and 90 % of the probability."""
    colour = sun_colour(lighting)
    labels: list[tuple[str, Floats]] = []
    for radius, share, width in ((lighting.radius_50, "50 %", 2.5), (lighting.radius_90, "90 %", 1.5)):
        rim = _rim(lighting, radius)
        if radius <= 0 or rim[180, 1] <= 0:
            continue
        line = pixels(rim[rim[:, 1] > -0.02])
        shaded_stroke(picture, list(pieces(line, picture.width)), colour, width)
        outwards = pixels(rim[180]) - pixels(_rim(lighting, 0.98 * radius)[180])
        outwards = outwards / np.hypot(*outwards)
        spot = pixels(rim[180]) + 14 * outwards
        labels.append((share, _clear_of([other for _, other in labels], spot, outwards)))
    for share, spot in labels:
        write_inside(picture, spot, share, _LETTERS, colour)


def _clear_of(others: Sequence[Floats], spot: Floats, outwards: Floats) -> Floats:
    """The spot (2,) of a share, moved along `outwards` as far as needed to cover none of the others."""
    room = np.array([text_width("90 %", _LETTERS) + 6, _LETTERS + 4])
    for other in others:
        lacking = room - (spot - other) * np.sign(outwards)
        if np.all(np.abs(spot - other) < room):
            spot = spot + outwards * float(np.min(lacking / np.maximum(np.abs(outwards), 1e-6)))
    return spot


def _rim(lighting: Lighting, radius: float) -> Floats:
    """Directions (361, 3) at `radius` deg around the sun: from the lowest (index 0) over the highest (180) and back."""
    right, up, sun = camera_axes(lighting.sun_azimuth, lighting.sun_elevation, 0.0)
    turn = np.linspace(0.0, 2 * np.pi, 361)[:, None]
    return np.asarray(
        np.cos(np.radians(radius)) * sun + np.sin(np.radians(radius)) * (np.sin(turn) * right - np.cos(turn) * up)
    )


def frame_directions(lighting: Lighting, aspect: float) -> Floats:
    """Directions (N, 3) through the photo's border, a closed loop."""
    y = np.tan(np.radians(lighting.vertical_fov) / 2)
    x, side = aspect * y, np.linspace(-1.0, 1.0, 48)
    one = np.ones_like(side)
    border = np.concatenate([np.stack(p, axis=-1) for p in ((side, one), (one, -side), (-side, -one), (-one, side))])
    right, up, forward = camera_axes(0.0, lighting.camera_elevation, lighting.camera_roll)
    return np.asarray(x * border[:, :1] * right + y * border[:, 1:] * up + forward)


def pieces(line: Floats, width: float) -> Iterator[Floats]:
    """A line (N, 2) cut where it jumps by more than half the picture's width, as it does at the seam."""
    jumps = np.flatnonzero(np.abs(np.diff(line[:, 0])) > width / 2) + 1
    yield from (piece for piece in np.split(line, jumps) if len(piece) > 1)

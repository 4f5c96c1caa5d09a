"""The sun compass, the sky from above, with the density of the sun's probability; and lines on a sphere.

The lines, on the sphere of directions, are those of the sun's regions and of the photo's frame.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.geometry import Floats, angles, camera_axes, direction
from lighting.prediction import EstimatedLight, SunDistribution
from lighting.preview import drawing
from lighting.records import Lighting
from lighting.sun_grid import grid_directions, row_blocks

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
        drawing.draw_text_inside(picture, spot, share, _SHARE_LETTERS, color)


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


_RINGS = (30, 60)  # deg of elevation, the compass's rings
_DENSITY_SIZE = 112  # pixels of the density before enlargement


def draw_compass(estimate: EstimatedLight, aspect: float, size: int) -> Image.Image:
    """The sky from above: zenith at the center, the camera's heading at the top, its right on the right.

    Args:
        estimate: the light and the sun's distribution.
        aspect: the photo's width / height.
        size: of the square panel, in pixels.
    """
    lighting = estimate.lighting
    panel = Image.new("RGB", (size, size), drawing.PANEL)
    radius = size / 2 - 44
    heat = _draw_density(estimate.distribution).resize((round(2 * radius),) * 2, Image.Resampling.BICUBIC)
    corner = (round(size / 2 - radius),) * 2
    panel.paste(heat, corner, drawing.rounded_mask(heat.size, heat.width // 2))
    sideways, _, along = np.abs(lighting.sun_direction)
    _draw_rings(panel, radius)
    view = dome_pixels(frame_directions(lighting, aspect), size, radius)
    drawing.draw_polygon(panel, view, drawing.WHITE, 0.10)
    drawing.draw_lines(panel, [view], drawing.WHITE, 1.5, 0.6)
    draw_regions(panel, lighting, lambda d: dome_pixels(d, size, radius))
    _write_degrees(panel, radius, across=bool(sideways < along))
    sun = dome_pixels(lighting.sun_direction[None], size, radius)
    drawing.draw_suns(panel, sun, drawing.sun_mark_color(lighting), 8)
    return panel


def _draw_density(distribution: SunDistribution) -> Image.Image:
    """Density of the sun's probability over the dome in colors; the scale ends at 1/sr, or at the peak if higher."""
    side = (np.arange(_DENSITY_SIZE) + 0.5) / _DENSITY_SIZE * 2 - 1
    x, y = np.meshgrid(side, side)
    elevation = np.maximum(90.0 * (1 - np.hypot(x, y)), 0.0)
    dome = direction(np.degrees(np.arctan2(x, -y)), elevation).reshape(-1, 3).astype(np.float32)
    density = _density(dome, distribution)
    level = np.sqrt(density / max(float(density.max()), 1.0)).reshape(_DENSITY_SIZE, _DENSITY_SIZE)
    steps = np.linspace(0.0, 1.0, len(drawing.HEAT))
    colors = np.stack([np.interp(level, steps, drawing.HEAT[:, c]) for c in range(3)], axis=-1)
    return Image.fromarray(colors.astype(np.uint8))


def _density(dome: NDArray[np.float32], distribution: SunDistribution) -> Floats:
    """Density [1/sr] (M,) at directions (M, 3), each cell spread over its neighborhood."""
    probability = np.asarray(distribution.probability, dtype=np.float32)
    cells = grid_directions(distribution.grid).astype(np.float32)
    concentration = np.float32(2.8 * len(cells) / (2 * np.pi))  # a spread of 0.6 times the cells' distance
    probable = probability > 1e-4 * probability.max()
    axes, density = concentration * cells[probable].T, np.empty(len(dome), np.float32)
    for part in row_blocks(len(dome)):
        kernel = dome[part] @ axes
        kernel -= concentration
        density[part] = np.exp(kernel, out=kernel) @ probability[probable]
    return density * (concentration / np.float32(2 * np.pi))


def _draw_rings(panel: Image.Image, radius: float) -> None:
    """Draw elevation rings and a cross labeled front, right, behind and left, clear of a sun on the horizon."""
    center = panel.width / 2
    spokes = [np.array([[center - radius, center], [center + radius, center]])]
    spokes.append(spokes[0][:, ::-1])
    angle = np.linspace(0.0, 2 * np.pi, 181)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    *rings, rim = (center + radius * (90 - elevation) / 90 * circle for elevation in (*_RINGS, 0))
    drawing.draw_lines(panel, spokes + rings, drawing.WHITE, 1, 0.22)
    drawing.draw_lines(panel, [rim], drawing.LINE, 2, 1.0)
    drawing.draw_text(panel, (center, 16), "front", drawing.TextStyle(18, drawing.TEXT, anchor="mm"))
    far = panel.width - 22.0
    for spot, word in (((center, panel.height - 16), "behind"), ((22.0, center), "left"), ((far, center), "right")):
        drawing.draw_text(panel, spot, word, drawing.TextStyle(18, drawing.MUTED, anchor="mm"))


def _write_degrees(panel: Image.Image, radius: float, across: bool) -> None:
    """Write the rings' degrees, on what is drawn: behind the zenith, or on its right where `across`.

    The regions' shares stand in line with the sun.
    """
    center = panel.width / 2
    for elevation in _RINGS:
        out = center + radius * (90 - elevation) / 90
        spot = (out + 6, center - 3) if across else (center + 6, out - 3)
        drawing.draw_text(panel, spot, f"{elevation}°", drawing.TextStyle(15, drawing.TEXT, anchor="ls", shaded=True))


def dome_pixels(directions: Floats, size: float, radius: float) -> Floats:
    """Return pixels (N, 2) on a compass; directions below the horizon lie on its rim.

    Args:
        directions: (N, 3) unit vectors.
        size: of the square panel, pixels.
        radius: of the dome, pixels.
    """
    azimuth, elevation = angles(directions)
    reach, angle = radius * (90.0 - np.maximum(elevation, 0.0)) / 90.0, np.radians(azimuth)
    return np.stack([size / 2 + reach * np.sin(angle), size / 2 - reach * np.cos(angle)], axis=-1)

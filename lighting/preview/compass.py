"""The panel that shows the sky from above, with the sun's probability."""

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.drawing import (
    HEAT,
    LINE,
    MUTED,
    PANEL,
    TEXT,
    WHITE,
    Style,
    polygon,
    rounded,
    stroke,
    sun_colour,
    sun_marks,
    write,
)
from lighting.geometry import Floats, angles, direction
from lighting.preview.sphere_lines import frame_directions, regions
from lighting.records import Estimate, SunDistribution
from lighting.sun_grid import grid_directions

_RINGS = (30, 60)  # degrees of elevation
_HEAT_SIZE = 112  # pixels of the density before enlargement


def compass_panel(estimate: Estimate, aspect: float, size: int) -> Image.Image:
    """The sky seen from above: zenith at the centre, the camera's heading at the top, its right on the right."""
    lighting = estimate.lighting
    panel = Image.new("RGB", (size, size), PANEL)
    radius = size / 2 - 44
    heat = _heat(estimate.distribution).resize((round(2 * radius),) * 2, Image.Resampling.BICUBIC)
    corner = (round(size / 2 - radius),) * 2
    panel.paste(heat, corner, rounded(heat.size, heat.width // 2))
    sideways, _, along = np.abs(lighting.sun_direction)
    _rings(panel, radius)
    view = _on_dome(frame_directions(lighting, aspect), size, radius)
    polygon(panel, view, WHITE, 0.10)
    stroke(panel, [view], WHITE, 1.5, 0.6)
    regions(panel, lighting, lambda d: _on_dome(d, size, radius))
    _write_degrees(panel, radius, across=bool(sideways < along))
    sun_marks(panel, _on_dome(lighting.sun_direction[None], size, radius), sun_colour(lighting), 8)
    return panel


def _heat(distribution: SunDistribution) -> Image.Image:
    """Density of the sun's probability over the dome in colours; the scale ends at 1/sr, or at the peak if higher."""
    side = (np.arange(_HEAT_SIZE) + 0.5) / _HEAT_SIZE * 2 - 1
    x, y = np.meshgrid(side, side)
    elevation = np.maximum(90.0 * (1 - np.hypot(x, y)), 0.0)
    dome = direction(np.degrees(np.arctan2(x, -y)), elevation).reshape(-1, 3).astype(np.float32)
    density = _density(dome, distribution)
    level = np.sqrt(density / max(float(density.max()), 1.0)).reshape(_HEAT_SIZE, _HEAT_SIZE)
    steps = np.linspace(0.0, 1.0, len(HEAT))
    return Image.fromarray(np.stack([np.interp(level, steps, HEAT[:, c]) for c in range(3)], axis=-1).astype(np.uint8))


def _density(dome: NDArray[np.float32], distribution: SunDistribution) -> Floats:
    """Density [1/sr] (M,) at directions (M, 3), each cell spread over its neighbourhood."""
    probability = np.asarray(distribution.probability, dtype=np.float32)
    cells = grid_directions(distribution.grid).astype(np.float32)
    concentration = np.float32(2.8 * len(cells) / (2 * np.pi))  # a spread of 0.6 times the cells' distance
    likely = probability > 1e-4 * probability.max()
    kernel = np.exp(concentration * (dome @ cells[likely].T - 1))
    return np.asarray(kernel @ probability[likely] * concentration / np.float32(2 * np.pi))


def _rings(panel: Image.Image, radius: float) -> None:
    """Draw elevation rings and a cross labelled front, right, behind and left, clear of a sun on the horizon."""
    centre = panel.width / 2
    spokes = [np.array([[centre - radius, centre], [centre + radius, centre]])]
    spokes.append(spokes[0][:, ::-1])
    rings = [_circle(centre, radius * (90 - elevation) / 90) for elevation in _RINGS]
    stroke(panel, spokes + rings, WHITE, 1, 0.22)
    stroke(panel, [_circle(centre, radius)], LINE, 2, 1.0)
    write(panel, (centre, 16), "front", Style(18, TEXT, anchor="mm"))
    write(panel, (centre, panel.height - 16), "behind", Style(18, MUTED, anchor="mm"))
    for x, word in ((22.0, "left"), (panel.width - 22.0, "right")):
        write(panel, (x, centre), word, Style(18, MUTED, anchor="mm"))


def _write_degrees(panel: Image.Image, radius: float, across: bool) -> None:
    """Write the rings' degrees, on what is drawn: behind the zenith, or on its right where `across`.

    The regions' shares stand in line with the sun.
    """
    centre = panel.width / 2
    for elevation in _RINGS:
        out = centre + radius * (90 - elevation) / 90
        spot = (out + 6, centre - 3) if across else (centre + 6, out - 3)
        write(panel, spot, f"{elevation}°", Style(15, TEXT, anchor="ls", shaded=True))


def _circle(centre: float, radius: float) -> Floats:
    turn = np.linspace(0.0, 2 * np.pi, 181)
    return np.stack([centre + radius * np.cos(turn), centre + radius * np.sin(turn)], axis=-1)


def _on_dome(directions: Floats, size: float, radius: float) -> Floats:
    """Pixels (N, 2) on a compass of that size; directions below the horizon are drawn on the rim."""
    azimuth, elevation = angles(directions)
    reach = radius * (90.0 - np.maximum(elevation, 0.0)) / 90.0
    turn = np.radians(azimuth)
    return np.stack([size / 2 + reach * np.sin(turn), size / 2 - reach * np.cos(turn)], axis=-1)

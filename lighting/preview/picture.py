"""One picture of a photo's light: photo with horizon, sun compass, environment map, three spheres, numbers in words."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from lighting.colour import tone_map
from lighting.geometry import angles, camera_axes, camera_pixel, direction, latlong_pixel
from lighting.preview.ink import (
    Colour,
    arrow_head,
    polygon,
    rounded,
    shaded_stroke,
    stroke,
    sun_marks,
    write,
    write_inside,
)
from lighting.preview.spheres import render_spheres
from lighting.records import Lighting
from lighting.sun_grid import grid_directions

Floats = NDArray[np.floating[Any]]

WIDTH = 1600  # of the whole picture, pixels
MAP_HEIGHT = 512  # rows of the map that the picture is drawn with
PHOTO_SIDE = 1000  # pixels that the photo's longer side keeps at least, if it has them
MARGIN = 40
GAP = 24
HEADER = 78  # height of the headline above the panels
CAPTION = 32  # height of the line above each panel
CELL = 76  # height of one number with its name
UPRIGHT_HEIGHT = 680  # of the upper row when the photo is upright
UPRIGHT_MAP_HEIGHT = 440

BACKGROUND: Colour = (21, 24, 30)
PANEL: Colour = (30, 34, 42)
TEXT: Colour = (235, 237, 240)
MUTED: Colour = (150, 157, 168)
LINE: Colour = (96, 104, 118)
WHITE: Colour = (255, 255, 255)
SUN: Colour = (255, 196, 70)
PALE: Colour = (208, 213, 221)  # the sun where it does not shine
HEAT = np.array([[30, 34, 42], [54, 56, 92], [132, 70, 104], [222, 116, 72], [255, 212, 116]])  # low to high density

_HEAT_SIZE = 112  # pixels of the compass' density before enlargement
_SHOULDER = 0.6  # linear value above which the display curve bends instead of clipping


@dataclass(frozen=True)
class _Box:
    x: int
    y: int
    width: int
    height: int


@dataclass(frozen=True)
class _Layout:
    """Where everything goes."""

    height: int  # of the whole picture
    photo: _Box
    compass: _Box
    envmap: _Box
    spheres: _Box
    cells: list[tuple[int, int]]  # top left corners of the numbers


def draw_preview(
    photo: NDArray[np.uint8],
    lighting: Lighting,
    probability: NDArray[np.floating[Any]],
    layout: str,
    envmap: NDArray[np.float32],
) -> NDArray[np.uint8]:
    """The picture (H, 1600, 3) of an upright photo (h, w, 3) and its light.

    `probability` (N,) belongs to the sun grid `layout`; `envmap` (H, 2H, 3) is `lighting` rendered in the photo's
    linear values, with or without the sun's disc.
    """
    aspect, numbers = photo.shape[1] / photo.shape[0], _numbers(lighting)
    plan = _plan(aspect, len(numbers))
    compass = _compass_panel(lighting, probability, layout, aspect, plan.compass.width)
    canvas = Image.new("RGB", (WIDTH, plan.height), BACKGROUND)
    _headline(canvas, lighting)
    for box, caption, panel in (
        (plan.photo, "Photo, with its horizon", _photo_panel(photo, lighting, plan.photo)),
        (plan.compass, "Sun compass: the sky from above, the photo's view outlined", compass),
        (plan.envmap, "Environment map, the photo's view outlined", _map_panel(envmap, lighting, aspect, plan.envmap)),
        (plan.spheres, "Mirror, glossy and diffuse in this light", _spheres_panel(envmap, lighting, plan.spheres)),
    ):
        _place(canvas, box, caption, panel)
    for corner, (name, value) in zip(plan.cells, numbers, strict=True):
        write(canvas, corner, name, 16, MUTED)
        write(canvas, (corner[0], corner[1] + 22), value, 25, TEXT)
    return np.asarray(canvas)


# --- layout


def _plan(aspect: float, count: int) -> _Layout:
    """Photo and compass above, map and spheres below; the numbers beside an upright photo, else at the foot."""
    inner, top = WIDTH - 2 * MARGIN, MARGIN + HEADER + CAPTION
    aspect = min(max(aspect, 0.5), 2.0)
    upright = aspect < 0.9
    upper = UPRIGHT_HEIGHT if upright else int((inner - GAP) / (1 + aspect))
    photo = _Box(MARGIN, top, round(upper * aspect), upper)
    compass = _Box(MARGIN + photo.width + GAP if upright else WIDTH - MARGIN - upper, top, upper, upper)
    below = top + upper + GAP + CAPTION
    lower = UPRIGHT_MAP_HEIGHT if upright else photo.width // 2
    envmap = _Box(MARGIN, below, 2 * lower, lower)
    left = MARGIN + envmap.width + GAP if upright else compass.x
    spheres = _Box(left, below, WIDTH - MARGIN - left, lower)
    foot = below + lower + GAP
    if upright:
        column = compass.x + compass.width + GAP + 8
        return _Layout(
            foot - GAP + MARGIN, photo, compass, envmap, spheres, [(column, top + CELL * i) for i in range(count)]
        )
    cells = [(MARGIN + i * inner // count, foot) for i in range(count)]
    return _Layout(foot + CELL - 10 + MARGIN // 2, photo, compass, envmap, spheres, cells)


def _place(canvas: Image.Image, box: _Box, caption: str, panel: Image.Image) -> None:
    """Panel with rounded corners, its caption above."""
    write(canvas, (box.x, box.y - CAPTION + 4), caption, 18, MUTED)
    canvas.paste(panel, (box.x, box.y), rounded(panel.size, 10))


# --- words


def _headline(canvas: Image.Image, lighting: Lighting) -> None:
    visible = lighting.sun_shines
    where = f"{_azimuth_words(lighting.sun_azimuth)}, {lighting.sun_elevation:.0f}° high"
    write(canvas, (MARGIN, MARGIN - 6), f"Sun {where}" if visible else "No direct sun", 38, SUN if visible else TEXT)
    if visible:
        half, most = _short(lighting.radius_50), _short(lighting.radius_90)
        spread = f"half of the probability lies within {half}°, 90 % within {most}°"
    else:
        spread = f"an overcast or shaded scene; if the sun shone, it would stand {where}"
    write(canvas, (MARGIN, MARGIN + 40), spread, 20, MUTED)
    model = f"{lighting.model_name} {lighting.model_version}"
    write(canvas, (WIDTH - MARGIN, MARGIN + 40), model, 18, MUTED, anchor="ra")
    write(canvas, (WIDTH - MARGIN, MARGIN + 8), _sources(lighting), 18, MUTED, anchor="ra")


def _sources(lighting: Lighting) -> str:
    """What the answer rests on if not on the pixels alone, and the heading that follows."""
    sources = [f"from {', '.join(lighting.evidence)}"] if len(lighting.evidence) > 1 else []
    heading = [] if lighting.camera_heading is None else [f"camera heading {lighting.camera_heading:.0f}°"]
    return "; ".join(sources + heading)


def _azimuth_words(azimuth: float) -> str:
    size = round(abs(azimuth))
    if size == 0:
        return "straight ahead"
    if size == 180:
        return "straight behind"
    side = "left" if azimuth < 0 else "right"
    return f"{size}° {side}" + (" (behind)" if size > 90 else "")


def _short(value: float) -> str:
    """One decimal below 10."""
    return f"{value:.1f}" if value < 9.95 else f"{value:.0f}"


def _numbers(lighting: Lighting) -> list[tuple[str, str]]:
    """Names and values of the record, in words."""
    up = "up" if lighting.camera_elevation >= 0 else "down"
    return [
        ("Sun azimuth", _azimuth_words(lighting.sun_azimuth).removesuffix(" (behind)")),
        ("Sun elevation", f"{lighting.sun_elevation:.1f}°"),
        ("50 % / 90 % within", f"{_short(lighting.radius_50)}° / {_short(lighting.radius_90)}°"),
        ("Direct sun", f"{100 * lighting.sun_visibility:.0f} %"),
        ("Turbidity", f"{lighting.turbidity:.1f}"),
        ("Exposure", f"{lighting.exposure:.3g}"),
        ("Camera elevation", f"{abs(lighting.camera_elevation):.1f}° {up}"),
        ("Camera roll", f"{round(lighting.camera_roll, 1) + 0.0:.1f}°"),
        ("Vertical field of view", f"{lighting.vertical_fov:.1f}°"),
    ]


# --- panels


def _photo_panel(photo: NDArray[np.uint8], lighting: Lighting, box: _Box) -> Image.Image:
    panel = Image.new("RGB", (box.width, box.height), PANEL)
    height, width = photo.shape[:2]
    scale = min(box.width / width, box.height / height)
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    picture = Image.fromarray(photo).resize(size, Image.Resampling.LANCZOS, reducing_gap=2.0)
    draw_horizon(picture, lighting)
    draw_sun(picture, lighting)
    panel.paste(picture, ((box.width - size[0]) // 2, (box.height - size[1]) // 2))
    return panel


def draw_horizon(picture: Image.Image, lighting: Lighting) -> None:
    """The horizon as a thin line with a soft shadow; nothing where it is out of view."""
    azimuth = np.linspace(-80.0, 80.0, 65)
    line = _camera_pixels(picture, direction(azimuth, 0.0), lighting)
    shaded_stroke(picture, [line], WHITE, 2)
    inside = line[(line[:, 0] > 0) & (line[:, 0] < picture.width)]
    if len(inside) and 30 < inside[0, 1] < picture.height:
        write(picture, (12, float(inside[0, 1]) - 8), "horizon", 17, WHITE, anchor="ls", shaded=True)


def _camera_pixels(picture: Image.Image, directions: Floats, lighting: Lighting) -> Floats:
    pixels = camera_pixel(
        directions,
        picture.width,
        picture.height,
        lighting.vertical_fov,
        elevation=lighting.camera_elevation,
        roll=lighting.camera_roll,
    )
    return pixels[~np.isnan(pixels[:, 0])]


def draw_sun(picture: Image.Image, lighting: Lighting) -> None:
    """The sun where it is in the picture, else an arrow at the edge that one would follow to find it."""
    colour = SUN if lighting.sun_shines else PALE
    seen = _camera_pixels(picture, lighting.sun_direction[None], lighting)
    if len(seen) and 0 <= seen[0, 0] < picture.width and 0 <= seen[0, 1] < picture.height:
        sun_marks(picture, seen, colour, 9)
        return
    right, up, forward = camera_axes(0.0, lighting.camera_elevation, lighting.camera_roll) @ lighting.sun_direction
    away = np.array([right, -up] if forward > 0 else [1.0 if right > 0 else -1.0, 0.0])
    away /= max(float(np.hypot(*away)), 1e-9)
    middle = np.array([picture.width, picture.height]) / 2
    tip = middle + away * np.min((middle - 14) / np.maximum(np.abs(away), 1e-9))
    arrow_head(picture, tip, away, colour)
    label = tip - away * 16 + [0, 30 if tip[1] < middle[1] else -30]
    write_inside(picture, label, "sun" if forward > 0 else "sun behind", 18, colour)


def _compass_panel(lighting: Lighting, probability: Floats, layout: str, aspect: float, size: int) -> Image.Image:
    """The dome from above: zenith at the centre, the camera's heading up, its right on the right."""
    panel = Image.new("RGB", (size, size), PANEL)
    radius = size / 2 - 44
    heat = _heat(probability, layout).resize((round(2 * radius),) * 2, Image.Resampling.BICUBIC)
    corner = (round(size / 2 - radius),) * 2
    panel.paste(heat, corner, rounded(heat.size, heat.width // 2))
    _rings(panel, radius)
    view = _on_dome(_frame_directions(lighting, aspect), size, radius)
    polygon(panel, view, WHITE, 0.10)
    stroke(panel, [view], WHITE, 1.5, 0.6)
    _regions(panel, lighting, lambda d: _on_dome(d, size, radius))
    sun_marks(panel, _on_dome(lighting.sun_direction[None], size, radius), SUN if lighting.sun_shines else PALE, 8)
    return panel


def _heat(probability: ArrayLike, layout: str) -> Image.Image:
    """Density of the sun's probability over the dome in colours; the scale ends at 1/sr, or at the peak if higher."""
    side = (np.arange(_HEAT_SIZE) + 0.5) / _HEAT_SIZE * 2 - 1
    x, y = np.meshgrid(side, side)
    elevation = np.maximum(90.0 * (1 - np.hypot(x, y)), 0.0)
    dome = direction(np.degrees(np.arctan2(x, -y)), elevation).reshape(-1, 3).astype(np.float32)
    density = _density(dome, np.asarray(probability, dtype=np.float32), layout)
    level = np.sqrt(density / max(float(density.max()), 1.0)).reshape(_HEAT_SIZE, _HEAT_SIZE)
    steps = np.linspace(0.0, 1.0, len(HEAT))
    return Image.fromarray(np.stack([np.interp(level, steps, HEAT[:, c]) for c in range(3)], axis=-1).astype(np.uint8))


def _density(dome: NDArray[np.float32], probability: NDArray[np.float32], layout: str) -> Floats:
    """Density [1/sr] (M,) at directions (M, 3), each cell spread over its neighbourhood."""
    cells = grid_directions(layout).astype(np.float32)
    concentration = np.float32(2.8 * len(cells) / (2 * np.pi))  # a spread of 0.6 times the cells' distance
    likely = probability > 1e-4 * probability.max()
    kernel = np.exp(concentration * (dome @ cells[likely].T - 1))
    return np.asarray(kernel @ probability[likely] * concentration / np.float32(2 * np.pi))


def _rings(panel: Image.Image, radius: float) -> None:
    """Elevation rings with their degrees, the cross of front, right, back and left, and those words."""
    centre = panel.width / 2
    spokes = [np.array([[centre - radius, centre], [centre + radius, centre]])]
    spokes.append(spokes[0][:, ::-1])
    rings = [_circle(centre, radius * (90 - elevation) / 90) for elevation in (30, 60)]
    stroke(panel, spokes + rings, WHITE, 1, 0.22)
    stroke(panel, [_circle(centre, radius)], LINE, 2, 1.0)
    for elevation in (30, 60):
        spot = (centre + 6, centre + radius * (90 - elevation) / 90 - 3)
        write(panel, spot, f"{elevation}°", 15, TEXT, anchor="ls", shaded=True)
    write(panel, (centre, 24), "front", 18, TEXT, anchor="mm")
    write(panel, (centre, panel.height - 22), "behind", 18, MUTED, anchor="mm")
    for x, word in ((22.0, "left"), (panel.width - 22.0, "right")):
        write(panel, (x, centre), word, 18, MUTED, anchor="mm")


def _circle(centre: float, radius: float) -> Floats:
    turn = np.linspace(0.0, 2 * np.pi, 181)
    return np.stack([centre + radius * np.cos(turn), centre + radius * np.sin(turn)], axis=-1)


def _on_dome(directions: Floats, size: float, radius: float) -> Floats:
    """Pixels (N, 2) on a compass of that size; what is below the horizon goes to the rim."""
    azimuth, elevation = angles(directions)
    reach = radius * (90.0 - np.maximum(elevation, 0.0)) / 90.0
    turn = np.radians(azimuth)
    return np.stack([size / 2 + reach * np.sin(turn), size / 2 - reach * np.cos(turn)], axis=-1)


def _map_panel(envmap: NDArray[np.float32], lighting: Lighting, aspect: float, box: _Box) -> Image.Image:
    picture = Image.fromarray(display(envmap)).resize((box.width, box.height), Image.Resampling.LANCZOS)

    def pixels(directions: Floats) -> Floats:
        return latlong_pixel(directions, box.height)

    frame = list(_pieces(pixels(_frame_directions(lighting, aspect)), box.width))
    shaded_stroke(picture, frame, WHITE, 1.5)
    _regions(picture, lighting, pixels)
    spots = pixels(lighting.sun_direction) + np.array([[-box.width, 0], [0, 0], [box.width, 0]])
    sun_marks(picture, spots, SUN if lighting.sun_shines else PALE, 6.5)
    for share, word in ((0.25, "90° left"), (0.5, "front"), (0.75, "90° right")):
        write(picture, (box.width * share, box.height - 12), word, 16, WHITE, anchor="ms", shaded=True)
    for share, anchor in ((0.008, "ls"), (0.992, "rs")):
        write(picture, (box.width * share, box.height - 12), "behind", 16, WHITE, anchor=anchor, shaded=True)
    return picture


def _spheres_panel(envmap: NDArray[np.float32], lighting: Lighting, box: _Box) -> Image.Image:
    linear = render_spheres(envmap, lighting, box.width, box.height, supersampling=2)
    return Image.fromarray(display(linear)).reduce(2)


def display(linear: NDArray[np.float32]) -> NDArray[np.uint8]:
    """8-bit sRGB of the photo's linear values, with a shoulder in place of a hard clip."""
    over = np.maximum(linear - _SHOULDER, 0) / np.float32(1 - _SHOULDER)
    return tone_map(np.minimum(linear, _SHOULDER) + (1 - _SHOULDER) * (1 - np.exp(-over)))


# --- the sun's regions and the photo's frame on the sphere


def _regions(picture: Image.Image, lighting: Lighting, pixels: Callable[[Floats], Floats]) -> None:
    """The circles around the sun that hold 50 % and 90 % of the probability, labelled."""
    colour = SUN if lighting.sun_shines else PALE
    for radius, share, width in ((lighting.radius_90, "90 %", 1.5), (lighting.radius_50, "50 %", 2.5)):
        rim = _rim(lighting, radius)
        if radius <= 0 or rim[180, 1] <= 0:
            continue
        line = pixels(rim[rim[:, 1] > -0.02])
        shaded_stroke(picture, list(_pieces(line, picture.width)), colour, width)
        outwards = pixels(rim[180]) - pixels(_rim(lighting, 0.98 * radius)[180])
        write_inside(picture, pixels(rim[180]) + 14 * outwards / np.hypot(*outwards), share, 15, colour)


def _rim(lighting: Lighting, radius: float) -> Floats:
    """Directions (361, 3) at `radius` deg around the sun: from the lowest (index 0) over the highest (180) and back."""
    right, up, sun = camera_axes(lighting.sun_azimuth, lighting.sun_elevation, 0.0)
    turn = np.linspace(0.0, 2 * np.pi, 361)[:, None]
    return np.asarray(
        np.cos(np.radians(radius)) * sun + np.sin(np.radians(radius)) * (np.sin(turn) * right - np.cos(turn) * up)
    )


def _frame_directions(lighting: Lighting, aspect: float) -> Floats:
    """Directions (N, 3) through the photo's border, a closed loop."""
    y = np.tan(np.radians(lighting.vertical_fov) / 2)
    x, side = aspect * y, np.linspace(-1.0, 1.0, 48)
    one = np.ones_like(side)
    border = np.concatenate([np.stack(p, axis=-1) for p in ((side, one), (one, -side), (-side, -one), (-one, side))])
    right, up, forward = camera_axes(0.0, lighting.camera_elevation, lighting.camera_roll)
    return np.asarray(x * border[:, :1] * right + y * border[:, 1:] * up + forward)


def _pieces(line: Floats, width: float) -> Iterator[Floats]:
    """A line (N, 2) cut where it jumps by more than half the picture's width, as it does at the seam."""
    jumps = np.flatnonzero(np.abs(np.diff(line[:, 0])) > width / 2) + 1
    yield from (piece for piece in np.split(line, jumps) if len(piece) > 1)

"""A plan as one picture: gain by start and end of the window, over the sphere for the best windows, errors in words."""

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.geometry import Floats
from lighting.preview.drawing import (
    BACKGROUND,
    LINE,
    MUTED,
    PANEL,
    TEXT,
    TextStyle,
    draw_lines,
    draw_polygon,
    draw_text,
)
from lighting.stereo.plan_records import Plan, Window, WindowTable, format_clock

WIDTH, HEIGHT = 1600, 900
MAX_USEFUL_ERROR = 45.0  # deg, a larger error says nothing of the normal
MIN_GAIN, MAX_GAIN = 1.0, 300.0  # the ends of the scale of colours

_RAMP = np.array([[255, 224, 130], [240, 140, 80], [172, 74, 108], [84, 58, 110], [40, 44, 62]])  # low to high gain
_TRIANGLE = (100, 150, 660)  # left, top and side of the panel by start and end
_SCALE = (100, 862, 660, 12)  # left, top, width and height of the scale
_RIGHT = 850  # where the spheres begin
_FIRST, _SPHERE, _STEP = 1010, 126, 141  # left of the first sphere, their width, and from one to the next
_ROWS = 390  # where the table of orientations begins
_ROW = 42  # pixels from one row of it to the next


def draw_plan(plan: Plan, title: str, subtitle: str) -> NDArray[np.uint8]:
    """Draw a plan as a picture (900, 1600, 3), sRGB.

    Args:
        plan: of one day or the best of several.
        title: its headline.
        subtitle: for whom and when it holds.
    """
    canvas = Image.new("RGB", (WIDTH, HEIGHT), BACKGROUND)
    draw_text(canvas, (40, 34), title, TextStyle(30, TEXT))
    draw_text(canvas, (40, 76), subtitle, TextStyle(18, MUTED))
    _draw_windows(canvas, plan)
    _draw_scale(canvas)
    view = "from above, north up" if plan.question.facing is None else "as its camera sees it"
    draw_text(canvas, (_RIGHT, 118), f"Noise gain over the sphere of normals {view}", TextStyle(18, MUTED))
    for column, window in enumerate(plan.windows):
        _draw_sphere(canvas, _FIRST + column * _STEP, window)
    _draw_orientations(canvas, plan.windows)
    return np.asarray(canvas)


def _gain_colors(gain: Floats) -> NDArray[np.uint8]:
    """Colors (..., 3) of noise gains (...), on a logarithmic scale from MIN_GAIN, bright, to MAX_GAIN, dark."""
    share = np.log(np.clip(gain, MIN_GAIN, MAX_GAIN) / MIN_GAIN) / np.log(MAX_GAIN / MIN_GAIN)
    stops = np.linspace(0, 1, len(_RAMP))
    colors = [np.interp(share, stops, channel) for channel in _RAMP.T]
    return np.round(np.stack(colors, axis=-1)).astype(np.uint8)


def _draw_windows(canvas: Image.Image, plan: Plan) -> None:
    """Start of the window to the right, its end upwards."""
    left, top, side = _TRIANGLE
    first, last = int(np.floor(plan.table.start.min() / 60)), int(np.ceil(plan.table.end.max() / 60))  # hours
    caption = "Noise gain by start and end of the window, median over orientations"
    draw_text(canvas, (left - 60, 118), caption, TextStyle(18, MUTED))
    canvas.paste(_window_raster(plan.table, first, last).resize((side, side), Image.Resampling.NEAREST), (left, top))
    every = 1 if last - first <= 12 else 2 if last - first <= 16 else 3
    for hour in range(first, last + 1, every):
        position = _axis_position(60.0 * hour, plan.table, first, last)
        draw_text(canvas, (left + position, top + side + 8), f"{hour}", TextStyle(16, MUTED, anchor="ma"))
        draw_text(canvas, (left - 10, top + side - position), f"{hour}", TextStyle(16, MUTED, anchor="rm"))
    draw_text(canvas, (left + side - 8, top + side - 10), "start", TextStyle(16, MUTED, anchor="rd"))
    draw_text(canvas, (left + 10, top + 10), "end", TextStyle(16, TEXT, shaded=True))
    for window in plan.windows:
        x, y = (_axis_position(minutes, plan.table, first, last) for minutes in (window.start, window.end))
        _draw_mark(canvas, (left + x, top + side - y), f"{window.hours} h", after=window.hours < 3)


def _axis_position(minutes: float, table: WindowTable, first: int, last: int) -> float:
    """Where along an axis a time is [pixels]: the middle of its cell."""
    cells = 60 * (last - first) / table.step + 1
    return ((minutes - 60 * first) / table.step + 0.5) / cells * _TRIANGLE[2]


def _window_raster(table: WindowTable, first: int, last: int) -> Image.Image:
    """The windows as one pixel each, the panel's ground where there is none."""
    cells = 60 / table.step
    side = round(cells * (last - first)) + 1
    pixels = np.full((side, side, 3), PANEL, dtype=np.uint8)
    column = np.rint((table.start / 60 - first) * cells).astype(np.intp)
    row = np.rint((last - table.end / 60) * cells).astype(np.intp)
    pixels[row, column] = _gain_colors(table.gain)
    return Image.fromarray(pixels)


def _draw_mark(canvas: Image.Image, spot: tuple[float, float], text: str, *, after: bool) -> None:
    """A mark with its name after it, or before."""
    angle = np.linspace(0, 2 * np.pi, 33)
    circle = np.stack([spot[0] + 8 * np.cos(angle), spot[1] + 8 * np.sin(angle)], axis=-1)
    for color, width in (((0, 0, 0), 5.0), (TEXT, 2.5)):
        draw_lines(canvas, [circle], color, width)
    beside = (spot[0] + (14 if after else -14), spot[1])
    draw_text(canvas, beside, text, TextStyle(18, TEXT, anchor="lm" if after else "rm", shaded=True))


def _draw_scale(canvas: Image.Image) -> None:
    left, top, width, height = _SCALE
    gains = MIN_GAIN * (MAX_GAIN / MIN_GAIN) ** np.linspace(0, 1, width)
    canvas.paste(Image.fromarray(np.broadcast_to(_gain_colors(gains), (height, width, 3)).copy()), (left, top))
    for gain in (1, 3, 10, 30, 100, 300):
        x = left + width * np.log(gain / MIN_GAIN) / np.log(MAX_GAIN / MIN_GAIN)
        label = f"{gain}+" if gain == MAX_GAIN else f"{gain}"
        draw_text(canvas, (x, top + height + 3), label, TextStyle(15, MUTED, anchor="ma"))
    draw_text(canvas, (left - 10, top + 6), "gain", TextStyle(15, MUTED, anchor="rm"))


def _draw_sphere(canvas: Image.Image, left: int, window: Window) -> None:
    top = 156
    picture = Image.fromarray(_gain_colors(window.sphere)).resize((_SPHERE, _SPHERE), Image.Resampling.BICUBIC)
    disc, angle = Image.new("RGB", picture.size), np.linspace(0, 2 * np.pi, 181)[:-1]
    rim = _SPHERE / 2 + (_SPHERE / 2 - 1) * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    draw_polygon(disc, rim, (255, 255, 255))
    canvas.paste(picture, (left, top), mask=disc.convert("L"))
    center = left + _SPHERE / 2
    draw_text(canvas, (center, top + _SPHERE + 14), f"{window.hours} h", TextStyle(24, TEXT, anchor="ma"))
    times = f"{format_clock(window.start)} to {format_clock(window.end)}"
    draw_text(canvas, (center, top + _SPHERE + 46), times, TextStyle(15, MUTED, anchor="ma"))


def _draw_orientations(canvas: Image.Image, windows: tuple[Window, ...]) -> None:
    """A row for each orientation, a column for each window."""
    draw_text(canvas, (_RIGHT, _ROWS), "Expected error of the normal, by orientation", TextStyle(18, MUTED))
    rows = [("median", [window.error for window in windows])]
    names = [orientation.name for orientation in windows[0].orientations]
    rows += [(name, [window.orientations[i].error for window in windows]) for i, name in enumerate(names)]
    draw_lines(canvas, [np.array([[_RIGHT, _ROWS + 30], [WIDTH - 40, _ROWS + 30]])], LINE, 1.0)
    for number, (name, errors) in enumerate(rows):
        y = _ROWS + 52 + number * _ROW
        draw_text(canvas, (_RIGHT, y), name, TextStyle(18, TEXT if number == 0 else MUTED, anchor="lm"))
        for column, error in enumerate(errors):
            x = _FIRST + column * _STEP + _SPHERE
            style = TextStyle(20, TEXT if error < 10 else MUTED, anchor="rm")
            draw_text(canvas, (x, y), format_angle_error(error), style)


def format_angle_error(error: float) -> str:
    """Format an error for people.

    Args:
        error: deg, at least 0.
    """
    return f">{MAX_USEFUL_ERROR:g}°" if error > MAX_USEFUL_ERROR else f"{error:.1f}°"

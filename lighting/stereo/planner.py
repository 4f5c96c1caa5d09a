"""When to photograph: a plan under modeled skies of a place or under measured ones, its record, headlines and picture.

The picture has the gain by start and end of the window, the gain over the sphere for the best windows, and the errors.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import date, timedelta, timezone
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.color import luminance
from lighting.envmap.latlong import remove_sun, shrink_envmap
from lighting.errors import EnvironmentMapError, ErrorCode, ParameterError
from lighting.fields import OPTIONAL_RANGES, Json, check_range
from lighting.files import read_envmap
from lighting.geometry import Floats, latlong_directions
from lighting.photo.timestamps import UTC_OFFSET_RANGE, YEAR_RANGE
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
from lighting.probe.bracket import probes_in
from lighting.stereo.light_vectors import (
    ONE_SKY,
    SKY_HEIGHT,
    ClockLocation,
    Skies,
    SkyDay,
    Weather,
    clear_brightness,
    gray_skies,
    modelled_day,
)
from lighting.stereo.schedule import (
    DayProgress,
    Plan,
    PlanRequest,
    Window,
    WindowTable,
    days_between,
    format_clock,
    make_plan,
)

MAX_PROBE_GAP = 20.0  # min between two probes that photos may be planned in


def probe_days(folder: Path, utc_offset: float = 0.0) -> dict[date, dict[float, Path]]:
    """List the maps of each day by minutes since midnight.

    Args:
        folder: of probes, in the SkyDB's layout.
        utc_offset: h, of the clock of days and minutes, and of the folders' names where the maps have no time.

    Raises:
        ProbeError: the folder has no probe.
    """
    zone = timezone(timedelta(hours=utc_offset))
    days: dict[date, dict[float, Path]] = {}
    for probe in probes_in(folder, zone):
        local = probe.time.astimezone(zone)
        days.setdefault(local.date(), {})[60.0 * local.hour + local.minute + local.second / 60] = probe.path
    return days


def _read_day(day: date, files: Mapping[float, Path]) -> SkyDay:
    """The probes of one day by minutes since midnight; ParameterError where there are fewer than two of it."""
    if len(files) < 2:
        sentence = f"There is one probe of {day}; a plan needs two or more of a day."
        raise ParameterError(sentence, code=ErrorCode.INSUFFICIENT)
    minutes = np.array(sorted(files))
    skies = gray_skies(read_skies([files[minute] for minute in minutes]))
    tolerance = min(float(np.diff(minutes).max()), MAX_PROBE_GAP) / 2
    return SkyDay(day, minutes, tolerance, skies, ONE_SKY)


def read_skies(files: list[Path]) -> Skies:
    """Read maps as skies of at most SKY_HEIGHT rows, the sun taken out of where a map is brightest.

    Args:
        files: OpenEXR maps of one size.

    Raises:
        EnvironmentMapError: a map cannot be read, or sizes differ.
    """
    parts = list(map(_read_sky, files))
    if len({sky.radiance.shape for sky in parts}) > 1:
        raise EnvironmentMapError("The probes differ in size; all must have the same number of rows.")
    return Skies.join(parts)


def _read_sky(file: Path) -> Skies:
    """The sky of one map; what stands above it around the map's brightest spot counts as the sun's disc."""
    image = read_envmap(file)
    light = luminance(image)
    top = light >= 0.5 * light.max()
    mean = (latlong_directions(len(image))[top] * light[top][:, None]).sum(axis=0)
    sun = np.asarray(mean / max(float(np.linalg.norm(mean)), 1e-12), dtype=np.float64)
    sky, irradiance = remove_sun(image, sun)
    return Skies(shrink_envmap(sky, SKY_HEIGHT)[None], sun[None], irradiance[None])


@dataclass(frozen=True)
class ModelledSkies:
    """A place and days there under a kind of sky; ParameterError for another one and for what is out of range."""

    latitude: float
    """Deg, positive north."""
    longitude: float
    """Deg, positive east."""
    first: date
    """The first day."""
    last: date
    """The last day."""
    sky: Weather = "clear"
    """The weather."""
    utc_offset: float | None = None
    """H; None is the longitude's, a whole number of hours."""

    def __post_init__(self) -> None:
        check_range("latitude", self.latitude, *OPTIONAL_RANGES["latitude"])
        check_range("longitude", self.longitude, *OPTIONAL_RANGES["longitude"])
        if self.sky not in _SKY_TEXT:
            sentence = f"The sky {self.sky!r} is not known; it must be one of {', '.join(_SKY_TEXT)}."
            raise ParameterError(sentence, "sky", ErrorCode.UNKNOWN)
        if self.utc_offset is not None:
            check_range("utc_offset", self.utc_offset, *UTC_OFFSET_RANGE)
        for name, day in (("first", self.first), ("last", self.last)):
            check_range(name, day.year, YEAR_RANGE[0] + 1, YEAR_RANGE[1] - 1, "The year")
        days_between(self.first, self.last)

    @property
    def location(self) -> ClockLocation:
        """Where, with the clock of the plan."""
        offset = round(self.longitude / 15) if self.utc_offset is None else self.utc_offset
        return ClockLocation(self.latitude, self.longitude, float(offset))


@dataclass(frozen=True)
class MeasuredSkies:
    """A folder of probes, and the days of it that count; None is no limit."""

    folder: Path
    """Of the probes."""
    first: date | None = None
    """The first day. None: any."""
    last: date | None = None
    """The last day. None: any."""
    utc_offset: float = 0.0
    """Hours, of the clock that days and times are told by."""

    def days(self) -> dict[date, dict[float, Path]]:
        """List the maps of each day that counts.

        Raises:
            ProbeError: the folder has no probe.
            ParameterError: it has none of these days.
        """
        days = probe_days(self.folder, self.utc_offset)
        first, last = self.first or min(days), self.last or self.first or max(days)
        days_between(first, last)
        chosen = {day: files for day, files in days.items() if first <= day <= last}
        if not chosen:
            when = f"on {first}" if first == last else f"from {first} to {last}"
            sentence = f"{self.folder} has no probes {when}; it has some from {min(days)} to {max(days)}."
            raise ParameterError(sentence, "first", ErrorCode.MISSING)
        return chosen


PlanSkies = ModelledSkies | MeasuredSkies


def plan_photos(skies: PlanSkies, question: PlanRequest, progress: DayProgress = iter) -> Plan:
    """Plan the best day.

    Args:
        skies: of the days to compare.
        question: what is to be photographed.
        progress: passes the days on as they are read.

    Raises:
        ParameterError: no window of any day has light.
    """
    if isinstance(skies, MeasuredSkies):
        files = skies.days()
        return make_plan(list(files), lambda day, _: _read_day(day, files[day]), question, progress=progress)
    location, weather, days = skies.location, skies.sky, days_between(skies.first, skies.last)

    def read(day: date, coarse: bool) -> SkyDay:
        return modelled_day(location, day, weather, coarse=coarse)

    return make_plan(days, read, question, clear_brightness(location, days), progress)


def plan_record(skies: PlanSkies, plan: Plan) -> Json:
    """Return the question and its answer as JSON.

    Args:
        skies: what was planned for.
        plan: its answer.
    """
    if isinstance(skies, MeasuredSkies):
        return {"sky": "probes", "utc_offset": skies.utc_offset, **plan.to_dict()}
    return {**asdict(skies.location), "sky": skies.sky, **plan.to_dict()}


def plan_title(skies: PlanSkies, plan: Plan) -> str:
    """Format a headline: when and where, under which sky.

    Args:
        skies: what was planned for.
        plan: its answer.
    """
    if isinstance(skies, MeasuredSkies):
        return f"{plan.day}, measured skies of {skies.folder.name}"
    location = skies.location
    north, east = "N" if location.latitude >= 0 else "S", "E" if location.longitude >= 0 else "W"
    location_text = f"{abs(location.latitude):.2f}° {north} {abs(location.longitude):.2f}° {east}"
    return f"{plan.day}, {location_text}, {_SKY_TEXT[skies.sky]}"


def plan_conditions(skies: PlanSkies, question: PlanRequest) -> str:
    """Format what a plan holds for.

    Args:
        skies: what was planned for.
        question: what is to be photographed.
    """
    offset = skies.utc_offset if isinstance(skies, MeasuredSkies) else skies.location.utc_offset
    facing = "surface all around and up" if question.facing is None else f"surface facing {question.facing:g}°"
    minutes, sign = round(abs(offset) * 60), "+" if offset >= 0 else "-"
    clock = f"UTC{sign}{minutes // 60:02d}:{minutes % 60:02d}"
    return f"{facing}, {question.shots} photos a window, noise {question.noise:g} %, times {clock}"


_SKY_TEXT = {"clear": "clear sky", "overcast": "overcast", "mixed": "broken cloud"}


_WIDTH, _HEIGHT = 1600, 900
MAX_USEFUL_ERROR = 45.0  # deg, a larger error says nothing of the normal
MIN_GAIN, MAX_GAIN = 1.0, 300.0  # the ends of the scale of colors

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
    canvas = Image.new("RGB", (_WIDTH, _HEIGHT), BACKGROUND)
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
    draw_lines(canvas, [np.array([[_RIGHT, _ROWS + 30], [_WIDTH - 40, _ROWS + 30]])], LINE, 1.0)
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

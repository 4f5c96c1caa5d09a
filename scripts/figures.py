"""The figures of docs/ that are drawn from the project's own geometry, skies and measurements.

`python -m scripts.make_pictures` writes them; `stereo-plan` and `stereo-normals` also print their numbers.
"""

from datetime import date

import click
import numpy as np
from numpy.typing import ArrayLike
from PIL import Image

from export.stereo.evaluate import SEASONS, Trial, normal_angles, photograph_subject, run_session
from export.stereo.renders import Subject
from export.stereo.surfaces import random_relief
from lighting.color import srgb_encode
from lighting.geometry import Floats, Pinhole, angles, camera_pixel, direction, latlong_pixel
from lighting.preview.drawing import (
    BACKGROUND,
    MUTED,
    PANEL,
    SUN,
    TEXT,
    WHITE,
    Srgb,
    TextStyle,
    draw_arrow_head,
    draw_lines,
    draw_outlined_lines,
    draw_polygon,
    draw_suns,
    draw_text,
    draw_text_inside,
    rounded_mask,
)
from lighting.stereo.light_vectors import gray_skies
from lighting.stereo.normal_network import Network
from lighting.stereo.planner import (
    ModelledSkies,
    draw_plan,
    format_angle_error,
    plan_conditions,
    plan_photos,
    plan_title,
)
from lighting.stereo.schedule import Plan, PlanRequest, format_clock

# axes: the frame, the angles and the environment map, all by lighting.geometry itself.

RED: Srgb = (255, 128, 116)
GREEN: Srgb = (140, 214, 130)
BLUE: Srgb = (130, 180, 255)

CHART_SIZE = (1600, 656)
CHART_MAP = (88, 84, 960, 480)  # x, y, width, height
SKETCH = (1104, 84, 456, 480)
AZIMUTH, ELEVATION = 50.0, 35.0  # deg, the sun of the chart
VIEWER = np.array([-1.0, 2.6, 4.6])  # where the sketch is seen from
AXIS_LENGTH = {"+X": 1.4, "-X": 1.1, "+Y": 1.5, "-Y": 0.0, "+Z": 1.0, "-Z": 1.9}
AXES = (
    ("+X right", (1, 0, 0), RED),
    ("-X left", (-1, 0, 0), RED),
    ("+Y up", (0, 1, 0), GREEN),
    ("-Y down", (0, -1, 0), GREEN),
    ("+Z behind", (0, 0, 1), BLUE),
    ("-Z forward", (0, 0, -1), BLUE),
)


def draw_axes() -> Image.Image:
    """Return the chart of the map, the frame and the angles."""
    canvas = Image.new("RGB", CHART_SIZE, BACKGROUND)
    for (x, y, width, height), caption, panel in (
        (
            CHART_MAP,
            "Environment map: width = 2 x height, row 0 is the zenith, the camera looks at the center",
            _chart_map(),
        ),
        (SKETCH, "Frame: right-handed, the camera at its origin", _chart_sketch()),
    ):
        draw_text(canvas, (x, y - 36), caption, TextStyle(19, TEXT))
        canvas.paste(panel, (x, y), rounded_mask((width, height), 10))
    _chart_ticks(canvas)
    return canvas


def _chart_map() -> Image.Image:
    """The lat-long image with its grid, its axes and the sun's two angles."""
    _, _, width, height = CHART_MAP
    shade = np.linspace(0, 1, height)[:, None]
    sky, ground = (
        np.array([[58, 92, 140]]) * (1 - shade) + np.array([[150, 176, 204]]) * shade,
        np.array([[72, 68, 64]]),
    )
    rows = np.where(shade < 0.5, sky, ground)
    picture = Image.fromarray(np.repeat(rows[:, None], width, axis=1).astype(np.uint8))
    for degree in range(-150, 180, 30):
        draw_lines(picture, [_line(direction(degree, np.linspace(-90, 90, 7)))], WHITE, 1, 0.28)
    for degree in range(-60, 90, 30):
        draw_lines(
            picture,
            [_line(direction(np.linspace(-179.99, 179.99, 13), degree))],
            WHITE,
            1,
            0.7 if degree == 0 else 0.28,
        )
    _chart_angles(picture)
    for name, axis, colour in AXES:
        _label_axis(picture, name, axis, colour)
    return picture


def _line(directions: Floats) -> Floats:
    """Pixels of directions on the map."""
    return latlong_pixel(directions, CHART_MAP[3])


def _label_axis(picture: Image.Image, name: str, axis: ArrayLike, colour: Srgb) -> None:
    """A dot and a name at the axis' pixel; the poles fill a row, +Z lies on the seam."""
    x, y = _line(np.asarray(axis, dtype=float))
    width, height = picture.size
    if 0 < y < height:
        for spot in (x, x + width if x == 0 else x):
            draw_polygon(picture, _circle((spot, y), 6), colour)
        anchors = ((14.0, "ls"), (width - 14.0, "rs")) if x == 0 else ((x, "ms"),)
        for spot, anchor in anchors:
            draw_text(picture, (spot, y - 14), name, TextStyle(20, colour, anchor=anchor, shaded=True))
        return
    draw_lines(picture, [np.array([[0, y], [width, y]])], colour, 8)
    draw_text(
        picture,
        (width / 2, 28 if y == 0 else height - 16),
        f"{name} (the whole row)",
        TextStyle(20, colour, anchor="ms", shaded=True),
    )


def _chart_angles(picture: Image.Image) -> None:
    """The sun with its azimuth along the horizon and its elevation above it."""
    foot, sun = _line(direction(AZIMUTH, 0)), _line(direction(AZIMUTH, ELEVATION))
    _arrow(picture, np.array([_line(direction(0, 0)), foot]), SUN)
    _arrow(picture, np.array([foot, sun + np.array([0, 16])]), SUN)
    draw_suns(picture, [sun], SUN, 9)
    draw_text(
        picture, (foot[0] - 8, foot[1] + 26), "azimuth grows to the right", TextStyle(18, SUN, anchor="ms", shaded=True)
    )
    draw_text(
        picture, (foot[0] + 12, (foot[1] + sun[1]) / 2), "elevation", TextStyle(18, SUN, anchor="lm", shaded=True)
    )


def _chart_ticks(canvas: Image.Image) -> None:
    """Degrees along the map's lower and left edge."""
    left, top, _, height = CHART_MAP
    for degree in range(-180, 181, 30):
        x = left + (degree / 360 + 0.5) * CHART_MAP[2]
        draw_text(canvas, (x, top + height + 12), f"{degree}°", TextStyle(17, MUTED, anchor="ma"))
    draw_text(canvas, (left + CHART_MAP[2] / 2, top + height + 38), "azimuth", TextStyle(17, MUTED, anchor="ma"))
    for degree in range(-90, 91, 30):
        y = top + (0.5 - degree / 180) * height
        draw_text(canvas, (left - 12, y), f"{degree}°", TextStyle(17, MUTED, anchor="rm"))


def _chart_sketch() -> Image.Image:
    """The camera at the origin, the axes and the sun's two angles, seen from above its left shoulder."""
    picture = Image.new("RGB", SKETCH[2:], PANEL)
    ground = np.array([(x, 0.0, z) for x, z in ((-1.7, -2.0), (1.7, -2.0), (1.7, 1.3), (-1.7, 1.3))])
    draw_polygon(picture, _project(ground), WHITE, 0.05)
    for name, axis, colour in AXES:
        tip = np.asarray(axis, dtype=float) * AXIS_LENGTH[name[:2]]
        if axis[1] >= 0:
            _arrow(picture, _project(np.stack([np.zeros(3), tip])), colour)
            above = 20 if axis[2] > 0 else -20  # the name clears the arrow head
            draw_text_inside(picture, _project(tip) + np.array([0, above]), name, 19, colour)
    _chart_sun(picture)
    _chart_camera(picture)
    return picture


def _chart_sun(picture: Image.Image) -> None:
    """Azimuth as an arc on the ground, elevation as one above it."""
    reach = 1.7
    sun, foot = reach * direction(AZIMUTH, ELEVATION), reach * np.cos(np.radians(ELEVATION)) * direction(AZIMUTH, 0)
    draw_outlined_lines(picture, [_project(np.stack([foot, np.zeros(3), sun]))], MUTED, 1.5)
    _arrow(picture, _project(1.25 * direction(np.linspace(0, AZIMUTH, 24), 0)), SUN)
    _arrow(picture, _project(1.25 * direction(AZIMUTH, np.linspace(0, ELEVATION, 24))), SUN)
    draw_suns(picture, [_project(sun)], SUN, 9)
    x, y = _project(1.25 * direction(0.6 * AZIMUTH, 0))
    draw_text(picture, (x, y - 14), "azimuth", TextStyle(16, SUN, anchor="mm", shaded=True))
    x, y = _project(1.29 * direction(AZIMUTH, ELEVATION / 2))
    draw_text(picture, (x + 6, y), "elevation", TextStyle(16, SUN, anchor="lm", shaded=True))


def _chart_camera(picture: Image.Image) -> None:
    """A small pyramid that opens along the viewing direction."""
    corners = 0.55 * np.array([(-0.42, 0.3, -1), (0.42, 0.3, -1), (0.42, -0.3, -1), (-0.42, -0.3, -1)])
    frame = _project(np.concatenate([corners, corners[:1]]))
    draw_polygon(picture, frame, WHITE, 0.18)
    edges = [_project(np.stack([np.zeros(3), corner])) for corner in corners]
    draw_lines(picture, [frame, *edges], WHITE, 2)


def _project(points: Floats) -> Floats:
    """Pixels (..., 2) of points (..., 3) in the sketch."""
    azimuth, elevation = angles(np.array([0.1, 0.2, -0.3]) - VIEWER)
    return camera_pixel(points - VIEWER, Pinhole(*SKETCH[2:], 36.0, float(azimuth), float(elevation)))


def _arrow(picture: Image.Image, path: Floats, colour: Srgb) -> None:
    """A line (N, 2) with a head at its end."""
    draw_outlined_lines(picture, [path], colour, 3)
    towards = path[-1] - path[-2]
    draw_arrow_head(picture, path[-1], towards / np.hypot(*towards), colour)


def _circle(center: tuple[float, float], radius: float) -> Floats:
    """Corners of a dot."""
    turn = np.linspace(0, 2 * np.pi, 48)
    return np.stack([center[0] + radius * np.cos(turn), center[1] + radius * np.sin(turn)], axis=-1)


# stereo-plan: a relief on a south wall in Bregenz, under skies that the project models.

PLAN_WALL = PlanRequest(facing=180.0)
PLAN_DAYS = (date(2026, 3, 20), date(2026, 6, 21), date(2026, 12, 21))


def _wall_plan(day: date, sky: str) -> tuple[ModelledSkies, Plan]:
    skies = ModelledSkies(47.5, 9.75, day, day, sky)  # type: ignore[arg-type]
    return skies, plan_photos(skies, PLAN_WALL)


def draw_stereo_plan() -> Image.Image:
    """Return the plan of a clear day in June; print those of three days under two skies."""
    for day in PLAN_DAYS:
        for sky in ("clear", "mixed"):
            skies, plan = _wall_plan(day, sky)
            best = ", ".join(
                f"{w.hours} h {format_clock(w.start)} to {format_clock(w.end)} "
                f"{format_angle_error(w.error)} (gain {w.gain:.0f})"
                for w in plan.windows
            )
            click.echo(f"{plan_title(skies, plan)}: {best}")
    skies, plan = _wall_plan(PLAN_DAYS[1], "clear")
    title = f"When to photograph: {plan_title(skies, plan)}"
    return Image.fromarray(draw_plan(plan, title, plan_conditions(skies, PLAN_WALL)))


# stereo-normals: a made vessel, its normals as found on two simulated days, and how far they are off.

VESSEL_SIDE, VESSEL_SEED, WORST_ERROR = 192, 37, 45.0  # pixels; of the shape; deg, drawn white


def draw_stereo_normals() -> Image.Image:
    """Return photos at 9, 12 and 16 h and normals by search and with the network; print their errors."""
    subject = Subject("vessel", "made", random_relief(VESSEL_SIDE, np.random.default_rng(VESSEL_SEED)))
    surface, network, rows = subject.surface, Network.load(), []
    for name in ("47° N, March", "47° N, June"):
        trial = Trial(SEASONS[name], shadows=True)
        photos = photograph_subject(subject, trial, gray_skies(trial.day.skies()))[[0, 3, 7], ..., 0]
        (found,) = run_session([subject], trial, network)
        search, both = found.errors()
        errors = (f"{np.median(part):.1f} / {part.mean():.1f}" for part in (search, both))
        click.echo(" ".join((name, *errors)))
        tiles = [np.repeat(srgb_encode(photo / photos.max())[..., None], 3, axis=-1) for photo in photos]
        maps = (surface.normals, found.search, found.network)
        tiles += [(normals + 1) / 2 * surface.mask[..., None] for normals in maps]
        off = np.clip(normal_angles(found.network, surface.normals) / WORST_ERROR, 0, 1) * surface.mask
        rows.append(np.concatenate([*tiles, np.repeat(off[..., None], 3, axis=-1)], axis=1))
    pixels = np.round(255 * np.concatenate(rows)).astype(np.uint8)
    return Image.fromarray(pixels)

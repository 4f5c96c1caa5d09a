"""Draw docs/axes.png: the frame, the angles and the environment map, all by lighting.geometry itself.

python docs/make_axes.py
"""

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image

from lighting.drawing import (
    BACKGROUND,
    MUTED,
    PANEL,
    SUN,
    TEXT,
    WHITE,
    Colour,
    Style,
    arrow_head,
    polygon,
    rounded,
    shaded_stroke,
    stroke,
    sun_marks,
    write,
    write_inside,
)
from lighting.geometry import Floats, Pinhole, angles, camera_pixel, direction, latlong_pixel

RED: Colour = (255, 128, 116)
GREEN: Colour = (140, 214, 130)
BLUE: Colour = (130, 180, 255)

SIZE = (1600, 656)
MAP = (88, 84, 960, 480)  # x, y, width, height
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


def main() -> None:
    """Write axes.png beside this script."""
    canvas = Image.new("RGB", SIZE, BACKGROUND)
    for (x, y, width, height), title, panel in (
        (MAP, "Environment map: width = 2 x height, row 0 is the zenith, the camera looks at the centre", draw_map()),
        (SKETCH, "Frame: right-handed, the camera at its origin", draw_sketch()),
    ):
        write(canvas, (x, y - 36), title, Style(19, TEXT))
        canvas.paste(panel, (x, y), rounded((width, height), 10))
    draw_ticks(canvas)
    canvas.save(Path(__file__).parent / "axes.png", optimize=True)


def draw_map() -> Image.Image:
    """The lat-long image with its grid, its axes and the sun's two angles."""
    _, _, width, height = MAP
    shade = np.linspace(0, 1, height)[:, None]
    sky, ground = (
        np.array([[58, 92, 140]]) * (1 - shade) + np.array([[150, 176, 204]]) * shade,
        np.array([[72, 68, 64]]),
    )
    rows = np.where(shade < 0.5, sky, ground)
    picture = Image.fromarray(np.repeat(rows[:, None], width, axis=1).astype(np.uint8))
    for angle in range(-150, 180, 30):
        stroke(picture, [line(direction(angle, np.linspace(-90, 90, 7)))], WHITE, 1, 0.28)
    for angle in range(-60, 90, 30):
        stroke(
            picture, [line(direction(np.linspace(-179.99, 179.99, 13), angle))], WHITE, 1, 0.7 if angle == 0 else 0.28
        )
    draw_angles(picture)
    for name, axis, colour in AXES:
        label_axis(picture, name, axis, colour)
    return picture


def line(directions: Floats) -> Floats:
    """Pixels of directions on the map."""
    return latlong_pixel(directions, MAP[3])


def label_axis(picture: Image.Image, name: str, axis: ArrayLike, colour: Colour) -> None:
    """A dot and a name at the axis' pixel; the poles fill a row, +Z lies on the seam."""
    x, y = line(np.asarray(axis, dtype=float))
    width, height = picture.size
    if 0 < y < height:
        for spot in (x, x + width if x == 0 else x):
            polygon(picture, circle((spot, y), 6), colour)
        anchors = ((14.0, "ls"), (width - 14.0, "rs")) if x == 0 else ((x, "ms"),)
        for spot, anchor in anchors:
            write(picture, (spot, y - 14), name, Style(20, colour, anchor=anchor, shaded=True))
        return
    stroke(picture, [np.array([[0, y], [width, y]])], colour, 8)
    write(
        picture,
        (width / 2, 28 if y == 0 else height - 16),
        f"{name} (the whole row)",
        Style(20, colour, anchor="ms", shaded=True),
    )


def draw_angles(picture: Image.Image) -> None:
    """The sun with its azimuth along the horizon and its elevation above it."""
    foot, sun = line(direction(AZIMUTH, 0)), line(direction(AZIMUTH, ELEVATION))
    arrow(picture, np.array([line(direction(0, 0)), foot]), SUN)
    arrow(picture, np.array([foot, sun + np.array([0, 16])]), SUN)
    sun_marks(picture, [sun], SUN, 9)
    write(picture, (foot[0] - 8, foot[1] + 26), "azimuth grows to the right", Style(18, SUN, anchor="ms", shaded=True))
    write(picture, (foot[0] + 12, (foot[1] + sun[1]) / 2), "elevation", Style(18, SUN, anchor="lm", shaded=True))


def draw_ticks(canvas: Image.Image) -> None:
    """Degrees along the map's lower and left edge."""
    left, top, _, height = MAP
    for angle in range(-180, 181, 30):
        x = left + (angle / 360 + 0.5) * MAP[2]
        write(canvas, (x, top + height + 12), f"{angle}°", Style(17, MUTED, anchor="ma"))
    write(canvas, (left + MAP[2] / 2, top + height + 38), "azimuth", Style(17, MUTED, anchor="ma"))
    for angle in range(-90, 91, 30):
        y = top + (0.5 - angle / 180) * height
        write(canvas, (left - 12, y), f"{angle}°", Style(17, MUTED, anchor="rm"))


def draw_sketch() -> Image.Image:
    """The camera at the origin, the axes and the sun's two angles, seen from above its left shoulder."""
    picture = Image.new("RGB", SKETCH[2:], PANEL)
    ground = np.array([(x, 0.0, z) for x, z in ((-1.7, -2.0), (1.7, -2.0), (1.7, 1.3), (-1.7, 1.3))])
    polygon(picture, project(ground), WHITE, 0.05)
    for name, axis, colour in AXES:
        tip = np.asarray(axis, dtype=float) * AXIS_LENGTH[name[:2]]
        if axis[1] >= 0:
            arrow(picture, project(np.stack([np.zeros(3), tip])), colour)
            above = 20 if axis[2] > 0 else -20  # the name clears the arrow head
            write_inside(picture, project(tip) + np.array([0, above]), name, 19, colour)
    draw_sun(picture)
    draw_camera(picture)
    return picture


def draw_sun(picture: Image.Image) -> None:
    """Azimuth as an arc on the ground, elevation as one above it."""
    reach = 1.7
    sun, foot = reach * direction(AZIMUTH, ELEVATION), reach * np.cos(np.radians(ELEVATION)) * direction(AZIMUTH, 0)
    shaded_stroke(picture, [project(np.stack([foot, np.zeros(3), sun]))], MUTED, 1.5)
    arrow(picture, project(1.25 * direction(np.linspace(0, AZIMUTH, 24), 0)), SUN)
    arrow(picture, project(1.25 * direction(AZIMUTH, np.linspace(0, ELEVATION, 24))), SUN)
    sun_marks(picture, [project(sun)], SUN, 9)
    x, y = project(1.25 * direction(0.6 * AZIMUTH, 0))
    write(picture, (x, y - 14), "azimuth", Style(16, SUN, anchor="mm", shaded=True))
    x, y = project(1.29 * direction(AZIMUTH, ELEVATION / 2))
    write(picture, (x + 6, y), "elevation", Style(16, SUN, anchor="lm", shaded=True))


def draw_camera(picture: Image.Image) -> None:
    """A small pyramid that opens along the viewing direction."""
    corners = 0.55 * np.array([(-0.42, 0.3, -1), (0.42, 0.3, -1), (0.42, -0.3, -1), (-0.42, -0.3, -1)])
    frame = project(np.concatenate([corners, corners[:1]]))
    polygon(picture, frame, WHITE, 0.18)
    edges = [project(np.stack([np.zeros(3), corner])) for corner in corners]
    stroke(picture, [frame, *edges], WHITE, 2)


def project(points: Floats) -> Floats:
    """Pixels (..., 2) of points (..., 3) in the sketch."""
    azimuth, elevation = angles(np.array([0.1, 0.2, -0.3]) - VIEWER)
    return camera_pixel(points - VIEWER, Pinhole(*SKETCH[2:], 36.0, float(azimuth), float(elevation)))


def arrow(picture: Image.Image, path: Floats, colour: Colour) -> None:
    """A line (N, 2) with a head at its end."""
    shaded_stroke(picture, [path], colour, 3)
    towards = path[-1] - path[-2]
    arrow_head(picture, path[-1], towards / np.hypot(*towards), colour)


def circle(centre: tuple[float, float], radius: float) -> Floats:
    """Corners of a dot."""
    turn = np.linspace(0, 2 * np.pi, 48)
    return np.stack([centre[0] + radius * np.cos(turn), centre[1] + radius * np.sin(turn)], axis=-1)


if __name__ == "__main__":
    main()

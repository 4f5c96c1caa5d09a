"""The preview: a picture of a photo's light, with the photo, the sky, the map, three spheres, and all in words."""

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import wrap

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.color import SRGB_LINEAR, check_envmap, check_pixels, srgb_bytes
from lighting.envmap.projection import photo_camera
from lighting.formatting import format_azimuth, format_side, format_sun_elevation, format_tilt
from lighting.geometry import Floats, Pinhole, fit_in_box, latlong_pixel
from lighting.ground import spot_warnings
from lighting.prediction import EstimatedLight, Segments, check_estimate
from lighting.preview import drawing
from lighting.preview.compass import draw_compass, draw_regions, frame_directions, split_at_seam
from lighting.preview.drawing import (
    BACKGROUND,
    MUTED,
    SUN,
    TEXT,
    WHITE,
    TextStyle,
    draw_suns,
    draw_text,
    rounded_mask,
    text_width,
)
from lighting.preview.spheres import (
    SphereScene,
    build_sphere_scene,
    draw_sphere_scene,
    insert_balls,
    limit_elevation,
    sphere_centers,
)
from lighting.records import MIN_SUITABLE, Lighting, SunCandidate, describe_candidates, describe_trust

PHOTO_SIDE = 1000  # pixels, least length of the photo's longer side if it has as many

_MAX_RADIUS = 90.0  # deg: where a tenth of the probability lies farther off, the sun may as well be opposite
_MIN_DOUBTFUL = 0.25  # probability of direct sunlight from which on its absence is not certain
_WARNING_LETTERS = 160  # of a line of warnings
PREVIEW_WIDTH = 1600  # of the whole picture
_MARGIN = 40  # around all
_GAP = 24  # between panels
_HEADER = 78  # height of the headline above the panels
_WARNING_LINE = 26  # height of a line of warnings, which stand below the headline
_CAPTION = 32  # height of the line above each panel
_LETTERS = 18  # size of a caption's letters
_CELL = 76  # height of one number with its name
_UPRIGHT_HEIGHT = 680  # of the upper row when the photo is upright
_UPRIGHT_MAP_HEIGHT = 440  # of the map below it
_MAP_WORDS = (  # share of the map's width, word and anchor
    (0.25, "90° left", "ms"), (0.5, "front", "ms"), (0.75, "90° right", "ms"),
    (0.008, "behind", "ls"), (0.992, "behind", "rs"),
)  # fmt: skip


@dataclass(frozen=True)
class _Box:
    """A rectangle by its upper left corner and its size."""

    x: int
    """Column of the left edge, pixels."""
    y: int
    """Row of the upper edge, pixels."""
    width: int
    """Columns, pixels."""
    height: int
    """Rows, pixels."""


@dataclass(frozen=True)
class _Layout:
    """Where everything goes."""

    height: int  # of the whole picture
    photo: _Box
    compass: _Box
    envmap: _Box
    spheres: _Box
    cells: list[tuple[int, int]]  # upper left corners of the numbers


def expose_photo(photo: NDArray[np.uint8], gain: float) -> NDArray[np.uint8]:
    """Return a photo (H, W, 3) sRGB whose linear values are multiplied.

    Args:
        photo: (H, W, 3) sRGB.
        gain: 0 or more.
    """
    return photo if gain == 1 else srgb_bytes(SRGB_LINEAR[photo] * np.float32(gain))


def draw_preview_pixels(
    photo: NDArray[np.uint8],
    estimate: EstimatedLight,
    envmap: NDArray[np.float32],
    *,
    photo_sun: bool | None = None,
) -> NDArray[np.uint8]:
    """The picture of a photo and its light, as sRGB pixels (H, 1600, 3).

    Args:
        photo: (H, W, 3) sRGB, upright, at the exposure of the light.
        estimate: the photo's light.
        envmap: (H, 2H, 3), the light's own map in the photo's linear values, with or without the sun's disc.
        photo_sun: whether the sun shines in the photo itself; None: as in the light.

    Raises:
        ParameterError: `estimate` is no EstimatedLight.
        PhotoError: `photo` is no photo's pixels.
        EnvironmentMapError: `envmap` is none.
    """
    check_estimate(estimate)
    photo = check_pixels(photo)
    lighting = estimate.lighting
    envmap = check_envmap(envmap)
    aspect, numbers = photo.shape[1] / photo.shape[0], _format_numbers(lighting)
    plan = _lay_out(aspect, len(numbers), len(_note_lines(lighting)))
    compass = draw_compass(estimate, aspect, plan.compass.width)
    scene, photo_scene = _sphere_scenes(envmap, lighting, plan.spheres)
    camera = photo_camera(lighting, photo.shape[1], photo.shape[0])
    photo_text = _format_photo_caption(camera, plan.photo.width, balls=photo_scene is not None)
    canvas = Image.new("RGB", (PREVIEW_WIDTH, plan.height), BACKGROUND)
    _draw_headline(canvas, lighting)
    map_panel = _draw_map_panel(envmap, lighting, aspect, plan.envmap)
    photo_panel = _draw_photo_panel(photo, lighting, plan.photo, photo_scene, estimate.segments, photo_sun)
    for box, caption, panel in (
        (plan.photo, photo_text, photo_panel),
        (plan.compass, "Sun compass: the sky from above, the photo's view outlined", compass),
        (plan.envmap, "Environment map, the photo's view outlined", map_panel),
        (plan.spheres, "Mirror, glossy and gray in this light", _spheres_panel(scene, lighting, plan.spheres)),
    ):
        draw_text(canvas, (box.x, box.y - _CAPTION + 4), caption, TextStyle(_LETTERS, MUTED))
        canvas.paste(panel, (box.x, box.y), rounded_mask(panel.size, 10))
    for corner, (name, value) in zip(plan.cells, numbers, strict=True):
        draw_text(canvas, corner, name, TextStyle(16, MUTED))
        draw_text(canvas, (corner[0], corner[1] + 22), value, TextStyle(25, TEXT))
    return np.asarray(canvas)


def draw_candidates_pixels(
    photo: NDArray[np.uint8],
    suns: Sequence[SunCandidate],
    views: Sequence[tuple[Lighting, NDArray[np.float32]]],
    segments: Segments | None = None,
    *,
    photo_sun: bool | None = None,
) -> NDArray[np.uint8]:
    """The photo in the light of each of its suns, side by side, as sRGB pixels (H, 1600, 3).

    Args:
        photo: (H, W, 3) sRGB, upright.
        suns: N, one or more.
        views: N, the light with that sun, and its map (H, 2H, 3) in the photo's linear values.
        segments: of the photo; None: nothing stands before its ground.
        photo_sun: whether the sun shines in the photo itself; None: as in the lights.
    """
    photo, count = check_pixels(photo), len(suns)
    aspect = min(max(photo.shape[1] / photo.shape[0], 0.5), 2.0)
    width = (PREVIEW_WIDTH - 2 * _MARGIN - (count - 1) * _GAP) // count
    height = round(min(width / aspect, _UPRIGHT_HEIGHT))
    top, below = _MARGIN + _CAPTION, _MARGIN + _CAPTION + height + _GAP
    canvas = Image.new("RGB", (PREVIEW_WIDTH, below + width // 2 + _MARGIN), BACKGROUND)
    for number, (sun, (light, envmap)) in enumerate(zip(suns, views, strict=True)):
        left = _MARGIN + number * (width + _GAP)
        box, spheres = _Box(left, top, width, height), _Box(left, below, width, width // 2)
        scene, in_photo = _sphere_scenes(check_envmap(envmap), light, spheres)
        where = f"{format_azimuth(sun.azimuth)}, {format_sun_elevation(sun.elevation)}"
        caption = f"--pick {number + 1}: {where} ({100 * sun.probability:.0f} %)"
        size = _fit_text_size(caption, _LETTERS + 2, width)
        draw_text(canvas, (left, top - _CAPTION + 2), caption, TextStyle(size, TEXT))
        for place, panel in (
            (box, _draw_photo_panel(photo, light, box, in_photo, segments, photo_sun)),
            (spheres, _spheres_panel(scene, light, spheres)),
        ):
            canvas.paste(panel, (place.x, place.y), rounded_mask(panel.size, 10))
    return np.asarray(canvas)


def _sphere_scenes(
    envmap: NDArray[np.float32], lighting: Lighting, box: _Box
) -> tuple[SphereScene, SphereScene | None]:
    """The spheres of a panel, and those that stand in the photo; None: none do."""
    centers = sphere_centers(box.width / box.height, limit_elevation(lighting))
    scene = build_sphere_scene(envmap, lighting.sun_direction, centers)
    return scene, scene if lighting.sun_irradiance is not None and lighting.spot_pixel is not None else None


def _spheres_panel(scene: SphereScene, lighting: Lighting, box: _Box) -> Image.Image:
    return Image.fromarray(draw_sphere_scene(scene, lighting, box.width, box.height))


# Headline, warnings and numbers.


def _draw_headline(canvas: Image.Image, lighting: Lighting) -> None:
    """Write where the sun stands and how sure that is, by which network and evidence, and the warnings."""
    visible, hedge = lighting.sun_shines, "perhaps " if lighting.radius_90 > _MAX_RADIUS else ""
    where = f"{format_azimuth(lighting.sun_azimuth)}, {format_sun_elevation(lighting.sun_elevation)}"
    none = "No direct sun" if lighting.sun_visibility < _MIN_DOUBTFUL else "Probably no direct sun"
    title = f"Sun {hedge}{where}" if visible else none
    doubtful = lighting.suitable is not None and lighting.suitable < MIN_SUITABLE
    title = f"Perhaps no outdoor daylight photo; if it is: {title[0].lower()}{title[1:]}" if doubtful else title
    sources = _format_sources(lighting)
    size = _fit_text_size(title, 28 if doubtful else 38, PREVIEW_WIDTH - 2 * _MARGIN - _GAP - text_width(sources, 18))
    draw_text(canvas, (_MARGIN, _MARGIN - 6), title, TextStyle(size, TEXT if doubtful or not visible else SUN))
    if visible and not lighting.radius_90:
        accuracy = "set by hand"
    elif visible:
        half, most = _format_short(lighting.radius_50), _format_short(lighting.radius_90)
        accuracy = f"half of the probability lies within {half}°, 90 % within {most}°; {describe_trust(lighting)}"
    elif lighting.sun_elevation < 0:
        accuracy = f"twilight: the sun is {where}"
    else:
        accuracy = (
            f"an overcast or shaded scene; if the sun shone, it would {hedge}be {where}; {describe_trust(lighting)}"
        )
    model = f"{lighting.model_name} {lighting.model_version}"
    size = _fit_text_size(accuracy, 20, PREVIEW_WIDTH - 2 * _MARGIN - _GAP - text_width(model, 18))
    draw_text(canvas, (_MARGIN, _MARGIN + 40), accuracy, TextStyle(size, MUTED))
    draw_text(canvas, (PREVIEW_WIDTH - _MARGIN, _MARGIN + 40), model, TextStyle(18, MUTED, anchor="ra"))
    draw_text(canvas, (PREVIEW_WIDTH - _MARGIN, _MARGIN + 8), sources, TextStyle(18, MUTED, anchor="ra"))
    for number, line in enumerate(_note_lines(lighting)):
        draw_text(canvas, (_MARGIN, _MARGIN + 70 + number * _WARNING_LINE), line, TextStyle(18, TEXT))


def _fit_text_size(text: str, size: int, width: float) -> int:
    """The size of a text's letters, smaller where the text would be wider than that."""
    return min(size, int(size * width / text_width(text, size)))


def _note_lines(lighting: Lighting) -> list[str]:
    """Where else the sun may be, the record's warnings, and why no ball stands in the photo, as wide as the picture."""
    warnings = [f"Warning: {warning}" for warning in (*lighting.warnings, *spot_warnings(lighting))]
    others = describe_candidates(lighting).capitalize()
    return [line for text in (others, *warnings) for line in wrap(text, _WARNING_LETTERS)]


def _format_sources(lighting: Lighting) -> str:
    """The evidence if it is more than the pixels, and the camera's heading if it is known."""
    sources = [f"from {', '.join(lighting.evidence)}"] if len(lighting.evidence) > 1 else []
    heading = [] if lighting.camera_heading is None else [f"camera heading {round(lighting.camera_heading) % 360}°"]
    return "; ".join(sources + heading)


def _format_short(value: float) -> str:
    """One decimal below 10."""
    return f"{value:.1f}" if value < 9.95 else f"{value:.0f}"


def _format_numbers(lighting: Lighting) -> list[tuple[str, str]]:
    """Names and values of the record, in words; a sun that was set by hand has no radii."""
    azimuth = {0: "ahead", 180: "behind"}.get(round(abs(lighting.sun_azimuth)), format_side(lighting.sun_azimuth))
    radii = f"{_format_short(lighting.radius_50)}° / {_format_short(lighting.radius_90)}°"
    return [
        ("Sun azimuth", azimuth),
        ("Sun elevation", f"{lighting.sun_elevation:.1f}°"),
        ("50 % / 90 % within", radii if lighting.radius_90 else "by hand"),
        ("Direct sun", f"{100 * lighting.sun_visibility:.0f} %"),
        ("Turbidity", f"{lighting.turbidity:.1f}"),
        ("Exposure", f"{lighting.exposure:.3g}"),
        ("Camera elevation", format_tilt(lighting.camera_elevation, 1)),
        ("Camera roll", f"{round(lighting.camera_roll, 1) + 0.0:.1f}°"),
        ("Vertical field of view", f"{lighting.vertical_fov:.1f}°"),
    ]


# The layout and the panels.


def _lay_out(aspect: float, count: int, warnings: int = 0) -> _Layout:
    """The layout: photo and compass above, map and spheres below; numbers beside an upright photo, else at the foot.

    Args:
        aspect: the photo's width / height.
        count: of the numbers.
        warnings: lines of them.
    """
    inner, top = PREVIEW_WIDTH - 2 * _MARGIN, _MARGIN + _HEADER + warnings * _WARNING_LINE + _CAPTION
    aspect = min(max(aspect, 0.5), 2.0)
    upright = aspect < 0.9
    upper = _UPRIGHT_HEIGHT if upright else int((inner - _GAP) / (1 + aspect))
    photo = _Box(_MARGIN, top, round(upper * aspect), upper)
    compass = _Box(_MARGIN + photo.width + _GAP if upright else PREVIEW_WIDTH - _MARGIN - upper, top, upper, upper)
    below = top + upper + _GAP + _CAPTION
    lower = _UPRIGHT_MAP_HEIGHT if upright else photo.width // 2
    envmap = _Box(_MARGIN, below, 2 * lower, lower)
    left = _MARGIN + envmap.width + _GAP if upright else compass.x
    spheres = _Box(left, below, PREVIEW_WIDTH - _MARGIN - left, lower)
    foot = below + lower + _GAP
    if upright:
        column = compass.x + compass.width + _GAP + 8
        cells = [(column, top + _CELL * i) for i in range(count)]
        return _Layout(foot - _GAP + _MARGIN, photo, compass, envmap, spheres, cells)
    cells = [(_MARGIN + i * inner // count, foot) for i in range(count)]
    return _Layout(foot + _CELL - 10 + _MARGIN // 2, photo, compass, envmap, spheres, cells)


def _draw_photo_panel(
    photo: NDArray[np.uint8],
    lighting: Lighting,
    box: _Box,
    scene: SphereScene | None = None,
    segments: Segments | None = None,
    photo_sun: bool | None = None,
) -> Image.Image:
    """The photo with its horizon and its sun.

    Args:
        photo: (H, W, 3) sRGB, upright.
        lighting: the photo's light and camera.
        box: the panel's size.
        scene: balls to put on the photo's ground; None for none.
        segments: of the photo; None: nothing stands before its ground.
        photo_sun: whether the sun shines in the photo itself; None: as in the light.
    """
    panel = Image.new("RGB", (box.width, box.height), drawing.PANEL)
    height, width = photo.shape[:2]
    size = fit_in_box(width, height, box.width, box.height)
    picture = Image.fromarray(photo).resize(size, Image.Resampling.LANCZOS, reducing_gap=2.0)
    picture = picture if scene is None else insert_balls(picture, lighting, scene, segments, photo_sun)
    drawing.draw_horizon(picture, lighting)
    drawing.draw_sun(picture, lighting)
    panel.paste(picture, ((box.width - size[0]) // 2, (box.height - size[1]) // 2))
    return panel


def _format_photo_caption(camera: Pinhole, width: int, *, balls: bool) -> str:
    """What the panel shows in a photo, in words that fit its width.

    Args:
        camera: the photo's.
        width: of the panel, in pixels.
        balls: whether it draws them.
    """
    x, y = drawing.horizon_pixels(camera).T
    order = np.argsort(x)
    edges = np.interp([0.0, camera.width], x[order], y[order]) if len(x) else np.array([np.inf])
    shown = ["its horizon"] if edges.min() < camera.height and edges.max() > 0 else []
    if not balls:
        return f"Photo, with {shown[0]}" if shown else "Photo"
    text = f"Photo, with {' and '.join([*shown, 'three balls'])}"
    long = f"{text} in its light"
    return long if text_width(long, _LETTERS) <= width else text


def _draw_map_panel(envmap: NDArray[np.float32], lighting: Lighting, aspect: float, box: _Box) -> Image.Image:
    """The environment map with the sun, its regions and the photo's outline.

    Args:
        envmap: (H, 2H, 3) linear Rec.709, row 0 is the zenith.
        lighting: the sun, and the camera.
        aspect: the photo's width / height.
        box: the panel's size.
    """
    picture = Image.fromarray(drawing.display_srgb(envmap)).resize((box.width, box.height), Image.Resampling.LANCZOS)

    def pixels(directions: Floats) -> Floats:
        return latlong_pixel(directions, box.height)

    frame = list(split_at_seam(pixels(frame_directions(lighting, aspect)), box.width))
    drawing.draw_outlined_lines(picture, frame, WHITE, 1.5)
    draw_regions(picture, lighting, pixels)
    spots = pixels(lighting.sun_direction) + np.array([[-box.width, 0], [0, 0], [box.width, 0]])
    draw_suns(picture, spots, drawing.sun_mark_color(lighting), 6.5)
    for share, word, anchor in _MAP_WORDS:
        style = TextStyle(16, WHITE, anchor, shaded=True)
        draw_text(picture, (box.width * share, box.height - 12), word, style)
    return picture

"""The preview: a picture of a photo's light, with the photo, the sky, the map, three spheres, and all in words."""

from dataclasses import replace
from textwrap import wrap

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.color import SRGB_LINEAR, check_pixels, srgb_bytes
from lighting.envmap.latlong import EPSILON_IRRADIANCE
from lighting.envmap.projection import photo_camera
from lighting.envmap.surroundings import photo_context, render_view
from lighting.files.atomic import encode_png
from lighting.files.exr import check_envmap
from lighting.formatting import format_azimuth, format_side, format_sun_elevation, format_tilt
from lighting.ground import spot_warnings
from lighting.preview import drawing, panels
from lighting.preview.drawing import BACKGROUND, MUTED, SUN, TEXT, TextStyle, draw_text, rounded_mask, text_width
from lighting.preview.panels import GAP, LETTERS, MARGIN, WIDTH
from lighting.preview.spheres import SphereScene, build_sphere_scene, limit_pitch, render_sphere_scene, sphere_centers
from lighting.records import MIN_SUITABLE, EstimatedLight, Lighting, check_estimate

MAP_HEIGHT = 512  # rows of the environment map
PHOTO_SIDE = 1000  # pixels, least length of the photo's longer side if it has as many

_PNG_LEVEL = 2  # a third of the work of 6, for a ninth more bytes
_MAX_RADIUS = 90.0  # deg: where a tenth of the probability lies farther off, the sun may as well be opposite
_MIN_DOUBTFUL = 0.25  # probability of direct sunlight from which on its absence is not certain
_WARNING_LETTERS = 160  # of a line of warnings


def encode_preview_png(picture: NDArray[np.uint8]) -> bytes:
    """A preview as PNG, packed quickly.

    Args:
        picture: (H, W, 3) sRGB.
    """
    return encode_png(picture, compress_level=_PNG_LEVEL)


def draw_preview_pixels(
    photo: NDArray[np.uint8],
    estimate: EstimatedLight,
    *,
    surroundings: bool | None = None,
    detail: bool = True,
    lighting: Lighting | None = None,
    sun: bool | None = None,
) -> NDArray[np.uint8]:
    """The picture of a photo and its light, as sRGB pixels (H, 1600, 3).

    Args:
        photo: (H, W, 3) sRGB, upright.
        estimate: the photo's light.
        surroundings: whether the map shows the place; None where the network predicted it.
        detail: whether the map then has detail all around the photo.
        lighting: the light as it was changed by hand, which is shown; None: the estimate's.
        sun: whether the sun is in the map; None: by `Lighting.sun_painted`.

    Raises:
        ParameterError: `estimate` is no EstimatedLight.
        PhotoError: `photo` is no photo's pixels.
    """
    check_estimate(estimate)
    shown = estimate if lighting is None else replace(estimate, lighting=lighting)
    context = photo_context(estimate, photo, surroundings=surroundings, detail=detail)
    gain = shown.lighting.exposure / max(estimate.lighting.exposure, EPSILON_IRRADIANCE)
    envmap, _ = render_view(shown.lighting, MAP_HEIGHT, sun=sun, context=context)
    return _draw_preview(_expose(photo, gain), shown, envmap)


def _expose(photo: NDArray[np.uint8], gain: float) -> NDArray[np.uint8]:
    """A photo (H, W, 3) sRGB whose linear values are multiplied."""
    return photo if gain == 1 else srgb_bytes(SRGB_LINEAR[photo] * np.float32(gain))


def _draw_preview(
    photo: NDArray[np.uint8], estimate: EstimatedLight, envmap: NDArray[np.float32] | None = None
) -> NDArray[np.uint8]:
    """The same as sRGB pixels (H, 1600, 3).

    `envmap` (H, 2H, 3) is the light's own map in the photo's linear values, with or without the sun's disc; by default
    it is rendered here. The errors are those of `draw_preview_pixels`, and EnvironmentMapError for what is no map.
    """
    check_estimate(estimate)
    photo = check_pixels(photo)
    lighting = estimate.lighting
    if envmap is None:
        envmap, _ = render_view(lighting, MAP_HEIGHT, context=photo_context(estimate, photo))
    envmap = check_envmap(envmap)
    aspect, numbers = photo.shape[1] / photo.shape[0], _format_numbers(lighting)
    plan = panels.lay_out(aspect, len(numbers), len(_warning_lines(lighting)))
    compass = panels.draw_compass(estimate, aspect, plan.compass.width)
    centers = sphere_centers(plan.spheres.width / plan.spheres.height, limit_pitch(lighting))
    scene = build_sphere_scene(envmap, lighting.sun_direction, centers)
    photo_scene = scene if lighting.sun_irradiance is not None and lighting.spot_pixel is not None else None
    camera = photo_camera(lighting, photo.shape[1], photo.shape[0])
    photo_text = panels.format_photo_caption(camera, plan.photo.width, balls=photo_scene is not None)
    canvas = Image.new("RGB", (WIDTH, plan.height), BACKGROUND)
    _draw_headline(canvas, lighting)
    map_panel = panels.draw_map_panel(envmap, lighting, aspect, plan.envmap)
    for box, caption, panel in (
        (plan.photo, photo_text, panels.draw_photo_panel(photo, lighting, plan.photo, photo_scene, estimate.segments)),
        (plan.compass, "Sun compass: the sky from above, the photo's view outlined", compass),
        (plan.envmap, "Environment map, the photo's view outlined", map_panel),
        (plan.spheres, "Mirror, glossy and grey in this light", _spheres_panel(scene, lighting, plan.spheres)),
    ):
        draw_text(canvas, (box.x, box.y - panels.CAPTION + 4), caption, TextStyle(LETTERS, MUTED))
        canvas.paste(panel, (box.x, box.y), rounded_mask(panel.size, 10))
    for corner, (name, value) in zip(plan.cells, numbers, strict=True):
        draw_text(canvas, corner, name, TextStyle(16, MUTED))
        draw_text(canvas, (corner[0], corner[1] + 22), value, TextStyle(25, TEXT))
    return np.asarray(canvas)


def _spheres_panel(scene: SphereScene, lighting: Lighting, box: panels.Box) -> Image.Image:
    linear = render_sphere_scene(scene, lighting, box.width, box.height, supersampling=2)
    return Image.fromarray(drawing.display_srgb(linear)).reduce(2)


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
    size = _fit_text_size(title, 28 if doubtful else 38, WIDTH - 2 * MARGIN - GAP - text_width(sources, 18))
    draw_text(canvas, (MARGIN, MARGIN - 6), title, TextStyle(size, TEXT if doubtful or not visible else SUN))
    if visible and not lighting.radius_90:
        accuracy = "set by hand"
    elif visible:
        half, most = _format_short(lighting.radius_50), _format_short(lighting.radius_90)
        accuracy = f"half of the probability lies within {half}°, 90 % within {most}°"
    elif lighting.sun_elevation < 0:
        accuracy = f"twilight: the sun is {where}"
    else:
        accuracy = f"an overcast or shaded scene; if the sun shone, it would {hedge}be {where}"
    draw_text(canvas, (MARGIN, MARGIN + 40), accuracy, TextStyle(20, MUTED))
    model = f"{lighting.model_name} {lighting.model_version}"
    draw_text(canvas, (WIDTH - MARGIN, MARGIN + 40), model, TextStyle(18, MUTED, anchor="ra"))
    draw_text(canvas, (WIDTH - MARGIN, MARGIN + 8), sources, TextStyle(18, MUTED, anchor="ra"))
    for number, line in enumerate(_warning_lines(lighting)):
        draw_text(canvas, (MARGIN, MARGIN + 70 + number * panels.WARNING_LINE), line, TextStyle(18, TEXT))


def _fit_text_size(text: str, size: int, width: float) -> int:
    """The size of a text's letters, smaller where the text would be wider than that."""
    return min(size, int(size * width / text_width(text, size)))


def _warning_lines(lighting: Lighting) -> list[str]:
    """The record's warnings, and why no ball stands in the photo, in lines as wide as the picture."""
    warnings = (*lighting.warnings, *spot_warnings(lighting))
    return [line for warning in warnings for line in wrap(f"Warning: {warning}", _WARNING_LETTERS)]


def _format_sources(lighting: Lighting) -> str:
    """The evidence if it is more than the pixels, and the camera's heading if it is known."""
    sources = [f"from {', '.join(lighting.evidence)}"] if len(lighting.evidence) > 1 else []
    heading = [] if lighting.camera_heading is None else [f"camera heading {round(lighting.camera_heading) % 360}°"]
    return "; ".join(sources + heading)


def _format_short(value: float) -> str:
    """One decimal below 10."""
    return f"{value:.1f}" if value < 9.95 else f"{value:.0f}"


def _format_radii(lighting: Lighting) -> str:
    """The radii around the sun; one that was stated by hand has none."""
    if not lighting.radius_90:
        return "by hand"
    return f"{_format_short(lighting.radius_50)}° / {_format_short(lighting.radius_90)}°"


def _format_short_azimuth(azimuth: float) -> str:
    """An azimuth [deg] for a column of numbers: "ahead", "behind" or "41° left"."""
    return {0: "ahead", 180: "behind"}.get(round(abs(azimuth)), format_side(azimuth))


def _format_numbers(lighting: Lighting) -> list[tuple[str, str]]:
    """Names and values of the record, in words."""
    return [
        ("Sun azimuth", _format_short_azimuth(lighting.sun_azimuth)),
        ("Sun elevation", f"{lighting.sun_elevation:.1f}°"),
        ("50 % / 90 % within", _format_radii(lighting)),
        ("Direct sun", f"{100 * lighting.sun_visibility:.0f} %"),
        ("Turbidity", f"{lighting.turbidity:.1f}"),
        ("Exposure", f"{lighting.exposure:.3g}"),
        ("Camera elevation", format_tilt(lighting.camera_elevation, 1)),
        ("Camera roll", f"{round(lighting.camera_roll, 1) + 0.0:.1f}°"),
        ("Vertical field of view", f"{lighting.vertical_fov:.1f}°"),
    ]

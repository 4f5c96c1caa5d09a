"""One picture of a photo's light: photo with horizon, sun compass, environment map, three spheres, numbers in words."""

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.colour import checked_pixels
from lighting.drawing import BACKGROUND, MUTED, TEXT, Style, display, rounded, write
from lighting.envmap import camera_of, known_place, render, surround
from lighting.files import checked_map, encode_png
from lighting.preview.compass import compass_panel
from lighting.preview.layout import CAPTION, LETTERS, WIDTH, Box, lay_out
from lighting.preview.map_panel import map_panel
from lighting.preview.photo_panel import photo_caption, photo_panel
from lighting.preview.words import draw_headline, numbers_of, warning_lines
from lighting.records import Estimate, Lighting, check_estimate
from lighting.spheres import Stage, lit_stage, pitch_of, render_stage, sphere_centres

MAP_HEIGHT = 512  # rows of the environment map
PHOTO_SIDE = 1000  # pixels, least length of the photo's longer side if it has as many


def preview_png(photo: NDArray[np.uint8], estimate: Estimate, *, surroundings: bool | None = None) -> bytes:
    """The picture of an upright photo (h, w, 3, sRGB) and its light, as PNG.

    `surroundings` says whether the map shows the place; by default it does where the network predicted it. Raises
    ParameterError for what is no Estimate, and PhotoError for what is no photo's pixels.
    """
    return encode_png(draw_preview(photo, estimate, _map(photo, estimate, surroundings)))


def draw_preview(
    photo: NDArray[np.uint8], estimate: Estimate, envmap: NDArray[np.float32] | None = None
) -> NDArray[np.uint8]:
    """The same as sRGB pixels (H, 1600, 3).

    `envmap` (H, 2H, 3) is the light's own map in the photo's linear values, with or without the sun's disc; by default
    it is rendered here. The errors are those of `preview_png`, and EnvironmentMapError for what is no map.
    """
    check_estimate(estimate)
    photo = checked_pixels(photo)
    lighting = estimate.lighting
    envmap = _map(photo, estimate, None) if envmap is None else checked_map(envmap)
    aspect, numbers = photo.shape[1] / photo.shape[0], numbers_of(lighting)
    plan = lay_out(aspect, len(numbers), len(warning_lines(lighting)))
    compass = compass_panel(estimate, aspect, plan.compass.width)
    centres = sphere_centres(plan.spheres.width / plan.spheres.height, pitch_of(lighting))
    stage = lit_stage(envmap, lighting.sun_direction, centres.astype(np.float64))
    placed = stage if lighting.sun_irradiance is not None else None
    camera = camera_of(lighting, photo.shape[1], photo.shape[0])
    seen = photo_caption(camera, plan.photo.width, balls=placed is not None)
    canvas = Image.new("RGB", (WIDTH, plan.height), BACKGROUND)
    draw_headline(canvas, lighting)
    for box, caption, panel in (
        (plan.photo, seen, photo_panel(photo, lighting, plan.photo, placed)),
        (plan.compass, "Sun compass: the sky from above, the photo's view outlined", compass),
        (plan.envmap, "Environment map, the photo's view outlined", map_panel(envmap, lighting, aspect, plan.envmap)),
        (plan.spheres, "Mirror, glossy and grey in this light", _spheres_panel(stage, lighting, plan.spheres)),
    ):
        _place(canvas, box, caption, panel)
    for corner, (name, value) in zip(plan.cells, numbers, strict=True):
        write(canvas, corner, name, Style(16, MUTED))
        write(canvas, (corner[0], corner[1] + 22), value, Style(25, TEXT))
    return np.asarray(canvas)


def _place(canvas: Image.Image, box: Box, caption: str, panel: Image.Image) -> None:
    """Panel with rounded corners, its caption above."""
    write(canvas, (box.x, box.y - CAPTION + 4), caption, Style(LETTERS, MUTED))
    canvas.paste(panel, (box.x, box.y), rounded(panel.size, 10))


def _map(photo: NDArray[np.uint8], estimate: Estimate, surroundings: bool | None) -> NDArray[np.float32]:
    place = known_place(estimate, photo, wanted=surroundings)
    return surround(estimate.lighting, place, MAP_HEIGHT) if place else render(estimate.lighting, MAP_HEIGHT)


def _spheres_panel(stage: Stage, lighting: Lighting, box: Box) -> Image.Image:
    linear = render_stage(stage, lighting, box.width, box.height, supersampling=2)
    return Image.fromarray(display(linear)).reduce(2)

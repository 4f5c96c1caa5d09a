"""The panel that shows the environment map."""

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.drawing import WHITE, Style, display, shaded_stroke, sun_colour, sun_marks, write
from lighting.geometry import Floats, latlong_pixel
from lighting.preview.layout import Box
from lighting.preview.sphere_lines import frame_directions, pieces, regions
from lighting.records import Lighting


def map_panel(envmap: NDArray[np.float32], lighting: Lighting, aspect: float, box: Box) -> Image.Image:
    """A map (H, 2H, 3) with the sun, its regions and the outline of a photo of this aspect (width / height)."""
    picture = Image.fromarray(display(envmap)).resize((box.width, box.height), Image.Resampling.LANCZOS)

    def pixels(directions: Floats) -> Floats:
        return latlong_pixel(directions, box.height)

    frame = list(pieces(pixels(frame_directions(lighting, aspect)), box.width))
    shaded_stroke(picture, frame, WHITE, 1.5)
    regions(picture, lighting, pixels)
    spots = pixels(lighting.sun_direction) + np.array([[-box.width, 0], [0, 0], [box.width, 0]])
    sun_marks(picture, spots, sun_colour(lighting), 6.5)
    for share, word in ((0.25, "90° left"), (0.5, "front"), (0.75, "90° right")):
        write(picture, (box.width * share, box.height - 12), word, Style(16, WHITE, anchor="ms", shaded=True))
    for share, anchor in ((0.008, "ls"), (0.992, "rs")):
        write(picture, (box.width * share, box.height - 12), "behind", Style(16, WHITE, anchor=anchor, shaded=True))
    return picture

"""A contact sheet of failures: each crop with its true and its estimated sun, in numbers and on a dial.

It shows pictures of the data: it is for looking at failures, and never published.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from export.evaluation.failures import Failure
from lighting.files import replacing

ACROSS = 5  # crops in a row
PICTURE = (320, 240)  # pixels
TEXT, LINE = 13, 16  # pixels, height of letters and of lines
DIAL = 26  # pixels, radius
TRUE, SAID = (255, 200, 0), (90, 180, 255)


def sheet(found: Sequence[Failure], pictures: Sequence[NDArray[np.uint8]]) -> Image.Image:
    """The failures in rows of ACROSS, each picture (h, w, 3) with three lines under it."""
    height = PICTURE[1] + 3 * LINE + 6
    whole = Image.new("RGB", (ACROSS * (PICTURE[0] + 4), -(-len(found) // ACROSS) * height), "white")
    for i, (one, picture) in enumerate(zip(found, pictures, strict=True)):
        corner = (i % ACROSS * (PICTURE[0] + 4), i // ACROSS * height)
        whole.paste(_with_dial(Image.fromarray(picture).resize(PICTURE), one), corner)
        text = "\n".join(_lines(i + 1, one))
        font = ImageFont.load_default(TEXT)
        ImageDraw.Draw(whole).multiline_text((corner[0] + 2, corner[1] + PICTURE[1]), text, "black", font, spacing=2)
    return whole


def _lines(number: int, f: Failure) -> tuple[str, str, str]:
    return (
        f"{number}: {f.error:.0f}° {f.panorama}",
        f"true {f.sun[0]:.0f}, {f.sun[1]:.0f}   said {f.said[0]:.0f}, {f.said[1]:.0f} ± {f.radius_50:.0f}",
        f"{f.cause}; {f.in_view}; direct {f.direct or 'unknown'}",
    )


def _with_dial(picture: Image.Image, f: Failure) -> Image.Image:
    """The picture with a dial of the suns from above: the zenith in the middle, the camera's azimuth at the top."""
    draw = ImageDraw.Draw(picture)
    middle = np.array(picture.size) - DIAL - 4
    draw.ellipse([*(middle - DIAL), *(middle + DIAL)], fill=(60, 60, 60), outline="white")
    draw.line([*middle, middle[0], middle[1] - DIAL], fill="white")
    for (azimuth, elevation), colour in ((f.sun, TRUE), (f.said, SAID)):
        turn, reach = np.radians(azimuth), DIAL * (1 - elevation / 90)
        spot = middle + reach * np.array([np.sin(turn), -np.cos(turn)])
        draw.ellipse([*(spot - 4), *(spot + 4)], fill=colour)
    return picture


def write_sheet(path: Path, found: Sequence[Failure], pictures: Sequence[NDArray[np.uint8]]) -> None:
    """The sheet as a PNG file."""
    with replacing(path) as temporary:
        sheet(found, pictures).save(temporary, "PNG")

"""Make the picture that moves on the page's first view, with the page itself.

    python -m scripts.make_moving_example http://127.0.0.1:8000/

Needs node, Chromium, and `npm ci` in `server/web`. Writes a photo, a strip of pictures of a turning teapot, and where
it stands, to `server/web/src/moving/`.
"""

import argparse
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image, ImageChops

ROOT = Path(__file__).parents[1]
TARGET = ROOT / "server" / "web" / "src" / "moving"
FRAMES = 36  # in a full turn
MARGIN = 6  # pixels around what the object changes
MIN_CHANGE = 10  # of 255, of a pixel that the object changes
NARROW = 800  # pixels, the width of the photo for phones
PHOTO_QUALITY = 72
STRIP_QUALITY = 62


def changed_box(photo: Image.Image, frames: list[Image.Image]) -> tuple[int, int, int, int]:
    """The part of a photo that any of several frames changes, with a margin.

    Args:
        photo: without the object.
        frames: of the same size.
    """
    changes = [np.asarray(ImageChops.difference(photo, frame)).max(axis=2) for frame in frames]
    rows, columns = np.nonzero(np.max(changes, axis=0) > MIN_CHANGE)
    left, top = int(columns.min()) - MARGIN, int(rows.min()) - MARGIN
    right, bottom = int(columns.max()) + 1 + MARGIN, int(rows.max()) + 1 + MARGIN
    return max(left, 0), max(top, 0), min(right, photo.width), min(bottom, photo.height)


def style_sheet(box: tuple[int, int, int, int], size: tuple[int, int]) -> str:
    """Where the strip stands on the photo, as CSS.

    Args:
        box: left, top, right and bottom, pixels.
        size: of the photo, pixels.
    """
    left, top, right, bottom = box
    shares = {
        "left": left / size[0],
        "top": top / size[1],
        "width": (right - left) / size[0],
        "height": (bottom - top) / size[1],
    }
    lines = [f"  {name}: {100 * share:.4f}%;" for name, share in shares.items()]
    timing = f".turning .moving-object {{\n  animation-timing-function: steps({FRAMES}, jump-none);\n}}"
    return "\n".join([".moving-object {", *lines, f"  background-size: 100% {100 * FRAMES}%;", "}", "", timing, ""])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("url", help="where the service runs")
    url = parser.parse_args().url
    browser = shutil.which("chromium") or shutil.which("google-chrome") or "chromium"
    with tempfile.TemporaryDirectory() as folder:
        script = ROOT / "scripts" / "moving_example.mjs"
        subprocess.run(["node", str(script), url, browser, folder, str(FRAMES)], check=True)
        photo = Image.open(Path(folder) / "photo.png").convert("RGB")
        frames = [Image.open(Path(folder) / f"{number}.png").convert("RGB") for number in range(FRAMES)]
    box = changed_box(photo, frames)
    strip = Image.new("RGB", (box[2] - box[0], FRAMES * (box[3] - box[1])))
    for number, frame in enumerate(frames):
        strip.paste(frame.crop(box), (0, number * (box[3] - box[1])))
    photo.save(TARGET / "street.jpg", quality=PHOTO_QUALITY, optimize=True, progressive=True)
    small = photo.resize((NARROW, round(NARROW * photo.height / photo.width)), Image.Resampling.LANCZOS)
    small.save(TARGET / f"street-{NARROW}.jpg", quality=PHOTO_QUALITY, optimize=True, progressive=True)
    strip.save(TARGET / "teapot.webp", quality=STRIP_QUALITY, method=6)
    (TARGET / "moving.css").write_text(style_sheet(box, photo.size), encoding="utf-8")


if __name__ == "__main__":
    main()

"""Which of a folder's EXR files each reader opens that this Python can import: python exr_readers.py FOLDER

Needs numpy and nothing of this project, so that any Python will do. NO.exr is what the others are compared with.
"""

import importlib
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

SAME = 0.3  # relative error up to which a picture counts as read; DWA changes values by up to 0.22


def openexr(module: Any, path: str) -> Any:
    return module.File(path).channels()["RGB"].pixels


def openimageio(module: Any, path: str) -> Any:
    return module.ImageInput.open(path).read_image("float")


def mitsuba(module: Any, path: str) -> Any:
    module.set_variant("scalar_rgb")
    return np.array(module.Bitmap(path))


def simpleimageio(module: Any, path: str) -> Any:
    return module.read(path)


def bpy(module: Any, path: str) -> Any:
    image = module.data.images.load(path)
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    pixels = np.empty(width * height * 4, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(height, width, 4)[::-1]


READERS: dict[str, Callable[[Any, str], Any]] = {
    "OpenEXR": openexr,
    "OpenImageIO": openimageio,
    "mitsuba": mitsuba,
    "simpleimageio": simpleimageio,
    "bpy": bpy,
}


def main() -> None:
    """Print a line for each reader."""
    files = sorted(Path(sys.argv[1]).glob("*.exr"))
    for name, read in READERS.items():
        try:
            module = importlib.import_module(name)
        except ImportError:
            continue
        version = module.app.version_string if name == "bpy" else getattr(module, "__version__", "")
        true = np.asarray(read(module, str(Path(sys.argv[1]) / "NO.exr")))[..., :3]
        opened = [path.stem for path in files if _opens(partial(read, module, str(path)), true)]
        refused = [path.stem for path in files if path.stem not in opened]
        print(f"{name} {version}: opened {', '.join(opened)}; not {', '.join(refused) or 'one'}", flush=True)


def _opens(read: Callable[[], Any], true: Any) -> bool:
    try:
        pixels = np.asarray(read(), dtype=np.float32)[..., :3]
    except Exception:  # each reader has its own errors
        return False
    return pixels.shape == true.shape and bool(np.all(np.abs(pixels - true) <= SAME * true))


if __name__ == "__main__":
    main()

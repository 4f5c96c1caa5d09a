"""Render the object over the photo with Mitsuba 3: python composite.py [samples [variant]].

Two renders, with the object and without, differ by its shadow and its reflected light: the plate is multiplied by their
ratio (Debevec 1998). The object's own pixels come from the render as they are. Writes composite.png.
"""

import sys
from pathlib import Path
from typing import Any

import mitsuba
import numpy as np

mi: Any = mitsuba

FOLDER = Path(__file__).resolve().parent


def main(samples: str = "64", variant: str = "scalar_rgb") -> None:
    mi.set_variant(variant)
    plate = linear(mi.Bitmap(str(FOLDER / "plate.png")))
    full = rendered(int(samples), "camera.xml", "light.xml", "object.xml")
    empty = rendered(int(samples), "camera.xml", "light.xml")
    covered = np.clip(rendered(16, "camera.xml", "object.xml")[..., 3:], 0, 1)
    shadowed = plate * full[..., :3] / np.maximum(empty[..., :3], 1e-6)
    picture = covered * full[..., :3] + (1 - covered) * shadowed
    mi.util.write_bitmap(str(FOLDER / "composite.png"), mi.Bitmap(picture.astype(np.float32)), write_async=False)


def linear(picture: Any) -> Any:
    return np.array(picture.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, srgb_gamma=False))


def rendered(samples: int, *parts: str) -> Any:
    """Linear pixels (H, W, 4) of a scene of these files; the same seed gives what they share the same noise."""
    names = "".join(f'<include filename="{FOLDER / part}"/>' for part in parts)
    scene = mi.load_string(f'<scene version="3.0.0">{names}</scene>', samples=samples)
    return np.array(mi.render(scene, seed=0))


if __name__ == "__main__":
    main(*sys.argv[1:])

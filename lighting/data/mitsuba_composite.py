"""Render the object over the photo with Mitsuba 3: python composite.py [samples [variant]].

Renders with the object and without differ by its shadow and its reflected light. The plate is multiplied by their ratio
(Debevec 1998). In shade, by lit_ground.png, the sun is left out of both, so that no shadow darkens shade. The object's
own pixels have as much of the sun as `sun_on_object` in object.xml says. Writes
composite.png. The variant scalar_rgb runs everywhere; llvm_ad_rgb is faster and needs LLVM.
"""

import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import mitsuba
import numpy as np
from numpy.typing import NDArray

mi: Any = mitsuba
Pixels = NDArray[np.float32]

_FOLDER = Path(__file__).resolve().parent
FALLBACK = "scalar_rgb"  # the variant that runs everywhere
TRY_SECONDS = 60  # after which a variant counts as one that hangs: a search for LLVM in vain can


def _main(samples: str = "64", variant: str = FALLBACK) -> None:
    if variant != FALLBACK:
        _try(variant)
    mi.set_variant(variant)
    plate = _linear(mi.Bitmap(str(_FOLDER / "plate.png")))
    lit = _lit_ground(plate.shape[1], plate.shape[0])
    sky, sun = _sky_and_sun(int(samples), "camera.xml", "light.xml", "object.xml")
    empty_sky, empty_sun = _sky_and_sun(int(samples), "camera.xml", "light.xml")
    covered = np.clip(_render(16, "camera.xml", "object.xml")[..., 3:], 0, 1)
    shadowed = plate * (sky + lit * sun) / np.maximum(empty_sky + lit * empty_sun, 1e-6)
    picture = covered * (sky + _sun_on_object() * sun) + (1 - covered) * shadowed
    mi.util.write_bitmap(str(_FOLDER / "composite.png"), mi.Bitmap(picture.astype(np.float32)), write_async=False)


def _try(variant: str) -> None:
    """Exit with a sentence where a variant cannot render here: a wrong LLVM aborts the whole process, or hangs it."""
    scene = {"type": "scene", "integrator": {"type": "path"}, "sensor": {"type": "perspective"}}
    render = f"mi.TensorXf(mi.render(mi.load_dict({scene}), spp=1)).numpy()"
    code = f"import mitsuba as mi; mi.set_variant({variant!r}); {render}"
    reason = ""
    try:
        command = [sys.executable, "-c", code]
        result = subprocess.run(command, capture_output=True, text=True, check=False, timeout=TRY_SECONDS)
        if result.returncode:
            reason = (result.stderr.strip().splitlines() or ["it aborted"])[-1]
    except subprocess.TimeoutExpired:
        reason = f"it hung for {TRY_SECONDS} s."
    if reason:
        sys.exit(f"Mitsuba's variant {variant} does not run here: {reason} Use {FALLBACK}, which needs no LLVM.")


def _linear(picture: "mitsuba.Bitmap") -> Pixels:
    return np.array(picture.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, srgb_gamma=False))


def _lit_ground(width: int, height: int) -> Pixels:
    """How much of the sun reaches the photo's ground (H, W, 1), 0 to 1."""
    values = np.array(mi.Bitmap(str(_FOLDER / "lit_ground.png"))).astype(np.float32) / 255
    fitted = mi.Bitmap(values.reshape(*values.shape[:2], 1)).resample([width, height])
    lit: Pixels = np.clip(np.array(fitted).reshape(height, width, 1), 0, 1)
    return lit


def _sun_on_object() -> float:
    """How much of the sun reaches the object, 0 to 1."""
    root = ElementTree.parse(_FOLDER / "object.xml").getroot()
    return next(float(part.attrib["value"]) for part in root.iter("default") if part.get("name") == "sun_on_object")


def _sky_and_sun(samples: int, *parts: str) -> tuple[Pixels, Pixels]:
    """Linear pixels (H, W, 3) of a scene of these files without the sun, and what the sun adds to them."""
    sky = _render(samples, *parts, sun_radiance="0 0 0")[..., :3]
    return sky, _render(samples, *parts)[..., :3] - sky


def _render(samples: int, *parts: str, **values: str) -> Pixels:
    """Linear pixels (H, W, 4) of a scene of these files; the same seed gives what they share the same noise."""
    names = "".join(f'<include filename="{_FOLDER / part}"/>' for part in parts)
    scene = mi.load_string(f'<scene version="3.0.0">{names}</scene>', samples=samples, **values)
    return np.array(mi.render(scene, seed=0))


if __name__ == "__main__":
    _main(*sys.argv[1:])

"""The sky and the sun of four numbers, by the project's own model; nothing here needs Blender."""

from typing import Any

import numpy as np

from .lighting.envmap import render, sun_irradiance
from .lighting.records import Lighting
from .lighting.scene.axes import colour_and_strength, to_z_up

HEIGHT = 512  # rows of the map, as in the scenes


def pixels(light: Lighting, shines: bool) -> Any:
    """The map as Blender keeps it: float32 RGBA in one row, bottom line first; the sun's disc is left out."""
    image = render(light, HEIGHT, sun=shines, disc=False)
    rgba = np.ones((*image.shape[:2], 4), dtype=np.float32)
    rgba[..., :3] = image[::-1]
    return rgba.ravel()


def sun(light: Lighting, shines: bool) -> dict[str, Any]:
    """What `aim_sun` takes: direction, colour and irradiance."""
    colour, strength = colour_and_strength(sun_irradiance(light) if shines else np.zeros(3))
    return {
        "direction": to_z_up(light.sun_direction).tolist(),
        "colour": colour.tolist(),
        "irradiance": strength,
    }

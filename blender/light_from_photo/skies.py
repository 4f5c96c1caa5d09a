"""The sky and the sun that the sliders say, by the project's own model; nothing here needs Blender."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from .lighting.color import color_and_intensity, luminance
from .lighting.envmap.relighting import adjust_lighting
from .lighting.envmap.render import render, sky_irradiance, sun_light
from .lighting.fields import RANGES
from .lighting.geometry import to_z_up
from .lighting.map_options import EXPOSURE_RANGE, Adjustments
from .lighting.records import Lighting

HEIGHT = 512  # rows of the map, as in the scenes
SLIDERS = {  # by the names of the command line, of HTTP and of Python; `exposure` in EV against the estimate
    "sun_azimuth": RANGES["sun_azimuth"],
    "sun_elevation": RANGES["sun_elevation"],
    "haze": RANGES["turbidity"],
    "exposure": EXPOSURE_RANGE,
}


def light_of_sliders(record: str, sliders: Mapping[str, float], overcast: bool = False) -> Lighting:
    """The light of a record (JSON), adjusted as the sliders say; its power follows them.

    Blender keeps numbers in single precision, which may lie just outside their range.
    """
    inside = {name: min(max(value, SLIDERS[name][0]), SLIDERS[name][1]) for name, value in sliders.items()}
    sun = inside["sun_azimuth"], inside["sun_elevation"]
    changes = Adjustments(sun, inside["exposure"], inside["haze"], overcast)
    return adjust_lighting(Lighting.from_dict(json.loads(record)), changes)


def pixels(light: Lighting, shines: bool) -> Any:
    """The map as Blender keeps it: float32 RGBA in one row, bottom line first; the sun's disc is left out."""
    image = render(light, HEIGHT, sun=shines, disc=False)
    rgba = np.ones((*image.shape[:2], 4), dtype=np.float32)
    rgba[..., :3] = image[::-1]
    return rgba.ravel()


def sun(light: Lighting, shines: bool) -> dict[str, Any]:
    """What `aim_sun` takes: direction, color and irradiance."""
    color, intensity = color_and_intensity(sun_light(light)[0] if shines else np.zeros(3))
    return {
        "direction": to_z_up(light.sun_direction).tolist(),
        "colour": color.tolist(),
        "irradiance": intensity,
    }


def native_sky(light: Lighting) -> dict[str, Any]:
    """What `aim_native_sky` takes."""
    return {
        "sun_direction": to_z_up(light.sun_direction).tolist(),
        "turbidity": light.turbidity,
        "ground_albedo": light.ground_albedo,
        "strength": light.exposure,
        "luminance": float(luminance(sky_irradiance(light))),
    }

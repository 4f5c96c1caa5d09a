"""A sky model and a scene tool as a contributor writes them."""

import numpy as np
from numpy.typing import ArrayLike

from lighting.geometry import Floats
from lighting.scene import Exporter, ExporterOption
from lighting.scene.records import Scene
from lighting.scene.writer import Folder, encode_plate
from lighting.sky import SkyModel, Weather

TEXT, PICTURE = "toy.txt", "toy.png"


def eastern_luminance(direction: ArrayLike, _sun_direction: ArrayLike, weather: Weather) -> Floats:
    """Luminance (...) along unit vectors (..., 3): brighter to the right of the camera; 0 below the horizon."""
    x, y, _ = np.moveaxis(np.asarray(direction, dtype=float), -1, 0)
    return np.where(y > 0, weather.turbidity + x, 0.0)


def write_toy(scene: Scene, folder: Folder, *, unit: str = "m") -> None:
    """Write TEXT with the sun, and PICTURE, the photo."""
    height = scene.camera_position[1] * {"m": 1, "cm": 100}[unit]
    lines = [f"sun {scene.lighting.sun_azimuth:g} {scene.lighting.sun_elevation:g}", f"camera {height:g} {unit}"]
    (folder / TEXT).write_text("\n".join(lines) + "\n", encoding="utf-8")
    (folder / PICTURE).write_bytes(encode_plate(scene))


EASTERN = SkyModel(eastern_luminance)
TOY = Exporter(write_toy, files=(TEXT, PICTURE), options={"unit": ExporterOption(("m", "cm"), default="m")})

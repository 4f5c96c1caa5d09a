"""Panoramas, labels and crops whose truth is known."""

from pathlib import Path

import numpy as np

from export.crops.cameras import Camera
from export.crops.crops import Crop
from export.crops.sources import Source
from export.data.labels import Label
from export.data.panoramas import Panorama
from export.networks.specs import specs
from lighting.colour import tone_map
from lighting.geometry import angle_between, direction, latlong_directions

SPEC = specs("0")["outdoor"]


SUN = (40.0, 25.0)  # deg


def label(azimuth: float = SUN[0], elevation: float = SUN[1], *, ok: bool = True) -> Label:
    return Label("p", azimuth, elevation, 2.0, "given", azimuth, elevation, 3.0, 0.5, 0.1, ok, "yes")


def source(kind: str = "hdr", place: str = "a", sun: Label | None = None) -> Source:
    """A panorama whose radiance falls off around the sun, so that its brightest pixel is the sun."""
    near = angle_between(latlong_directions(256), direction(*SUN))
    picture = np.repeat(np.exp(-((near / 8) ** 2))[..., None] * 0.8 + 0.1, 3, axis=-1).astype(np.float32)
    levels = (tone_map(picture),) if kind == "ldr" else (picture,)
    return Source(Panorama("p", Path("p"), kind, place, "train"), levels, sun or label())


def brightest(crop: Crop) -> tuple[float, float]:
    y, x = np.unravel_index(np.argmax(crop.linear[..., 1]), crop.linear.shape[:2])
    return float(x) + 0.5, float(y) + 0.5


VIEWS = [Camera(0, 12.0, -7.0, 60.0, 4 / 3), Camera(0, -5.0, 9.0, 70.0, 3 / 4), Camera(0, 20.0, 0.0, 40.0, 16 / 9)]


def crop(camera: Camera, azimuth: float, elevation: float) -> Crop:
    """A grey picture of the size that the canvas holds."""
    height = round(SPEC.width / max(camera.aspect, 1.0))
    linear = np.full((height, round(height * camera.aspect), 3), 0.2, np.float32)
    return Crop(linear, camera, azimuth, elevation, 2.0, 1.0, 3.0, 0.5)

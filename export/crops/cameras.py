"""Cameras in a panorama: the angles they are drawn from, by protocol, and what they see where."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from lighting.geometry import Pinhole, camera_pixel, direction, wrap_azimuth

MAX_HORIZONTAL_FOV = 106.0  # deg, about that of a phone's ultra-wide lens
PHONE_ASPECTS = (9 / 16, 2 / 3, 3 / 4, 1.0, 4 / 3, 3 / 2, 16 / 9)
TILTED = 45.0  # deg, largest roll of a tilted phone
AIMS = 40  # cameras tried until one sees the sun


@dataclass(frozen=True)
class Camera:
    """How a crop is taken; angles in deg, in the panorama's frame."""

    azimuth: float  # -180 to 180
    elevation: float
    roll: float
    vertical_fov: float
    aspect: float  # width / height
    mirrored: bool = False


def paper_camera(rng: np.random.Generator) -> Camera:
    """The protocol of CVPR 2017: elevation within 20 deg, vertical field of view 35 to 68 deg, 4:3, no roll."""
    return Camera(rng.uniform(-180, 180), rng.uniform(-20, 20), 0.0, rng.uniform(35, 68), 4 / 3)


def _phone_camera(rng: np.random.Generator) -> Camera:
    """What phones take: elevation within 35 deg, roll within 10, vertical field of view 25 to 90, 9:16 to 16:9."""
    aspect = float(rng.choice(PHONE_ASPECTS))
    widest = np.degrees(2 * np.arctan(np.tan(np.radians(MAX_HORIZONTAL_FOV / 2)) / aspect))
    fov = rng.uniform(25, min(90.0, widest))
    return Camera(rng.uniform(-180, 180), rng.uniform(-35, 35), rng.uniform(-10, 10), fov, aspect)


def training_camera(rng: np.random.Generator) -> Camera:
    """Half as phones take photos, half near the paper's protocol with a small roll; half of all are mirrored.

    One in seven of the phones is tilted, by up to TILTED.
    """
    if rng.random() < 0.5:
        camera = _phone_camera(rng)
        if rng.random() < 1 / 7:
            camera = replace(camera, roll=rng.uniform(-TILTED, TILTED))
    else:
        roll = float(np.clip(rng.normal(0, 2), -10, 10))
        camera = replace(paper_camera(rng), roll=roll, vertical_fov=rng.uniform(32, 75))
    return replace(camera, mirrored=bool(rng.random() < 0.5))


def aimed_camera(rng: np.random.Generator, azimuth: float, elevation: float) -> Camera:
    """A training camera turned until its picture holds a sun there [deg]; after AIMS attempts, any camera."""
    for _ in range(AIMS):
        camera = training_camera(rng)
        camera = replace(camera, azimuth=float(wrap_azimuth(azimuth + rng.uniform(-53, 53))))
        if direction_to_pixel(camera, azimuth - camera.azimuth, elevation, round(1000 * camera.aspect), 1000):
            break
    return camera


def pinhole_camera(camera: Camera, width: int, height: int, azimuth: float = 0.0) -> Pinhole:
    """The camera of a picture of that many pixels, which looks to an azimuth [deg]."""
    return Pinhole(width, height, camera.vertical_fov, azimuth, camera.elevation, camera.roll)


def direction_to_pixel(
    camera: Camera, azimuth: float, elevation: float, width: int, height: int
) -> tuple[float, float] | None:
    """Pixel (x, y) of a picture where a direction [deg] lies, its azimuth relative to the camera; None if outside."""
    x, y = camera_pixel(direction(azimuth, elevation), pinhole_camera(camera, width, height))
    return (float(x), float(y)) if 0 <= x <= width and 0 <= y <= height else None


PROTOCOLS: dict[str, Callable[[np.random.Generator], Camera]] = {
    "paper": paper_camera,
    "phone": _phone_camera,
    "train": training_camera,
}

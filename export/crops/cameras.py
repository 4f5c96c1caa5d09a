"""Cameras in a panorama: the angles they are drawn from, by protocol, and what they see where."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from lighting.geometry import Pinhole, camera_pixel, direction, wrap_azimuth

MAX_HORIZONTAL_FOV = 106.0  # deg, about that of a phone's ultra-wide lens
PHONE_ASPECTS = (9 / 16, 2 / 3, 3 / 4, 1.0, 4 / 3, 3 / 2, 16 / 9)
_MAX_TILTED_ROLL = 45.0  # deg, of a tilted phone
_MAX_AIM_ATTEMPTS = 40  # cameras tried until one sees the sun


@dataclass(frozen=True)
class Camera:
    """How a crop is taken; angles in deg, in the panorama's frame."""

    azimuth: float  # -180 to 180
    elevation: float  # positive looks up
    roll: float
    vertical_fov: float
    aspect: float  # width / height
    mirrored: bool = False  # left and right are swapped in the picture


def paper_camera(rng: np.random.Generator) -> Camera:
    """The protocol of CVPR 2017: elevation within 20 deg, vertical field of view 35 to 68 deg, 4:3, no roll.

    Args:
        rng: draws the angles.
    """
    return Camera(rng.uniform(-180, 180), rng.uniform(-20, 20), 0.0, rng.uniform(35, 68), 4 / 3)


def _phone_camera(rng: np.random.Generator) -> Camera:
    """What phones take: elevation within 35 deg, roll within 10, vertical field of view 25 to 90, 9:16 to 16:9."""
    aspect = float(rng.choice(PHONE_ASPECTS))
    widest = np.degrees(2 * np.arctan(np.tan(np.radians(MAX_HORIZONTAL_FOV / 2)) / aspect))
    fov = rng.uniform(25, min(90.0, widest))
    return Camera(rng.uniform(-180, 180), rng.uniform(-35, 35), rng.uniform(-10, 10), fov, aspect)


def training_camera(rng: np.random.Generator) -> Camera:
    """Half as phones take photos, half near the paper's protocol with a small roll; half of all are mirrored.

    One in seven of the phones is tilted, by up to 45 deg.

    Args:
        rng: draws the angles.
    """
    if rng.random() < 0.5:
        camera = _phone_camera(rng)
        if rng.random() < 1 / 7:
            camera = replace(camera, roll=rng.uniform(-_MAX_TILTED_ROLL, _MAX_TILTED_ROLL))
    else:
        roll = float(np.clip(rng.normal(0, 2), -10, 10))
        camera = replace(paper_camera(rng), roll=roll, vertical_fov=rng.uniform(32, 75))
    return replace(camera, mirrored=bool(rng.random() < 0.5))


def aimed_camera(rng: np.random.Generator, azimuth: float, elevation: float) -> Camera:
    """A training camera whose picture holds the sun; after 40 attempts, any camera.

    Args:
        rng: draws the cameras.
        azimuth: deg, of the sun in the panorama.
        elevation: deg, of the sun.
    """
    for _ in range(_MAX_AIM_ATTEMPTS):
        camera = training_camera(rng)
        camera = replace(camera, azimuth=float(wrap_azimuth(azimuth + rng.uniform(-53, 53))))
        if direction_to_pixel(camera, azimuth - camera.azimuth, elevation, round(1000 * camera.aspect), 1000):
            break
    return camera


def pinhole_camera(camera: Camera, width: int, height: int, azimuth: float = 0.0) -> Pinhole:
    """The camera of a picture of `width` x `height` pixels.

    Args:
        camera: its elevation, roll and field of view.
        width: pixels.
        height: pixels.
        azimuth: deg, to which it looks, whatever that of `camera`.
    """
    return Pinhole(width, height, camera.vertical_fov, azimuth, camera.elevation, camera.roll)


def direction_to_pixel(
    camera: Camera, azimuth: float, elevation: float, width: int, height: int
) -> tuple[float, float] | None:
    """Pixel (x, y) of a picture where a direction lies; None if outside.

    Args:
        camera: its elevation, roll and field of view.
        azimuth: deg, relative to the camera, positive to the right.
        elevation: deg above the horizon.
        width: pixels of the picture.
        height: pixels of the picture.
    """
    x, y = camera_pixel(direction(azimuth, elevation), pinhole_camera(camera, width, height))
    return (float(x), float(y)) if 0 <= x <= width and 0 <= y <= height else None


PROTOCOLS: dict[str, Callable[[np.random.Generator], Camera]] = {  # by their names in reports
    "paper": paper_camera,
    "phone": _phone_camera,
    "train": training_camera,
}

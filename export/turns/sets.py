"""Photos of panoramas as the members of a set: one lens that nobody noted, overlapping views, changing gains."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from export.crops import Camera, automatic_gain, generator, pinhole
from export.data import Panorama, linear_of, read_picture
from lighting.colour import tone_map
from lighting.geometry import Floats, camera_directions, sample_latlong

WIDTH, HEIGHT = 640, 480  # pixels; the panoramas hold no more
FOVS = (40.0, 65.0)  # deg, vertical
OVERLAPS = (0.25, 0.7)  # of neighbours' width
GAINS = (0.7, 1.3)  # of each channel


@dataclass(frozen=True, eq=False)
class Taken:
    """One photo and how it was taken."""

    pixels: NDArray[np.uint8]  # (HEIGHT, WIDTH, 3) sRGB
    camera: Camera


def sweep(panorama: Panorama, count: int, purpose: str) -> list[Taken]:
    """`count` photos, each overlapping the one before; decided by the panorama's name and the purpose alone."""
    rng = generator(panorama.name, count, purpose)
    fov, azimuth = rng.uniform(*FOVS), rng.uniform(-180, 180)
    side = rng.choice([-1.0, 1.0])
    cameras = []
    for _ in range(count):
        cameras.append(Camera(float(azimuth), rng.uniform(-10, 15), rng.normal(0, 2), fov, WIDTH / HEIGHT))
        azimuth = azimuth + side * across(fov) * (1 - rng.uniform(*OVERLAPS))
    picture = exposed(panorama)
    return [Taken(photo(picture, camera, rng.uniform(*GAINS, 3)), camera) for camera in cameras]


def across(vertical_fov: float) -> float:
    """Horizontal field of view [deg] of a photo of the set."""
    return float(2 * np.degrees(np.arctan(np.tan(np.radians(vertical_fov / 2)) * WIDTH / HEIGHT)))


def exposed(panorama: Panorama) -> NDArray[np.float32]:
    """Linear values (H, 2H, 3) of which the bright parts are near white."""
    linear = linear_of(panorama, read_picture(panorama))
    return linear if panorama.kind == "ldr" else well_exposed(linear)


def well_exposed(linear: NDArray[np.float32]) -> NDArray[np.float32]:
    """Scene-referred values (H, W, 3) times a number that brings their bright parts near white."""
    return np.asarray(linear * automatic_gain(linear), dtype=np.float32)


def photo(linear: NDArray[np.float32], camera: Camera, gain: Floats, rows: int = HEIGHT) -> NDArray[np.uint8]:
    """What a camera takes of a panorama in linear values (H, 2H, 3): `rows` of pixels."""
    columns = round(rows * camera.aspect)
    rays = camera_directions(pinhole(camera, columns, rows, camera.azimuth))
    return np.asarray(tone_map(sample_latlong(linear, rays.astype(np.float32)) * gain))


def one_each(panoramas: Sequence[Panorama]) -> list[Panorama]:
    """One panorama a place, chosen by its name."""
    places: dict[str, list[Panorama]] = {}
    for panorama in panoramas:
        places.setdefault(panorama.place, []).append(panorama)
    return [own[int(generator(place, 0, "which").integers(len(own)))] for place, own in sorted(places.items())]

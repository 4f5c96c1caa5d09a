"""Bracketed exposures of skies that are known: a camera in front of a rendered map, with its noise and its bits."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats
from lighting.photo import LinearPhoto
from lighting.probe.lens import Lens, lens_directions, lens_pixels
from lighting.records import Lighting
from lighting.sky.hosek_wilkie import sky_radiance, sun_disc_points, sun_disc_radiance

TIMES = tuple(float(time) for time in np.geomspace(1 / 8000, 1, 7))  # s
ELECTRONS = 50_000.0  # at full scale, of a full-frame camera at its base sensitivity
READ_ELECTRONS = 3.0


@dataclass(frozen=True)
class Camera:
    """A camera's bits, and how much of its full scale the brightest pixel fills in the shortest exposure."""

    bits: int = 14
    fill: float = 0.8  # over 1, the sun clips in every exposure
    noise: bool = True


def photograph(lighting: Lighting, lens: Lens, rotation: Floats) -> NDArray[np.float32]:
    """Mean radiance (h, w, 3) that each pixel of a lens sees of the sky and the sun; 0 outside its circle.

    The sky is sampled in the middle of each pixel; the sun's disc is summed point by point into the pixels that it
    falls on, so that its power is exact.
    """
    pixels = np.stack(np.meshgrid(np.arange(lens.width) + 0.5, np.arange(lens.height) + 0.5), axis=-1)
    towards = lens_directions(lens, pixels) @ rotation.T
    seen = np.isfinite(towards).all(axis=-1)
    sun = lighting.sun_direction
    picture = np.zeros((lens.height, lens.width, 3))
    picture[seen] = sky_radiance(towards[seen], sun, lighting.turbidity, lighting.ground_albedo)
    points, weight = sun_disc_points(sun)
    at = np.floor(lens_pixels(lens, points @ rotation)).astype(np.intp)
    radiance = sun_disc_radiance(points, sun, lighting.turbidity) * weight[:, None]
    np.add.at(picture, (at[:, 1], at[:, 0]), radiance / _solid_angle(lens, at)[:, None])
    return np.asarray(picture * lighting.exposure, dtype=np.float32)


def _solid_angle(lens: Lens, at: NDArray[np.intp]) -> Floats:
    """Solid angle [sr] (N,) of the pixels in these columns and rows (N, 2)."""
    a, b, c, d = (lens_directions(lens, at + np.array(corner)) for corner in ((0, 0), (1, 0), (1, 1), (0, 1)))
    return np.asarray(np.linalg.norm(np.cross(c - a, d - b), axis=-1) / 2)


def expose(
    picture: NDArray[np.float32], camera: Camera, rng: np.random.Generator, times: Sequence[float] = TIMES
) -> list[LinearPhoto]:
    """A bracket of a picture's radiance (h, w, 3), the longest exposure last; relative exposures are `times`."""
    gain = camera.fill / (float(picture.max()) * min(times))
    full = 2**camera.bits - 1
    photos = []
    for time in times:
        value = np.asarray(picture * (gain * time), dtype=np.float64)
        if camera.noise:
            electrons = np.minimum(value, 2.0) * ELECTRONS
            value = rng.normal(electrons, np.sqrt(electrons + READ_ELECTRONS**2)) / ELECTRONS
        counts = np.clip(np.rint(value * full), 0, full)
        photos.append(LinearPhoto((counts / full).astype(np.float32), 0.98, 1 / full, time))
    return photos


def gain_of(picture: NDArray[np.float32], camera: Camera, times: Sequence[float] = TIMES) -> float:
    """Merged radiance / true radiance of such a bracket."""
    return camera.fill / (float(picture.max()) * min(times))

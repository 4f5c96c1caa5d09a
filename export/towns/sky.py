"""Skies over rendered places: clear, cloudy or overcast; the clear part and the sun are Hosek-Wilkie's."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.colour import luminance
from lighting.envmap import render
from lighting.geometry import Floats, latlong_directions
from lighting.records import Lighting
from lighting.sky.hosek_wilkie import SUN_SOLID_ANGLE, sun_radiance

HEIGHT = 256  # rows of the map that lights a place
EXPOSURE = 0.02  # of sky radiance; crops are exposed anew
OVERCAST, CLOUDY = 0.2, 0.4  # shares of the skies
OPACITY = 4.0  # a cloud hides the sun more than it hides the sky


@dataclass(frozen=True)
class Sky:
    """The light over a place, with the truth about it."""

    radiance: NDArray[np.float32]  # (HEIGHT, 2 HEIGHT, 3) without the sun, black below the horizon
    lighting: Lighting
    sunlight: float  # share of the sun's light that the clouds let through, 0 to 1

    @property
    def is_overcast(self) -> bool:
        """Whether the sky hides where the sun is."""
        return self.sunlight < 0.03

    @property
    def sun_irradiance(self) -> Floats:
        """Irradiance (3,) of the sunlight below the clouds, on a plane that faces the sun."""
        lighting = self.lighting
        radiance = sun_radiance(lighting.sun_direction, lighting.turbidity)
        return np.asarray(radiance * (SUN_SOLID_ANGLE * lighting.exposure * self.sunlight))

    def disc(self, height: int) -> NDArray[np.float32]:
        """The sun's disc alone, dimmed by the clouds: (height, 2 height, 3)."""
        sun = render(self.lighting, height, sun=True) - render(self.lighting, height, sun=False)
        sun[height // 2 :] = 0.0
        return np.asarray(sun * self.sunlight, dtype=np.float32)


def random_sky(rng: np.random.Generator) -> Sky:
    """A sky with any sun from 2 to 80 deg above the horizon and any turbidity from 1.8 to 9."""
    lighting = Lighting(
        sun_azimuth=rng.uniform(-180, 180),
        sun_elevation=float(rng.triangular(2, 20, 80)),
        turbidity=float(np.exp(rng.uniform(np.log(1.8), np.log(9)))),
        exposure=EXPOSURE,
    )
    draw = rng.random()
    if draw < OVERCAST:
        return Sky(overcast(lighting, rng), lighting, 0.0)
    clear = render(lighting, HEIGHT, sun=False)
    clear[HEIGHT // 2 :] = 0.0
    return cloudy(clear, lighting, rng) if draw < OVERCAST + CLOUDY else Sky(clear, lighting, 1.0)


def overcast(lighting: Lighting, rng: np.random.Generator) -> NDArray[np.float32]:
    """The CIE overcast sky, at random brighter towards the hidden sun."""
    towards = latlong_directions(HEIGHT)
    up = towards[..., 1:2]
    glow = rng.uniform(0, 0.4) * np.exp(4 * (towards @ lighting.sun_direction - 1))[..., None]
    waves = 1 + rng.uniform(0, 0.25) * (noise(rng, up) - 0.5)
    dome = np.where(up > 0, ((1 + 2 * up) / 3 + glow) * waves, 0.0) * np.exp(rng.normal(0, (0.05, 0.02, 0.06)))
    return dome.astype(np.float32)


def cloudy(clear: NDArray[np.float32], lighting: Lighting, rng: np.random.Generator) -> Sky:
    """White clouds before a clear sky, brighter towards the sun, grey where they are thick."""
    towards = latlong_directions(HEIGHT)
    up, cosine = towards[..., 1:2], (towards @ lighting.sun_direction)[..., None]
    shape = noise(rng, up)
    threshold = np.quantile(shape[: HEIGHT // 2], 1 - rng.uniform(0.1, 0.7))
    alpha = np.clip((shape - threshold) / rng.uniform(0.04, 0.3), 0, 1) * (up > 0) * np.clip(up / 0.06, 0, 1)
    white = float(np.median(luminance(clear[: HEIGHT // 2]))) * rng.uniform(1.2, 2.5)
    cloud = white * (1 + 2.5 * np.exp(6 * (cosine - 1))) * (1 - rng.uniform(0, 0.5) * alpha**2)
    row, column = np.unravel_index(int(np.argmax(cosine)), cosine.shape[:2])
    sunlight = float((1 - alpha[row, column, 0]) ** OPACITY)
    return Sky((clear * (1 - alpha) + cloud * alpha).astype(np.float32), lighting, sunlight)


def noise(rng: np.random.Generator, up: Floats) -> Floats:
    """Fractal noise (H, 2H, 1), about 0 to 1, as on a plane above; `up` is the height of each direction."""
    towards = latlong_directions(HEIGHT)
    plane = towards[..., [0, 2]] / (np.maximum(up, 0.0) + rng.uniform(0.1, 0.4))
    total, weight = np.zeros(towards.shape[:2]), 0.0
    for octave in range(5):
        share = 0.55**octave
        total += share * _lattice(rng, plane * 2**octave)
        weight += share
    return np.asarray((total / weight)[..., None])


def _lattice(rng: np.random.Generator, plane: Floats) -> Floats:
    """Random values at whole coordinates, smoothly between them; repeats after 64."""
    values, start = rng.random((64, 64)), rng.uniform(0, 64, 2)
    cell = np.floor(plane + start).astype(int)
    part = plane + start - cell
    part = part * part * (3 - 2 * part)
    x, z = cell[..., 0] % 64, cell[..., 1] % 64
    x1, z1 = (x + 1) % 64, (z + 1) % 64
    near = values[x, z] * (1 - part[..., 0]) + values[x1, z] * part[..., 0]
    far = values[x, z1] * (1 - part[..., 0]) + values[x1, z1] * part[..., 0]
    return np.asarray(near * (1 - part[..., 1]) + far * part[..., 1])

"""What light is in an HDR panorama: its sun, its sky and its ground as a crop's exposure has them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from export.crops import Crop, pinhole
from export.evaluation.sphere import HEIGHT, pooled
from lighting.colour import luminance
from lighting.envmap import rotate, row_levels
from lighting.geometry import (
    Floats,
    angle_between,
    angles,
    camera_pixel,
    direction,
    latlong_angles,
    latlong_directions,
    latlong_solid_angle,
)
from lighting.prefilter import shrink

ROWS = 256  # of the maps in which suns are split off, at least: pixels are joined whole

_SEARCH = 6.0  # deg around the label's sun in which the brightest pixel counts as the sun
_REACH = 2.5  # deg around that pixel over which the sun's light is summed: lenses spread it
_RING = (3.0, 6.0)  # deg around it whose median is the sky before the sun


@dataclass(frozen=True, eq=False)
class TrueLight:
    """The light of one crop; maps have HEIGHT rows and the crop's azimuth 0 in the middle."""

    image: Floats  # (HEIGHT, 2 HEIGHT, 3)
    sun_direction: Floats | None  # (3,), None without direct sun
    sun_irradiance: Floats  # (3,) of a surface that faces the sun; 0 without direct sun
    sky_irradiance: Floats  # (3,) of a level surface from above, without the sun
    ground: Floats  # (3,) radiance, the mean that a level surface facing down receives


@dataclass(frozen=True, eq=False)
class Split:
    """A panorama at ROWS rows or a few more with its sun apart, in its own frame and units."""

    image: Floats  # (R, 2R, 3)
    sunless: Floats
    sun_azimuth: float  # deg, NaN without direct sun
    sun_elevation: float
    sun_irradiance: Floats  # (3,)


def split(image: NDArray[np.float32], near: Floats | None) -> Split:
    """A panorama (H, 2H, 3) with the sun near a direction (3,) apart; None where no direct light reaches the place."""
    small = shrink(image, len(image) // max(1, len(image) // ROWS))
    if near is None:
        return Split(small, small, math.nan, math.nan, np.zeros(3))
    sunless, sun, power = without_true_sun(small, near)
    azimuth, elevation = (float(angle) for angle in angles(sun))
    return Split(small, sunless, azimuth, elevation, power)


def true_light(panorama: Split, azimuth: float, gain: float) -> TrueLight:
    """The light of a camera that looks to an azimuth [deg] of a panorama, `gain` times as bright."""
    image, sunless = (rotate(m.astype(np.float32), -azimuth) * gain for m in (panorama.image, panorama.sunless))
    sun = direction(panorama.sun_azimuth - azimuth, panorama.sun_elevation)
    above, below = levels(sunless)
    return TrueLight(
        pooled(image), sun if math.isfinite(sun[0]) else None, panorama.sun_irradiance * gain, above, below / math.pi
    )


def without_true_sun(image: Floats, near: Floats) -> tuple[Floats, Floats, Floats]:
    """The map with the sky beside the sun in the sun's place, the sun's direction (3,), and its irradiance (3,)."""
    height = len(image)
    rays = latlong_directions(height)
    bright = np.where(angle_between(rays, near) < _SEARCH, luminance(image), -1.0)
    sun = rays[np.unravel_index(int(np.argmax(bright)), bright.shape)]
    away = angle_between(rays, sun)
    ring = (away > _RING[0]) & (away < _RING[1]) & (rays[..., 1] > 0)
    disc = (away <= _REACH) & (rays[..., 1] > 0)
    beside = np.median(image[ring], axis=0)
    weight = np.broadcast_to(latlong_solid_angle(height)[:, None], disc.shape)[disc]
    power = weight @ np.maximum(image[disc] - beside, 0.0)
    rest = np.array(image)
    rest[disc] = np.minimum(rest[disc], beside)
    return rest, sun, np.asarray(power)


def levels(image: Floats) -> tuple[Floats, Floats]:
    """Irradiance (3,) of level surfaces that face up and down, by a map (H, 2H, 3)."""
    rows = row_levels(len(image))[:, None] * image.mean(axis=1, dtype=np.float64)
    half = len(image) // 2
    return np.asarray(rows[:half].sum(axis=0)), np.asarray(rows[half:].sum(axis=0))


def mirrored_photo(crop: Crop) -> Floats:
    """The map (HEIGHT, 2 HEIGHT, 3) of a picture that is mirrored at its edges until it fills the sphere.

    The picture's own angles are known; what is brighter than white is clipped, as in a photo.
    """
    height, width = crop.linear.shape[:2]
    camera = pinhole(crop.camera, width, height)
    across = math.degrees(2 * math.atan(width / 2 / camera.focal_length))
    azimuth, elevation = latlong_angles(HEIGHT)
    tilt = crop.camera.elevation
    folded = tilt + _folded(elevation - tilt, camera.vertical_fov)
    inside = direction(_folded(azimuth, across)[None, :], folded[:, None])
    x, y = np.moveaxis(camera_pixel(inside, camera), -1, 0)
    column = np.clip(np.nan_to_num(x), 0, width - 1).astype(int)
    row = np.clip(np.nan_to_num(y), 0, height - 1).astype(int)
    return np.asarray(np.clip(crop.linear, 0, 1)[row, column])


def _folded(angle: Floats, span: float) -> Floats:
    """Angles [deg] folded like a fan into -span / 2 to span / 2."""
    there = np.mod(angle + span / 2, 2 * span)
    return np.asarray(np.where(there < span, there, 2 * span - there) - span / 2)


def mean_map(lights: Sequence[TrueLight]) -> Floats:
    """The mean of maps over panoramas and over azimuth (HEIGHT, 2 HEIGHT, 3)."""
    mean = np.mean([light.image.mean(axis=1, keepdims=True) for light in lights], axis=0)
    return np.asarray(mean.repeat(2 * HEIGHT, axis=1))

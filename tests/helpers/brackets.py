"""Bracketed exposures of known skies, and how exactly they are merged and aligned."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from lighting.envmap.render import render, sun_light
from lighting.geometry import Floats, angle_between, latlong_directions
from lighting.photo.linear import LinearPhoto
from lighting.probe.alignment import yaw_rotation
from lighting.probe.bracket import make_bracket
from lighting.probe.develop import BracketSettings, Moment, make_probe
from lighting.probe.fisheye import Lens, project_to_lens, resample_to_latlong, unproject_from_lens
from lighting.probe.merging import clipped_mask
from lighting.records import Lighting
from lighting.sky.clear_sky import sky_radiance, sun_disc_points, sun_disc_radiance

BRACKET_TIMES = tuple(float(time) for time in np.geomspace(1 / 8000, 1, 7))  # s
ELECTRONS = 50_000.0  # at full scale, of a full-frame camera at its base sensitivity
READ_ELECTRONS = 3.0
SKY_PLACE = (47.0, 8.0)  # deg
SKY_DAY = datetime(2024, 6, 1, 9, 0, tzinfo=UTC)
_TURBIDITY = 3.0  # of the synthetic clear skies
_MAP_HEIGHT = 256  # rows of the maps compared
SKY_FILL = 8.0  # of full scale: the peak in the shortest exposure when the sky is exposed for, and the sun clips

_DARK = 0.05  # quantile that counts as the darkest sky


@dataclass(frozen=True)
class BracketCamera:
    """A camera's bits, and how much of its full scale the brightest pixel fills in the shortest exposure."""

    bits: int = 14  # of an integer
    fill: float = 0.8  # of full scale; over 1, the sun clips in every exposure
    noise: bool = True  # of light and of reading


def clear_sky_at(moment: Moment) -> Lighting:
    """A clear sky of a moment.

    Args:
        moment: when and where.
    """
    azimuth, elevation = moment.sun
    return Lighting(sun_azimuth=azimuth, sun_elevation=elevation, turbidity=_TURBIDITY, exposure=1.0)


def photograph_sky(lighting: Lighting, lens: Lens, rotation: Floats) -> NDArray[np.float32]:
    """Mean radiance (h, w, 3) that each pixel of a lens sees of the sky and the sun; 0 outside its circle.

    The sky is sampled in the middle of each pixel. The sun's disc is summed point by point into the pixels that it
    falls on, so that its power is exact.

    Args:
        lighting: sun, turbidity and exposure.
        lens: with its size in pixels.
        rotation: (3, 3) from the camera's axes to the world's.
    """
    pixels = np.stack(np.meshgrid(np.arange(lens.width) + 0.5, np.arange(lens.height) + 0.5), axis=-1)
    rays = unproject_from_lens(lens, pixels) @ rotation.T
    inside = np.isfinite(rays).all(axis=-1)
    sun = lighting.sun_direction
    picture = np.zeros((lens.height, lens.width, 3))
    picture[inside] = sky_radiance(rays[inside], sun, lighting.turbidity, lighting.ground_albedo)
    points, weight = sun_disc_points(sun)
    at = np.floor(project_to_lens(lens, points @ rotation)).astype(np.intp)
    radiance = sun_disc_radiance(points, sun, lighting.turbidity) * weight[:, None]
    np.add.at(picture, (at[:, 1], at[:, 0]), radiance / _pixel_solid_angle(lens, at)[:, None])
    return np.asarray(picture * lighting.exposure, dtype=np.float32)


def _pixel_solid_angle(lens: Lens, at: NDArray[np.intp]) -> Floats:
    """Solid angle [sr] (N,) of the pixels in these columns and rows (N, 2)."""
    a, b, c, d = (unproject_from_lens(lens, at + np.array(corner)) for corner in ((0, 0), (1, 0), (1, 1), (0, 1)))
    return np.asarray(np.linalg.norm(np.cross(c - a, d - b), axis=-1) / 2)


def expose_bracket(
    picture: NDArray[np.float32],
    camera: BracketCamera,
    rng: np.random.Generator,
    times: Sequence[float] = BRACKET_TIMES,
) -> list[LinearPhoto]:
    """A bracket of a picture, the longest exposure last.

    Args:
        picture: (h, w, 3) radiance.
        camera: its bits and noise.
        rng: of the noise.
        times: s, relative exposures, ascending.
    """
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


def bracket_gain(picture: NDArray[np.float32], camera: BracketCamera, times: Sequence[float] = BRACKET_TIMES) -> float:
    """Merged radiance / true radiance of such a bracket."""
    return camera.fill / (float(picture.max()) * min(times))


# Errors of a merged bracket.


@dataclass(frozen=True)
class _BracketErrors:
    """A merged synthetic bracket against its truth."""

    sky: float  # root mean square of the relative error over the sky
    longest: float  # the same of the longest exposure alone, without any merging
    steps: float  # of the camera's rounding, that red has in it in the darkest twentieth of the sky
    sun: float  # largest relative error of the sun's irradiance over the channels
    clipped: bool  # whether the probe says so of the sun
    rotation: float  # deg, between the estimated and the true one


def measure_bracket(camera: BracketCamera, moment: Moment, lens: Lens, yaw: float, seed: int = 0) -> _BracketErrors:
    """Photograph a clear sky, merge it and compare."""
    lighting, rotation = clear_sky_at(moment), yaw_rotation(yaw)
    picture = photograph_sky(lighting, lens, rotation)
    bracket = make_bracket(expose_bracket(picture, camera, np.random.default_rng(seed)))
    settings = BracketSettings(
        kind=lens.kind,
        fov=lens.fov,
        center=lens.center,
        radius=lens.radius,
        camera_elevation=lens.elevation,
        height=_MAP_HEIGHT,
    )
    probe = make_probe(bracket, moment, settings)
    assert probe.spot is not None
    assert probe.alignment is not None
    gain = bracket_gain(picture, camera)
    power = probe.spot.irradiance / gain / sun_light(lighting)[0] - 1
    longest, seconds = bracket.photos[-1], BRACKET_TIMES[-1]
    radiance = longest.pixels / np.float32(seconds)
    single = resample_to_latlong(radiance, clipped_mask(longest), lens, rotation, _MAP_HEIGHT)[0]
    sky, alone = (_sky_error(image, lighting, gain) for image in (probe.image, single))
    steps = float(np.quantile(picture[picture.any(axis=-1), 0], _DARK) * gain * seconds / longest.step)
    turned = rotation_between(probe.alignment.rotation, rotation)
    return _BracketErrors(sky, alone, steps, float(np.abs(power).max()), probe.spot.clipped, turned)


def _sky_error(image: NDArray[np.float32], lighting: Lighting, gain: float) -> float:
    """Relative root mean square over the sky above 5 deg and 5 deg from the sun, of a map (H, 2H, 3)."""
    rays = latlong_directions(len(image))
    sky = (rays[..., 1] > np.sin(np.radians(5))) & (angle_between(rays, lighting.sun_direction) > 5)
    truth = render(lighting, len(image), sun=False)[sky]
    return float(np.sqrt(np.mean((image[sky] / gain / truth - 1) ** 2)))


def rotation_between(a: Floats, b: Floats) -> float:
    """The angle [deg] of the rotation between two."""
    return float(np.degrees(np.arccos(np.clip((np.trace(a @ b.T) - 1) / 2, -1, 1))))

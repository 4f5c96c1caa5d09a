"""Environment maps of a Lighting: the sky, a sun of the right power, and the ground that they light.

An environment map is a lat-long image (H, 2H, 3), float32, linear Rec.709, in the pixel layout of geometry.py. Its
values are `exposure` x the sky model's radiance, which are the photo's own linear values.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lighting.errors import ParameterError
from lighting.geometry import SUN_RADIUS, Floats, angles, direction, latlong_angles, latlong_solid_angle, wrap_azimuth
from lighting.records import Lighting
from lighting.sky import (
    sky_gradation,
    sky_lobe,
    sky_parameters,
    sun_disc_points,
    sun_disc_radiance,
)

Image = NDArray[np.float32]

MIN_HEIGHT, MAX_HEIGHT = 16, 4096

_LOBE_STEPS = 1 << 16  # of the table over the angle to the sun; taking the nearest entry errs by less than 3e-4
_CHUNK = 1 << 17  # pixels painted at once, few enough for the processor's cache
_IRRADIANCE_HEIGHT = 128  # rows of the sky that is integrated to light the ground; accurate to 2e-4
_FINE_HEIGHT = 8192  # rows of the grid that samples the disc: 24 across it
_FINE_PER_PIXEL = 4  # least number of grid rows per row of pixels
_WHOLE_PIXEL = 1e-6  # pixels; a yaw this close to a whole number of pixels counts as one


def render(lighting: Lighting, height: int = 512, *, sun: bool | None = None, disc: bool = True) -> Image:
    """Environment map (H, 2H, 3) of a lighting; `height` is even, 16 to 4096.

    `sun` says whether the disc is painted; None paints it when `sun_visibility` is at least 0.5. The sum of the disc's
    radiance x solid angle is the same at every height, and the ground is lit by what is painted. Without `disc` the sun
    lights the ground and is left for a light of its own. Raises ParameterError for another height.
    """
    _check_height(height)
    painted = lighting.sun_shines if sun is None else sun
    image = np.empty((height, 2 * height, 3), dtype=np.float32)
    lobe = _lobe_table(lighting)
    power, irradiance = _disc_power(lighting) if painted else (np.zeros(3), np.zeros(3))
    _paint_sky(image[: height // 2], lighting, lobe)
    ground = lighting.ground_albedo / math.pi * (irradiance + _sky_irradiance(lighting, lobe))
    _paint_ground(image[height // 2 :], ground)
    if painted and disc:
        _paint_sun(image, lighting, power)
    return image


def rotate(image: Image, yaw: float) -> Image:
    """The map turned by `yaw` [deg]: what was at azimuth a is at a + yaw. Exact for a whole number of pixels.

    Otherwise neighbouring pixels are interpolated linearly, also across the seam. Raises ParameterError unless finite.
    """
    if not math.isfinite(yaw):
        raise ParameterError(f"yaw must be a finite number, not {yaw!r}.")
    shift = yaw % 360.0 / 360.0 * image.shape[1]
    whole = math.floor(shift + _WHOLE_PIXEL)
    share = np.float32(shift - whole)
    turned = np.roll(image, whole, axis=1)
    if share <= _WHOLE_PIXEL:
        return turned
    return np.asarray(turned * (1 - share) + np.roll(turned, 1, axis=1) * share)


def turn(lighting: Lighting, yaw: float) -> Lighting:
    """The record of a map turned by `yaw` [deg]; its azimuth 0 lies `yaw` to the left of where the camera points."""
    azimuth = float(wrap_azimuth(lighting.sun_azimuth + yaw))
    if lighting.camera_heading is None:
        return replace(lighting, sun_azimuth=azimuth)
    degrees, probability = np.arange(360.0), lighting.camera_heading_probability
    shifted = np.interp(degrees + yaw, degrees, probability, period=360.0) if probability else np.array([])
    return replace(
        lighting,
        sun_azimuth=azimuth,
        camera_heading=(lighting.camera_heading - yaw) % 360.0,
        camera_heading_probability=tuple(shifted.tolist()),
    )


def sun_irradiance(lighting: Lighting) -> Floats:
    """Irradiance (3,) on a surface that faces the sun: radiance x solid angle of the disc above the horizon."""
    return _disc_power(lighting)[0]


def sky_irradiance(lighting: Lighting) -> Floats:
    """Irradiance (3,) of open level ground by the sky, without the sun's disc."""
    return _sky_irradiance(lighting, _lobe_table(lighting))


def view(lighting: Lighting, height: int = 512, *, sun: bool | None = None, yaw: float = 0.0) -> tuple[Image, Lighting]:
    """The rendered map turned by `yaw` [deg], and the lighting turned with it; parameters as in `render`."""
    image = render(lighting, height, sun=sun)
    return (rotate(image, yaw), turn(lighting, yaw)) if yaw else (image, lighting)


def _check_height(height: int) -> None:
    if isinstance(height, bool) or not isinstance(height, int) or height % 2 or not MIN_HEIGHT <= height <= MAX_HEIGHT:
        raise ParameterError(f"height is {height!r}; it must be an even number from {MIN_HEIGHT} to {MAX_HEIGHT}.")


def _lobe_table(lighting: Lighting) -> Image:
    """`sky_lobe` of each channel (3, steps + 1) at equal steps of the angle to the sun, 0 to 180 deg."""
    chord = 2 * np.sin(np.linspace(0.0, math.pi / 2, _LOBE_STEPS + 1, dtype=np.float32))
    coefficients, _ = sky_parameters(lighting.sun_elevation, lighting.turbidity, lighting.ground_albedo)
    return np.stack([sky_lobe(row, chord * chord) for row in coefficients])


def _paint_sky(image: Image, lighting: Lighting, lobe: Image) -> None:
    """Fill the upper half (H / 2, 2H, 3) of a map: per row a factor and an offset, per pixel one look-up of the lobe.

    The angle g between two directions follows from sin^2(g / 2) = sin^2(de / 2) + cos e cos e' sin^2(da / 2), of which
    the row gives all but the last factor and the column that one; this keeps its precision next to the sun.
    """
    factor, offset = _row_terms(lighting, 2 * len(image))
    azimuth, elevation = latlong_angles(2 * len(image))
    sun = math.radians(lighting.sun_elevation)
    vertical = _f32(np.sin((np.radians(elevation) - sun) / 2) ** 2)
    horizontal = _f32(np.cos(np.radians(elevation)) * math.cos(sun))
    column = _f32(np.sin(np.radians(azimuth - lighting.sun_azimuth) / 2) ** 2)
    rows = max(1, _CHUNK // image.shape[1])
    for start in range(0, len(image), rows):
        part = slice(start, min(start + rows, len(image)))
        half_sine = np.sqrt(vertical[part, None] + horizontal[part, None] * column)
        step = np.arcsin(np.minimum(half_sine, 1)) * np.float32(_LOBE_STEPS / (math.pi / 2))
        index = (step + np.float32(0.5)).astype(np.intp)
        for channel in range(3):
            value = lobe[channel].take(index)
            value += offset[channel, part, None]
            value *= factor[channel, part, None]
            np.maximum(value, 0, out=image[part, :, channel])


def _row_terms(lighting: Lighting, height: int) -> tuple[Image, Image]:
    """Factor and offset (3, H / 2) of the rows above the horizon, exposure and mean radiance in the factor."""
    up = np.sin(np.radians(latlong_angles(height)[1][: height // 2]))
    coefficients, radiance = sky_parameters(lighting.sun_elevation, lighting.turbidity, lighting.ground_albedo)
    terms = [sky_gradation(row, up) for row in coefficients]
    factor = np.stack([factor for factor, _ in terms]) * radiance[:, None] * lighting.exposure
    return _f32(factor), _f32(np.stack([offset for _, offset in terms]))


def _paint_ground(image: Image, radiance: Floats) -> None:
    """Fill the lower half (H / 2, 2H, 3) with one colour (3,); copying whole rows is fastest."""
    image[0] = radiance
    image[1:] = image[0]


def _sky_irradiance(lighting: Lighting, lobe: Image) -> Floats:
    """Irradiance (3,) of a horizontal surface by the sky without the disc."""
    half = _IRRADIANCE_HEIGHT // 2
    sky = np.empty((half, 2 * _IRRADIANCE_HEIGHT, 3), dtype=np.float32)
    _paint_sky(sky, lighting, lobe)
    edges = np.sin(np.linspace(math.pi / 2, 0, half + 1)) ** 2
    return np.asarray((edges[:-1] - edges[1:]) @ sky.mean(axis=1, dtype=np.float64)) * math.pi


def _exposed_disc(directions: Floats, lighting: Lighting) -> Floats:
    return sun_disc_radiance(directions, lighting.sun_direction, lighting.turbidity) * lighting.exposure


def _paint_sun(image: Image, lighting: Lighting, disc_power: Floats) -> None:
    """Add the disc: the mean over each pixel of its radiance on a finer grid, scaled to the disc's exact power."""
    height, width = image.shape[:2]
    row, column, directions = _fine_grid(lighting, height)
    radiance = _exposed_disc(directions, lighting)
    power = radiance * np.hypot(directions[..., 0], directions[..., 2])[..., None]  # x the cell's relative solid angle
    lit = radiance.any(axis=-1)
    pixels, inverse = np.unique((row[:, None] * width + column % width)[lit], return_inverse=True)
    sums = np.stack([np.bincount(inverse, power[lit][:, channel], len(pixels)) for channel in range(3)], axis=-1)
    scale = disc_power / np.maximum(sums.sum(axis=0), np.finfo(np.float64).tiny)
    image.reshape(-1, 3)[pixels] += _f32(sums * scale / latlong_solid_angle(height)[pixels // width, None])


def _disc_power(lighting: Lighting) -> tuple[Floats, Floats]:
    """Radiance x solid angle (3,) of the part of the disc above the horizon, and the irradiance (3,) of the ground."""
    points, weight = sun_disc_points(lighting.sun_direction)
    radiance = _exposed_disc(points, lighting)
    return np.asarray(weight @ radiance), np.asarray((weight * points[:, 1]) @ radiance)


def _fine_grid(lighting: Lighting, height: int) -> tuple[NDArray[np.intp], NDArray[np.intp], Floats]:
    """A grid over the visible disc, finer than a map's pixels: its directions (R, C, 3) and the map's row (R,) and
    column (C,) that each of its rows and columns lies in; columns may run over the seam.
    """
    azimuth, elevation = (float(angle) for angle in angles(lighting.sun_direction))
    widest = math.cos(math.radians(max(elevation - SUN_RADIUS, 0.0)))
    split = max(_FINE_PER_PIXEL, -(-_FINE_HEIGHT // height))
    across = math.ceil(split * widest)
    if elevation + SUN_RADIUS >= 90.0:
        columns = np.arange(2 * height * across)
    else:
        reach = math.degrees(math.asin(math.sin(math.radians(SUN_RADIUS)) / math.cos(math.radians(elevation))))
        columns = _cells(azimuth + 180.0 - reach, azimuth + 180.0 + reach, height * across / 180.0)
    rows = _cells(90.0 - elevation - SUN_RADIUS, 90.0 - elevation + SUN_RADIUS, height * split / 180.0)
    rows = rows[rows >= 0]
    fine_azimuth = (columns + 0.5) * (180.0 / (height * across)) - 180.0
    fine_elevation = 90.0 - (rows + 0.5) * (180.0 / (height * split))
    return rows // split, columns // across, direction(fine_azimuth, fine_elevation[:, None])


def _cells(start: float, end: float, per_degree: float) -> NDArray[np.intp]:
    """Indices of the cells between two angles [deg]."""
    return np.arange(math.floor(start * per_degree), math.ceil(end * per_degree))


def _f32(values: Floats) -> Image:
    return np.asarray(values, dtype=np.float32)

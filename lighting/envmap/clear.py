"""Clear skies by the model of Hosek and Wilkie, painted with tables along two axes."""

import math
from functools import lru_cache

import numpy as np

from lighting.envmap.maps import Image, f32, row_levels
from lighting.geometry import Floats, latlong_angles
from lighting.records import Lighting
from lighting.sky.hosek_wilkie import sky_gradation, sky_lobe, sky_parameters

_LOBE_STEPS = 1 << 16  # of the table by the angle to the sun; taking the nearest entry errs by less than 4e-4
_CHUNK = 1 << 17  # pixels painted at once, few enough for the processor's cache
_IRRADIANCE_HEIGHT = 128  # rows of the sky that is integrated to light the ground; accurate to 2e-4


def lobe_table(lighting: Lighting) -> Image:
    """`sky_lobe` of each channel (3, steps + 1) at the angles to the sun that `paint_clear` looks up."""
    return _lobe_table(lighting.sun_elevation, lighting.turbidity, lighting.ground_albedo)


@lru_cache(maxsize=1)  # a photo's sky is looked at before it is painted
def _lobe_table(sun_elevation: float, turbidity: float, ground_albedo: float) -> Image:
    angle, chord2 = _lobe_angles()
    coefficients, _ = sky_parameters(sun_elevation, turbidity, ground_albedo)
    table = np.stack([sky_lobe(row, chord2, angle) for row in coefficients])
    table.setflags(write=False)  # since others get it as well
    return table


@lru_cache(maxsize=1)
def _lobe_angles() -> tuple[Image, Image]:
    """The table's angles to the sun [rad] (steps + 1,), and their squared chords."""
    share = np.linspace(0.0, 1.0, _LOBE_STEPS + 1)
    angle = f32(2 * np.arctan2(share, 1 - share))
    return angle, np.square(2 * np.sin(angle / 2))


def paint_clear(image: Image, lighting: Lighting, lobe: Image) -> None:
    """Fill the upper half (H / 2, 2H, 3) of a map: per row a factor and an offset, per pixel one look-up of the lobe.

    The angle g between two directions follows from sin^2(g / 2) = sin^2(de / 2) + cos e cos e' sin^2(da / 2), of which
    the row gives all but the last factor and the column that one; this keeps its precision next to the sun. The table
    goes by sin(g / 2) / (sin(g / 2) + cos(g / 2)), which is as fine at both ends and needs no arcsine.
    """
    factor, offset = _row_terms(lighting, 2 * len(image))
    azimuth, elevation = latlong_angles(2 * len(image))
    sun = math.radians(lighting.sun_elevation)
    vertical = f32(np.sin((np.radians(elevation) - sun) / 2) ** 2)
    horizontal = f32(np.cos(np.radians(elevation)) * math.cos(sun))
    column = f32(np.sin(np.radians(azimuth - lighting.sun_azimuth) / 2) ** 2)
    rows = max(1, _CHUNK // image.shape[1])
    for start in range(0, len(image), rows):
        part = slice(start, min(start + rows, len(image)))
        # numpy clips at two ends in a third of the time that it takes at one
        sine2 = np.clip(vertical[part, None] + horizontal[part, None] * column, 0, 1)
        sine, cosine = np.sqrt(sine2), np.sqrt(1 - sine2)
        index = (sine / (sine + cosine) * np.float32(_LOBE_STEPS) + np.float32(0.5)).astype(np.intp)
        for channel in range(3):
            value = lobe[channel].take(index)
            value += offset[channel, part, None]
            value *= factor[channel, part, None]
            image[part, :, channel] = np.clip(value, 0, np.inf, out=value)


def _row_terms(lighting: Lighting, height: int) -> tuple[Image, Image]:
    """Factor and offset (3, H / 2) of the rows above the horizon, exposure and mean radiance in the factor."""
    up = np.sin(np.radians(latlong_angles(height)[1][: height // 2]))
    coefficients, radiance = sky_parameters(lighting.sun_elevation, lighting.turbidity, lighting.ground_albedo)
    terms = [sky_gradation(row, up) for row in coefficients]
    factor = np.stack([factor for factor, _ in terms]) * radiance[:, None] * lighting.exposure
    return f32(factor), f32(np.stack([offset for _, offset in terms]))


def clear_irradiance(lighting: Lighting, lobe: Image) -> Floats:
    """Irradiance (3,) of a horizontal surface by the sky without the disc."""
    half = _IRRADIANCE_HEIGHT // 2
    sky = np.empty((half, 2 * _IRRADIANCE_HEIGHT, 3), dtype=np.float32)
    paint_clear(sky, lighting, lobe)
    return np.asarray(row_levels(_IRRADIANCE_HEIGHT)[:half] @ sky.mean(axis=1, dtype=np.float64))

"""Training targets beside the sun's direction: irradiances, the surroundings, where in the picture the sun is.

An HDR panorama with an unclipped sun tells both powers. An 8-bit one tells the sky's as far as it is not clipped. How
much a sun that shines adds to it then follows from a clear sky of the same sun, which is a weaker truth.

The surroundings are a coarse map of radiance, in the crop's exposure and white balance. They hold many values where the
sun's direction is a single one, so a network that predicts them has learnt more from a panorama than which place it is.
What is learnt also completes the maps that reflect the place.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from PIL import Image

from export.crops.crops import Camera, Crop, Source, resize
from export.data.panoramas import linearize
from lighting.envmap.render import sky_irradiance, sun_light
from lighting.geometry import Floats, direction, latlong_directions, latlong_solid_angle
from lighting.prediction import ModelSpec
from lighting.records import Lighting

_SUN_RADIUS = 4.0  # deg around an unclipped sun that belong to it
_GLARE = (6.0, 10.0)  # deg around it, whose mean is taken for the sky behind the sun
_CLIPPED = 0.98  # linear values of an 8-bit picture from here on may stand for anything brighter
_MAX_CLIPPED_SHARE = 0.12  # of the sky's cosine-weighted solid angle; with more, the sky's power is unknown
_CLEAR_TURBIDITY = 3.0  # of the sky whose sun stands in for a clipped one
_VISIBLE_RATIO = (1.2, 1.55, 2.1)  # median of the unclipped panoramas' ratio over that sky's: trees and walls hide sky
_COVERED_SUN = 0.01  # power of a sun that does not shine, as a share of the sky's
_COVER = {"yes": 0.0, "partly": 0.4, "no": 0.8}

ROWS, COLUMNS = 12, 24  # cells of the map of the surroundings
CELLS = ROWS * COLUMNS
MIN_RADIANCE = 0.01  # added to radiances before the logarithm
MAX_CELL = 4.0  # the photo's white is 1; the sun's disc counts no more than this
_FINE = 6  # parts of a row and of a column, the steps by which the map is rotated

CELL = 16  # pixels of the canvas along one side of a cell in which the sun may be
_TARGET_STD = 0.7  # cells, of the target around the sun


@dataclass(frozen=True)
class _Irradiance:
    """Targets of one panorama; NaN where it does not tell."""

    sun: Floats  # (3,) on a plane that faces the sun
    sky: Floats  # (3,) on a level plane, all that lies above the horizon but the sun
    cover: float  # 0 clear, 1 overcast


def panorama_irradiance(source: Source) -> _Irradiance:
    """The irradiances of a panorama's sun and sky, as far as it tells them.

    Args:
        source: with its label.
    """
    linear = np.asarray(linearize(source.panorama, source.levels[-1]), dtype=np.float64)
    sun, sky = _measure(linear, source)
    label, direct = source.label, source.panorama.direct
    if direct == "no":
        sun = _COVERED_SUN * sky
    elif direct == "yes" and not np.isfinite(sun).all() and math.isfinite(label.sun_elevation):
        sun = sky * clear_sun_to_sky_ratio(round(max(label.sun_elevation, 0.0)))
    cover = 1.0 if source.panorama.sun == "none" else _COVER.get(direct, math.nan)
    return _Irradiance(sun, sky, cover)


@lru_cache(maxsize=128)
def clear_sun_to_sky_ratio(elevation: int) -> Floats:
    """Power of a clear sky's sun over that of what lies above the horizon (3,).

    Args:
        elevation: deg, of the sun above the horizon.
    """
    clear = Lighting(0.0, float(elevation), _CLEAR_TURBIDITY, 1.0)
    return np.asarray(sun_light(clear)[0] / sky_irradiance(clear)) * _VISIBLE_RATIO


def _measure(linear: Floats, source: Source) -> tuple[Floats, Floats]:
    """Powers (3,) of sun and sky in the picture; NaN where they are clipped."""
    height = len(linear)
    rays = latlong_directions(height)[: height // 2]
    solid = latlong_solid_angle(height)[: height // 2, None]
    above = linear[: height // 2].copy()
    unknown = np.full(3, math.nan)
    sun, label = unknown, source.label
    if source.panorama.kind == "hdr" and source.panorama.sun_is_unclipped:
        distance = np.degrees(np.arccos(np.clip(rays @ direction(label.sun_azimuth, label.sun_elevation), -1, 1)))
        behind = above[(distance > _GLARE[0]) & (distance < _GLARE[1])].mean(axis=0)
        disc = distance < _SUN_RADIUS
        sun = ((above - behind) * solid[..., None])[disc].sum(axis=0)
        above[disc] = behind
    weight = solid * rays[..., 1]
    clipped = (above.max(axis=-1) > _CLIPPED) & (source.panorama.kind == "ldr")
    if (weight * clipped).sum() > _MAX_CLIPPED_SHARE * weight.sum():
        return sun, unknown
    return np.maximum(sun, 1e-6), np.asarray((above * weight[..., None]).sum(axis=(0, 1)))


def coarse_radiance(source: Source) -> Floats:
    """Linear radiance (_FINE * ROWS, _FINE * COLUMNS, 3) of a panorama, in its own exposure.

    Args:
        source: its smallest level is read.
    """
    linear = np.asarray(linearize(source.panorama, source.levels[-1]), dtype=np.float32)
    return resize(linear, _FINE * COLUMNS, _FINE * ROWS, Image.Resampling.BOX)


def surroundings_in_camera(radiance: Floats, camera: Camera, gains: Floats) -> Floats:
    """Log radiance (ROWS * COLUMNS * 3,) row by row, the camera's azimuth in the map's middle, mirrored as the crop is.

    Args:
        radiance: that of `coarse_radiance`.
        camera: of the crop.
        gains: (3,) factors from the panorama's values to the photo's.
    """
    rolled = np.roll(radiance, -round(camera.azimuth / 360 * _FINE * COLUMNS), axis=1)
    rolled = rolled[:, ::-1] if camera.mirrored else rolled
    rows = rolled.reshape(ROWS, _FINE, _FINE * COLUMNS, 3).mean(axis=1)
    cells = np.minimum(rows * gains, MAX_CELL).reshape(ROWS, COLUMNS, _FINE, 3).mean(axis=2)
    return np.asarray(np.log(cells + MIN_RADIANCE), dtype=np.float32).ravel()


def sun_in_view_target(crop: Crop, spec: ModelSpec, visible: bool | None) -> Floats:
    """Probabilities (1 + cells,) that the picture shows no sun, and that each cell does, row by row; zeros if unknown.

    A crop that looks elsewhere shows none.

    Args:
        crop: with the sun's direction.
        spec: of the network whose canvas has the cells.
        visible: whether the panorama shows the sun; None if unknown.
    """
    rows, columns = spec.height // CELL, spec.width // CELL
    probability: Floats = np.zeros(1 + rows * columns)
    if visible is None:
        return probability
    pixel = crop.sun_pixel if visible else None
    if pixel is None:
        probability[0] = 1.0
        return probability
    height, width = crop.linear.shape[:2]
    margin = np.array([(spec.width - width) // 2, (spec.height - height) // 2])
    x, y = (np.array(pixel) + margin) / CELL - 0.5
    squared_distance = (np.arange(columns)[None, :] - x) ** 2 + (np.arange(rows)[:, None] - y) ** 2
    bell = np.exp(-squared_distance / (2 * _TARGET_STD**2)).ravel()
    probability[1:] = bell / bell.sum()
    return probability

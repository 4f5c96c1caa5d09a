"""The colour of the ground, from the pixels of a photo below its horizon."""

import numpy as np
from numpy.typing import NDArray

from lighting.colour import luminance
from lighting.envmap.maps import irradiance_of, row_levels
from lighting.envmap.photo_view import sampled
from lighting.envmap.render import level_irradiance
from lighting.geometry import Floats
from lighting.records import Lighting

_BELOW = (0.2, 0.05)  # sines of the angle below the horizon; the first one counts below which enough ground is seen
_LEAST = 0.02  # share of the picture that must show ground
_KEPT = (0.25, 0.75)  # quantiles of brightness between which pixels count
_RANGE = (0.02, 0.9)  # of the reflectance
_BLACK = 1e-6  # radiance or irradiance that stands for none
_OTHER = 0.6  # how far the brightness goes, under a clear sky, to that of the ground all around as the network has it;
_DARKER = 0.2  # stops by which that is too dark; `python -m export fit ground`, on places that a network never saw


def photo_ground(
    pixels: NDArray[np.uint8], lighting: Lighting, around: NDArray[np.float32] | None = None
) -> Floats | None:
    """Reflectance (3,) of the ground that a photo (h, w, 3, sRGB) shows under the lighting's irradiances.

    It is the mean of the linear values well below the estimated horizon (near it things stand upright), without the
    darkest and the brightest quarter, over (sky + sin(elevation) x sun) / pi. With `around`, an estimate's, its
    brightness is drawn to that of the ground which the photo does not show, the less the cloudier the sky is, for there
    the network errs more. None where the photo shows too little ground or the irradiances are not known.
    """
    if lighting.sky_irradiance is None or lighting.sun_irradiance is None:
        return None
    photo, directions = sampled(pixels, lighting)
    down = -directions[..., 1]
    seen = next((down > below for below in _BELOW if np.mean(down > below) >= _LEAST), None)
    if seen is None:
        return None
    ground = photo[seen]
    grey = ground.mean(axis=1)
    low, high = _quantiles(grey, _KEPT)
    inside = (grey >= low) & (grey <= high)
    level = np.maximum(level_irradiance(lighting), _BLACK)
    found = ground[inside].mean(axis=0)
    if around is not None:
        share = _OTHER * (1 - (lighting.sky_cover or 0.0))
        found = found * (2**_DARKER * brightness_below(around) / max(float(luminance(found)), _BLACK)) ** share
    return np.asarray(np.clip(np.pi * found / level, *_RANGE))


def brightness_below(around: NDArray[np.float32]) -> float:
    """Luminance of the ground in a coarse panorama (R, C, 3), as level ground that faces down would receive it."""
    half = len(around) // 2
    return float(luminance(irradiance_of(row_levels(len(around))[half:], around[half:]))) / np.pi


def _quantiles(values: Floats, shares: tuple[float, float]) -> Floats:
    """numpy's quantiles of values (N,), without the module of masked arrays that numpy imports for them."""
    return np.asarray(np.interp(np.array(shares) * (len(values) - 1), np.arange(len(values)), np.sort(values)))

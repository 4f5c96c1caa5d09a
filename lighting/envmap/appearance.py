"""Ground albedo and sky colour read from the photo."""

import numpy as np
from numpy.typing import NDArray

from lighting.color import luminance
from lighting.envmap.latlong import irradiance_from_rows, max_channel, row_irradiance
from lighting.envmap.projection import CLIPPED, sample_photo
from lighting.envmap.render import level_irradiance, render
from lighting.geometry import Floats, sample_latlong
from lighting.records import Lighting

# The colour of the sky, from the pixels of a photo above its horizon.

_HEIGHT = 32  # rows of the map with which the photo is compared
_MIN_SIN_ELEVATION = 0.05  # sine of the angle above the horizon from which a pixel may show sky
_MAX_STEP = 0.1  # largest step of brightness, 0 to 1, from a pixel of sky to its neighbours
_MIN_SKY_LUMINANCE = 0.6  # share of the map's luminance there that a pixel of sky has at least
_MIN_SKY_SHARE = 0.02  # share of the picture that must show sky
_MAX_SAMPLES = 500  # pixels, of which the mean is exact enough
_TINT_EXPONENT = (
    0.11,
    0.51,
)  # power of that ratio under a clear sky, and what cover squared adds; fitted on crops of `train`
_EPSILON = 1e-9  # radiance or irradiance that stands for none
_MAX_COLOR_RATIO = 2.0  # most by which a channel changes against green


def sky_white_balance(pixels: NDArray[np.uint8], lighting: Lighting) -> Floats | None:
    """Factors (3,) that bring the sky's irradiance nearer to the colour of the sky in a photo (h, w, 3, sRGB).

    A cloudy sky has one colour, so there the photo counts for much; a clear one differs from place to place, and what
    is seen low over the horizon says little of the rest. Luminance stays. None where the photo shows too little sky or
    the irradiances are not known.
    """
    off = sky_color_ratio(pixels, lighting)
    if off is None:
        return None
    said = np.array(lighting.sky_irradiance) + _EPSILON
    tint = off ** (_TINT_EXPONENT[0] + _TINT_EXPONENT[1] * (lighting.sky_cover or 0.0) ** 2)
    return np.asarray(tint * float(luminance(said) / luminance(said * tint)))


def sky_color_ratio(pixels: NDArray[np.uint8], lighting: Lighting) -> Floats | None:
    """The colour (3,) of the sky that a photo shows over that of the bare map in the same directions; green is 1.

    Smooth, bright pixels above the estimated horizon count as sky. None as `photo_sky`.
    """
    if lighting.sky_irradiance is None:
        return None
    photo, directions = sample_photo(pixels, lighting)
    smooth = _brightness_steps(np.sqrt(luminance(photo))) < _MAX_STEP
    likely = np.nonzero(smooth & (directions[..., 1] > _MIN_SIN_ELEVATION) & (max_channel(photo) < CLIPPED))
    least = _MIN_SKY_SHARE * smooth.size
    if len(likely[0]) < least:
        return None
    some = tuple(axis[:: len(axis) // _MAX_SAMPLES + 1] for axis in likely)
    seen, there = photo[some], sample_latlong(render(lighting, _HEIGHT, sun=False), directions[some])
    sky = luminance(seen) > _MIN_SKY_LUMINANCE * luminance(there)
    if sky.mean() * len(likely[0]) < least:
        return None
    ratio = seen[sky].mean(axis=0) / np.maximum(there[sky].mean(axis=0), _EPSILON)
    return np.asarray(np.clip(ratio / max(ratio[1], _EPSILON), 1 / _MAX_COLOR_RATIO, _MAX_COLOR_RATIO))


def _brightness_steps(grey: NDArray[np.float32]) -> NDArray[np.float32]:
    """How much a picture (h, w) changes from each pixel to its neighbours, the larger step of either direction."""
    down, across = (np.abs(np.diff(grey, axis=axis)) for axis in (0, 1))
    down, across = np.pad(down, ((1, 1), (0, 0))), np.pad(across, ((0, 0), (1, 1)))
    return np.asarray(np.maximum(down[1:], down[:-1]) + np.maximum(across[:, 1:], across[:, :-1]))


# The colour of the ground, from the pixels of a photo below its horizon.

_MIN_SIN_DEPRESSION = (
    0.2,
    0.05,
)  # sines of the angle below the horizon; the first one counts below which enough ground is seen
_MIN_GROUND_SHARE = 0.02  # share of the picture that must show ground
_QUANTILES = (0.25, 0.75)  # quantiles of brightness between which pixels count
_REFLECTANCE_RANGE = (0.02, 0.9)  # of the reflectance
_EPSILON_IRRADIANCE = 1e-6  # radiance or irradiance that stands for none
_NETWORK_SHARE = (
    0.6  # how far the brightness goes, under a clear sky, to that of the ground all around as the network has it;
)
_NETWORK_BIAS_STOPS = (
    0.2  # stops by which that is too dark; `python -m export fit ground`, on places that a network never saw
)


def estimate_ground_albedo(
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
    photo, directions = sample_photo(pixels, lighting)
    down = -directions[..., 1]
    seen = next((down > below for below in _MIN_SIN_DEPRESSION if np.mean(down > below) >= _MIN_GROUND_SHARE), None)
    if seen is None:
        return None
    ground = photo[seen]
    grey = ground.mean(axis=1)
    low, high = _quantiles(grey, _QUANTILES)
    inside = (grey >= low) & (grey <= high)
    level = np.maximum(level_irradiance(lighting), _EPSILON_IRRADIANCE)
    found = ground[inside].mean(axis=0)
    if around is not None:
        share = _NETWORK_SHARE * (1 - (lighting.sky_cover or 0.0))
        found = (
            found
            * (2**_NETWORK_BIAS_STOPS * ground_luminance(around) / max(float(luminance(found)), _EPSILON_IRRADIANCE))
            ** share
        )
    return np.asarray(np.clip(np.pi * found / level, *_REFLECTANCE_RANGE))


def ground_luminance(around: NDArray[np.float32]) -> float:
    """Luminance of the ground in a coarse panorama (R, C, 3), as level ground that faces down would receive it."""
    half = len(around) // 2
    return float(luminance(irradiance_from_rows(row_irradiance(len(around))[half:], around[half:]))) / np.pi


def _quantiles(values: Floats, shares: tuple[float, float]) -> Floats:
    """numpy's quantiles of values (N,), without the module of masked arrays that numpy imports for them."""
    return np.asarray(np.interp(np.array(shares) * (len(values) - 1), np.arange(len(values)), np.sort(values)))

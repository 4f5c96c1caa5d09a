"""The colour of the sky, from the pixels of a photo above its horizon."""

import numpy as np
from numpy.typing import NDArray

from lighting.colour import luminance
from lighting.envmap.maps import brightest
from lighting.envmap.photo_view import CLIPPED, sampled
from lighting.envmap.render import render
from lighting.geometry import Floats, sample_latlong
from lighting.records import Lighting

_HEIGHT = 32  # rows of the map with which the photo is compared
_ABOVE = 0.05  # sine of the angle above the horizon from which a pixel may show sky
_SMOOTH = 0.1  # largest step of brightness, 0 to 1, from a pixel of sky to its neighbours
_BRIGHT = 0.6  # share of the map's luminance there that a pixel of sky has at least
_LEAST = 0.02  # share of the picture that must show sky
_MANY = 500  # pixels, of which the mean is exact enough
_TRUST = (0.11, 0.51)  # power of that ratio under a clear sky, and what cover squared adds; fitted on crops of `train`
_DARKEST = 1e-9  # radiance or irradiance that stands for none
_RATIO = 2.0  # most by which a channel changes against green


def photo_sky(pixels: NDArray[np.uint8], lighting: Lighting) -> Floats | None:
    """Factors (3,) that bring the sky's irradiance nearer to the colour of the sky in a photo (h, w, 3, sRGB).

    A cloudy sky has one colour, so there the photo counts for much; a clear one differs from place to place, and what
    is seen low over the horizon says little of the rest. Luminance stays. None where the photo shows too little sky or
    the irradiances are not known.
    """
    off = sky_ratio(pixels, lighting)
    if off is None:
        return None
    said = np.array(lighting.sky_irradiance) + _DARKEST
    tint = off ** (_TRUST[0] + _TRUST[1] * (lighting.sky_cover or 0.0) ** 2)
    return np.asarray(tint * float(luminance(said) / luminance(said * tint)))


def sky_ratio(pixels: NDArray[np.uint8], lighting: Lighting) -> Floats | None:
    """The colour (3,) of the sky that a photo shows over that of the bare map in the same directions; green is 1.

    Smooth, bright pixels above the estimated horizon count as sky. None as `photo_sky`.
    """
    if lighting.sky_irradiance is None:
        return None
    photo, directions = sampled(pixels, lighting)
    smooth = _steps(np.sqrt(luminance(photo))) < _SMOOTH
    likely = np.nonzero(smooth & (directions[..., 1] > _ABOVE) & (brightest(photo) < CLIPPED))
    least = _LEAST * smooth.size
    if len(likely[0]) < least:
        return None
    some = tuple(axis[:: len(axis) // _MANY + 1] for axis in likely)
    seen, there = photo[some], sample_latlong(render(lighting, _HEIGHT, sun=False), directions[some])
    sky = luminance(seen) > _BRIGHT * luminance(there)
    if sky.mean() * len(likely[0]) < least:
        return None
    ratio = seen[sky].mean(axis=0) / np.maximum(there[sky].mean(axis=0), _DARKEST)
    return np.asarray(np.clip(ratio / max(ratio[1], _DARKEST), 1 / _RATIO, _RATIO))


def _steps(grey: NDArray[np.float32]) -> NDArray[np.float32]:
    """How much a picture (h, w) changes from each pixel to its neighbours, the larger step of either direction."""
    down, across = (np.abs(np.diff(grey, axis=axis)) for axis in (0, 1))
    down, across = np.pad(down, ((1, 1), (0, 0))), np.pad(across, ((0, 0), (1, 1)))
    return np.asarray(np.maximum(down[1:], down[:-1]) + np.maximum(across[:, 1:], across[:, :-1]))

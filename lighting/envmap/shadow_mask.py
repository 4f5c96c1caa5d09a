"""Where the ground that a photo shows lies in sunlight, and where in shade.

One rule holds for the preview, the scenes and the page: what stands where less than half of the sun reaches the ground
is in shade. The sun does not reach it, and it casts no shadow of the sun. Anything else stands in the sun, and its
shadow falls on lit ground alone.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.color import SRGB_LINEAR, check_pixels, luminance
from lighting.envmap.latlong import EPSILON_IRRADIANCE
from lighting.envmap.projection import photo_camera
from lighting.envmap.render import sky_irradiance, sun_light
from lighting.geometry import Floats, Pinhole, camera_directions, camera_pixel, clip_slice, shrink_size
from lighting.prediction import THINGS, Segments, pixel_share
from lighting.records import Lighting, check_lighting

_MAX_SIDE = 256  # pixels of the mask's longer side
_GRAIN = 2  # pixels of it over which brightness is averaged, so that a dark stone is no shade
_SIN_BELOW = np.sin(np.radians(1.0))  # sine of the angle below the horizon from which a pixel counts as ground
_MIN_GROUND = 0.02  # share of the picture that must show ground

_MAX_THINGS = 0.5  # probability of a thing at a pixel that counts as ground
_THINGS_EDGE = 0.4  # of that probability, over which a shadow fades at a thing
_MIN_SUNLIT = 0.5  # share of the sun under things, below which they stand in shade

_LOG2_RANGE = (-7.0, 0.0)  # of luminance
_BINS = 64  # of a histogram over it
_MIN_STEP = 1.0  # stops between shade and sunlight; a smaller difference is the ground's own
_MIN_PREDICTED_SHARE = 0.6  # of the predicted step
_MIN_CLASS_SHARE = 0.03  # of the ground that the rarer class takes
_GREENER, _BLUER = 0.3, 0.2  # stops of color by which grass differs from lit sand, and up to which it is no shade
_THRESHOLD_REACH = 1.0  # stops from the threshold of ordinary ground, within which the picture's is sought first

# Which ground is dappled. Of the photos of `train` whose sun the network doubts, 25 of 29 found so are in the sun.
_SIN_NEAR = 0.15  # sine of the angle below the horizon from which its grain is seen
_MIN_DAPPLED_STEP = 2.0  # stops
_MIN_DAPPLED_SHARE = 0.15  # of sun and of shade
_MIN_EDGES = 0.08  # share of neighbors of which one is bright and one dark

_LOG2_ALBEDO = (-3.4, 1.2)  # of a ground's reflectance: mean, and standard deviation with the errors of irradiance
_SUNLIT_SHARE = 0.8  # of the ground, where the sun reaches the scene
_MIN_SUNLIT_SHARE = 0.05


def ground_shadow_mask(
    photo: NDArray[np.uint8], lighting: Lighting, *, sun: bool | None = None, segments: Segments | None = None
) -> NDArray[np.float32]:
    """How much of the sun reaches what each pixel of a photo shows: (H, W), 0 in shade, 1 in sunlight.

    It has the photo's aspect and at most 256 pixels on its longer side. It is 1 above the horizon, and everywhere if
    the light has no sun or shade and sunlight lie less than a stop apart. Else the ground falls into a bright and a
    dark class by Otsu's threshold on log luminance. That is sought first near the one between ordinary ground in the
    sun and in shade. The dark class must be darker than that, and about as much as shade is.

    If not, all ground is of one class. It counts as shade if ordinary ground would rather be so dark in shade, in view
    of the probability that the sun reaches the scene. What is dark by itself may count as shade.

    Args:
        photo: (h, w, 3) sRGB, else PhotoError.
        lighting: of the photo, else ParameterError.
        sun: whether the light has one; None: by `Lighting.sun_painted`.
        segments: of the photo. Plants, people and other things are no ground then, and count as lit. None: all below
            the horizon is ground.

    References:
        [1] Otsu, A Threshold Selection Method from Gray-Level Histograms, IEEE SMC 1979.
    """
    return read_ground_shade(photo, lighting, sun=sun, segments=segments).lit


@dataclass(frozen=True, eq=False)
class GroundShade:
    """Sunlight and shade on the ground of a photo."""

    lit: NDArray[np.float32]
    """(H, W) as `ground_shadow_mask` returns it."""
    shaded_light: float | None
    """How bright shaded ground is beside lit ground, 0 to 1; None where the photo does not show both."""


def read_ground_shade(
    photo: NDArray[np.uint8], lighting: Lighting, *, sun: bool | None = None, segments: Segments | None = None
) -> GroundShade:
    """Where the ground of a photo is in the sun, and how dark its shade is.

    Args:
        photo: as that of `ground_shadow_mask`.
        lighting: likewise.
        sun: likewise.
        segments: likewise.
    """
    check_lighting(lighting)
    small = _shrink_photo(check_pixels(photo))
    height, width = small.shape[:2]
    direct = float(luminance(sun_light(lighting)[0])) * max(float(lighting.sun_direction[1]), 0.0)
    sky = float(luminance(sky_irradiance(lighting)))
    step = float(np.log2(1 + direct / max(sky, EPSILON_IRRADIANCE)))  # stops between sunlit and shaded ground
    white = float(np.log2(max(sky + direct, EPSILON_IRRADIANCE) / np.pi))  # of a level white surface in the sun
    stops = _log_luminance(small)
    rays = camera_directions(photo_camera(lighting, stops.shape[1], stops.shape[0]))
    shown = rays[..., 1] < -_SIN_BELOW
    if segments is not None:
        shown &= pixel_share(segments, stops.shape[1], stops.shape[0], *THINGS) <= _MAX_THINGS
    shines = lighting.sun_painted if sun is None else sun
    if not shines or step < _MIN_STEP or shown.mean() < _MIN_GROUND:
        return GroundShade(np.ones((height, width), dtype=np.float32), None)
    middle = white + _LOG2_ALBEDO[0] - step / 2  # between ordinary ground in the sun and in shade
    classes = _classify_ground(stops[shown], middle, max(_MIN_STEP, _MIN_PREDICTED_SHARE * step))
    lit, shaded_light = np.ones(shown.shape, dtype=np.float32), None
    if classes is None or _is_grass_beside_sand(small, shown, stops > sum(classes) / 2):
        lit[shown] = np.median(stops[shown]) >= white + _min_lit_albedo(step, lighting.sun_visibility)
    else:
        dark, bright = classes
        lit[shown] = np.clip((stops[shown] - (dark + bright) / 2) / (0.5 * (bright - dark)) + 0.5, 0, 1)
        shaded_light = float(2 ** (dark - bright))
    mask = np.asarray(Image.fromarray(lit).resize((width, height), Image.Resampling.BILINEAR))
    return GroundShade(mask, shaded_light)


def _is_grass_beside_sand(small: NDArray[np.uint8], shown: NDArray[np.bool_], bright: NDArray[np.bool_]) -> bool:
    """Whether the dark ground (h, w) is of another kind: greener than the bright one, and not bluer as shade is."""
    channels = (_block_means(SRGB_LINEAR[small[..., channel]].astype(np.float64)) for channel in range(3))
    red, green, blue = (np.log2(np.maximum(channel, 2.0 ** _LOG2_RANGE[0])) for channel in channels)
    greener, bluer = (
        float(np.median(tint[shown & ~bright]) - np.median(tint[shown & bright]))
        for tint in (green - (red + blue) / 2, blue - red)
    )
    return greener > _GREENER and bluer < _BLUER


def shadow_receivers(lit: NDArray[np.float32], segments: Segments | None) -> NDArray[np.float32]:
    """Where (H, W) the sun's shadow of what stands on the ground may fall: the lit ground, without what stands on it.

    Args:
        lit: (H, W) the picture's `ground_shadow_mask`.
        segments: of the picture; None: nothing stands on its ground.
    """
    if segments is None:
        return lit
    things = pixel_share(segments, lit.shape[1], lit.shape[0], *THINGS)
    return np.asarray(lit * np.clip((_MAX_THINGS - things) / _THINGS_EDGE + 0.5, 0, 1))


def is_in_shade(lit: NDArray[np.float32], camera: Pinhole, feet: Floats, reach: float) -> bool:
    """Whether things stand in shade, by the rule above.

    Args:
        lit: (H, W) the picture's `ground_shadow_mask`.
        camera: of the picture.
        feet: (N, 3) where things touch the ground, from the camera.
        reach: pixels of the camera beside the feet, of the rectangle that counts.
    """
    return _mean_sunlit(lit, camera, feet, reach) < _MIN_SUNLIT


def stands_in_sun(lit: NDArray[np.float32], reach: Floats) -> NDArray[np.bool_]:
    """Where (H, W) of a picture a thing would stand in the sun, by the rule above.

    Args:
        lit: (H, W) the picture's `ground_shadow_mask`.
        reach: (H, W) pixels of the mask beside a foot there, of the rectangle that counts.
    """
    height, width = lit.shape
    rows = _reached(np.arange(height)[:, None] + 0.5, reach, height)
    return np.asarray(box_means(lit, rows, _reached(np.arange(width) + 0.5, reach, width)) >= _MIN_SUNLIT)


def box_means(values: NDArray[np.float32], rows: tuple[Any, Any], columns: tuple[Any, Any]) -> Floats:
    """Return the means (H, W) of values within boxes of which none is empty.

    Args:
        values: (H, W).
        rows: for each pixel the box's first row and the one after its last, whole numbers that broadcast to (H, W).
        columns: the same of its columns.
    """
    sums = np.zeros((len(values) + 1, values.shape[1] + 1))
    np.cumsum(values.cumsum(axis=0, dtype=np.float64), axis=1, out=sums[1:, 1:])
    (top, bottom), (left, right) = rows, columns
    first, end = top * sums.shape[1], bottom * sums.shape[1]
    total = sums.take(end + right) - sums.take(first + right) - sums.take(end + left) + sums.take(first + left)
    return np.asarray(total / ((bottom - top) * (right - left)))


def _reached(middle: Floats, reach: Floats, count: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The first row or column within reach of a middle, and the one after the last, as `clip_slice` has them."""
    return (
        np.maximum(middle - reach, 0).astype(np.intp),
        np.minimum((middle + reach).astype(np.intp) + 1, count),
    )


def dappled_sunlight(photo: NDArray[np.uint8], lighting: Lighting) -> tuple[float, float] | None:
    """The share of what lies below a photo's horizon that the sun reaches in patches, and the stops between the kinds.

    Leaves and things count as ground does. None where no such patches mix finely, as they do under trees.

    Args:
        photo: (h, w, 3) sRGB.
        lighting: of the photo, whose camera counts.
    """
    stops = _log_luminance(_shrink_photo(check_pixels(photo)))
    near = camera_directions(photo_camera(lighting, stops.shape[1], stops.shape[0]))[..., 1] < -_SIN_NEAR
    if near.mean() < _MIN_GROUND:
        return None
    classes = _otsu_classes(stops[near], 0.0, np.inf)
    if classes is None or classes[1] - classes[0] < _MIN_DAPPLED_STEP:
        return None
    dark, bright = classes
    lit, pairs = stops > (dark + bright) / 2, near[:, 1:] & near[:, :-1]
    share = float(lit[near].mean())
    edges = float((lit[:, 1:] != lit[:, :-1])[pairs].mean() if pairs.any() else 0)
    mixed = _MIN_DAPPLED_SHARE < share < 1 - _MIN_DAPPLED_SHARE and edges > _MIN_EDGES
    return (share, bright - dark) if mixed else None


def _mean_sunlit(lit: NDArray[np.float32], camera: Pinhole, feet: Floats, reach: float) -> float:
    """How far the ground at the feet of things lies in sunlight, 0 to 1; 1 where the picture does not show it.

    Args:
        lit: (H, W) the picture's `ground_shadow_mask`.
        camera: of the picture.
        feet: (N, 3) where things touch the ground, from the camera.
        reach: pixels of the camera beside the feet, of the rectangle that counts.
    """
    pixels = camera_pixel(feet, camera)
    if not np.isfinite(pixels).all():  # behind the camera
        return 1.0
    scale = len(lit) / camera.height
    x, y = (pixels * scale).T
    columns = clip_slice(float(x.mean()), float(np.ptp(x) / 2 + reach * scale), lit.shape[1])
    rows = clip_slice(float(y.mean()), reach * scale, len(lit))
    part = lit[rows, columns]
    return float(part.mean()) if part.size else 1.0


def _classify_ground(stops: Floats, middle: float, least: float) -> tuple[float, float] | None:
    """The means of ground in shade and in the sun, a `least` step apart, by a threshold near the middle or by any.

    One farther off counts only if the dark kind is not bright: it splits light paving, not lit ground from walls.
    """
    near, any_ = (_otsu_classes(stops, middle, reach) for reach in (_THRESHOLD_REACH, np.inf))
    if near is not None and near[1] - near[0] >= least:
        return near
    if any_ is None or any_[1] - any_[0] < least or any_[0] >= middle + _THRESHOLD_REACH:
        return None
    return any_


def _min_lit_albedo(step: float, visibility: float) -> float:
    """Log2 of the reflectance, if it were lit, of ground that is as likely to lie in shade.

    By Bayes' rule with a normal distribution of log2 reflectance: in shade it would be a `step` more than it seems.
    """
    (mean, std), lit = _LOG2_ALBEDO, _SUNLIT_SHARE * visibility
    return float(mean - step / 2 - std**2 * np.log(max(lit, _MIN_SUNLIT_SHARE) / (1 - lit)) / step)


def _shrink_photo(photo: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The photo (h, w, 3) with at most _MAX_SIDE pixels along its longer side."""
    size = shrink_size(photo.shape[1], photo.shape[0], _MAX_SIDE)
    return np.asarray(Image.fromarray(photo).resize(size, Image.Resampling.BOX, reducing_gap=2.0))


def _log_luminance(photo: NDArray[np.uint8]) -> Floats:
    """Log2 of the luminance of blocks of a photo (h, w, 3), within _LOG2_RANGE."""
    gray = _block_means(luminance(SRGB_LINEAR[photo].astype(np.float64)))
    return np.log2(np.clip(gray, *np.exp2(_LOG2_RANGE)))


def _block_means(gray: Floats) -> Floats:
    """Means of blocks of _GRAIN pixels each way of a picture (h, w); the last ones take what is left over."""
    starts = [np.arange(max(1, count // _GRAIN)) * _GRAIN for count in gray.shape]
    sums = np.add.reduceat(np.add.reduceat(gray, starts[0], axis=0), starts[1], axis=1)
    sizes = [np.diff([*start, count]) for start, count in zip(starts, gray.shape, strict=True)]
    return np.asarray(sums / np.outer(*sizes))


def _otsu_classes(stops: Floats, middle: float, reach: float) -> tuple[float, float] | None:
    """The means of the two classes into which log2 luminances (N,) fall by a threshold near the middle.

    The darker comes first, and the threshold lies halfway between them. None if one class is rare.
    """
    counts, edges = np.histogram(stops, _BINS, _LOG2_RANGE)
    values = (edges[:-1] + edges[1:]) / 2
    below = np.cumsum(counts)[:-1]
    above = len(stops) - below
    sums = np.cumsum(counts * values)
    dark = sums[:-1] / np.maximum(below, 1)
    bright = (sums[-1] - sums[:-1]) / np.maximum(above, 1)
    near = np.abs((dark + bright) / 2 - middle) <= reach
    variance = np.where((below > 0) & (above > 0) & near, below * above * (bright - dark) ** 2, -1.0)
    best = int(np.argmax(variance))
    if variance[best] < 0 or min(below[best], above[best]) < _MIN_CLASS_SHARE * len(stops):
        return None
    return float(dark[best]), float(bright[best])

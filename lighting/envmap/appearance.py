"""What a photo shows of its place: ground albedo, snow, the sky's color, and which kind of place it is.

A linear classifier [1] finds the kind by what the network tells: what the photo shows at each height, and how bright
and colorful each elevation is. `python -m export kinds` fits it.

References: [1] Bishop, Pattern Recognition and Machine Learning, section 4.3.4 (2006).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import NDArray

from lighting.color import LUMINANCE_WEIGHTS, luminance, max_channel
from lighting.envmap.latlong import EPSILON_IRRADIANCE, Image, irradiance_from_rows, row_irradiance
from lighting.envmap.projection import CLIPPED, sample_photo
from lighting.envmap.render import level_irradiance, render
from lighting.fields import clip_color
from lighting.geometry import Floats, sample_latlong
from lighting.prediction import THINGS, Segments, SurfaceClass, class_share, pixel_share
from lighting.records import Lighting

# What the kind of place is told by.
PLACE_KINDS = ("city", "garden", "park", "meadow", "forest", "shore", "bare", "snow")

_PHOTO_ROWS = 4  # parts of a photo, from its top
_AROUND_ROWS = 6  # rings of what is around the camera
KIND_FEATURES = _PHOTO_ROWS * len(SurfaceClass) + 3 * _AROUND_ROWS
_DARKEST = 0.02  # of the mean luminance around, that counts in a logarithm

# Which pixels count as sky, and how far they tint it.
_MAP_ROWS = 32  # of the map with which the photo is compared
_MIN_SIN_ELEVATION = 0.05  # sine of the angle above the horizon from which a pixel may show sky
_MAX_STEP = 0.1  # of brightness, 0 to 1, from a pixel of sky to its neighbors
_MIN_SKY_LUMINANCE = 0.6  # share of the map's luminance that a pixel of sky has at least
_SUNSET_SUN = (20.0, 30.0)  # deg, of suns under which an orange sky is that of a sunset, and above which it is none
_SUNSET_SHARES = (  # stops of red over blue in a photo's sky, and how far all the sky takes its color; chosen by eye
    (-0.1, 0.3, 1.0),
    (0.0, 0.6, 0.9),
)
_MIN_SKY_PROBABILITY = 0.5  # of the sky at a pixel of a sunset
_MIN_ORANGE_STOPS = 0.5  # of red over blue in a pixel of a sunset
_MIN_SUNSET_LUMINANCE = 0.15  # share of the map's luminance that its pixels have at least: the map's glow is brighter
_MIN_SKY_SHARE = 0.02  # share of the picture that must show sky
_MAX_SAMPLES = 500  # pixels, of which the mean is exact enough
_TINT_EXPONENT = (0.13, 0.31)  # under a clear sky, and what cover squared adds; fitted on crops of `train`
_MAX_COLOR_RATIO = 2.0  # by which a channel changes against green

# Which pixels count as ground, and how far the network's view of it counts.
_MIN_SIN_DEPRESSION = (0.2, 0.05)  # sines of the angle below the horizon; the first that leaves enough ground counts
_MIN_GROUND_SHARE = 0.02  # share of the picture that must show ground
_NEVER_GROUND = (SurfaceClass.PERSON, SurfaceClass.VEHICLE)
_MAX_HIDDEN = 0.4  # probability of a thing at a pixel that counts
_QUANTILES = (0.25, 0.75)  # of brightness, between which pixels count
_REFLECTANCE_RANGE = (0.02, 0.9)

# Which ground is snow. Of 466 photos of `train`, only those of snow count; of 100 HDR crops, one white floor does.
_SNOW_REFLECTANCE = 0.85
_MIN_SNOW_REFLECTANCE = 0.6  # of the ground, for a place of snow
_MIN_BLUE_REFLECTANCE = 0.38  # the same of ground that is blue in the photo, as snow under a clear sky is
_BLUE = 1.1  # of such ground: its blue over its red
_UNLIKELY_SNOW, _LIKELY_SNOW = 0.1, 0.6  # probabilities of a place of snow: below it is none, above white ground tells
_MOSTLY_WHITE = 0.55  # share of the ground, where snow is likely
_MAX_SNOW_BUILDING = 0.15  # of the photo, for a place of snow
_MIN_SNOW_SHARE = 0.7  # of the ground's pixels that are white
_MIN_SNOW_LUMINANCE = 0.25  # of a white pixel
_MAX_SNOW_SATURATION = 0.3  # of it: what its least channel lacks of its largest
_MAX_SNOW_TINT = 1.4  # of the largest reflectance over the least
_MIN_SHADED_LUMINANCE = 0.2  # of a pixel of snow that may lie in shade
_MAX_BLUE_SATURATION = 0.6  # of it where it is blue
_BLUE_TOLERANCE = 0.03  # of green, by which red may be over it and blue under it
_MAX_BLUE_TINT = 1.7
_MAX_WARM_TINT = 1.25  # warmer ground is pavement
_MAX_SNOW_GAIN = 4.0
# The last two by `python -m export fit ground`, on places that a network never saw.
_NETWORK_SHARE = 0.6  # how far the brightness goes, under a clear sky, to that of the network's panorama
_NETWORK_BIAS_STOPS = 0.2  # by which the panorama's ground is too dark


@dataclass(frozen=True, eq=False)
class PhotoSamples:
    """A few of a photo's pixels, as `sample_photo` takes them, and which of them may show ground and sky."""

    colors: Image
    """Linear values (h, w, 3)."""
    directions: Floats
    """Unit vectors (h, w, 3)."""
    segments: Segments | None = None
    """What the photo shows. None: unknown, and all below the horizon may be ground."""

    @classmethod
    def of_photo(cls, pixels: NDArray[np.uint8], lighting: Lighting, segments: Segments | None = None) -> Self:
        """Sample a photo.

        Args:
            pixels: (h, w, 3) sRGB.
            lighting: with the photo's camera.
            segments: what the photo shows; None: unknown.
        """
        return cls(*sample_photo(pixels, lighting), segments)

    @cached_property
    def largest(self) -> NDArray[np.float32]:
        """The largest channel (h, w)."""
        return max_channel(self.colors)

    @cached_property
    def ground(self) -> NDArray[np.bool_] | None:
        """Which (h, w) show ground: well below the horizon, near which things stand upright. None: too few.

        People, vehicles, plants and other things do not count. Where little else is below the horizon, plants and
        things do, and people and vehicles never.
        """
        down = -self.directions[..., 1]
        for hiding in (THINGS, _NEVER_GROUND):
            free = self.segments is None or pixel_share(self.segments, *down.shape[::-1], *hiding) < _MAX_HIDDEN
            for sine in _MIN_SIN_DEPRESSION:
                below = free & (down > sine)
                if np.mean(below) >= _MIN_GROUND_SHARE:
                    return below
        return None

    @cached_property
    def ground_colors(self) -> Image:
        """The linear values (N, 3) of `ground`, of which there must be some."""
        return self.colors[self.ground]

    @cached_property
    def ground_largest(self) -> NDArray[np.float32]:
        """Their largest channel (N,)."""
        return self.largest[self.ground]

    @cached_property
    def sky(self) -> NDArray[np.bool_] | None:
        """Which (h, w) may show sky: smooth, not clipped, above the estimated horizon. None: too few."""
        smooth = _brightness_steps(np.sqrt(luminance(self.colors))) < _MAX_STEP
        above = smooth & (self.directions[..., 1] > _MIN_SIN_ELEVATION) & (self.largest < CLIPPED)
        return above if above.sum() >= _MIN_SKY_SHARE * above.size else None


def sky_white_balance(samples: PhotoSamples, lighting: Lighting) -> Floats | None:
    """Factors (3,) that bring the sky's irradiance nearer to the color of the sky in a photo; luminance stays.

    A cloudy sky has one color, so the photo counts for much. A clear one differs from place to place, and the sky low
    over the horizon says little of the rest, but that an orange one is of a sunset. None where the photo shows too
    little sky, or irradiances are unknown.

    Args:
        samples: of the photo; by its segments no orange wall counts as the sky of a sunset.
        lighting: estimated for the photo.
    """
    if lighting.sky_irradiance is None or samples.sky is None:
        return None
    bare_sky = render(lighting, _MAP_ROWS, sun=False)
    if (colors := _sky_colors(samples, samples.sky, lighting, bare_sky)) is None:
        return None
    sunset = colors if lighting.sun_elevation < _SUNSET_SUN[1] else None
    if sunset is not None and samples.segments is not None:
        sky = pixel_share(samples.segments, *samples.sky.shape[::-1], SurfaceClass.SKY)
        sunset = _sky_colors(samples, samples.sky & (sky > _MIN_SKY_PROBABILITY), lighting, bare_sky)
    irradiance = np.array(lighting.sky_irradiance) + EPSILON_IRRADIANCE
    exponent = _TINT_EXPONENT[0] + _TINT_EXPONENT[1] * (lighting.sky_cover or 0.0) ** 2
    tint = _color_ratio(*colors) ** exponent
    if sunset is not None:
        red, _, blue = np.maximum(sunset[0], EPSILON_IRRADIANCE)
        low = float(np.interp(lighting.sun_elevation, _SUNSET_SUN, (1.0, 0.0)))
        share = low * float(np.interp(np.log2(red / blue), *_SUNSET_SHARES))
        warm = _color_ratio(sunset[0], irradiance) ** share
        tint = warm if warm[0] / warm[2] > max(tint[0] / tint[2], 1.0) else tint
    return np.asarray(tint * float(luminance(irradiance) / luminance(irradiance * tint)))


def share_sky_color(samples: Sequence[PhotoSamples], lights: Sequence[Lighting]) -> list[Lighting]:
    """Give the lights of photos under one sky its color: the geometric mean of what `sky_white_balance` finds.

    Args:
        samples: of each photo.
        lights: estimated for each photo; they stay as they are where no photo tells the color.
    """
    balances = list(map(sky_white_balance, samples, lights))
    tints = [np.log(tint) for tint in balances if tint is not None]
    if not tints:
        return list(lights)
    tint = np.exp(np.mean(tints, axis=0))
    return [
        replace(light, sky_irradiance=clip_color(tint * light.sky_irradiance, "sky_irradiance")) for light in lights
    ]


def sky_color_ratio(samples: PhotoSamples, lighting: Lighting) -> Floats | None:
    """The color (3,) of the sky in a photo over that of the bare map in the same directions; green is 1.

    Smooth, bright pixels above the estimated horizon count as sky. None as in `sky_white_balance`.

    Args:
        samples: of the photo.
        lighting: estimated for the photo.
    """
    if lighting.sky_irradiance is None or samples.sky is None:
        return None
    colors = _sky_colors(samples, samples.sky, lighting, render(lighting, _MAP_ROWS, sun=False))
    return None if colors is None else _color_ratio(*colors)


def _color_ratio(colors: Floats, map_colors: Floats) -> Floats:
    """One color (3,) over another; green is 1."""
    ratio = colors / np.maximum(map_colors, EPSILON_IRRADIANCE)
    return np.asarray(np.clip(ratio / max(ratio[1], EPSILON_IRRADIANCE), 1 / _MAX_COLOR_RATIO, _MAX_COLOR_RATIO))


def _sky_colors(
    samples: PhotoSamples, candidates: NDArray[np.bool_], lighting: Lighting, bare_sky: Image
) -> tuple[Floats, Floats] | None:
    """The mean colors (3,) of a photo and of the bare map where candidates (h, w) are sky; None where too few are."""
    needed = _MIN_SKY_SHARE * candidates.size
    rows, columns = np.nonzero(candidates)
    if len(rows) < needed:
        return None
    step = len(rows) // _MAX_SAMPLES + 1
    chosen = rows[::step], columns[::step]
    colors = samples.colors[chosen]
    map_colors = sample_latlong(bare_sky, samples.directions[chosen])
    least = np.full(len(colors), _MIN_SKY_LUMINANCE)
    if lighting.sun_elevation < _SUNSET_SUN[0]:
        least[colors[:, 0] > 2**_MIN_ORANGE_STOPS * colors[:, 2]] = _MIN_SUNSET_LUMINANCE
    sky = luminance(colors) > least * luminance(map_colors)
    if sky.mean() * len(rows) < needed:
        return None
    return colors[sky].mean(axis=0), map_colors[sky].mean(axis=0)


def _brightness_steps(gray: NDArray[np.float32]) -> NDArray[np.float32]:
    """How much a picture (h, w) changes from each pixel to its neighbors, the larger step of either direction."""
    down, across = np.abs(gray[1:] - gray[:-1]), np.abs(gray[:, 1:] - gray[:, :-1])
    vertical, horizontal = np.zeros((2, *gray.shape), gray.dtype)
    vertical[:-1], horizontal[:, :-1] = down, across
    np.maximum(vertical[1:], down, out=vertical[1:])
    np.maximum(horizontal[:, 1:], across, out=horizontal[:, 1:])
    return np.asarray(vertical + horizontal)


def estimate_ground_albedo(
    samples: PhotoSamples, lighting: Lighting, panorama: NDArray[np.float32] | None = None
) -> Floats | None:
    """Reflectance (3,) of the ground that a photo shows under the lighting's irradiances.

    It is the mean of the linear values of the ground, over (sky + sin(elevation) x sun) / pi. The darkest and the
    brightest quarter do not count. It is the grayer the more of them is clipped. None where the photo shows too little
    ground or the irradiances are unknown.

    Args:
        samples: of the photo.
        lighting: estimated for the photo.
        panorama: (R, 2R, 3) the network's surroundings. They draw the brightness to that of the ground which the photo
            does not show, the less the cloudier the sky is, for then the network errs more. None: the photo alone.
    """
    if lighting.sky_irradiance is None or lighting.sun_irradiance is None or samples.ground is None:
        return None
    radiance = _middle_mean(samples.ground_colors)
    if panorama is not None:
        share = _NETWORK_SHARE * (1 - (lighting.sky_cover or 0.0))
        around = 2**_NETWORK_BIAS_STOPS * ground_luminance(panorama)
        radiance = radiance * (around / max(float(luminance(radiance)), EPSILON_IRRADIANCE)) ** share
    reflectance = np.pi * radiance / np.maximum(level_irradiance(lighting), EPSILON_IRRADIANCE)
    # what is clipped is white, whatever its color was
    known = float(np.mean(samples.ground_largest < CLIPPED))
    gray = float(luminance(reflectance))
    return np.asarray(np.clip(gray + known * (reflectance - gray), *_REFLECTANCE_RANGE))


def snow_gain(samples: PhotoSamples, lighting: Lighting) -> float:
    """The factor, 1 to 4, that makes a light so bright that the snow in a photo reflects no more of it than snow does.

    Ground is snow where most of it is bright and hardly colored; clipped, it is at least as bright as it seems. 1 where
    the photo shows no snow or the irradiances are unknown.

    Args:
        samples: of the photo.
        lighting: estimated for the photo.
    """
    reflectance = _snow_reflectance(samples, lighting)
    if reflectance is None:
        return 1.0
    return float(np.clip(luminance(reflectance) / _SNOW_REFLECTANCE, 1.0, _MAX_SNOW_GAIN))


def shows_snow(samples: PhotoSamples, lighting: Lighting, probability: float | None = None) -> bool:
    """Whether the ground that a photo shows is snow, and no white pavement before buildings.

    Args:
        samples: of the photo.
        lighting: of the photo, after `snow_gain`.
        probability: that the place is one of snow, 0 to 1; then white ground that is darker is snow, too, or bright
            ground is none. None: unknown.
    """
    if probability is not None and probability < _UNLIKELY_SNOW:
        return False
    segments = samples.segments
    if segments is not None and float(class_share(segments, SurfaceClass.BUILDING).mean()) > _MAX_SNOW_BUILDING:
        return False
    if samples.ground is None:
        return False
    if probability is not None and probability > _LIKELY_SNOW and _white_share(samples, shaded=True) > _MOSTLY_WHITE:
        return True
    reflectance = _snow_reflectance(samples, lighting, shaded=True)
    if reflectance is None:
        return False
    red, _, blue = _middle_mean(samples.ground_colors)
    return float(luminance(reflectance)) > (_MIN_BLUE_REFLECTANCE if blue > _BLUE * red else _MIN_SNOW_REFLECTANCE)


def _snow_reflectance(samples: PhotoSamples, lighting: Lighting, *, shaded: bool = False) -> Floats | None:
    """Reflectance (3,) of ground that is bright and hardly colored; None where the photo shows no such ground.

    Where it is `shaded` it may be blue, but hardly warm.
    """
    if lighting.sky_irradiance is None or samples.ground is None:
        return None
    if _white_share(samples, shaded=shaded) < _MIN_SNOW_SHARE:
        return None
    reflectance = (
        np.pi * _middle_mean(samples.ground_colors) / np.maximum(level_irradiance(lighting), EPSILON_IRRADIANCE)
    )
    tint = _MAX_SNOW_TINT
    if shaded:
        tint = _MAX_WARM_TINT if reflectance[0] > reflectance[2] else _MAX_BLUE_TINT
    return None if reflectance.max() > tint * reflectance.min() else np.asarray(reflectance)


def _white_share(samples: PhotoSamples, *, shaded: bool) -> float:
    """The share of a photo's ground that is bright and hardly colored; in shade it may be blue."""
    ground, high = samples.ground_colors, samples.ground_largest
    spread = high - np.minimum(np.minimum(ground[:, 0], ground[:, 1]), ground[:, 2])
    pale = spread < _MAX_SNOW_SATURATION * high
    if shaded:
        cool = (np.diff(ground, axis=1) > -_BLUE_TOLERANCE * ground[:, 1:2]).all(axis=1)
        pale |= cool & (spread < _MAX_BLUE_SATURATION * high)
    white = pale & (luminance(ground) > (_MIN_SHADED_LUMINANCE if shaded else _MIN_SNOW_LUMINANCE))
    return float(white.mean())


def _middle_mean(ground: Floats) -> Floats:
    """The mean (3,) of linear values (N, 3) without their darkest and brightest quarters."""
    gray = ground.mean(axis=1)
    low, high = _quantiles(gray, _QUANTILES)
    return np.asarray(ground[(gray >= low) & (gray <= high)].mean(axis=0))


def ground_luminance(panorama: NDArray[np.float32]) -> float:
    """Luminance of the ground in a coarse panorama, as level ground that faces down would receive it.

    Args:
        panorama: (R, 2R, 3) linear radiance.
    """
    half = len(panorama) // 2
    return float(luminance(irradiance_from_rows(row_irradiance(len(panorama))[half:], panorama[half:]))) / np.pi


def _quantiles(values: Floats, shares: tuple[float, float]) -> Floats:
    """numpy's quantiles of values (N,), without the module of masked arrays that numpy imports for them."""
    return np.asarray(np.interp(np.array(shares) * (len(values) - 1), np.arange(len(values)), np.sort(values)))


def kind_features(segments: Segments, surroundings: NDArray[np.float32]) -> Floats:
    """By what a place's kind is told (F,): square roots of shares of the classes, logarithms of rings of light.

    Args:
        segments: (R, C, classes) of the photo.
        surroundings: (R, 2R, 3) linear, any scale, what is around the camera.
    """
    edges = np.arange(_PHOTO_ROWS + 1) * len(segments) // _PHOTO_ROWS
    parts = [segments[low : max(high, low + 1)].mean(axis=(0, 1)) for low, high in pairwise(edges)]
    rings = surroundings.reshape(_AROUND_ROWS, -1, 3).mean(axis=1, dtype=np.float64)
    brightness = rings @ LUMINANCE_WEIGHTS
    log = np.log(rings / max(float(brightness.mean()), 1e-9) + _DARKEST)
    gray = log @ LUMINANCE_WEIGHTS
    return np.concatenate([np.sqrt(parts).ravel(), gray - gray.mean(), (log[:, ::2] - log[:, 1:2]).ravel()])


def kind_probability(features: Floats, weights: Floats) -> Floats:
    """Probabilities (..., K) of PLACE_KINDS.

    Args:
        features: (..., F) of `kind_features`.
        weights: (F + 1, K) of the classifier, the last row for 1.
    """
    logits = features @ weights[:-1] + weights[-1]
    odds = np.exp(logits - logits.max(axis=-1, keepdims=True))
    return np.asarray(odds / odds.sum(axis=-1, keepdims=True))

"""Ground albedo, snow and sky color read from the photo."""

import numpy as np
from numpy.typing import NDArray

from lighting.color import luminance
from lighting.envmap.latlong import EPSILON_IRRADIANCE, irradiance_from_rows, max_channel, row_irradiance
from lighting.envmap.projection import CLIPPED, sample_photo
from lighting.envmap.render import level_irradiance, render
from lighting.geometry import Floats, sample_latlong
from lighting.records import Lighting
from lighting.segmentation import THINGS, Segments, SurfaceClass, class_share, pixel_share

# Which pixels count as sky, and how far they tint it.
_MAP_ROWS = 32  # of the map with which the photo is compared
_MIN_SIN_ELEVATION = 0.05  # sine of the angle above the horizon from which a pixel may show sky
_MAX_STEP = 0.1  # of brightness, 0 to 1, from a pixel of sky to its neighbours
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
_TINT_EXPONENT = (0.11, 0.51)  # under a clear sky, and what cover squared adds; fitted on crops of `train`
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


def sky_white_balance(pixels: NDArray[np.uint8], lighting: Lighting, segments: Segments | None = None) -> Floats | None:
    """Factors (3,) that bring the sky's irradiance nearer to the color of the sky in a photo; luminance stays.

    A cloudy sky has one color, so the photo counts for much. A clear one differs from place to place, and the sky low
    over the horizon says little of the rest, but that an orange one is of a sunset. None where the photo shows too
    little sky, or irradiances are unknown.

    Args:
        pixels: (h, w, 3) sRGB.
        lighting: estimated for the photo.
        segments: of the photo, so that no orange wall counts as the sky of a sunset; None: unknown.
    """
    colors = _sky_colors(pixels, lighting)
    if colors is None:
        return None
    irradiance = np.array(lighting.sky_irradiance) + EPSILON_IRRADIANCE
    exponent = _TINT_EXPONENT[0] + _TINT_EXPONENT[1] * (lighting.sky_cover or 0.0) ** 2
    tint = _color_ratio(*colors) ** exponent
    seen = colors if segments is None else _sky_colors(pixels, lighting, segments)
    if seen is not None:
        warm = _color_ratio(seen[0], irradiance) ** _sunset_exponent(seen[0], lighting.sun_elevation)
        tint = warm if warm[0] / warm[2] > max(tint[0] / tint[2], 1.0) else tint
    return np.asarray(tint * float(luminance(irradiance) / luminance(irradiance * tint)))


def _sunset_exponent(sky: Floats, sun_elevation: float) -> float:
    """How far all the sky takes the color (3,) of a photo's: the more the warmer it is and the lower the sun [deg]."""
    red, _, blue = np.maximum(sky, EPSILON_IRRADIANCE)
    low = float(np.interp(sun_elevation, _SUNSET_SUN, (1.0, 0.0)))
    return low * float(np.interp(np.log2(red / blue), *_SUNSET_SHARES))


def sky_color_ratio(pixels: NDArray[np.uint8], lighting: Lighting) -> Floats | None:
    """The color (3,) of the sky in a photo over that of the bare map in the same directions; green is 1.

    Smooth, bright pixels above the estimated horizon count as sky. None as in `sky_white_balance`.

    Args:
        pixels: (h, w, 3) sRGB.
        lighting: estimated for the photo.
    """
    colors = _sky_colors(pixels, lighting)
    return None if colors is None else _color_ratio(*colors)


def _color_ratio(colors: Floats, map_colors: Floats) -> Floats:
    """One color (3,) over another; green is 1."""
    ratio = colors / np.maximum(map_colors, EPSILON_IRRADIANCE)
    return np.asarray(np.clip(ratio / max(ratio[1], EPSILON_IRRADIANCE), 1 / _MAX_COLOR_RATIO, _MAX_COLOR_RATIO))


def _sky_colors(
    pixels: NDArray[np.uint8], lighting: Lighting, segments: Segments | None = None
) -> tuple[Floats, Floats] | None:
    """The mean colors (3,) of the sky in a photo and of the bare map there; None as in `sky_white_balance`."""
    if lighting.sky_irradiance is None:
        return None
    photo, directions = sample_photo(pixels, lighting)
    smooth = _brightness_steps(np.sqrt(luminance(photo))) < _MAX_STEP
    if segments is not None:
        smooth &= pixel_share(segments, smooth.shape[1], smooth.shape[0], SurfaceClass.SKY) > _MIN_SKY_PROBABILITY
    candidates = np.nonzero(smooth & (directions[..., 1] > _MIN_SIN_ELEVATION) & (max_channel(photo) < CLIPPED))
    needed = _MIN_SKY_SHARE * smooth.size
    if len(candidates[0]) < needed:
        return None
    chosen = tuple(axis[:: len(axis) // _MAX_SAMPLES + 1] for axis in candidates)
    colors = photo[chosen]
    map_colors = sample_latlong(render(lighting, _MAP_ROWS, sun=False), directions[chosen])
    least = np.full(len(colors), _MIN_SKY_LUMINANCE)
    if lighting.sun_elevation < _SUNSET_SUN[0]:
        least[colors[:, 0] > 2**_MIN_ORANGE_STOPS * colors[:, 2]] = _MIN_SUNSET_LUMINANCE
    sky = luminance(colors) > least * luminance(map_colors)
    if sky.mean() * len(candidates[0]) < needed:
        return None
    return colors[sky].mean(axis=0), map_colors[sky].mean(axis=0)


def _brightness_steps(gray: NDArray[np.float32]) -> NDArray[np.float32]:
    """How much a picture (h, w) changes from each pixel to its neighbours, the larger step of either direction."""
    down, across = (np.abs(np.diff(gray, axis=axis)) for axis in (0, 1))
    down, across = np.pad(down, ((1, 1), (0, 0))), np.pad(across, ((0, 0), (1, 1)))
    return np.asarray(np.maximum(down[1:], down[:-1]) + np.maximum(across[:, 1:], across[:, :-1]))


def estimate_ground_albedo(
    pixels: NDArray[np.uint8],
    lighting: Lighting,
    panorama: NDArray[np.float32] | None = None,
    segments: Segments | None = None,
) -> Floats | None:
    """Reflectance (3,) of the ground that a photo shows under the lighting's irradiances.

    It is the mean of the linear values well below the estimated horizon, over (sky + sin(elevation) x sun) / pi. Near
    the horizon things stand upright; the darkest and the brightest quarter do not count. It is the grayer the more of
    them is clipped. None where the photo shows too little ground or the irradiances are unknown.

    Args:
        pixels: (h, w, 3) sRGB.
        lighting: estimated for the photo.
        panorama: (R, 2R, 3) the network's surroundings. They draw the brightness to that of the ground which the photo
            does not show, the less the cloudier the sky is, for then the network errs more. None: the photo alone.
        segments: of the photo. People, vehicles, plants and other things do not count then; where little else is below
            the horizon, plants and things do, and people and vehicles never. None: all below the horizon counts.
    """
    if lighting.sky_irradiance is None or lighting.sun_irradiance is None:
        return None
    ground = _ground_pixels(pixels, lighting, segments)
    if ground is None:
        return None
    radiance = _middle_mean(ground)
    if panorama is not None:
        share = _NETWORK_SHARE * (1 - (lighting.sky_cover or 0.0))
        brightness = max(float(luminance(radiance)), EPSILON_IRRADIANCE)
        radiance = radiance * (2**_NETWORK_BIAS_STOPS * ground_luminance(panorama) / brightness) ** share
    level = np.maximum(level_irradiance(lighting), EPSILON_IRRADIANCE)
    reflectance = np.pi * radiance / level
    known = float(np.mean(max_channel(ground) < CLIPPED))  # what is clipped is white, whatever its color was
    gray = float(luminance(reflectance))
    return np.asarray(np.clip(gray + known * (reflectance - gray), *_REFLECTANCE_RANGE))


def snow_gain(pixels: NDArray[np.uint8], lighting: Lighting, segments: Segments | None = None) -> float:
    """The factor, 1 to 4, that makes a light so bright that the snow in a photo reflects no more of it than snow does.

    Ground is snow where most of it is bright and hardly colored; clipped, it is at least as bright as it seems. 1 where
    the photo shows no snow or the irradiances are unknown.

    Args:
        pixels: (h, w, 3) sRGB.
        lighting: estimated for the photo.
        segments: which pixels are no ground; None: unknown.
    """
    reflectance = _snow_reflectance(pixels, lighting, segments)
    if reflectance is None:
        return 1.0
    return float(np.clip(luminance(reflectance) / _SNOW_REFLECTANCE, 1.0, _MAX_SNOW_GAIN))


def shows_snow(pixels: NDArray[np.uint8], lighting: Lighting, segments: Segments | None = None) -> bool:
    """Whether the ground that a photo shows is snow, and no white pavement before buildings.

    Args:
        pixels: (h, w, 3) sRGB.
        lighting: of the photo, after `snow_gain`.
        segments: which pixels are no ground; None: unknown.
    """
    if segments is not None and float(class_share(segments, SurfaceClass.BUILDING).mean()) > _MAX_SNOW_BUILDING:
        return False
    reflectance = _snow_reflectance(pixels, lighting, segments, shaded=True)
    return reflectance is not None and float(luminance(reflectance)) > _MIN_SNOW_REFLECTANCE


def _snow_reflectance(
    pixels: NDArray[np.uint8], lighting: Lighting, segments: Segments | None, *, shaded: bool = False
) -> Floats | None:
    """Reflectance (3,) of ground that is bright and hardly colored; None where the photo shows no such ground.

    Args:
        pixels: (h, w, 3) sRGB.
        lighting: of the photo.
        segments: which pixels are no ground; None: unknown.
        shaded: whether it may be blue, as in shade, but hardly warm.
    """
    ground = None if lighting.sky_irradiance is None else _ground_pixels(pixels, lighting, segments)
    if ground is None:
        return None
    high = max_channel(ground)
    spread = high - ground.min(axis=1)
    pale = spread < _MAX_SNOW_SATURATION * high
    if shaded:
        cool = (np.diff(ground, axis=1) > -_BLUE_TOLERANCE * ground[:, 1:2]).all(axis=1)
        pale |= cool & (spread < _MAX_BLUE_SATURATION * high)
    white = (luminance(ground) > (_MIN_SHADED_LUMINANCE if shaded else _MIN_SNOW_LUMINANCE)) & pale
    reflectance = np.pi * _middle_mean(ground) / np.maximum(level_irradiance(lighting), EPSILON_IRRADIANCE)
    tint = _MAX_SNOW_TINT
    if shaded:
        tint = _MAX_WARM_TINT if reflectance[0] > reflectance[2] else _MAX_BLUE_TINT
    if white.mean() < _MIN_SNOW_SHARE or reflectance.max() > tint * reflectance.min():
        return None
    return np.asarray(reflectance)


def _ground_pixels(pixels: NDArray[np.uint8], lighting: Lighting, segments: Segments | None) -> Floats | None:
    """Linear values (N, 3) well below the horizon in a photo; None where it shows too little of that."""
    photo, directions = sample_photo(pixels, lighting)
    down = -directions[..., 1]
    free = _free_of_things(segments, down.shape)
    shows_ground = (mask & (down > sine) for mask in free for sine in _MIN_SIN_DEPRESSION)
    below = next((mask for mask in shows_ground if np.mean(mask) >= _MIN_GROUND_SHARE), None)
    return None if below is None else np.asarray(photo[below])


def _middle_mean(ground: Floats) -> Floats:
    """The mean (3,) of linear values (N, 3) without their darkest and brightest quarters."""
    gray = ground.mean(axis=1)
    low, high = _quantiles(gray, _QUANTILES)
    return np.asarray(ground[(gray >= low) & (gray <= high)].mean(axis=0))


def _free_of_things(segments: Segments | None, shape: tuple[int, ...]) -> list[NDArray[np.bool_]]:
    """Which pixels (h, w) of a photo may count as ground, the better choice first."""
    if segments is None:
        return [np.ones(shape, dtype=bool)]
    height, width = shape
    hidden = pixel_share(segments, width, height, *THINGS), pixel_share(segments, width, height, *_NEVER_GROUND)
    return [share < _MAX_HIDDEN for share in hidden]


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

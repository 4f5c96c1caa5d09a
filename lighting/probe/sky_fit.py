"""The sky of a map: turbidity, exposure and cloud cover, by the Hosek-Wilkie model fitted to it.

The procedure is the one of "Deep Outdoor Illumination Estimation"
(CVPR 2017). It holds the sun fixed with a ground albedo of 0.3. Turbidity and exposure are fitted to the sky's pixels
by robust non-linear least squares.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.color import luminance
from lighting.envmap.latlong import shrink_envmap
from lighting.errors import ErrorCode, ProbeError
from lighting.fields import Json
from lighting.geometry import Floats, angle_between, direction, latlong_angles, latlong_directions, wrap_azimuth
from lighting.probe.sun_detection import (
    ANALYSIS_HEIGHT,
    Mask,
    find_sun,
    find_sun_blob,
    import_ndimage,
    is_clipped,
    label_regions,
    pixel_solid_angles,
)
from lighting.records import GROUND_ALBEDO
from lighting.sky.clear_sky import sky_radiance

_SUN_CLEARANCE = 20.0  # deg around the sun left out: glow and flare
_MIN_SKY = 0.25  # sr, 4 % of the dome
_MIN_CLIPPED = 0.9  # linear: from here on a pixel, averaged from larger ones, may hold clipped values
_SAMPLES = 1500  # directions of equal solid angle that enter the fit
_CHANNEL_WEIGHT = np.array([0.2, 0.6, 0.2])  # in the error: much like luminance, since cameras saturate a blue sky
_ERROR_SCALE = 0.2  # of log(picture / model) at which a pixel has half its weight; clear skies differ by 0.1
_GAIN_PULL = 0.5  # of the channels' gains towards each other: white balance is unknown, but not arbitrary

_MAX_RESIDUAL = 0.2  # `SkyFit.residual` from which on a fit is not trusted
_MAX_GAIN_RANGE = 0.6  # range of the channels' log gains from which on it is not
_MIN_SHARE = 0.5  # of the sky's pixels that keep their weight in a trusted fit
_MIN_COVERAGE = 0.4  # sr, of the sky that the model of a trusted fit explains


@dataclass(frozen=True)
class SkyFit:
    """The Hosek-Wilkie sky nearest to a picture's sky."""

    turbidity: float
    """Turbidity, 1 to 10."""
    exposure: float
    """Picture's linear values / sky radiance."""
    residual: float
    """Robust spread of log(picture / model) over the sky's pixels."""
    ok: bool
    """Whether the fit may be trusted."""


@dataclass(frozen=True)
class _Sky:
    """Samples of a picture's sky."""

    directions: Floats  # (N, 3) unit vectors, each for the same solid angle
    pixels: Floats  # (N, 3) linear
    solid_angle: float  # sr, of all

    def model(self, sun_direction: Floats, turbidity: float) -> Floats:
        radiance = sky_radiance(self.directions, sun_direction, turbidity, GROUND_ALBEDO)
        return np.asarray(np.maximum(radiance, 1e-5))


def fit_sky(linear: NDArray[np.float32], sun_direction: Floats) -> SkyFit | None:
    """Fit the Hosek-Wilkie sky to a panorama whose sun is known and up.

    The picture's white balance is unknown, so each channel has its own gain, pulled weakly towards a common one. Errors
    are differences of logarithms; pixels far from the model (clouds, masts) lose their weight. Turbidity is searched
    over its whole range, and the gains at each turbidity follow in closed form: no start value is needed, and no local
    minimum can hold the fit.

    Args:
        linear: (H, 2H, 3) linear Rec.709.
        sun_direction: (3,) unit vector.

    Returns:
        The fit; None where too little clear sky is visible.
    """
    sky = _sample_sky(shrink_envmap(linear, ANALYSIS_HEIGHT), sun_direction)
    if sky.solid_angle < _MIN_SKY:
        return None
    turbidity, reach = 5.5, 4.5
    for step in (0.5, 0.1, 0.02):
        candidates = np.clip(np.arange(turbidity - reach, turbidity + reach + step / 2, step), 1.0, 10.0)
        costs = [_fit_gains(sky, sun_direction, candidate)[0] for candidate in candidates]
        turbidity, reach = float(candidates[int(np.argmin(costs))]), step
    _, gains, error, weight = _fit_gains(sky, sun_direction, turbidity)
    exposure = weight @ luminance(sky.pixels) / (weight @ luminance(sky.model(sun_direction, turbidity)))
    residual, share = float(np.median(error)), float(weight.mean())
    inside = 1.05 < turbidity < 9.95  # at an end of the range the best fit may lie beyond it
    explained = residual < _MAX_RESIDUAL and share > _MIN_SHARE and share * sky.solid_angle > _MIN_COVERAGE
    ok = bool(inside and explained and np.ptp(gains) < _MAX_GAIN_RANGE)
    return SkyFit(turbidity, float(exposure), residual, ok)


def _sky_mask(linear: NDArray[np.float32], sun_direction: Floats) -> Mask:
    """Pixels (H, 2H) of clear sky: away from the sun, not blown out, bluish, smooth, part of a large patch high up."""
    height = len(linear)
    elevation = np.repeat(latlong_angles(height)[1][:, None], 2 * height, axis=1)
    is_far = angle_between(latlong_directions(height), sun_direction) > _SUN_CLEARANCE
    blue = linear[..., 2] > 1.05 * linear[..., 0]
    smooth = _roughness(np.log(np.maximum(luminance(linear), 1e-4))) < 0.06
    mask = (elevation > 3.0) & is_far & blue & smooth
    if is_clipped(linear):
        mask &= linear.max(axis=-1) < _MIN_CLIPPED
    patches = label_regions(mask)
    size = np.bincount(patches.ravel(), pixel_solid_angles(height).ravel())
    top = import_ndimage().maximum(elevation, patches, np.arange(len(size)))
    return np.asarray(mask & ((size > 0.03) & (np.asarray(top) > 25.0))[patches])


def _roughness(image: Floats) -> Floats:
    """Change per pixel (H, 2H), the larger of across and down."""
    across = np.abs(np.roll(image, 1, axis=1) - np.roll(image, -1, axis=1)) / 2
    return np.maximum(across, np.abs(np.gradient(image, axis=0)))


def _sample_sky(linear: NDArray[np.float32], sun_direction: Floats) -> _Sky:
    mask = _sky_mask(linear, sun_direction)
    order = np.cumsum(pixel_solid_angles(len(linear))[mask])
    if not len(order):
        return _Sky(np.empty((0, 3)), np.empty((0, 3)), 0.0)
    chosen = np.searchsorted(order, (np.arange(_SAMPLES) + 0.5) / _SAMPLES * order[-1])
    directions, pixels = latlong_directions(len(linear))[mask][chosen], np.maximum(linear[mask][chosen], 1e-4)
    return _Sky(directions, pixels, float(order[-1]))


def _fit_gains(sky: _Sky, sun_direction: Floats, turbidity: float) -> tuple[float, Floats, Floats, Floats]:
    """Cost, log gains (3,), errors (N,) and weights (N,) at one turbidity, by iteratively re-weighted least squares."""
    ratio = np.log(sky.pixels) - np.log(sky.model(sun_direction, turbidity))
    offset = np.median(ratio, axis=0)
    for scale in (0.5, *[_ERROR_SCALE] * 6):  # the first one wide, so that a median on clouds can still move
        common = _CHANNEL_WEIGHT @ offset
        gains = common + (offset - common) / (1 + _GAIN_PULL)
        square = (ratio - gains) ** 2 @ _CHANNEL_WEIGHT
        weight = 1 / (1 + square / scale**2)
        offset = weight @ ratio / weight.sum()
    pull = _GAIN_PULL * float(_CHANNEL_WEIGHT @ (gains - common) ** 2) / _ERROR_SCALE**2
    return float(np.log1p(square / _ERROR_SCALE**2).mean()) + pull, gains, np.sqrt(square), weight


_MIN_ELEVATION = 10.0  # deg, below which hills, trees and haze hide the sky
_MIN_ROWS = 16  # of a map; in fewer the sun's glow leaves too little sky
_MAX_CLEAR_ERROR = 0.35  # of |log(measured / model)| of the luminance, up to which a direction counts as clear


@dataclass(frozen=True)
class SkyState:
    """A sky in numbers; angles in deg, azimuth from the map's center column, clockwise positive, -180 to 180."""

    sun_azimuth: float
    """Deg, -180 to 180: 0 = the middle of the map, positive to the right."""
    sun_elevation: float
    """Deg above the horizon, -4.2 to 90."""
    sun_source: str
    """"found" in the map or "given"."""
    fit: SkyFit
    """Of the clear sky."""
    cover: float
    """Share of the sky above _MIN_ELEVATION that the model of the clear sky does not explain, 0 to 1."""

    def to_dict(self) -> Json:
        """As JSON, with no more digits than the sky tells."""
        return {
            "sun_azimuth": round(self.sun_azimuth, 2),
            "sun_elevation": round(self.sun_elevation, 2),
            "sun_source": self.sun_source,
            "turbidity": round(self.fit.turbidity, 2),
            "exposure": float(f"{self.fit.exposure:.5g}"),
            "residual": round(self.fit.residual, 4),
            "trusted": self.fit.ok,
            "cover": round(self.cover, 4),
        }


def describe_sky(image: NDArray[np.float32], sun: tuple[float, float] | None = None) -> SkyState:
    """Describe a map's sky: sun, turbidity, exposure and cloud cover.

    Args:
        image: (H, 2H, 3) linear Rec.709, row 0 is the zenith.
        sun: deg, azimuth from the center column and elevation; None finds it in the map.

    Raises:
        ProbeError: the map is too small, black or negative, its sun is not found or below the horizon, or no clear sky
            is visible.
    """
    _check_sky(image)
    source = "given" if sun else "found"
    if sun is None:
        spot = find_sun_blob(image, np.zeros(image.shape[:2], dtype=bool)) or find_sun(image)
        if spot is None:
            raise ProbeError("No sun is found in the map; give its azimuth and elevation.")
        sun = spot.azimuth, spot.elevation
    azimuth, elevation = sun
    if elevation < 0:
        sentence = f"The sun is {-elevation:.0f} deg below the horizon: there is no daylight sky to fit."
        raise ProbeError(sentence, code=ErrorCode.NIGHT)
    fit = fit_sky(image, direction(azimuth, elevation))
    if fit is None:
        raise ProbeError("Too little clear sky is seen to fit a model to: the sky is overcast or hidden.")
    cover = _cloud_cover(image, direction(azimuth, elevation), fit)
    return SkyState(float(wrap_azimuth(azimuth)), elevation, source, fit, cover)


def _check_sky(image: NDArray[np.float32]) -> None:
    """Raise ProbeError for a map (H, 2H, 3) that is too small, black or negative."""
    if len(image) < _MIN_ROWS:
        rows = "1 row" if len(image) == 1 else f"{len(image)} rows"
        raise ProbeError(f"The map has {rows}; a sky needs {_MIN_ROWS} or more to be fitted.")
    light = luminance(image[: len(image) // 2])
    if (light > 0).sum() <= (light < 0).sum():  # a few values under 0 are the ringing of a filter
        raise ProbeError("The sky in the map is black or negative.")


def _cloud_cover(image: NDArray[np.float32], sun: Floats, fit: SkyFit) -> float:
    """`SkyState.cover` of a map (H, 2H, 3) whose sun stands in a direction (3,), by the model fitted to it."""
    small = shrink_envmap(image, ANALYSIS_HEIGHT)
    directions = latlong_directions(len(small))
    high = np.broadcast_to(latlong_angles(len(small))[1][:, None] > _MIN_ELEVATION, small.shape[:2])
    counted = high & (angle_between(directions, sun) > _SUN_CLEARANCE)
    model = luminance(sky_radiance(directions[counted], sun, fit.turbidity, GROUND_ALBEDO)) * fit.exposure
    error = np.abs(np.log(np.maximum(luminance(small[counted]), 1e-12) / np.maximum(model, 1e-12)))
    area = pixel_solid_angles(len(small))[counted]
    return float(area[error > _MAX_CLEAR_ERROR].sum() / area.sum())

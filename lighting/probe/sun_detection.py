"""Where the sun is in a measured sky: clipped or not, as a peak or as a blob of light."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.color import luminance
from lighting.envmap.latlong import shrink_envmap
from lighting.errors import require_extra
from lighting.geometry import (
    Floats,
    angle_between,
    angles,
    direction,
    latlong_angles,
    latlong_directions,
    latlong_solid_angle,
)

Mask = NDArray[np.bool_]
ANALYSIS_HEIGHT = 128  # rows of the picture in which the sun is sought and to whose sky the model is fitted


_WHITE = 0.98  # of the whitest part of the upper half: pixels above it form the bright regions
_MIN_REGION = 2e-4  # sr, a cap of half a degree: no bright region is smaller
_MIN_PEAK = 0.94  # linear: the sun blows a picture out
_MAX_FLATNESS = 0.62  # blur of 24 deg / blur of 1.5 deg, at the peak: higher in a white sky than around a sun
_MIN_REGION_SHARE = 0.4  # share of all bright regions that the sun's region must hold
_MIN_PEAK_CONTRAST = 1000.0  # an unclipped sun / the median of the upper half


@dataclass(frozen=True, eq=False)
class DetectedSun:
    """A sun found in a picture."""

    azimuth: float
    """Deg, 0 = center column, positive to the right."""
    elevation: float
    """Elevation, deg."""
    radius: float
    """Deg, of a cap as large as the blown-out region; the position is no better than a part of it."""

    @property
    def direction(self) -> Floats:
        """Unit vector (3,)."""
        return direction(self.azimuth, self.elevation)


def find_sun(linear: NDArray[np.float32]) -> DetectedSun | None:
    """Find the sun in a panorama.

    In an unclipped (HDR) picture it is the centroid of the radiance around the peak. In a clipped one it is the
    centroid of the largest blown-out region. There a pixel counts by its solid angle and its excess over the median
    of its row, so bright haze along the horizon counts for little.

    Args:
        linear: (H, 2H, 3) linear Rec.709.

    Returns:
        The sun; None where it is hidden or behind clouds.
    """
    small = shrink_envmap(linear, ANALYSIS_HEIGHT)
    above = np.repeat(latlong_angles(len(small))[1][:, None] > 0, 2 * len(small), axis=1)
    if is_clipped(small):
        return _find_clipped(small, above)
    value = luminance(small) * above
    region = _peak_region(value, _MIN_PEAK_CONTRAST * float(np.median(value[above])))
    return None if region is None else _locate_region(region, value)


def _peak_region(value: Floats, least: float) -> Mask | None:
    """What is brighter than a tenth of the peak around the peak; None where the peak is not over `least`."""
    peak = float(value.max())
    if peak <= least:
        return None
    regions = label_regions(value > 0.1 * peak)
    return np.asarray(regions == regions[np.unravel_index(int(value.argmax()), value.shape)])


def _find_clipped(small: NDArray[np.float32], above: Mask) -> DetectedSun | None:
    white = small.min(axis=-1)
    excess = np.maximum(white - np.median(white, axis=1, keepdims=True), 0.0)
    regions = label_regions(above & (white >= _WHITE * np.percentile(white[above], 99.8)))
    area = pixel_solid_angles(len(small)).ravel()
    size = np.bincount(regions.ravel(), area)
    value = np.bincount(regions.ravel(), area * excess.ravel())[1:] * (size[1:] > _MIN_REGION)
    if not value.size or value.max() <= _MIN_REGION_SHARE * value.sum():
        return None
    best = regions == int(np.argmax(value)) + 1
    flat = _blur(white, 24.0)[best].max() > _MAX_FLATNESS * _blur(white, 1.5)[best].max()
    return None if flat or white[best].max() < _MIN_PEAK else _locate_region(best, excess)


def _locate_region(region: Mask, value: Floats) -> DetectedSun:
    area = pixel_solid_angles(len(region))[region]
    azimuth, elevation = angles((area * value[region]) @ latlong_directions(len(region))[region])
    radius = math.degrees(math.acos(1 - float(area.sum()) / (2 * math.pi)))
    return DetectedSun(float(azimuth), float(elevation), radius)


def _blur(image: Floats, std: float) -> Floats:
    """A lat-long image (H, 2H) blurred by a Gaussian of `std` [deg] on the sphere, to first order."""
    height, width = image.shape
    rows = std / 180.0 * height
    pad = min(math.ceil(3 * rows), height)
    opposite = np.roll(image, width // 2, axis=1)
    tall = np.concatenate([opposite[:pad][::-1], image, opposite[-pad:][::-1]])
    down = import_ndimage().gaussian_filter1d(tall, rows, axis=0)[pad : pad + height]
    columns = rows / np.cos(np.radians(latlong_angles(height)[1]))
    decay = np.exp(-2 * (np.pi * np.fft.rfftfreq(width) * columns[:, None]) ** 2)
    return np.asarray(np.fft.irfft(np.fft.rfft(down, axis=1) * decay, n=width, axis=1))


_MIN_SUN_CONTRAST = 200.0  # the sun's pixel / the median above the horizon; sunlit clouds stay under 50
_MAX_CLIPPED_RADIUS = 12.0  # deg, radius of a clipped region that can still be called the sun
MARGIN = 1.5  # pixels of the map around the bright region whose light counts as the sun's


@dataclass(frozen=True, eq=False)
class SunBlob(DetectedSun):
    """The sun as a map shows it."""

    clipped: bool
    """Brighter than the shortest exposure could measure."""
    irradiance: Floats
    """(3,), on a surface that faces it, above the sky beside it; the least that it can be if clipped."""


def find_sun_blob(image: NDArray[np.float32], clipped: Mask) -> SunBlob | None:
    """Find the sun in a map whose clipped pixels are marked.

    Args:
        image: (H, 2H, 3) linear Rec.709.
        clipped: (H, 2H), pixels whose radiance is a lower bound.

    Returns:
        The sun; None where none is above the horizon.
    """
    directions = latlong_directions(len(image))
    value = np.where(directions[..., 1] > 0, luminance(image), 0.0)
    region = _bright_region(value, clipped & (directions[..., 1] > 0))
    if region is None:
        return None
    area = pixel_solid_angles(len(image))
    size = float(area[region].sum())
    radius = float(np.degrees(np.arccos(1 - size / (2 * np.pi))))
    center = (area * value)[region] @ directions[region]
    distance = angle_between(directions, center)
    reach = radius + MARGIN * 180.0 / len(image)
    ring = (distance > reach) & (distance < reach + MARGIN * 180.0 / len(image))  # much brighter than a few deg away
    background = np.median(image[ring], axis=0) if ring.any() else np.zeros(3)
    is_near = distance < reach
    light = np.maximum(image[is_near] - background, 0) * area[is_near][:, None]
    azimuth, elevation = angles(luminance(light) @ directions[is_near])
    return SunBlob(float(azimuth), float(elevation), radius, bool(clipped[region].any()), light.sum(axis=0))


def _bright_region(value: Floats, clipped: Mask) -> Mask | None:
    """The largest of the clipped regions, or what is brighter than a tenth of the peak around the peak."""
    area = pixel_solid_angles(len(value))
    if clipped.any():
        regions = label_regions(clipped)
        power = np.bincount(regions.ravel(), (area * value).ravel())
        best = regions == int(np.argmax(power[1:])) + 1
        cap = 2 * np.pi * (1 - np.cos(np.radians(_MAX_CLIPPED_RADIUS)))
        return best if area[best].sum() < cap else None
    return _peak_region(value, _MIN_SUN_CONTRAST * float(np.median(value[value > 0])))


def is_clipped(linear: NDArray[np.float32]) -> bool:
    """Tell whether a linear picture was clipped at white: it has no value above 1.

    Args:
        linear: (H, W, 3), at least 0.
    """
    return float(linear.max()) <= 1.0


def import_ndimage() -> Any:
    """Import scipy's image filters; MissingExtraError where scipy is not installed."""
    return require_extra("scipy.ndimage", "Measured skies need scipy", "all")


def label_regions(mask: Mask) -> NDArray[np.intp]:
    """Number the connected regions of a mask, which cross the seam.

    Args:
        mask: (H, 2H).

    Returns:
        The number of each pixel's region (H, 2H); 0 outside the mask.
    """
    labels, count = import_ndimage().label(mask, np.ones((3, 3)))
    same = np.arange(count + 1)
    for left, right in zip(labels[:, 0], labels[:, -1], strict=True):
        if left and right:
            same[same == same[right]] = same[left]
    return np.asarray(same[labels])


def pixel_solid_angles(height: int) -> Floats:
    """Return the solid angle [sr] of each pixel (H, 2H).

    Args:
        height: H, rows of the map.
    """
    return np.repeat(latlong_solid_angle(height)[:, None], 2 * height, axis=1)

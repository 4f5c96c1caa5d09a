"""Finding the sun in the pixels of a panorama."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.colour import luminance
from lighting.geometry import Floats, angles, direction, latlong_angles, latlong_directions
from lighting.prefilter import shrink
from lighting.probe.regions import HEIGHT, Mask, connected, is_clipped, ndimage, solid_angle

WHITE = 0.98  # of the whitest part of the upper half: pixels above it form the bright regions
SMALLEST = 2e-4  # sr, a cap of half a degree: no bright region is smaller
LEAST_PEAK = 0.94  # linear: the sun blows a picture out
FLATTEST = 0.62  # blur of 24 deg / blur of 1.5 deg, at the peak: higher in a white sky than around a sun
LEAST_PART = 0.4  # share of all bright regions that the sun's region must hold
LEAST_CONTRAST = 1000.0  # an unclipped sun / the median of the upper half


@dataclass(frozen=True)
class FoundSun:
    """A sun found in a picture."""

    azimuth: float  # deg, 0 = centre column, positive to the right
    elevation: float  # deg
    radius: float  # deg, of a cap as large as the blown-out region; the position is no better than a part of it

    @property
    def direction(self) -> Floats:
        return direction(self.azimuth, self.elevation)


def find_sun(linear: NDArray[np.float32]) -> FoundSun | None:
    """The sun in a panorama (H, 2H, 3), None where it is hidden or behind clouds.

    In an unclipped (HDR) picture it is the centroid of the radiance around the peak. In a clipped one it is the
    centroid of the largest blown-out region, where a pixel counts by its solid angle and by its excess over the median
    of its row: bright haze along the horizon then counts for little.
    """
    small = shrink(linear, HEIGHT)
    above = np.repeat(latlong_angles(len(small))[1][:, None] > 0, 2 * len(small), axis=1)
    return _find_clipped(small, above) if is_clipped(small) else _find_peak(small, above)


def _find_peak(small: NDArray[np.float32], above: Mask) -> FoundSun | None:
    value = luminance(small) * above
    peak = float(value.max())
    if peak <= LEAST_CONTRAST * float(np.median(value[above])):
        return None
    regions = connected(value > 0.1 * peak)
    return _centre(regions == regions[np.unravel_index(int(value.argmax()), value.shape)], value)


def _find_clipped(small: NDArray[np.float32], above: Mask) -> FoundSun | None:
    white = small.min(axis=-1)
    excess = np.maximum(white - np.median(white, axis=1, keepdims=True), 0.0)
    regions = connected(above & (white >= WHITE * np.percentile(white[above], 99.8)))
    area = solid_angle(len(small)).ravel()
    size = np.bincount(regions.ravel(), area)
    value = np.bincount(regions.ravel(), area * excess.ravel())[1:] * (size[1:] > SMALLEST)
    if not value.size or value.max() <= LEAST_PART * value.sum():
        return None
    best = regions == int(np.argmax(value)) + 1
    flat = _blur(white, 24.0)[best].max() > FLATTEST * _blur(white, 1.5)[best].max()
    return None if flat or white[best].max() < LEAST_PEAK else _centre(best, excess)


def _centre(region: Mask, value: Floats) -> FoundSun:
    area = solid_angle(len(region))[region]
    azimuth, elevation = angles((area * value[region]) @ latlong_directions(len(region))[region])
    radius = math.degrees(math.acos(1 - float(area.sum()) / (2 * math.pi)))
    return FoundSun(float(azimuth), float(elevation), radius)


def _blur(image: Floats, sigma: float) -> Floats:
    """A lat-long image (H, 2H) blurred by a Gaussian of `sigma` [deg] on the sphere, to first order."""
    height, width = image.shape
    rows = sigma / 180.0 * height
    pad = min(math.ceil(3 * rows), height)
    opposite = np.roll(image, width // 2, axis=1)
    tall = np.concatenate([opposite[:pad][::-1], image, opposite[-pad:][::-1]])
    down = ndimage().gaussian_filter1d(tall, rows, axis=0)[pad : pad + height]
    columns = rows / np.cos(np.radians(latlong_angles(height)[1]))
    decay = np.exp(-2 * (np.pi * np.fft.rfftfreq(width) * columns[:, None]) ** 2)
    return np.asarray(np.fft.irfft(np.fft.rfft(down, axis=1) * decay, n=width, axis=1))

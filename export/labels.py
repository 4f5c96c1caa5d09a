"""Labels of a panorama: where the sun is, and the turbidity and exposure of the Hosek-Wilkie sky that fits it.

The procedure is the one of "Deep Outdoor Illumination Estimation" (CVPR 2017): find the sun, hold it fixed with a
ground albedo of 0.3, and fit turbidity and exposure to the sky's pixels by robust non-linear least squares.
"""

import csv
import math
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from export.panoramas import DataError, Panorama, read_index, read_linear, shrink
from lighting.atomic import replacing
from lighting.colour import luminance
from lighting.geometry import angle_between, angles, direction, latlong_angles, latlong_directions, latlong_solid_angle
from lighting.parameters import GROUND_ALBEDO
from lighting.sky import sky_radiance

Floats = NDArray[np.floating[Any]]
Mask = NDArray[np.bool_]

SUN_HEIGHT = 128  # rows of the picture in which the sun is sought
SKY_HEIGHT = 128  # rows of the picture to which the sky is fitted


@dataclass(frozen=True)
class Sun:
    """A sun found in a picture."""

    azimuth: float  # deg, 0 = centre column, positive to the right
    elevation: float  # deg
    radius: float  # deg, of a cap as large as the blown-out region; the position is no better than a part of it

    @property
    def direction(self) -> Floats:
        return direction(self.azimuth, self.elevation)


@dataclass(frozen=True)
class SkyFit:
    """The Hosek-Wilkie sky nearest to a picture's sky."""

    turbidity: float  # 1 to 10
    exposure: float  # picture's linear values / sky radiance
    residual: float  # robust spread of log(picture / model) over the sky's pixels
    coverage: float  # sr, of the sky that the model explains
    ok: bool  # whether the fit may be trusted


@dataclass(frozen=True)
class Label:
    """What training takes from a panorama; NaN where it has no value."""

    name: str
    sun_azimuth: float
    sun_elevation: float
    sun_uncertainty: float  # deg, one sigma
    sun_source: str  # "given" in the index, "found" in the picture, "none" where it has none or none is known
    found_azimuth: float  # what `find_sun` says, whatever the source
    found_elevation: float
    turbidity: float
    exposure: float
    fit_residual: float
    fit_ok: bool
    direct: str


# --- the sun ---------------------------------------------------------------------------------------------------------


def find_sun(linear: NDArray[np.float32]) -> Sun | None:
    """The sun in a panorama (H, 2H, 3), None where it is hidden or behind clouds."""
    small = shrink(linear, SUN_HEIGHT)
    glow = _blur(np.minimum(luminance(small), 1.0), 8.0)
    regions = _bright_regions(small)
    if not regions:
        return None
    solid_angle = _solid_angle(len(small))
    best = max(regions, key=lambda region: float((solid_angle * glow)[region].sum()))
    weight = solid_angle[best] * _blur(small.min(axis=-1) ** 2, 2.5)[best] ** 4
    azimuth, elevation = angles(weight @ latlong_directions(len(small))[best])
    radius = math.degrees(math.acos(1 - min(float(solid_angle[best].sum()), 2 * math.pi) / (2 * math.pi)))
    return None if radius > MAXIMUM_RADIUS or elevation <= 0 else Sun(float(azimuth), float(elevation), radius)


MAXIMUM_RADIUS = 30.0  # deg


def _bright_regions(small: NDArray[np.float32]) -> list[Mask]:
    """Connected regions above the horizon that are nearly as white as the picture gets."""
    height = len(small)
    white = np.minimum(small.min(axis=-1), 1.0)
    above = np.repeat(latlong_angles(height)[1][:, None] > 0, 2 * height, axis=1)
    labels = _connected(above & (white >= 0.92 * np.percentile(white[above], 99.8)))
    return [labels == label for label in np.unique(labels) if label]


def _connected(mask: Mask) -> NDArray[np.intp]:
    """Numbers of the connected regions of a lat-long mask, joined across the seam; 0 outside."""
    labels, count = ndimage.label(mask, np.ones((3, 3)))
    same = np.arange(count + 1)
    for left, right in zip(labels[:, 0], labels[:, -1], strict=True):
        if left and right:
            same[same == same[right]] = same[left]
    return np.asarray(same[labels])


def _blur(image: Floats, sigma: float) -> Floats:
    """A lat-long image (H, 2H) blurred by a Gaussian of `sigma` [deg] on the sphere, to first order."""
    height, width = image.shape
    rows = sigma / 180.0 * height
    pad = min(math.ceil(3 * rows), height)
    opposite = np.roll(image, width // 2, axis=1)
    tall = np.concatenate([opposite[:pad][::-1], image, opposite[-pad:][::-1]])
    down = ndimage.gaussian_filter1d(tall, rows, axis=0)[pad : pad + height]
    columns = rows / np.cos(np.radians(latlong_angles(height)[1]))
    decay = np.exp(-2 * (np.pi * np.fft.rfftfreq(width) * columns[:, None]) ** 2)
    return np.asarray(np.fft.irfft(np.fft.rfft(down, axis=1) * decay, n=width, axis=1))


# --- the sky ---------------------------------------------------------------------------------------------------------

SUN_CLEARANCE = 20.0  # deg around the sun left out: glow and flare
MINIMUM_SKY = 0.25  # sr, 4 % of the dome
SAMPLES = 1500  # directions of equal solid angle that enter the fit
CHANNEL_WEIGHT = np.array([0.2, 0.6, 0.2])  # in the error: much like luminance, since cameras saturate a blue sky
SPREAD = 0.2  # of log(picture / model) at which a pixel has half its weight; clear skies leave the model by 0.1
GAIN_PULL = 0.5  # of the channels' gains towards each other: white balance is unknown, but not arbitrary

WORST_RESIDUAL = 0.2
WORST_GAINS = 0.6  # range of the channels' log gains
LEAST_SHARE = 0.5  # of the sky's pixels that keep their weight
LEAST_COVERAGE = 0.4  # sr


@dataclass(frozen=True)
class _Sky:
    """Samples of a picture's sky."""

    towards: Floats  # (N, 3) unit vectors, each for the same solid angle
    pixels: Floats  # (N, 3) linear
    solid_angle: float  # sr, of all

    def model(self, sun_direction: Floats, turbidity: float) -> Floats:
        radiance = sky_radiance(self.towards, sun_direction, turbidity, GROUND_ALBEDO)
        return np.asarray(np.maximum(radiance, 1e-5))


def fit_sky(linear: NDArray[np.float32], sun_direction: Floats) -> SkyFit | None:
    """The sky of a panorama (H, 2H, 3) whose sun is known and up; None where too little clear sky can be seen.

    A photo's white balance is unknown, so each channel has its own gain, pulled weakly to a common one. The error is
    that of the logarithm, pixels off the model (clouds, masts) lose their weight, and turbidity is searched over its
    whole range while the gains follow in closed form: no start value, no local minimum.
    """
    sky = _sample_sky(shrink(linear, SKY_HEIGHT), sun_direction)
    if sky.solid_angle < MINIMUM_SKY:
        return None
    turbidity, reach = 5.5, 4.5
    for step in (0.5, 0.1, 0.02):
        candidates = np.clip(np.arange(turbidity - reach, turbidity + reach + step / 2, step), 1.0, 10.0)
        costs = [_fit_gains(sky, sun_direction, candidate)[0] for candidate in candidates]
        turbidity, reach = float(candidates[int(np.argmin(costs))]), step
    return _conclude(sky, sun_direction, turbidity)


def sky_mask(linear: NDArray[np.float32], sun_direction: Floats) -> Mask:
    """Pixels (H, 2H) of clear sky: away from the sun, not blown out, bluish, smooth, part of a large patch high up."""
    height = len(linear)
    elevation = np.repeat(latlong_angles(height)[1][:, None], 2 * height, axis=1)
    away = angle_between(latlong_directions(height), sun_direction) > SUN_CLEARANCE
    blue = linear[..., 2] > 1.05 * linear[..., 0]
    smooth = _roughness(np.log(np.maximum(luminance(linear), 1e-4))) < 0.06
    mask = (elevation > 3.0) & away & blue & smooth & (linear.max(axis=-1) < _blown(linear))
    patches = _connected(mask)
    size = np.bincount(patches.ravel(), _solid_angle(height).ravel())
    top = ndimage.maximum(elevation, patches, np.arange(len(size)))
    return mask & ((size > 0.03) & (np.asarray(top) > 25.0))[patches]


def _blown(linear: NDArray[np.float32]) -> float:
    """Value above which a channel may have been clipped: just under 1 in an LDR picture."""
    return 0.9 if linear.max() <= 1.0 else math.inf


def _roughness(image: Floats) -> Floats:
    """Change per pixel (H, 2H), the larger of across and down."""
    across = np.abs(np.roll(image, 1, axis=1) - np.roll(image, -1, axis=1)) / 2
    return np.maximum(across, np.abs(np.gradient(image, axis=0)))


def _sample_sky(linear: NDArray[np.float32], sun_direction: Floats) -> _Sky:
    mask = sky_mask(linear, sun_direction)
    order = np.cumsum(_solid_angle(len(linear))[mask])
    if not len(order):
        return _Sky(np.empty((0, 3)), np.empty((0, 3)), 0.0)
    chosen = np.searchsorted(order, (np.arange(SAMPLES) + 0.5) / SAMPLES * order[-1])
    towards, pixels = latlong_directions(len(linear))[mask][chosen], np.maximum(linear[mask][chosen], 1e-4)
    return _Sky(towards, pixels, float(order[-1]))


def _fit_gains(sky: _Sky, sun_direction: Floats, turbidity: float) -> tuple[float, Floats, Floats, Floats]:
    """Cost, log gains (3,), errors (N,) and weights (N,) at one turbidity, by iteratively re-weighted least squares."""
    ratio = np.log(sky.pixels) - np.log(sky.model(sun_direction, turbidity))
    offset = np.median(ratio, axis=0)
    for spread in (0.5, *[SPREAD] * 6):  # the first one wide, so that a median on clouds can still move
        common = CHANNEL_WEIGHT @ offset
        gains = common + (offset - common) / (1 + GAIN_PULL)
        square = (ratio - gains) ** 2 @ CHANNEL_WEIGHT
        weight = 1 / (1 + square / spread**2)
        offset = weight @ ratio / weight.sum()
    pull = GAIN_PULL * float(CHANNEL_WEIGHT @ (gains - common) ** 2) / SPREAD**2
    return float(np.log1p(square / SPREAD**2).mean()) + pull, gains, np.sqrt(square), weight


def _conclude(sky: _Sky, sun_direction: Floats, turbidity: float) -> SkyFit:
    _, gains, error, weight = _fit_gains(sky, sun_direction, turbidity)
    exposure = weight @ luminance(sky.pixels) / (weight @ luminance(sky.model(sun_direction, turbidity)))
    residual, share = float(np.median(error)), float(weight.mean())
    coverage = share * sky.solid_angle
    inside = 1.05 < turbidity < 9.95  # at an end of the range the best fit may lie beyond it
    explained = residual < WORST_RESIDUAL and share > LEAST_SHARE and coverage > LEAST_COVERAGE
    ok = bool(inside and explained and np.ptp(gains) < WORST_GAINS)
    return SkyFit(turbidity, float(exposure), residual, coverage, ok)


def _solid_angle(height: int) -> Floats:
    """Solid angle [sr] of each pixel (H, 2H)."""
    return np.repeat(latlong_solid_angle(height)[:, None], 2 * height, axis=1)


# --- a folder --------------------------------------------------------------------------------------------------------


def label_panorama(panorama: Panorama) -> Label:
    """The panorama's label; a sun given in the index wins over the one found in the picture."""
    linear = read_linear(panorama, SUN_HEIGHT)
    found = find_sun(linear)
    azimuth, elevation, uncertainty, source = _sun_of(panorama, found)
    fit = None if source == "none" else fit_sky(linear, direction(azimuth, max(elevation, 0.0)))
    return Label(
        name=panorama.name,
        sun_azimuth=azimuth,
        sun_elevation=elevation,
        sun_uncertainty=uncertainty,
        sun_source=source,
        found_azimuth=found.azimuth if found else math.nan,
        found_elevation=found.elevation if found else math.nan,
        turbidity=fit.turbidity if fit else math.nan,
        exposure=fit.exposure if fit else math.nan,
        fit_residual=fit.residual if fit else math.nan,
        fit_ok=bool(fit and fit.ok and uncertainty <= 12.0),
        direct=panorama.direct,
    )


def _sun_of(panorama: Panorama, found: Sun | None) -> tuple[float, float, float, str]:
    """Azimuth, elevation, uncertainty [deg] and source."""
    if panorama.sun_azimuth is not None and panorama.sun_elevation is not None:
        uncertainty = 5.0 if panorama.sun_uncertainty is None else panorama.sun_uncertainty
        return panorama.sun_azimuth, panorama.sun_elevation, uncertainty, "given"
    judged = panorama.sun == "none" or panorama.label  # someone looked and could not tell
    if found is None or judged:
        return math.nan, math.nan, math.nan, "none"
    return found.azimuth, found.elevation, max(2.0, found.radius / 2), "found"


def write_labels(labels: Iterable[Label], path: str | Path) -> None:
    """One row a label; the file appears whole or not at all."""
    names = [field.name for field in fields(Label)]
    with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows([_text(getattr(label, name)) for name in names] for label in labels)


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.6g}"
    return str(value)


def read_labels(path: str | Path) -> list[Label]:
    """What `write_labels` wrote; DataError if the file is missing or of another layout."""
    try:
        with Path(path).open(newline="", encoding="utf-8") as file:
            return [_label(row) for row in csv.DictReader(file)]
    except (OSError, ValueError, KeyError, csv.Error) as error:
        raise DataError(f"The labels {path} cannot be read: {error}.") from error


def _label(row: dict[str, str]) -> Label:
    texts = {"name", "sun_source", "direct"}
    values: dict[str, Any] = {}
    for field in fields(Label):
        text = row[field.name]
        values[field.name] = text if field.name in texts else float(text or "nan") if field.name != "fit_ok" else text == "yes"
    return Label(**values)


def run(data: Path, out: Path, workers: int = 2) -> None:
    """Label a folder of panoramas, write the labels and print how well they agree with what is given."""
    panoramas = read_index(data)
    with ProcessPoolExecutor(workers) as pool:
        labels = list(pool.map(label_panorama, panoramas, chunksize=8))
    write_labels(labels, out)

"""Labels of a panorama: where the sun is, and the turbidity and exposure of the Hosek-Wilkie sky that fits it.

The procedure is the one of "Deep Outdoor Illumination Estimation" (CVPR 2017): find the sun, hold it fixed with a
ground albedo of 0.3, and fit turbidity and exposure to the sky's pixels by robust non-linear least squares.
"""

import csv
import math
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from export.panoramas import DataError, Panorama, decode, read_index, read_linear, shrink
from export.synthetic import render_panorama
from lighting.atomic import replacing
from lighting.colour import luminance
from lighting.geometry import angle_between, angles, direction, latlong_angles, latlong_directions, latlong_solid_angle
from lighting.parameters import GROUND_ALBEDO
from lighting.sky import sky_radiance

Floats = NDArray[np.floating[Any]]
Mask = NDArray[np.bool_]

HEIGHT = 128  # rows of the picture in which the sun is sought and to whose sky the model is fitted
WEAKEST_SUN = 12.0  # deg; a sun less certain than this gives no fit to be trusted


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

WHITE = 0.98  # of the whitest part of the upper half: what belongs to a bright region
SMALLEST = 2e-4  # sr, a cap of half a degree: no bright region is smaller
LEAST_PEAK = 0.94  # linear: the sun blows a picture out
FLATTEST = 0.62  # glow 24 deg wide / 1.5 deg wide: the sun stands out, a white sky does not
LEAST_PART = 0.4  # of all that is bright lies in the sun's region
LEAST_CONTRAST = 1000.0  # an unclipped sun / the median of the upper half


def find_sun(linear: NDArray[np.float32]) -> Sun | None:
    """The sun in a panorama (H, 2H, 3), None where it is hidden or behind clouds.

    Unclipped (HDR) it is the peak of the radiance; clipped, the centroid of the largest of the blown-out regions.
    Both weigh a pixel by its solid angle and by what it has above the median of its row, so that a bright haze along
    the horizon counts for little.
    """
    small = shrink(linear, HEIGHT)
    above = np.repeat(latlong_angles(len(small))[1][:, None] > 0, 2 * len(small), axis=1)
    return _find_clipped(small, above) if _is_clipped(small) else _find_peak(small, above)


def _find_peak(small: NDArray[np.float32], above: Mask) -> Sun | None:
    value = luminance(small) * above
    peak = value.max()
    if peak <= LEAST_CONTRAST * np.median(value[above]):
        return None
    regions = _connected(value > 0.1 * peak)
    return _centre(regions == regions[np.unravel_index(int(value.argmax()), value.shape)], value)


def _find_clipped(small: NDArray[np.float32], above: Mask) -> Sun | None:
    white = small.min(axis=-1)
    excess = np.maximum(white - np.median(white, axis=1, keepdims=True), 0.0)
    regions = _connected(above & (white >= WHITE * np.percentile(white[above], 99.8)))
    solid_angle = _solid_angle(len(small)).ravel()
    size = np.bincount(regions.ravel(), solid_angle)
    value = np.bincount(regions.ravel(), solid_angle * excess.ravel())[1:] * (size[1:] > SMALLEST)
    if not value.size or value.max() <= LEAST_PART * value.sum():
        return None
    best = regions == int(np.argmax(value)) + 1
    flat = _blur(white, 24.0)[best].max() > FLATTEST * _blur(white, 1.5)[best].max()
    return None if flat or white[best].max() < LEAST_PEAK else _centre(best, excess)


def _is_clipped(linear: NDArray[np.float32]) -> bool:
    return float(linear.max()) <= 1.0


def _centre(region: Mask, value: Floats) -> Sun:
    solid_angle = _solid_angle(len(region))[region]
    azimuth, elevation = angles((solid_angle * value[region]) @ latlong_directions(len(region))[region])
    radius = math.degrees(math.acos(1 - float(solid_angle.sum()) / (2 * math.pi)))
    return Sun(float(azimuth), float(elevation), radius)


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
LEAST_CLIPPED = 0.9  # linear: from here on a pixel, averaged from larger ones, may hold clipped values
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
    sky = _sample_sky(shrink(linear, HEIGHT), sun_direction)
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
    mask = (elevation > 3.0) & away & blue & smooth
    if _is_clipped(linear):
        mask &= linear.max(axis=-1) < LEAST_CLIPPED
    patches = _connected(mask)
    size = np.bincount(patches.ravel(), _solid_angle(height).ravel())
    top = ndimage.maximum(elevation, patches, np.arange(len(size)))
    return np.asarray(mask & ((size > 0.03) & (np.asarray(top) > 25.0))[patches])


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
    linear = read_linear(panorama, HEIGHT)
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
        fit_ok=bool(fit and fit.ok and uncertainty <= WEAKEST_SUN and not panorama.sky_is_altered),
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
    """One row a label; the file appears whole or not at all. DataError if it cannot be written."""
    names = [field.name for field in fields(Label)]
    try:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(names)
            writer.writerows([_text(getattr(label, name)) for name in names] for label in labels)
    except OSError as error:
        raise DataError(f"The labels cannot be written to {path}: {error}.") from error


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
            return [
                Label(**{field.name: _value(row[field.name], field.type) for field in fields(Label)})
                for row in csv.DictReader(file, restval="")
            ]
    except KeyError as error:
        raise DataError(f"The labels {path} have no column {error}.") from error
    except (OSError, ValueError, csv.Error) as error:
        raise DataError(f"The labels {path} cannot be read: {error}.") from error


def _value(text: str, kind: Any) -> Any:
    if kind is bool:
        return text == "yes"
    return float(text or "nan") if kind is float else text


# --- how good they are -----------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Agreement:
    """How `find_sun` agrees with suns that are given."""

    visible: int  # panoramas whose sun is given and in the picture
    found: int  # of these, a sun was found
    error_25: float  # deg, quartiles of the angle between found and given
    error_50: float
    error_75: float
    gross: float  # share of the found ones that are more than 20 deg off
    overcast: int  # panoramas without a sun
    rejected: int  # of these, none was found

    def __str__(self) -> str:
        return (
            f"sun found in {self.found} of {self.visible}, off by {self.error_50:.2f} deg in the median "
            f"(quartiles {self.error_25:.2f} and {self.error_75:.2f}), {self.gross:.1%} by more than 20 deg; "
            f"no sun found in {self.rejected} of {self.overcast} without one"
        )


@dataclass(frozen=True)
class RenderedCheck:
    """How labels of rendered panoramas agree with what they were rendered from."""

    rendered: int  # panoramas with a visible sun
    found: int
    sun_error: float  # deg, median
    fitted: int  # with the true sun
    turbidity_error: float  # median of the absolute
    exposure_error: float  # median of |log|

    def __str__(self) -> str:
        return (
            f"sun found in {self.found} of {self.rendered}, off by {self.sun_error:.2f} deg in the median; "
            f"sky fitted in {self.fitted}, turbidity off by {self.turbidity_error:.3f} "
            f"and exposure by {self.exposure_error:.2%} in the median"
        )


def agreement(panoramas: Iterable[Panorama], labels: Iterable[Label]) -> Agreement:
    """Found suns against given ones, over the panoramas whose sun is given as visible or as none."""
    by_name = {label.name: label for label in labels}
    pairs = [(panorama.sun, by_name[panorama.name]) for panorama in panoramas]
    visible = [label for sun, label in pairs if sun == "visible" and label.sun_source == "given"]
    overcast = [label for sun, label in pairs if sun == "none"]
    errors = np.array([_error(label) for label in visible if not math.isnan(label.found_azimuth)])
    low, median, high = (float(v) for v in np.percentile(errors, [25, 50, 75])) if len(errors) else [math.nan] * 3
    gross = float((errors > 20.0).mean()) if len(errors) else math.nan
    rejected = sum(math.isnan(label.found_azimuth) for label in overcast)
    return Agreement(len(visible), len(errors), low, median, high, gross, len(overcast), rejected)


def _error(label: Label) -> float:
    given = direction(label.sun_azimuth, label.sun_elevation)
    return float(angle_between(direction(label.found_azimuth, label.found_elevation), given))


def check_rendered(count: int = 60, height: int = 128) -> RenderedCheck:
    """Label `count` rendered clear skies, clipped to 8 bits like a photo, half of them with buildings and trees."""
    scenes = [render_panorama(seed, height, things=8 * (seed % 2)) for seed in range(count)]
    scenes = [scene for scene in scenes if scene.sun_visible]
    pictures = [decode(scene.picture) for scene in scenes]
    suns = [direction(scene.sun_azimuth or 0.0, scene.sun_elevation or 0.0) for scene in scenes]
    found = [(find_sun(picture), sun) for picture, sun in zip(pictures, suns, strict=True)]
    fits = [(fit_sky(picture, sun), scene) for picture, sun, scene in zip(pictures, suns, scenes, strict=True)]
    sun_errors = [float(angle_between(one.direction, sun)) for one, sun in found if one]
    turbidity = [abs(fit.turbidity - (scene.turbidity or 0.0)) for fit, scene in fits if fit]
    exposure = [abs(math.log(fit.exposure / scene.exposure)) for fit, scene in fits if fit]
    medians = [float(np.median(errors)) for errors in (sun_errors, turbidity, exposure)]
    return RenderedCheck(len(scenes), len(sun_errors), medians[0], len(turbidity), medians[1], medians[2])


def run(data: Path, out: Path, workers: int = 2) -> None:
    """Label a folder of panoramas, write the labels and print how far they can be trusted."""
    panoramas = read_index(data)
    with ProcessPoolExecutor(workers) as pool:
        labels = list(pool.map(label_panorama, panoramas, chunksize=8))
    write_labels(labels, out)
    trusted = [label for label in labels if label.fit_ok]
    by_eye = [panorama for panorama in panoramas if "machine" not in panorama.label]
    print(f"{out}: {len(labels)} panoramas, {sum(label.sun_source != 'none' for label in labels)} with a sun")
    print(f"given against found: {agreement(panoramas, labels)}")
    print(f"  where no machine had a hand in what is given: {agreement(by_eye, labels)}")
    print(
        f"sky fits to be trusted: {len(trusted)}; turbidity {_quartiles([label.turbidity for label in trusted])}, "
        f"exposure {_quartiles([label.exposure for label in trusted])}"
    )
    print(f"rendered skies: {check_rendered()}")


def _quartiles(values: Sequence[float]) -> str:
    return "/".join(f"{value:.3g}" for value in np.percentile(values, [25, 50, 75])) if values else "none"

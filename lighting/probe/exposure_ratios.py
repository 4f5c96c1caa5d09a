"""The ratios of a bracket's exposures, measured in their pixels.

Where both exposures of a pair are neither clipped nor dark, the short one's values are the long one's divided by the
ratio, plus what black and rounding leave. A straight line through them, with outliers out-weighted, has the ratio as
its slope; the errors are nearly all in the short one, so that one is the dependent variable. Where the values differ
hardly more than noise makes them, a line would be too flat, and the ratio is that of the means.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from lighting.errors import ProbeError
from lighting.geometry import Floats
from lighting.photo.linear import LinearPhoto
from lighting.probe.bracket import Bracket
from lighting.probe.sun_detection import Mask

READ_NOISE = 2e-4  # of full scale, where rounding is finer than that
LIGHT_NOISE = 5e-5  # variance per value: 20,000 electrons at full scale
MIN_SAMPLES = 24  # values that a ratio is measured from
MIN_VARIANCE_RATIO = 20.0  # variance of the values / of noise, from which a line's slope is less than 5 % too flat
MAX_RATIO_ERROR = 0.2  # relative, of a ratio that is worth telling
MAX_SAMPLES = 20_000  # used of them
MIN_LINEAR_EXPONENT = 0.75  # log of the measured ratio / log of EXIF's, below which the pixels are coded by a curve
MAX_EXIF_DIFFERENCE = 0.08  # relative, of EXIF's ratio and the pixels'; third stops round to 7 %
MIN_EXPOSURE_STEP = 1.2  # between exposures, for their ratio to tell a curve
_REWEIGHTINGS = 8  # of re-weighted least squares
_CURVE = {True: "srgb", False: "linear"}
MIN_VALUE, MAX_VALUE = 0.04, 0.7  # of white in the longer exposure: dark pixels say little, bright ones may bend
MIN_SURE_SAMPLES, MAX_SURE_ERROR = 1000, 0.02  # values, and relative error, of a well measured ratio


def noise_variance(value: Any, step: Any) -> Any:
    """Variance of values that are rounded to steps; numbers for numbers.

    Args:
        value: (...) of full scale.
        step: (...) of full scale.
    """
    return READ_NOISE**2 + step**2 / 12 + LIGHT_NOISE * np.maximum(value, 0)


def max_terraced_value(step: float) -> float:
    """The value under which noise is less than half a step of rounding; negative where it never is.

    Args:
        step: of full scale.
    """
    return (step**2 / 4 - READ_NOISE**2) / LIGHT_NOISE


@dataclass(frozen=True)
class ExposureRatio:
    """A longer exposure / the next shorter one."""

    value: float
    """Over 0."""
    error: float
    """One standard deviation, relative."""
    samples: int
    """Values that it was measured from."""

    @property
    def is_sure(self) -> bool:
        return self.samples >= MIN_SURE_SAMPLES and self.error <= MAX_SURE_ERROR


@dataclass(frozen=True, eq=False)
class ExposureRatios:
    """How long each exposure of a bracket is."""

    relative: Floats
    """(N,), with EXIF s x ISO / 100 / f-number^2, else the longest is 1."""
    ratios: tuple[ExposureRatio | None, ...]
    """Measured, (N - 1); None where the pixels cannot say."""
    from_exif: bool
    """Whether the files' own exposures counted."""
    warnings: tuple[str, ...]
    """Sentences for people."""


def measure_ratios(bracket: Bracket) -> ExposureRatios:
    """Find relative exposures: by EXIF where all files have it, else from the pixels.

    Args:
        bracket: exposures, the shortest first.

    Raises:
        ProbeError: neither can say, or EXIF shows that the pixels are coded by a curve.
    """
    ratios = tuple(_measure_ratio(short, long) for short, long in pairwise(bracket.photos))
    exposures = [photo.exposure for photo in bracket.photos]
    if all(value is not None for value in exposures):
        relative = np.array(exposures, dtype=np.float64)
        return ExposureRatios(relative, ratios, True, _check_exif_ratios(relative, ratios, bracket.names))
    if None in ratios:
        first, second = bracket.names[ratios.index(None) :][:2]
        raise ProbeError(
            f"The exposures {first} and {second} share too few pixels that are neither clipped nor dark. State their "
            f"exposure times in EXIF."
        )
    relative = np.array(np.cumprod([1.0, *(ratio.value for ratio in ratios if ratio is not None)]), dtype=np.float64)
    return ExposureRatios(relative / relative[-1], ratios, False, ())


def _measure_ratio(short: LinearPhoto, long: LinearPhoto) -> ExposureRatio | None:
    """The ratio by the pixels that both show; None where they are too few."""
    full = min(long.white, float(long.pixels.max()))
    usable = (long.pixels < MAX_VALUE * full) & (long.pixels > MIN_VALUE * full) & (short.pixels < short.white)
    clear = usable & ~dilate(clipped_mask(long))[..., None]
    index = np.flatnonzero(clear if clear.sum() >= MIN_SURE_SAMPLES else usable)
    if len(index) < MIN_SAMPLES:
        return None
    chosen = index[:: -(-len(index) // MAX_SAMPLES)]
    x, y = (np.asarray(photo.pixels.reshape(-1)[chosen], dtype=np.float64) for photo in (long, short))
    if x.var() < MIN_VARIANCE_RATIO * noise_variance(x.mean(), long.step):
        slope, error = y.mean() / x.mean(), short.step / 2 / x.mean()
    else:
        slope, error = _robust_slope(x, y)
    if slope <= 0 or error > MAX_RATIO_ERROR * slope:
        return None
    return ExposureRatio(float(1 / slope), float(error / slope), len(index))


def clipped_mask(photo: LinearPhoto) -> Mask:
    """Mark the pixels (H, W) of which a channel is clipped.

    Args:
        photo: linear, with the value of its white.
    """
    return np.asarray((photo.pixels >= photo.white).any(axis=-1))


def dilate(mask: Mask) -> Mask:
    """The mask and the eight neighbours of each of its pixels: a lens and demosaicing smear over one.

    Args:
        mask: (H, W).
    """
    wide = mask.copy()
    wide[1:] |= mask[:-1]
    wide[:-1] |= mask[1:]
    result = wide.copy()
    result[:, 1:] |= wide[:, :-1]
    result[:, :-1] |= wide[:, 1:]
    return result


def _robust_slope(x: Floats, y: Floats) -> tuple[float, float]:
    """Slope of y over x and its standard error, by least squares re-weighted with Tukey's biweight; 0 where x is one
    value alone.

    The error counts an eighth of the values as independent, for neighbours and channels share their errors.
    """
    weight = np.ones_like(x)
    for _ in range(_REWEIGHTINGS):
        total = weight.sum()
        mean_x, mean_y = weight @ x / total, weight @ y / total
        variance = weight @ (x - mean_x) ** 2
        if variance <= 0:  # all that count are of one value
            return 0.0, 0.0
        slope = weight @ ((x - mean_x) * (y - mean_y)) / variance
        residual = y - mean_y - slope * (x - mean_x)
        scale = max(1.4826 * float(np.median(np.abs(residual))), 1e-6)
        weight = np.maximum(1 - (residual / (4.7 * scale)) ** 2, 0) ** 2
    return float(slope), float(np.sqrt(weight @ residual**2 / total * 8 / variance))


def _check_exif_ratios(
    relative: Floats, ratios: tuple[ExposureRatio | None, ...], names: tuple[str, ...]
) -> tuple[str, ...]:
    """Warnings where the pixels contradict EXIF; ProbeError where they do as a curve would."""
    steps = zip((relative[1:] / relative[:-1]).tolist(), ratios, pairwise(names), strict=True)
    sure = [(t, ratio.value, pair) for t, ratio, pair in steps if ratio and ratio.is_sure and t > MIN_EXPOSURE_STEP]
    different = [(t, value, pair) for t, value, pair in sure if abs(t / value - 1) > MAX_EXIF_DIFFERENCE]
    powers = [np.log(value) / np.log(t) for t, value, _ in different]
    if powers and not MIN_LINEAR_EXPONENT < np.median(powers) < 1 / MIN_LINEAR_EXPONENT:
        t, value, _ = different[0]
        coded = bool(np.median(powers) < MIN_LINEAR_EXPONENT)
        state = "coded by a curve" if coded else "linear and were decoded as if by a curve"
        raise ProbeError(
            f"The pixels are {state}: exposures that differ {t:.3g}-fold by EXIF differ {value:.3g}-fold in the "
            f"pixels; say --curve {_CURVE[coded]}."
        )
    sentence = "EXIF says that {} is {:.3g} times as long as {}, the pixels say {:.3g}."
    return tuple(sentence.format(second, t, first, value) for t, value, (first, second) in different)

"""The ratios of a bracket's exposures, measured in their pixels, and the exposures merged to radiance.

Ratios. Where both exposures of a pair are neither clipped nor dark, the short one's values are the long one's divided
by the ratio, plus what black and rounding leave. A straight line through them, with outliers out-weighted, has the
ratio as its slope; the errors are nearly all in the short one, so that one is the dependent variable. Where the values
differ hardly more than noise makes them, a line would be too flat, and the ratio is that of the means.

Weights. Each value is weighted by the inverse of its variance, as Hasinoff, Durand and Freeman have it (CVPR 2010). The
variance is that of a camera of common size: a file does not say how many electrons fill its full scale. A clipped value
weighs nothing, so a pixel that is clipped in every exposure is known to be brighter than the shortest one says, and is
marked.

Rounding. A sky a few of a camera's steps above black is recorded as terraces. Where the noise is so much smaller than a
step, neighbors round alike. No mean over them then tells what lies between two steps. But the true value is within
half a step of the recorded one, and a sky has no terraces. So such values are smoothed and put back into that interval,
over and over (projections onto convex sets). The smoothing is a recursive filter along rows and columns (Gastal and
Oliveira, SIGGRAPH 2011). It stops where neighbors differ by more than a step. It is applied as 2 S - S S, which leaves
slopes and curves as they are.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.errors import ProbeError
from lighting.geometry import Floats
from lighting.photo.linear import LinearPhoto
from lighting.probe.bracket import Bracket
from lighting.probe.sun_detection import Mask

_READ_NOISE = 2e-4  # of full scale, where rounding is finer than that
_LIGHT_NOISE = 5e-5  # variance per value: 20,000 electrons at full scale
_MIN_SAMPLES = 24  # values that a ratio is measured from
_MIN_VARIANCE_RATIO = 20.0  # variance of the values / of noise, from which a line's slope is less than 5 % too flat
_MAX_RATIO_ERROR = 0.2  # relative, of a ratio that is worth telling
_MAX_SAMPLES = 20_000  # used of them
_MIN_LINEAR_EXPONENT = 0.75  # log of the measured ratio / log of EXIF's, below which the pixels are coded by a curve
_MAX_EXIF_DIFFERENCE = 0.08  # relative, of EXIF's ratio and the pixels'; third stops round to 7 %
_MIN_EXPOSURE_STEP = 1.2  # between exposures, for their ratio to tell a curve
_REWEIGHTINGS = 8  # of re-weighted least squares
_CURVE = {True: "srgb", False: "linear"}
_MIN_VALUE, _MAX_VALUE = 0.04, 0.7  # of white in the longer exposure: dark pixels say little, bright ones may bend
_MIN_SURE_SAMPLES, _MAX_SURE_ERROR = 1000, 0.02  # values, and relative error, of a well measured ratio


def noise_variance(value: Any, step: Any) -> Any:
    """Variance of values that are rounded to steps; numbers for numbers.

    Args:
        value: (...) of full scale.
        step: (...) of full scale.
    """
    return _READ_NOISE**2 + step**2 / 12 + _LIGHT_NOISE * np.maximum(value, 0)


def max_terraced_value(step: float) -> float:
    """The value under which noise is less than half a step of rounding; negative where it never is.

    Args:
        step: of full scale.
    """
    return (step**2 / 4 - _READ_NOISE**2) / _LIGHT_NOISE


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
        return self.samples >= _MIN_SURE_SAMPLES and self.error <= _MAX_SURE_ERROR


@dataclass(frozen=True, eq=False)
class ExposureRatios:
    """How long each exposure of a bracket is."""

    relative: Floats
    """(N,), with EXIF s x ISO / 100 / f-number^2, else the longest is 1."""
    ratios: tuple[ExposureRatio | None, ...]
    """Measured, (N - 1); None where the pixels cannot say."""
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
        return ExposureRatios(relative, ratios, _check_exif_ratios(relative, ratios, bracket.names))
    if None in ratios:
        first, second = bracket.names[ratios.index(None) :][:2]
        raise ProbeError(
            f"The exposures {first} and {second} share too few pixels that are neither clipped nor dark. State their "
            f"exposure times in EXIF."
        )
    relative = np.array(np.cumprod([1.0, *(ratio.value for ratio in ratios if ratio is not None)]), dtype=np.float64)
    return ExposureRatios(relative / relative[-1], ratios, ())


def _measure_ratio(short: LinearPhoto, long: LinearPhoto) -> ExposureRatio | None:
    """The ratio by the pixels that both show; None where they are too few."""
    full = min(long.white, float(long.pixels.max()))
    usable = (long.pixels < _MAX_VALUE * full) & (long.pixels > _MIN_VALUE * full) & (short.pixels < short.white)
    clear = usable & ~dilate(clipped_mask(long))[..., None]
    index = np.flatnonzero(clear if clear.sum() >= _MIN_SURE_SAMPLES else usable)
    if len(index) < _MIN_SAMPLES:
        return None
    chosen = index[:: -(-len(index) // _MAX_SAMPLES)]
    x, y = (np.asarray(photo.pixels.reshape(-1)[chosen], dtype=np.float64) for photo in (long, short))
    if x.var() < _MIN_VARIANCE_RATIO * noise_variance(x.mean(), long.step):
        slope, error = y.mean() / x.mean(), short.step / 2 / x.mean()
    else:
        slope, error = _robust_slope(x, y)
    if slope <= 0 or error > _MAX_RATIO_ERROR * slope:
        return None
    return ExposureRatio(float(1 / slope), float(error / slope), len(index))


def clipped_mask(photo: LinearPhoto) -> Mask:
    """Mark the pixels (H, W) of which a channel is clipped.

    Args:
        photo: linear, with the value of its white.
    """
    return np.asarray((photo.pixels >= photo.white).any(axis=-1))


def dilate(mask: Mask) -> Mask:
    """The mask and the eight neighbors of each of its pixels: a lens and demosaicing smear over one.

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

    The error counts an eighth of the values as independent, for neighbors and channels share their errors.
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
    sure = [(t, ratio.value, pair) for t, ratio, pair in steps if ratio and ratio.is_sure and t > _MIN_EXPOSURE_STEP]
    different = [(t, value, pair) for t, value, pair in sure if abs(t / value - 1) > _MAX_EXIF_DIFFERENCE]
    powers = [np.log(value) / np.log(t) for t, value, _ in different]
    if powers and not _MIN_LINEAR_EXPONENT < np.median(powers) < 1 / _MIN_LINEAR_EXPONENT:
        t, value, _ = different[0]
        coded = bool(np.median(powers) < _MIN_LINEAR_EXPONENT)
        state = "coded by a curve" if coded else "linear and were decoded as if by a curve"
        raise ProbeError(
            f"The pixels are {state}: exposures that differ {t:.3g}-fold by EXIF differ {value:.3g}-fold in the "
            f"pixels; say --curve {_CURVE[coded]}."
        )
    sentence = "EXIF says that {} is {:.3g} times as long as {}, the pixels say {:.3g}."
    return tuple(sentence.format(second, t, first, value) for t, value, (first, second) in different)


_ROWS_AT_ONCE = 128  # merged at once, so that little memory is needed beside the exposures
SMOOTHING_REACH = 3.6  # deg, of the smoothing: less than the features of a clear sky, more than a pixel of its map
_SMOOTHING_PASSES = 12  # of smoothing and putting back
_MAX_LINKED_STEPS = 1.5  # steps, up to which neighbors belong to one surface

Pixels = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class MergedHdr:
    """A picture of radiance, in units of full scale / relative exposure."""

    radiance: NDArray[np.float32]
    """(H, W, 3); where clipped, the least that it can be."""
    clipped: Mask
    """(H, W), a channel is clipped in every exposure."""


def merge_exposures(bracket: Bracket, relative: Floats) -> MergedHdr:
    """Merge a bracket to one picture of radiance, each value weighted by the inverse of its variance.

    Args:
        bracket: exposures, the shortest first.
        relative: (N,) relative lengths of the exposures, over 0.

    Raises:
        ProbeError: every pixel is clipped in every exposure, or all are black.

    References:
        [1] Hasinoff, Durand and Freeman, Noise-optimal capture for high dynamic range photography, CVPR 2010.
    """
    shortest, *longer = map(clipped_mask, bracket.photos)
    masks = [shortest, *map(dilate, longer)]
    if masks[0].all():
        raise ProbeError("Every pixel is clipped in the shortest exposure; nothing can be measured.")
    if max(float(photo.pixels.max()) for photo in bracket.photos) <= 0:
        raise ProbeError("Every pixel of every exposure is black; nothing can be measured.")
    radiance = np.empty_like(bracket.photos[0].pixels)
    for rows in (slice(start, start + _ROWS_AT_ONCE) for start in range(0, len(radiance), _ROWS_AT_ONCE)):
        radiance[rows] = _merge_rows(bracket, relative, rows, masks)
    return MergedHdr(radiance, masks[0])


def _merge_rows(bracket: Bracket, relative: Floats, rows: slice, masks: list[Mask]) -> Floats:
    """Radiance (R, W, 3) of some rows; `masks` (H, W) say where each exposure is clipped, or is beside that."""
    values = np.stack([photo.pixels[rows] for photo in bracket.photos])
    white = np.array([photo.white for photo in bracket.photos], dtype=np.float32)[:, None, None, None]
    usable = (values < white) & ~np.stack([mask[rows] for mask in masks])[..., None]
    usable[0] = values[0] < white[0]
    length = np.asarray(relative, dtype=np.float32)[:, None, None, None]
    first = _divide(np.where(usable, values, 0).sum(axis=0), np.where(usable, length, 0).sum(axis=0))
    steps = np.array([photo.step for photo in bracket.photos], dtype=np.float32)[:, None, None, None]
    variance = noise_variance(first * length, steps)
    weight = np.where(usable, length / variance, 0)  # of the value; that of the radiance is length times as much
    merged = _divide((weight * values).sum(axis=0), (weight * length).sum(axis=0))
    return np.where(usable.any(axis=0), np.maximum(merged, 0), np.minimum(values[0], 1.0) / length[0])


def _divide(a: Floats, b: Floats) -> Floats:
    """a / b (...), 0 where both are."""
    return np.asarray(a / np.maximum(b, np.finfo(np.float32).tiny))


def dequantize(merged: MergedHdr, bracket: Bracket, relative: Floats, reach: float) -> MergedHdr:
    """Smooth the coarsely rounded values of a merged picture within what rounding leaves open.

    A value changes to one that rounds to what the longest exposure that does not clip it recorded, and only where that
    one's noise is less than half a step. Black, bright and clipped values stay.

    Args:
        merged: the picture of `merge_exposures`.
        bracket: its exposures.
        relative: (N,) relative lengths of the exposures, over 0.
        reach: pixels, standard deviation of the smoothing.

    References:
        [1] Gastal and Oliveira, Domain transform for edge-aware image and video processing, SIGGRAPH 2011.
    """
    if all(max_terraced_value(photo.step) <= photo.step / 2 for photo in bracket.photos):
        return merged
    usable = [~dilate(clipped_mask(photo)) for photo in bracket.photos]
    radiance = merged.radiance.copy()
    for channel in range(radiance.shape[-1]):
        recorded, half = _recorded_radiance(bracket.photos, relative, usable, channel)
        if half.any():
            start = radiance[..., channel]
            radiance[..., channel] = _smooth_within_rounding(start, np.where(half > 0, recorded, start), half, reach)
    return replace(merged, radiance=radiance)


def _recorded_radiance(
    photos: Sequence[LinearPhoto], relative: Floats, usable: Sequence[Mask], channel: int
) -> tuple[Pixels, Pixels]:
    """Radiance (H, W) of a channel by the longest usable exposure, and half a step of its rounding; 0 where fine."""
    recorded = np.zeros(usable[0].shape, dtype=np.float32)
    half = np.zeros_like(recorded)
    for photo, length, where in zip(photos, relative, usable, strict=True):
        value = photo.pixels[..., channel]
        coarse = (value > photo.step / 2) & (value < max_terraced_value(photo.step))
        recorded = np.where(where, value / np.float32(length), recorded)
        half = np.where(where, np.where(coarse, np.float32(photo.step / 2 / length), 0), half)
    return recorded, half


def _smooth_within_rounding(start: Pixels, recorded: Pixels, half: Pixels, reach: float) -> Pixels:
    """Values (H, W) as smooth as they can be within `half` (H, W) of the `recorded` ones; `start` where that is 0.

    Neighbors that differ by more than 1.5 of the coarser one's steps, and those beside black, are not mixed; `reach`
    [pixels] is the standard deviation of the filter.
    """
    keep = np.float32(np.exp(-np.sqrt(2) / reach))
    row_shares, column_shares = keep * _surface_links(recorded, half), keep * _surface_links(recorded.T, half.T)
    lower, upper = recorded - half, recorded + half
    values = start
    for _ in range(_SMOOTHING_PASSES):
        smoothed = _smooth_edge_aware(values, row_shares, column_shares)
        twice_smoothed = _smooth_edge_aware(smoothed, row_shares, column_shares)
        values = np.where(half > 0, np.clip(2 * smoothed - twice_smoothed, lower, upper), start)
    return values


def _surface_links(recorded: Pixels, half: Pixels) -> Pixels:
    """1 where a value and the one in the row above it (H, W) belong to one surface, else 0."""
    links = np.zeros(recorded.shape, dtype=np.float32)
    step = 2 * np.maximum(half[1:], half[:-1])
    positive = (recorded[1:] > 0) & (recorded[:-1] > 0)
    links[1:] = positive & (np.abs(np.diff(recorded, axis=0)) <= _MAX_LINKED_STEPS * step)
    return links


def _smooth_edge_aware(values: Pixels, down: Pixels, along: Pixels) -> Pixels:
    """Values (H, W) mixed with their neighbors by shares `down` (H, W) columns and `along` (W, H) rows."""
    rows = np.ascontiguousarray(values.T)
    _mix_rows(rows, along)
    columns = np.ascontiguousarray(rows.T)
    _mix_rows(columns, down)
    return columns


def _mix_rows(values: Pixels, shares: Pixels) -> None:
    """Mix each row of values into the next one by its share, down and then up again, in place."""
    for row in range(1, len(values)):
        values[row] += shares[row] * (values[row - 1] - values[row])
    for row in range(len(values) - 2, -1, -1):
        values[row] += shares[row + 1] * (values[row + 1] - values[row])

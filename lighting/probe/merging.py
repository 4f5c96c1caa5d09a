"""Exposures of a bracket, merged to radiance.

Each value is weighted by the inverse of its variance, as Hasinoff, Durand and Freeman have it (CVPR 2010). The variance
is that of a camera of common size: a file does not say how many electrons fill its full scale. A clipped value weighs
nothing, so a pixel that is clipped in every exposure is known to be brighter than the shortest one says, and is marked.

Rounding. A sky a few of a camera's steps above black is recorded as terraces. Where the noise is so much smaller than a
step, neighbours round alike. No mean over them then tells what lies between two steps. But the true value is within
half a step of the recorded one, and a sky has no terraces. So such values are smoothed and put back into that interval,
over and over (projections onto convex sets). The smoothing is a recursive filter along rows and columns (Gastal and
Oliveira, SIGGRAPH 2011). It stops where neighbours differ by more than a step. It is applied as 2 S - S S, which leaves
slopes and curves as they are.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lighting.errors import ProbeError
from lighting.geometry import Floats
from lighting.photo.linear import LinearPhoto
from lighting.probe.bracket import Bracket
from lighting.probe.exposure_ratios import clipped_mask, dilate, max_terraced_value, noise_variance
from lighting.probe.sun_detection import Mask

_ROWS_AT_ONCE = 128  # merged at once, so that little memory is needed beside the exposures
SMOOTHING_REACH = 3.6  # deg, of the smoothing: less than the features of a clear sky, more than a pixel of its map
SMOOTHING_PASSES = 12  # of smoothing and putting back
_MAX_LINKED_STEPS = 1.5  # steps, up to which neighbours belong to one surface

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

    Neighbours that differ by more than 1.5 of the coarser one's steps, and those beside black, are not mixed; `reach`
    [pixels] is the standard deviation of the filter.
    """
    keep = np.float32(np.exp(-np.sqrt(2) / reach))
    row_shares, column_shares = keep * _surface_links(recorded, half), keep * _surface_links(recorded.T, half.T)
    lower, upper = recorded - half, recorded + half
    values = start
    for _ in range(SMOOTHING_PASSES):
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
    """Values (H, W) mixed with their neighbours by shares `down` (H, W) columns and `along` (W, H) rows."""
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

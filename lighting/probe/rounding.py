"""What rounding took from the dark of a picture, given back where the picture is smooth.

A sky a few of a camera's steps above black is recorded as terraces. Where the noise is so much smaller than a step that
neighbours round alike, no mean over them tells what lies between two steps; but the true value is within half a step of
the recorded one, and a sky has no terraces. So such values are smoothed and put back into that interval, over and over
(projections onto convex sets). The smoothing is a recursive filter along rows and columns that stops where neighbours
differ by more than a step (Gastal and Oliveira, *Domain transform for edge-aware image and video processing*, SIGGRAPH
2011), applied as 2 S - S S, which leaves slopes and curves as they are.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats
from lighting.photo import LinearPhoto
from lighting.probe.exposures import Bracket
from lighting.probe.merge import Merged
from lighting.probe.noise import smooth_below
from lighting.probe.ratios import beside, clipped
from lighting.probe.regions import Mask

Pixels = NDArray[np.float32]

REACH = 3.6  # deg, of the smoothing: less than the features of a clear sky, more than a pixel of its map
PASSES = 12  # of smoothing and putting back
_LINKED = 1.5  # steps, up to which neighbours belong to one surface


def unrounded(merged: Merged, bracket: Bracket, relative: Floats, reach: float) -> Merged:
    """The merged picture of exposures of these relative lengths (N,) with its coarsely rounded values smoothed.

    `reach` [pixels] is that of the smoothing. A value changes to one that rounds to what the longest exposure that does
    not clip it recorded, and only where that one's noise is less than half a step; black, bright and clipped ones stay.
    """
    if all(smooth_below(photo.step) <= photo.step / 2 for photo in bracket.photos):
        return merged
    usable = [~beside(clipped(photo)) for photo in bracket.photos]
    radiance = merged.radiance.copy()
    for channel in range(radiance.shape[-1]):
        recorded, half = _recorded(bracket.photos, relative, usable, channel)
        if half.any():
            start = radiance[..., channel]
            radiance[..., channel] = within_rounding(start, np.where(half > 0, recorded, start), half, reach)
    return replace(merged, radiance=radiance)


def _recorded(
    photos: Sequence[LinearPhoto], relative: Floats, usable: Sequence[Mask], channel: int
) -> tuple[Pixels, Pixels]:
    """Radiance (H, W) of a channel by the longest usable exposure, and half a step of its rounding; 0 where fine."""
    recorded = np.zeros(usable[0].shape, dtype=np.float32)
    half = np.zeros_like(recorded)
    for photo, length, where in zip(photos, relative, usable, strict=True):
        value = photo.pixels[..., channel]
        coarse = (value > photo.step / 2) & (value < smooth_below(photo.step))
        recorded = np.where(where, value / np.float32(length), recorded)
        half = np.where(where, np.where(coarse, np.float32(photo.step / 2 / length), 0), half)
    return recorded, half


def within_rounding(start: Pixels, recorded: Pixels, half: Pixels, reach: float) -> Pixels:
    """Values (H, W) as smooth as they can be within `half` (H, W) of the `recorded` ones; `start` where that is 0.

    Neighbours that differ by more than 1.5 of the coarser one's steps, and those beside black, are not mixed; `reach`
    [pixels] is the standard deviation of the filter.
    """
    keep = np.float32(np.exp(-np.sqrt(2) / reach))
    down, along = keep * _links(recorded, half), keep * _links(recorded.T, half.T)
    least, most = recorded - half, recorded + half
    values = start
    for _ in range(PASSES):
        once = _smoothed(values, down, along)
        twice = _smoothed(once, down, along)
        values = np.where(half > 0, np.clip(2 * once - twice, least, most), start)
    return values


def _links(recorded: Pixels, half: Pixels) -> Pixels:
    """1 where a value and the one in the row above it (H, W) belong to one surface, else 0."""
    links = np.zeros(recorded.shape, dtype=np.float32)
    step = 2 * np.maximum(half[1:], half[:-1])
    seen = (recorded[1:] > 0) & (recorded[:-1] > 0)
    links[1:] = seen & (np.abs(np.diff(recorded, axis=0)) <= _LINKED * step)
    return links


def _smoothed(values: Pixels, down: Pixels, along: Pixels) -> Pixels:
    """Values (H, W) mixed with their neighbours by shares `down` (H, W) columns and `along` (W, H) rows."""
    rows = np.ascontiguousarray(values.T)
    _sweep(rows, along)
    columns = np.ascontiguousarray(rows.T)
    _sweep(columns, down)
    return columns


def _sweep(values: Pixels, shares: Pixels) -> None:
    """Mix each row of values into the next one by its share, down and then up again, in place."""
    for row in range(1, len(values)):
        values[row] += shares[row] * (values[row - 1] - values[row])
    for row in range(len(values) - 2, -1, -1):
        values[row] += shares[row + 1] * (values[row + 1] - values[row])

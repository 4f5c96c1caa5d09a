"""Bracketed exposures to one picture of radiance, each value weighted by the inverse of its variance.

A clipped value weighs nothing, so a pixel that is clipped in every exposure is known to be brighter than the shortest
one says, and is marked.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.errors import ProbeError
from lighting.geometry import Floats
from lighting.probe.exposures import Bracket
from lighting.probe.noise import noise_variance
from lighting.probe.ratios import beside, clipped
from lighting.probe.regions import Mask

_ROWS = 128  # merged at once, so that little memory is needed beside the exposures


@dataclass(frozen=True, eq=False)
class Merged:
    """A picture of radiance, in units of full scale / relative exposure."""

    radiance: NDArray[np.float32]  # (H, W, 3); where clipped, the least that it can be
    clipped: Mask  # (H, W), a channel is clipped in every exposure


def merge(bracket: Bracket, relative: Floats) -> Merged:
    """One picture of a bracket's exposures of these relative lengths (N,).

    Raises ProbeError where every pixel is clipped in every exposure, and where all are black.
    """
    masks = [beside(clipped(photo)) if index else clipped(photo) for index, photo in enumerate(bracket.photos)]
    if masks[0].all():
        raise ProbeError("Every pixel is clipped in the shortest exposure; nothing can be measured.")
    if max(float(photo.pixels.max()) for photo in bracket.photos) <= 0:
        raise ProbeError("Every pixel of every exposure is black; nothing can be measured.")
    radiance = np.empty_like(bracket.photos[0].pixels)
    for start in range(0, len(radiance), _ROWS):
        rows = slice(start, start + _ROWS)
        radiance[rows] = _merged_rows(bracket, relative, rows, masks)
    return Merged(radiance, masks[0])


def _merged_rows(bracket: Bracket, relative: Floats, rows: slice, masks: list[Mask]) -> Floats:
    """Radiance (R, W, 3) of some rows; `masks` (H, W) say where each exposure is clipped, or is beside that."""
    values = np.stack([photo.pixels[rows] for photo in bracket.photos])
    white = np.array([photo.white for photo in bracket.photos], dtype=np.float32)[:, None, None, None]
    usable = (values < white) & ~np.stack([mask[rows] for mask in masks])[..., None]
    usable[0] = values[0] < white[0]
    length = np.asarray(relative, dtype=np.float32)[:, None, None, None]
    first = _ratio(np.where(usable, values, 0).sum(axis=0), np.where(usable, length, 0).sum(axis=0))
    steps = np.array([photo.step for photo in bracket.photos], dtype=np.float32)[:, None, None, None]
    variance = noise_variance(first * length, steps)
    weight = np.where(usable, length / variance, 0)  # of the value; that of the radiance is length times as much
    merged = _ratio((weight * values).sum(axis=0), (weight * length).sum(axis=0))
    return np.where(usable.any(axis=0), np.maximum(merged, 0), np.minimum(values[0], 1.0) / length[0])


def _ratio(a: Floats, b: Floats) -> Floats:
    """a / b (...), 0 where both are."""
    return np.asarray(a / np.maximum(b, np.finfo(np.float32).tiny))

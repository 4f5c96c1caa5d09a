"""What the sun's path over several photos tells: where the cameras look, and the latitude or the date and the clock.

Each hypothesis puts the sun somewhere for every photo. Its likelihood for each heading is the product of what the
network says of those suns, photo by photo; photos that show the same under the same sun count for less (overlap.py).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lighting.circular import HEADINGS, Heading, heading
from lighting.errors import ParameterError
from lighting.evidence.overlap import AZIMUTH, UNLIKE, axes, counts
from lighting.geometry import Floats, direction
from lighting.records import Prediction
from lighting.sun_grid import smooth_density

SUN_STEP = 15.0  # deg an hour that the sun moves
DOUBT = 0.02  # share of suns of which the network's answer says nothing
LOWEST = -1.0  # deg, elevation under which no sun lights a photo

_STEP = 2.0  # deg, of the tables; the network's cells are coarser
_CHUNK = 256  # hypotheses at once


@dataclass(frozen=True, eq=False)
class Paths:
    """Hypotheses about where the sun stood."""

    elevation: Floats  # (H, n) deg, of each photo's sun under each hypothesis
    azimuth: Floats  # (H, n) deg clockwise from true north
    prior: Floats  # (H,) probabilities before a pixel is seen, up to a factor


@dataclass(frozen=True, eq=False)
class Followed:
    """What the photos say of hypotheses about the sun's path."""

    probability: Floats  # (H,) sums to 1
    heading: Heading  # of azimuth 0 in the photos' common frame, from true north


def follow(predictions: Sequence[Prediction], turns: Floats, hours: Floats, paths: Paths) -> Followed:
    """The hypotheses' probabilities by photos at headings (n,) [deg] in one frame, taken at `hours` (n,).

    ParameterError where every hypothesis has the sun below the horizon in one of the photos.
    """
    if (paths.elevation < LOWEST).any(axis=1).all():
        raise ParameterError("Whatever is assumed, the sun is below the horizon in one of the photos.")
    share = counts(*axes(predictions, turns), AZIMUTH, likeness(hours))
    tables = [_table(p) for p in predictions]
    apart, alike = (
        _weights([power * table for power, table in zip(powers, tables, strict=True)], turns, paths)
        for powers in (share, share / share.sum())
    )
    weight = (1.0 - AZIMUTH.misled) * apart + AZIMUTH.misled * alike
    return Followed(weight.sum(axis=1), heading(weight.sum(axis=0)))


def _weights(tables: Sequence[Floats], turns: Floats, paths: Paths) -> Floats:
    """Probabilities (H, 360) of hypotheses and headings by log densities (n, E, A) that add up."""
    log = np.concatenate([_log_likelihood(tables, turns, part) for part in _parts(paths)])
    log += np.log(np.maximum(paths.prior, 1e-300))[:, None]
    weight = np.exp(log - log.max())
    return np.asarray(weight / weight.sum())


def likeness(hours: Floats) -> Floats:
    """How alike the light of photos is (n, n), 0 to 1, by the hours (n,) at which they were taken."""
    moved = SUN_STEP * np.abs(hours[:, None] - hours[None])
    return np.asarray(np.exp(-moved / UNLIKE))


def _table(prediction: Prediction) -> Floats:
    """Log densities (E, A) at every second degree of elevation and of azimuth, both from 0 on."""
    suns = direction(np.arange(0.0, 360.0, _STEP)[None, :], np.arange(0.0, 90.1, _STEP)[:, None])
    density = smooth_density(prediction.sun_probability, suns, prediction.spec.sun_grid)
    return np.asarray(np.log((1 - DOUBT) * density + DOUBT / (2 * np.pi)))


def _parts(paths: Paths) -> list[Paths]:
    edges = range(0, len(paths.prior), _CHUNK)
    return [Paths(*(v[k : k + _CHUNK] for v in (paths.elevation, paths.azimuth, paths.prior))) for k in edges]


def _log_likelihood(tables: Sequence[Floats], turns: Floats, paths: Paths) -> Floats:
    """Log likelihoods (H, 360) by heading; minus infinity where the sun is down."""
    total = np.zeros((len(paths.prior), len(HEADINGS)))
    for k, (table, turn) in enumerate(zip(tables, turns, strict=True)):
        towards = paths.azimuth[:, k, None] - HEADINGS - turn
        total += _read(table, np.maximum(paths.elevation[:, k, None], 0.0), towards)
    total[(paths.elevation < LOWEST).any(axis=1)] = -np.inf
    return total


def _read(table: Floats, elevation: Floats, azimuth: Floats) -> Floats:
    """Values of a table (E, A) at elevations and azimuths [deg] that broadcast, linear between its own."""
    row, column = np.minimum(elevation, 89.999) / _STEP, np.mod(azimuth, 360.0) / _STEP
    y, x = row.astype(int), column.astype(int) % table.shape[1]
    v, u = row - y, column - np.floor(column)
    beside = (x + 1) % table.shape[1]
    low = (1 - u) * table[y, x] + u * table[y, beside]
    high = (1 - u) * table[y + 1, x] + u * table[y + 1, beside]
    return np.asarray((1 - v) * low + v * high)

"""How the azimuths of a measured sky are counted, from the sky alone: a scanner or camera whose north is not known.

A clear sky is brightest around the sun, and the ephemeris says where that is. One moment leaves two answers, clockwise
from one direction or counter-clockwise from another, for a clear sky is the same left and right of the sun; as the sun
moves on, the right answer stays and the wrong one turns at twice the sun's pace. So all moments are fitted together.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lighting.colour import luminance
from lighting.errors import ProbeError
from lighting.geometry import Floats, angle_between, direction, wrap_azimuth
from lighting.records import GROUND_ALBEDO
from lighting.sky.hosek_wilkie import sky_radiance

TURBIDITIES = (2.0, 3.0, 4.0, 6.0, 8.0)  # tried, from very clear to hazy
SUN_CLEARANCE = 10.0  # deg around the sun left out
LIMIT = 0.5  # of |log(measured / model)|: from here on an error counts no more
_STEP = 2.0  # deg, between the offsets tried
_LEAST_DIFFERENCE = 1.05  # the other sense's error / the better one's, from which on the sense is known


@dataclass(frozen=True, eq=False)
class Scan:
    """One sky in a few directions, and where the sun truly was."""

    azimuth: Floats  # (N,) deg, as filed
    elevation: Floats  # (N,) deg
    luminance: Floats  # (N,), any unit
    sun: tuple[float, float]  # azimuth clockwise from true north, elevation, deg

    def directions(self, sense: int, offset: float) -> Floats:
        """Unit vectors (N, 3) in the world."""
        return direction(sense * self.azimuth + offset, self.elevation)


@dataclass(frozen=True, eq=False)
class Orientation:
    """True azimuth = sense x filed azimuth + offset."""

    sense: int  # 1 clockwise, -1 counter-clockwise
    offset: float  # deg, in (-180, 180]
    error: float  # root mean square of log(measured / model), cut at LIMIT
    other: float  # the same for the other sense at its best
    offsets: Floats  # (S,) deg, what each scan alone would say

    @property
    def sure(self) -> bool:
        return self.other > _LEAST_DIFFERENCE * self.error


def orient(scans: Sequence[Scan]) -> Orientation:
    """Sense and offset of scans by one instrument that stood still; ProbeError for none or with the sun down."""
    if not scans:
        raise ProbeError("There is no scan to orient.")
    if any(scan.sun[1] < 0 for scan in scans):
        raise ProbeError("The sun is below the horizon in a scan; there is no sky to fit.")
    offsets = np.arange(0.0, 360.0, _STEP)
    errors = {sense: np.array([_errors(scan, sense, offsets) for scan in scans]) for sense in (1, -1)}
    joint = {sense: np.sqrt((each**2).mean(axis=0)) for sense, each in errors.items()}
    sense = min(joint, key=lambda s: float(joint[s].min()))
    best = float(_lowest(offsets, joint[sense]))
    alone = np.array([_lowest(offsets, each) for each in errors[sense]])
    return Orientation(sense, best, float(joint[sense].min()), float(joint[-sense].min()), alone)


def log_errors(measured: Floats, model: Floats) -> Floats:
    """log(measured / model) (N,) less its median: what is left when the model has the best scale."""
    error = np.log(np.maximum(measured, 1e-12)) - np.log(np.maximum(model, 1e-12))
    return np.asarray(error - np.median(error))


def _errors(scan: Scan, sense: int, offsets: Floats) -> Floats:
    """The least error over turbidities at each offset (M,): root mean square of the logarithm, cut at LIMIT."""
    sun = direction(*scan.sun)
    towards = direction(sense * scan.azimuth + offsets[:, None], scan.elevation)
    far = angle_between(towards, sun) > SUN_CLEARANCE
    squares = []
    for turbidity in TURBIDITIES:
        model = luminance(sky_radiance(towards, sun, turbidity, GROUND_ALBEDO))
        error = np.log(np.maximum(scan.luminance, 1e-12)) - np.log(np.maximum(model, 1e-12))
        error = np.where(far, error, np.nan)
        error -= np.nanmedian(error, axis=1, keepdims=True)
        squares.append(np.nanmean(np.minimum(error**2, LIMIT**2), axis=1))
    return np.asarray(np.sqrt(np.min(squares, axis=0)))


def _lowest(offsets: Floats, errors: Floats) -> float:
    """The offset of the least error, between the steps by a parabola, in (-180, 180]."""
    index = int(errors.argmin())
    before, at, after = errors[index - 1], errors[index], errors[(index + 1) % len(errors)]
    bend = before - 2 * at + after
    shift = 0.5 * (before - after) / bend if bend > 0 else 0.0
    return float(wrap_azimuth(offsets[index] + shift * _STEP))

"""How much longer one exposure of a bracket is than the next: by EXIF, or measured from the pixels.

Where both exposures of a pair are neither clipped nor dark, the short one's values are the long one's divided by the
ratio, plus what black and rounding leave. A straight line through them, with outliers out-weighted, has the ratio as
its slope; the errors are nearly all in the short one, so that one is the dependent variable. Where the values differ
hardly more than noise makes them, a line would be too flat, and the ratio is that of the means.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from lighting.errors import ProbeError
from lighting.geometry import Floats
from lighting.photo import LinearPhoto
from lighting.probe.exposures import Bracket
from lighting.probe.noise import noise_variance
from lighting.probe.regions import Mask

LEAST_VALUE, MOST_VALUE = 0.04, 0.7  # of white in the longer exposure: dark pixels say little, bright ones may bend
LEAST_SAMPLES = 24  # values that a ratio is measured from
LEAST_SPREAD = 20.0  # variance of these values / that of noise, from which on a line's slope is less than 5 % too flat
MOST_ERROR = 0.2  # relative, of a ratio that is worth telling
SURE_SAMPLES, SURE_ERROR = 1000, 0.02  # values from which on, and error up to which, a ratio counts as well measured
MOST_SAMPLES = 20_000  # used of them
GAMMA = 0.75  # log of the measured ratio / log of EXIF's, below which the pixels are coded by a curve
DIFFERENCE = 0.08  # relative, between EXIF's ratio and the pixels', that is worth a warning: third stops round to 7 %
LEAST_STEP = 1.2  # between exposures, for their ratio to tell a curve
_STEPS = 8  # of re-weighted least squares
_CURVE = {True: "srgb", False: "linear"}


@dataclass(frozen=True)
class Ratio:
    """A longer exposure / the next shorter one."""

    value: float
    error: float  # one sigma, relative
    samples: int  # values it was measured from

    @property
    def sure(self) -> bool:
        return self.samples >= SURE_SAMPLES and self.error <= SURE_ERROR


@dataclass(frozen=True, eq=False)
class Exposed:
    """How long each exposure of a bracket is."""

    relative: Floats  # (N,), with EXIF s x ISO / 100 / f-number^2, else the longest is 1
    ratios: tuple[Ratio | None, ...]  # measured, (N - 1); None where the pixels cannot say
    from_exif: bool
    warnings: tuple[str, ...]


def exposed(bracket: Bracket) -> Exposed:
    """Relative exposures by EXIF where all files have it, else from the pixels.

    Raises ProbeError where neither can say, and where EXIF shows that the pixels are coded by a curve.
    """
    ratios = tuple(measured_ratio(short, long) for short, long in pairwise(bracket.photos))
    told = [photo.exposure for photo in bracket.photos]
    if all(value is not None for value in told):
        relative = np.array(told, dtype=np.float64)
        return Exposed(relative, ratios, True, _against_pixels(relative, ratios, bracket.names))
    missing = next((index for index, ratio in enumerate(ratios) if ratio is None), None)
    if missing is not None:
        first, second = bracket.names[missing : missing + 2]
        raise ProbeError(
            f"The exposures {first} and {second} share too few pixels that are neither clipped nor dark to measure "
            f"their ratio, and have no exposure times in EXIF."
        )
    steps = np.array([ratio.value for ratio in ratios if ratio is not None])
    relative = np.concatenate([[1.0], np.cumprod(steps)])
    return Exposed(relative / relative[-1], ratios, False, ())


def measured_ratio(short: LinearPhoto, long: LinearPhoto) -> Ratio | None:
    """The ratio by the pixels that both show; None where they are too few."""
    full = min(long.white, float(long.pixels.max()))
    usable = (long.pixels < MOST_VALUE * full) & (long.pixels > LEAST_VALUE * full) & (short.pixels < short.white)
    clear = usable & ~beside(clipped(long))[..., None]
    index = np.flatnonzero(clear if clear.sum() >= SURE_SAMPLES else usable)
    if len(index) < LEAST_SAMPLES:
        return None
    chosen = index[:: -(-len(index) // MOST_SAMPLES)]
    x, y = (np.asarray(photo.pixels.reshape(-1)[chosen], dtype=np.float64) for photo in (long, short))
    if x.var() < LEAST_SPREAD * noise_variance(x.mean(), long.step):
        slope, error = y.mean() / x.mean(), short.step / 2 / x.mean()
    else:
        slope, error = _robust_slope(x, y)
    return (
        None if slope <= 0 or error > MOST_ERROR * slope else Ratio(float(1 / slope), float(error / slope), len(index))
    )


def clipped(photo: LinearPhoto) -> Mask:
    """Pixels (H, W) of which a channel is clipped."""
    return np.asarray((photo.pixels >= photo.white).any(axis=-1))


def beside(mask: Mask) -> Mask:
    """The mask (H, W) and the eight neighbours of each of its pixels: a lens and demosaicing smear over one."""
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
    for _ in range(_STEPS):
        total = weight.sum()
        mean_x, mean_y = weight @ x / total, weight @ y / total
        spread = weight @ (x - mean_x) ** 2
        if spread <= 0:  # all that count are of one value
            return 0.0, 0.0
        slope = weight @ ((x - mean_x) * (y - mean_y)) / spread
        residual = y - mean_y - slope * (x - mean_x)
        scale = max(1.4826 * float(np.median(np.abs(residual))), 1e-6)
        weight = np.maximum(1 - (residual / (4.7 * scale)) ** 2, 0) ** 2
    return float(slope), float(np.sqrt(weight @ residual**2 / total * 8 / spread))


def _against_pixels(relative: Floats, ratios: tuple[Ratio | None, ...], names: tuple[str, ...]) -> tuple[str, ...]:
    """Warnings where the pixels contradict EXIF; ProbeError where they do as a curve would."""
    different = []
    for told, ratio, pair in zip(relative[1:] / relative[:-1], ratios, pairwise(names), strict=True):
        if ratio and ratio.sure and told > LEAST_STEP and abs(told / ratio.value - 1) > DIFFERENCE:
            different.append((float(told), ratio.value, pair))
    powers = [np.log(value) / np.log(t) for t, value, _ in different]
    if powers and not GAMMA < np.median(powers) < 1 / GAMMA:
        t, value, _ = different[0]
        coded = bool(np.median(powers) < GAMMA)
        state = "coded by a curve" if coded else "linear and were decoded as if by a curve"
        raise ProbeError(
            f"The pixels are {state}: exposures that differ {t:.3g}-fold by EXIF differ {value:.3g}-fold in the "
            f"pixels; say --curve {_CURVE[coded]}."
        )
    return tuple(
        f"EXIF says that {second} is {t:.3g} times as long as {first}, the pixels say {value:.3g}."
        for t, value, (first, second) in different
    )

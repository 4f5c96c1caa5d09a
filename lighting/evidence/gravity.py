"""The camera's elevation and roll by the network together with what the photo itself says of gravity.

Both are weighted by their errors (Kalman's gain), unless they are too far apart for chance.
"""

import math
from dataclasses import dataclass

from lighting.geometry import STEEP, wrap_azimuth
from lighting.records import CodedWarning, Prediction, WarningCode
from lighting.words import tilt_in_words

CAMERA_SPREAD = 3.5  # deg, of the network's camera elevation: 91 (paper) and 79 % (phone) of `val` lie within 5 deg
ROLL_SPREAD = 2.0  # deg, of its camera roll: 68 % of the crops of `val` lie within 1.0 (paper) and 2.3 deg (phone)
MOST_APART = 20.0  # deg between the two that 1 % of the crops of `val` pass (0.2 % of paper, 2 % of phone)

_LEARNT = 35.0  # deg of elevation, up and down, that the network learnt from: it says no steeper ones


@dataclass(frozen=True)
class Gravity:
    """How the camera was held, by the photo's metadata."""

    elevation: float  # deg, positive looks up
    roll: float | None  # deg, positive turns the camera clockwise; None where it is not known
    spread: float  # deg, one standard deviation


def contrary(prediction: Prediction, gravity: Gravity, subject: str = "photo") -> CodedWarning | None:
    """A sentence about a `subject` whose pixels and gravity are farther apart than chance explains."""
    above, aside = _apart(prediction, gravity)
    if math.hypot(above, aside * math.cos(math.radians(gravity.elevation))) <= MOST_APART:
        return None
    said = _words(gravity.elevation, gravity.roll)
    return CodedWarning(
        f"By its metadata the camera {said}, by the pixels it "
        f"{_words(prediction.camera_elevation, None if gravity.roll is None else prediction.camera_roll)}: "
        f"the {subject} may be cropped, turned or edited. What the metadata say of it was not used.",
        WarningCode.GRAVITY_CONTRADICTED,
    )


def held(prediction: Prediction, gravity: Gravity) -> tuple[float, float]:
    """The camera's elevation and roll [deg] by both. Where it looks straight up or down within 5 deg, the roll is 0."""
    above, aside = _apart(prediction, gravity)
    elevation = gravity.elevation + above * _share(gravity.spread, CAMERA_SPREAD)
    if abs(elevation) > STEEP:
        return elevation, 0.0
    if gravity.roll is None:
        return elevation, prediction.camera_roll
    return elevation, float(wrap_azimuth(gravity.roll + aside * _share(gravity.spread, ROLL_SPREAD)))


def tilt_spread(gravity: Gravity | None) -> float:
    """One standard deviation [deg] of the elevation by both."""
    return CAMERA_SPREAD if gravity is None else CAMERA_SPREAD * math.sqrt(_share(gravity.spread, CAMERA_SPREAD))


def _apart(prediction: Prediction, gravity: Gravity) -> tuple[float, float]:
    """By how much [deg] the network has more elevation and roll; its limit stands for steeper cameras."""
    known = min(max(gravity.elevation, -_LEARNT), _LEARNT)
    aside = 0.0 if gravity.roll is None else float(wrap_azimuth(prediction.camera_roll - gravity.roll))
    return prediction.camera_elevation - known, aside


def _share(stated: float, said: float) -> float:
    """The weight of the network, whose spread is `said`, beside what is stated with another."""
    return stated**2 / (stated**2 + said**2)


def _words(elevation: float, roll: float | None) -> str:
    looks = f"looks {tilt_in_words(elevation)}"
    return looks if roll is None else f"{looks} with a roll of {roll + 0.0:.0f}°"

"""How and when the exposures of a probe were taken."""

import math
from dataclasses import dataclass
from datetime import datetime

from lighting.errors import ErrorCode, ProbeError
from lighting.evidence import sun_position
from lighting.geometry import wrap_azimuth
from lighting.photo import Curve
from lighting.probe.lens import Kind, check_circle

MOST_STOPS = 40.0  # of a filter; one for the sun has 17


@dataclass(frozen=True)
class Settings:
    """How the pictures were taken, and what is wanted of them; None is the usual, as `lens_of` has it.

    Raises ProbeError for numbers that no picture is taken by.
    """

    kind: Kind = "equidistant"
    fov: float | None = None  # deg
    centre: tuple[float, float] | None = None  # pixels
    radius: float | None = None  # pixels
    pitch: float | None = None  # deg
    mirrored: bool = False
    nd: float = 0.0  # stops of a filter before the lens
    yaw: float | None = None  # deg clockwise from north of the camera's azimuth 0; None finds it by the sun
    height: int = 512  # rows of the map
    curve: Curve | None = None
    fill: bool = False  # a clipped sun is taken from the model

    def __post_init__(self) -> None:
        _check_finite("The lens", self.fov, *(self.centre or ()), self.radius, self.pitch, self.nd, self.yaw)
        check_circle(self.kind, self.fov, self.radius)
        if not 0.0 <= self.nd <= MOST_STOPS:
            raise ProbeError(
                f"The filter has {self.nd:g} stops; it must have 0 to {MOST_STOPS:g}.", "nd", ErrorCode.OUT_OF_RANGE
            )
        if self.pitch is not None and not -90.0 <= self.pitch <= 90.0:
            raise ProbeError(
                f"The camera looks {self.pitch:g} deg up; that must lie in -90 to 90.", "pitch", ErrorCode.OUT_OF_RANGE
            )


@dataclass(frozen=True)
class Moment:
    """When and where a bracket was taken."""

    time: datetime  # aware
    latitude: float  # deg, positive north
    longitude: float  # deg, positive east

    def __post_init__(self) -> None:
        _check_finite("The place", self.latitude, self.longitude)

    @property
    def sun(self) -> tuple[float, float]:
        """Azimuth in (-180, 180] and elevation [deg] by the ephemeris."""
        azimuth, elevation = sun_position(self.time, self.latitude, self.longitude)
        return float(wrap_azimuth(azimuth)), float(elevation)


def check_day(moment: Moment) -> None:
    """Raise ProbeError where the sun is below the horizon."""
    if moment.sun[1] < 0:
        time = moment.time.isoformat(timespec="minutes")
        raise ProbeError(
            f"At {time} the sun is {-moment.sun[1]:.0f} deg below the horizon: it is night.", code=ErrorCode.NIGHT
        )


def _check_finite(what: str, *numbers: float | None) -> None:
    if not all(number is None or math.isfinite(number) for number in numbers):
        raise ProbeError(f"{what} is told by a number that is not finite.", code=ErrorCode.WRONG_TYPE)

"""What a plan answers: the best windows of a day and what each promises, as records and as JSON."""

import math
from dataclasses import dataclass
from datetime import date

from lighting.geometry import Floats
from lighting.records import Json
from lighting.validation import check_range

HOURS = (1, 2, 3, 6)  # the lengths of windows compared
MIN_SHOTS, MAX_SHOTS = 3, 1000
NOISE_RANGE = (0.001, 100.0)  # per cent


@dataclass(frozen=True)
class PlanRequest:
    """What is to be photographed, and with how many photos of which noise; raises ParameterError out of range."""

    facing: float | None = None
    """Deg clockwise from north, where the surface faces; None: all around and up."""
    shots: int = 8
    """Photos of a window."""
    noise: float = 1.0
    """Standard deviation of a pixel, per cent of the brightest light."""

    def __post_init__(self) -> None:
        check_range("shots", self.shots, MIN_SHOTS, MAX_SHOTS)
        check_range("noise", self.noise, *NOISE_RANGE)
        if self.facing is not None:
            check_range("facing", self.facing, -360.0, 360.0)


@dataclass(frozen=True)
class SurfaceOrientation:
    """What a window promises for one orientation of the surface; infinite where its light resolves nothing."""

    name: str
    """Name, in words."""
    azimuth: float
    """Deg clockwise from north, where the normal points."""
    elevation: float
    """Deg, of the normal above the horizon."""
    error: float
    """Deg, expected (root mean square) error of the normal, 90 at most."""
    gain: float
    """Gain, lambda_max."""
    interval_95: tuple[float, float, float]
    """+- of the normal's components east, up, south."""

    def to_dict(self) -> Json:
        """As JSON, null for what the light does not resolve."""
        return {
            "name": self.name,
            "azimuth": self.azimuth,
            "elevation": self.elevation,
            "error": _round_finite(self.error),
            "gain": _round_finite(self.gain),
            "interval_95": [_round_finite(value) for value in self.interval_95],
        }


@dataclass(frozen=True)
class Window:
    """A window of a day, and what it promises."""

    hours: int
    """Hours, its length."""
    start: float
    """Minutes since midnight."""
    end: float
    """Minutes since midnight."""
    error: float
    """Deg, expected error of the normal, median over the orientations of interest, 90 at most."""
    gain: float
    """Lambda_max, median."""
    rotation_free_gain: float
    """1 / sigma_min, median."""
    orientations: tuple[SurfaceOrientation, ...]
    """Of surfaces, and how well each is told."""
    sphere: Floats
    """(S, S), lambda_max over the half sphere seen, see `half_sphere_normals`."""

    def to_dict(self) -> Json:
        """As JSON, times by the clock of the place."""
        return {
            "hours": self.hours,
            "start": format_clock(self.start),
            "end": format_clock(self.end),
            "error": _round_finite(self.error),
            "gain": _round_finite(self.gain),
            "rotation_free_gain": _round_finite(self.rotation_free_gain),
            "orientations": [orientation.to_dict() for orientation in self.orientations],
        }


@dataclass(frozen=True)
class WindowTable:
    """All windows of a day, for a drawing by start and end."""

    step: float
    """Min between starts and between ends."""
    start: Floats
    """(W,) min since midnight."""
    end: Floats
    """End, (W,)."""
    gain: Floats
    """(W,) lambda_max, median; infinite where nothing is resolved."""


@dataclass(frozen=True)
class DayScore:
    """How good a day is."""

    day: date
    """Day, the date."""
    errors: tuple[float, ...]
    """Deg, least of each length of HOURS, 90 where none fits."""

    def to_dict(self) -> Json:
        """As JSON."""
        return {"date": self.day.isoformat(), "errors": [_round_finite(error) for error in self.errors]}


@dataclass(frozen=True)
class Plan:
    """The best of several days, and its windows."""

    day: date
    """Day, the best."""
    question: PlanRequest
    """What was asked."""
    windows: tuple[Window, ...]
    """The best of each length of HOURS that fits the day."""
    days: tuple[DayScore, ...]
    """Each day's score."""
    table: WindowTable
    """All windows of the day."""

    def to_dict(self) -> Json:
        """As JSON: angles in deg, times by the clock of the place, null for what the light does not resolve."""
        question = self.question
        return {
            "date": self.day.isoformat(),
            "facing": question.facing,
            "shots": question.shots,
            "noise": question.noise,
            "windows": [window.to_dict() for window in self.windows],
            "days": [score.to_dict() for score in self.days],
        }


def format_clock(minutes: float) -> str:
    """Format a time of day, such as "10:45".

    Args:
        minutes: since midnight.
    """
    whole = round(minutes)
    return f"{whole // 60:02d}:{whole % 60:02d}"


def _round_finite(value: float) -> float | None:
    """Four digits of it; None where it is infinite."""
    return float(f"{value:.4g}") if math.isfinite(value) else None

"""The windows of a day in which photometric stereo resolves a surface's normals best.

Every window holds the same number of photos, evenly spread from its start to its end, all of one exposure. It brings
the brightest mean light vector of the plan's days to length 1, under a clear sky where skies are modeled.
Noise is in per cent of that, which is about the brightness of a surface's best lit spot, so that the surface's albedo
cancels. A window is judged by the median, over the orientations of interest and draws of the clouds, of the expected
error of the normal (noise_gain.py).
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from datetime import date, timedelta

import numpy as np
from numpy.typing import NDArray

from lighting.errors import ErrorCode, ParameterError
from lighting.fields import Json, check_range
from lighting.geometry import Floats, direction
from lighting.stereo.light_vectors import DAY_MINUTES, SkyDay, illumination_matrices
from lighting.stereo.noise_gain import (
    angular_error,
    angular_std,
    gain_from_inverse,
    interval_95,
    rotation_free_gain,
    window_gram_inverses,
)

HOURS = (1, 2, 3, 6)  # the lengths of windows compared
MIN_SHOTS, MAX_SHOTS = 3, 1000
_NOISE_RANGE = (0.001, 100.0)  # per cent
_START_STEP = 15.0  # min between the starts of windows
MIN_WINDOW = 30.0  # min
_MAX_DAYS = 366  # of a plan: a leap year
_CHUNK = 1 << 16  # matrices held at once: what of them is summed stays in a processor's cache
_NORMAL_COUNT = 180  # over the whole sphere, of which those of interest count
_MAX_VISIBLE_ANGLE = 80.0  # deg from the facing direction, within which a camera sees orientations well
_SPHERE_SIZE = 31  # normals across a drawn half sphere
_COMPASS = (("north", 0.0), ("east", 90.0), ("south", 180.0), ("west", 270.0))

_NamedNormal = tuple[str, float, float]  # name, azimuth [deg clockwise from north], elevation [deg] of the normal
_DayReader = Callable[[date, bool], SkyDay]  # a day's light; coarse for a first look at one of many, else fine


def normals_of_interest(facing: float | None) -> Floats:
    """Return the unit normals (N, 3) by which windows are judged.

    Args:
        facing: deg clockwise from north; normals lie within 80 deg of it. None is all that do not look down.
    """
    number = np.arange(_NORMAL_COUNT)  # spread evenly over the sphere along a spiral of golden angles
    up, angle = 1 - (2 * number + 1) / _NORMAL_COUNT, np.pi * (3 - np.sqrt(5)) * number
    level = np.sqrt(1 - up**2)
    normals = np.stack([level * np.sin(angle), up, -level * np.cos(angle)], axis=-1)
    if facing is None:
        return np.asarray(normals[normals[:, 1] >= 0])
    return np.asarray(normals[normals @ direction(facing, 0.0) > np.cos(np.radians(_MAX_VISIBLE_ANGLE))])


def _named_normals(facing: float | None) -> tuple[list[_NamedNormal], Floats]:
    """Return the orientations that a plan speaks of, and their unit normals (N, 3).

    Args:
        facing: deg clockwise from north, where the surface faces; None is all directions and up.
    """
    if facing is None:
        slopes = [("level", 0.0, 90.0), *((f"slope to the {name}", azimuth, 45.0) for name, azimuth in _COMPASS)]
        orientations = [*slopes, *((f"wall to the {name}", azimuth, 0.0) for name, azimuth in _COMPASS)]
    else:
        front, *sides = ((facing + offset) % 360.0 for offset in (0.0, -45.0, 45.0))
        tilted = [("ahead", front, 0.0), ("45° up", front, 45.0), ("45° down", front, -45.0)]
        orientations = [*tilted, *((f"towards {azimuth:g}°", azimuth, 0.0) for azimuth in sides)]
    _, azimuths, elevations = zip(*orientations, strict=True)
    return orientations, direction(azimuths, elevations)


def _half_sphere_normals(facing: float | None, size: int) -> Floats:
    """Return the unit normals (S, S, 3) of a sphere's pixels as a distant camera sees it.

    Beyond the rim they are those of the rim.

    The camera stands before the surface, upright; or, without a facing direction, above with north at the top.

    Args:
        facing: deg clockwise from north, where the surface faces; None is up.
        size: S, pixels.
    """
    side = (np.arange(size) + 0.5) / size * 2 - 1
    x, y = np.meshgrid(side, -side)
    beyond = np.maximum(np.hypot(x, y), 1.0)
    x, y = x / beyond, y / beyond
    normals = np.stack([x, y, np.sqrt(np.maximum(1 - x**2 - y**2, 0))], axis=-1)
    if facing is None:
        return np.asarray(normals @ np.stack([direction(90.0, 0.0), direction(0.0, 0.0), direction(0.0, 90.0)]))
    left = direction(facing - 90.0, 0.0)  # the surface's left is the camera's right
    return np.asarray(normals @ np.stack([left, direction(0.0, 90.0), direction(facing, 0.0)]))


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
        check_range("noise", self.noise, *_NOISE_RANGE)
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
        numbers = {"error": _round_finite(self.error), "gain": _round_finite(self.gain)}
        return asdict(self) | numbers | {"interval_95": [_round_finite(value) for value in self.interval_95]}


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
    """(S, S), lambda_max over the half sphere seen, see `_half_sphere_normals`."""

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
class Plan:
    """The best of several days, and its windows."""

    day: date
    """Day, the best."""
    question: PlanRequest
    """What was asked."""
    windows: tuple[Window, ...]
    """The best of each length of HOURS that fits the day."""
    days: tuple[tuple[date, tuple[float, ...]], ...]
    """Each day, and the least errors of each length of HOURS, deg, 90 where none fits."""
    table: WindowTable
    """All windows of the day."""

    def to_dict(self) -> Json:
        """As JSON: angles in deg, times by the clock of the place, null for what the light does not resolve."""
        return {
            "date": self.day.isoformat(),
            **asdict(self.question),
            "windows": [window.to_dict() for window in self.windows],
            "days": [
                {"date": day.isoformat(), "errors": list(map(_round_finite, errors))} for day, errors in self.days
            ],
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


@dataclass(frozen=True)
class _Windows:
    """W windows of a day, each with the same number of photos."""

    start: Floats  # (W,) min since midnight
    end: Floats  # (W,)
    moments: NDArray[np.intp]  # (K, W, shots), the photos' moments in the day's light, under each draw of the clouds

    def __len__(self) -> int:
        return len(self.start)


def list_windows(day: SkyDay, hours: float, shots: int) -> _Windows:
    """List the windows of one length that start on quarters of an hour and lie in light.

    Args:
        day: its skies.
        hours: the windows' length.
        shots: photos of each.
    """
    start = np.arange(0.0, DAY_MINUTES - 60 * hours + 1e-6, _START_STEP)
    return _windows_in_light(day, start, start + 60 * hours, shots)


def _all_windows(day: SkyDay, shots: int, step: float) -> _Windows:
    """The windows that start and end on multiples of `step` minutes, MIN_WINDOW or longer, and lie in light."""
    grid = np.arange(0.0, DAY_MINUTES + 1e-6, step)
    start, end = (side.ravel() for side in np.meshgrid(grid, grid, indexing="ij"))
    long = end - start >= MIN_WINDOW
    return _windows_in_light(day, start[long], end[long], shots)


def _score_windows(windows: _Windows, light: Floats, normals: Floats) -> tuple[Floats, Floats]:
    """Score windows by what they are worth for normals.

    Args:
        windows: of one day.
        light: (N, V x T, 3) mean light vectors of that day.
        normals: (N, 3) unit vectors.

    Returns:
        Expected turns of the normal [rad] (W,) per unit of noise, and lambda_max (W,). Both are medians over normals
        and draws of the clouds, per unit of the skies' radiance, and infinite where nothing is resolved.
    """
    step = max(1, _CHUNK // (len(windows.moments) * len(normals)))
    std, gain = np.empty(len(windows)), np.empty(len(windows))
    for chunk in (slice(start, start + step) for start in range(0, len(windows), step)):
        inverses = window_gram_inverses(light, windows.moments[:, chunk])
        std[chunk] = np.median(angular_std(inverses, normals[:, None, None]), axis=(0, 1))
        gain[chunk] = np.median(gain_from_inverse(inverses).max(axis=-1), axis=(0, 1))
    return std, gain


def _windows_in_light(day: SkyDay, start: Floats, end: Floats, shots: int) -> _Windows:
    moments, lit = day.moments(start, end, shots)
    return _Windows(start[lit], end[lit], moments[:, lit])


DayProgress = Callable[[Sequence[date]], Iterable[date]]


def days_between(first: date, last: date) -> list[date]:
    """List all days of a range.

    Args:
        first: the first day.
        last: the last day, included.

    Raises:
        ParameterError: they are reversed or more than 366.
    """
    count = (last - first).days + 1
    if count < 1:
        raise ParameterError(f"The last day, {last}, is before the first, {first}.", "last", ErrorCode.CONTRADICTION)
    if count > _MAX_DAYS:
        sentence = f"From {first} to {last} are {count} days; a plan covers {_MAX_DAYS} at most."
        raise ParameterError(sentence, "last", ErrorCode.OUT_OF_RANGE)
    return [first + timedelta(days=i) for i in range(count)]


def make_plan(
    days: Sequence[date],
    read: _DayReader,
    question: PlanRequest,
    reference: float | None = None,
    progress: DayProgress = iter,
) -> Plan:
    """Plan the best of several days: the one with the least product of its least errors of each length of HOURS.

    A day without light is passed over if there are others.

    Args:
        days: one or more.
        read: reads a day's light.
        question: what is to be photographed.
        reference: length of the mean light vector that the exposure brings to 1; None is the brightest of the days.
        progress: passes the days on as they are read.

    Raises:
        ParameterError: no window fits any day.
    """
    summaries = [_summarize_day(day, read, question, coarse=len(days) > 1) for day in progress(days)]
    if not any(summary.has_window for summary in summaries):
        raise ParameterError(summaries[0].objection, "first", ErrorCode.INSUFFICIENT)
    scale = reference or max(summary.brightest for summary in summaries)
    errors = angular_error(np.stack([summary.angular_std for summary in summaries]) * scale, question.noise / 100)
    burden = np.log(errors).sum(axis=1) + np.where([summary.has_window for summary in summaries], 0, np.inf)
    chosen = int(np.argmin(burden))
    best = summaries[chosen].day_light or read(days[chosen], False)
    scores = tuple((day, tuple(map(float, row))) for day, row in zip(days, errors, strict=True))
    normals = normals_of_interest(question.facing)
    light = best.light(normals) / scale
    windows = tuple(_best_windows(best, light, normals, question, scale))
    step = _START_STEP if len(best.clouds) == 1 else 2 * _START_STEP
    listed = _all_windows(best, question.shots, step)
    table = WindowTable(step, listed.start, listed.end, _score_windows(listed, light, normals)[1])
    return Plan(best.date, question, windows, scores, table)


@dataclass(frozen=True)
class _DaySummary:
    """What a first look at a day found."""

    angular_std: Floats  # (len(HOURS),) of the best window of each length; inf where none fits
    has_window: bool  # whether a window of any length does
    brightest: float  # mean light vector's length
    objection: str  # a sentence, if none fits
    day_light: SkyDay | None = None  # its light, if it is fine


def _summarize_day(day: date, read: _DayReader, question: PlanRequest, *, coarse: bool) -> _DaySummary:
    try:
        day_light = read(day, coarse)
    except ParameterError as error:
        return _DaySummary(np.full(len(HOURS), np.inf), False, 0.0, str(error))
    normals = normals_of_interest(question.facing)
    light = day_light.light(normals)
    windows = [list_windows(day_light, hours, question.shots) for hours in HOURS]
    angular_std = np.array([_score_windows(each, light, normals)[0].min(initial=np.inf) for each in windows])
    brightest = float(np.linalg.norm(light, axis=-1).max())  # the longest mean light vector
    objection = f"On {day} light is never there for an hour on end; photometric stereo needs that."
    return _DaySummary(angular_std, any(map(len, windows)), brightest, objection, None if coarse else day_light)


def _best_windows(day: SkyDay, light: Floats, normals: Floats, question: PlanRequest, scale: float) -> Iterable[Window]:
    """The best of each length, of a day's scaled mean light vectors (N, moments, 3)."""
    for hours in HOURS:
        windows = list_windows(day, hours, question.shots)
        if not len(windows):
            continue
        stds, gains = _score_windows(windows, light, normals)
        best = int(np.argmin(stds))
        moments = windows.moments[:, best]
        start, end, gain = (float(each[best]) for each in (windows.start, windows.end, gains))
        error = float(angular_error(stds[best], question.noise / 100))
        free_gain = float(np.median(rotation_free_gain(light[:, moments])))
        orientations = tuple(_predict_orientations(day, moments, question, scale))
        over_sphere = _half_sphere_normals(question.facing, _SPHERE_SIZE).reshape(-1, 3)
        sphere_gains = gain_from_inverse(_gram_inverses(day, moments, over_sphere, scale)).max(axis=-1)
        sphere = np.asarray(np.median(sphere_gains, axis=1).reshape(_SPHERE_SIZE, _SPHERE_SIZE))
        yield Window(hours, start, end, error, gain, free_gain, orientations, sphere)


def _predict_orientations(
    day: SkyDay, moments: NDArray[np.intp], question: PlanRequest, scale: float
) -> Iterator[SurfaceOrientation]:
    """What each named orientation gets of photos at moments (K, shots)."""
    names, normals = _named_normals(question.facing)
    inverses, noise = _gram_inverses(day, moments, normals, scale), question.noise / 100
    error = np.median(angular_error(angular_std(inverses, normals[:, None]), noise), axis=1)
    gain = np.median(gain_from_inverse(inverses), axis=1)
    for name, e, g, interval in zip(names, error, gain, interval_95(gain, noise), strict=True):
        east, up, south = map(float, interval)
        yield SurfaceOrientation(*name, float(e), float(g.max()), (east, up, south))


def _gram_inverses(day: SkyDay, moments: NDArray[np.intp], normals: Floats, scale: float) -> Floats:
    """(M^T M)^-1 (N, K, 3, 3) of photos at moments (K, shots) for normals (N, 3)."""
    used, index = np.unique(moments, return_inverse=True)
    light = illumination_matrices(day.skies.at(used), normals)[..., 0] / scale
    return window_gram_inverses(light, index.reshape(moments.shape))

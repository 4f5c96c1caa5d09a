"""When to take the photos: the windows of a day in which photometric stereo resolves a surface's normals best.

Every window holds the same number of photos, evenly spread from its start to its end, all of one exposure: the one
that brings the brightest mean light vector of the plan's days to length 1, under a clear sky where skies are modelled.
Noise is in per cent of that, which is about the brightness of a surface's best lit spot, so that the surface's albedo
cancels. A window is judged by the median, over the orientations of interest and draws of the clouds, of the expected
error of the normal.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import date, timedelta

import numpy as np
from numpy.typing import NDArray

from lighting.errors import ErrorCode, ParameterError
from lighting.geometry import Floats
from lighting.stereo.days import Day
from lighting.stereo.gain import (
    angular_error,
    angular_spread,
    gain_of,
    interval_95,
    rotation_free_gain,
    window_inverses,
)
from lighting.stereo.mean_light import illumination
from lighting.stereo.orientations import half_sphere, named_normals, normals_of_interest
from lighting.stereo.plan import HOURS, DayScore, Orientation, Plan, Question, Table, Window
from lighting.stereo.windows import START_STEP, all_windows, windows_of, worth

Progress = Callable[[Sequence[date]], Iterable[date]]
Reader = Callable[[date, bool], Day]  # a day's light; coarse for a first look at one of many, else fine

MOST_DAYS = 366  # of a plan: a leap year
SPHERE = 31  # normals across a drawn half sphere


def days_between(first: date, last: date) -> list[date]:
    """All days from first to last; ParameterError where they are reversed or too many."""
    count = (last - first).days + 1
    if count < 1:
        raise ParameterError(f"The last day, {last}, is before the first, {first}.", "last", ErrorCode.CONTRADICTION)
    if count > MOST_DAYS:
        raise ParameterError(
            f"From {first} to {last} are {count} days; a plan covers {MOST_DAYS} at most.",
            "last",
            ErrorCode.OUT_OF_RANGE,
        )
    return [first + timedelta(days=i) for i in range(count)]


def make_plan(
    days: Sequence[date],
    read: Reader,
    question: Question,
    reference: float | None = None,
    progress: Progress = iter,
) -> Plan:
    """The plan of the best of several days.

    `reference` is the length of mean light vector that the exposure brings to 1; None takes the brightest of the days
    read, over the orientations of interest. The best day has the least product of its least errors of each length of
    HOURS. A day without light is passed over if there are others. Raises ParameterError where no window fits
    any.
    """
    looks = [_look(day, read, question, coarse=len(days) > 1) for day in progress(days)]
    if not any(look.fits for look in looks):
        raise ParameterError(looks[0].objection, "first", ErrorCode.INSUFFICIENT)
    scale = reference or max(look.brightest for look in looks)
    errors = angular_error(np.stack([look.spread for look in looks]) * scale, question.noise / 100)
    burden = np.log(errors).sum(axis=1) + np.where([look.fits for look in looks], 0, np.inf)
    chosen = int(np.argmin(burden))
    best = looks[chosen].found or read(days[chosen], False)
    scores = tuple(DayScore(day, tuple(map(float, row))) for day, row in zip(days, errors, strict=True))
    normals = normals_of_interest(question.facing)
    light = best.light(normals) / scale
    windows = tuple(_best_windows(best, light, normals, question, scale))
    return Plan(best.date, question, windows, scores, _table(best, light, normals, question))


def brightest_light(light: Floats) -> float:
    """The length of the longest mean light vector (..., 3)."""
    return float(np.linalg.norm(light, axis=-1).max())


@dataclass(frozen=True)
class _Look:
    """What a first look at a day found."""

    spread: Floats  # (len(HOURS),) of the best window of each length; inf where none fits
    fits: bool  # whether a window of any length does
    brightest: float  # mean light vector's length
    objection: str  # a sentence, if none fits
    found: Day | None = None  # its light, if it is fine


def _look(day: date, read: Reader, question: Question, *, coarse: bool) -> _Look:
    try:
        found = read(day, coarse)
    except ParameterError as error:
        return _Look(np.full(len(HOURS), np.inf), False, 0.0, str(error))
    normals = normals_of_interest(question.facing)
    light = found.light(normals)
    windows = [windows_of(found, hours, question.shots) for hours in HOURS]
    spread = np.array([worth(each, light, normals).spread.min(initial=np.inf) for each in windows])
    objection = f"On {day} light is never there for an hour on end; photometric stereo needs that."
    return _Look(spread, any(map(len, windows)), brightest_light(light), objection, None if coarse else found)


def _best_windows(day: Day, light: Floats, normals: Floats, question: Question, scale: float) -> Iterable[Window]:
    """The best of each length, of a day's scaled mean light vectors (N, moments, 3)."""
    for hours in HOURS:
        windows = windows_of(day, hours, question.shots)
        if not len(windows):
            continue
        worths = worth(windows, light, normals)
        best = int(np.argmin(worths.spread))
        moments = windows.moments[:, best]
        yield Window(
            hours=hours,
            start=float(windows.start[best]),
            end=float(windows.end[best]),
            error=float(angular_error(worths.spread[best], question.noise / 100)),
            gain=float(worths.gain[best]),
            rotation_free_gain=float(np.median(rotation_free_gain(light[:, moments]))),
            orientations=_promises(day, moments, question, scale),
            sphere=_sphere(day, moments, question, scale),
        )


def _promises(day: Day, moments: NDArray[np.intp], question: Question, scale: float) -> tuple[Orientation, ...]:
    """What each named orientation gets of photos at moments (K, shots)."""
    names, normals = named_normals(question.facing)
    inverses, noise = _inverses(day, moments, normals, scale), question.noise / 100
    error = np.median(angular_error(angular_spread(inverses, normals[:, None]), noise), axis=1)
    gain = np.median(gain_of(inverses), axis=1)
    interval = interval_95(gain, noise)
    return tuple(
        Orientation(*name, float(e), float(g.max()), (float(i[0]), float(i[1]), float(i[2])))
        for name, e, g, i in zip(names, error, gain, interval, strict=True)
    )


def _sphere(day: Day, moments: NDArray[np.intp], question: Question, scale: float) -> Floats:
    normals = half_sphere(question.facing, SPHERE).reshape(-1, 3)
    gain = gain_of(_inverses(day, moments, normals, scale)).max(axis=-1)
    return np.asarray(np.median(gain, axis=1).reshape(SPHERE, SPHERE))


def _inverses(day: Day, moments: NDArray[np.intp], normals: Floats, scale: float) -> Floats:
    """(M^T M)^-1 (N, K, 3, 3) of photos at moments (K, shots) for normals (N, 3)."""
    used, index = np.unique(moments, return_inverse=True)
    light = illumination(day.skies.at(used), normals)[..., 0] / scale
    return window_inverses(light, index.reshape(moments.shape))


def _table(day: Day, light: Floats, normals: Floats, question: Question) -> Table:
    step = START_STEP if len(day.clouds) == 1 else 2 * START_STEP
    windows = all_windows(day, question.shots, step)
    return Table(step, windows.start, windows.end, worth(windows, light, normals).gain)

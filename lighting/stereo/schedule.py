"""The windows of a day in which photometric stereo resolves a surface's normals best.

Every window holds the same number of photos, evenly spread from its start to its end, all of one exposure. It brings
the brightest mean light vector of the plan's days to length 1, under a clear sky where skies are modelled.
Noise is in per cent of that, which is about the brightness of a surface's best lit spot, so that the surface's albedo
cancels. A window is judged by the median, over the orientations of interest and draws of the clouds, of the expected
error of the normal.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lighting.color import LUMINANCE_WEIGHTS
from lighting.errors import ErrorCode, ParameterError
from lighting.geometry import Floats
from lighting.stereo.light_vectors import (
    CLOUD_SPELL,
    SKY_HEIGHT,
    Skies,
    broken_skies,
    clear_skies,
    draw_sunshine,
    illumination_matrices,
    overcast_skies,
    sun_directions,
)
from lighting.stereo.noise_gain import (
    angular_error,
    angular_std,
    gain_from_inverse,
    half_sphere_normals,
    interval_95,
    named_normals,
    normals_of_interest,
    rotation_free_gain,
    window_gram_inverses,
)
from lighting.stereo.plan_records import HOURS, DayScore, Plan, PlanRequest, SurfaceOrientation, Window, WindowTable

Weather = Literal["clear", "overcast", "mixed"]

CLOUD_DRAWS = 32  # of the clouds of a mixed day
DAY_MINUTES = 24 * 60  # min
SPELLS = int(DAY_MINUTES / CLOUD_SPELL)
ONE_SKY = np.zeros((1, SPELLS), dtype=np.intp)  # the clouds of a day that has one variant
FINE_STEP, COARSE_STEP = 5.0, 10.0  # min between modelled moments


@dataclass(frozen=True)
class ClockLocation:
    """A location, and the clock by which its days and times are stated."""

    latitude: float
    """Deg, positive north."""
    longitude: float
    """Deg, positive east."""
    utc_offset: float
    """Hours, of the clock that days and times are told by."""


@dataclass(frozen=True)
class SkyDay:
    """Skies of one day at T moments in one channel, in one variant or in several between which clouds choose."""

    date: date
    """Date, the day."""
    minutes: Floats
    """(T,) since midnight by the clock of the place, ascending."""
    tolerance: float
    """Min by which a photo's moment may miss the time wanted."""
    skies: Skies
    """Of V x T moments: all of the first variant, then all of the next."""
    clouds: NDArray[np.intp]
    """(K, spells of a day), which variant each draw of the clouds shows in each spell."""

    def light(self, normals: Floats) -> Floats:
        """Return the mean light vectors (N, V x T, 3) of normals.

        Args:
            normals: (N, 3) unit vectors.
        """
        return np.asarray(illumination_matrices(self.skies, normals)[..., 0])

    def moments(self, start: Floats, end: Floats, shots: int) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
        """Find the moments of photos spread evenly over windows, both ends in.

        Spells of clouds are counted from the start of each window, so that all windows meet the same clouds.

        Args:
            start: (W,) min since midnight.
            end: (W,) min since midnight.
            shots: photos of each window.

        Returns:
            Indices (K, W, shots), and whether (W,) every photo finds light within the day's tolerance.
        """
        times = start[:, None] + (end - start)[:, None] * np.linspace(0.0, 1.0, shots)
        next_index = np.clip(np.searchsorted(self.minutes, times), 1, len(self.minutes) - 1)
        is_next = self.minutes[next_index] - times < times - self.minutes[next_index - 1]
        index = np.where(is_next, next_index, next_index - 1)
        in_light = np.abs(self.minutes[index] - times) <= self.tolerance
        spell = ((times - start[:, None]) / CLOUD_SPELL).astype(np.intp) % self.clouds.shape[1]
        return index + len(self.minutes) * self.clouds[:, spell], np.asarray(in_light.all(axis=1))


def modelled_day(location: ClockLocation, day: date, weather: Weather, *, coarse: bool = False) -> SkyDay:
    """Model the moments of a day, midnight to midnight, that the sun is up: all of a polar day.

    Args:
        location: where, and by which clock.
        day: by that clock.
        weather: the kind of sky.
        coarse: half as many moments, in maps of half the size.

    Raises:
        ParameterError: the sun does not rise.
    """
    step, height = (COARSE_STEP, SKY_HEIGHT // 2) if coarse else (FINE_STEP, SKY_HEIGHT)
    minutes = np.arange(0.0, DAY_MINUTES, step)
    suns = _sun_path(location, [day], minutes)
    up = suns[:, 1] > 0
    if up.sum() < 2:
        raise ParameterError(_night_sentence(location, day, day), "first", ErrorCode.NIGHT)
    minutes, suns = minutes[up], suns[up]
    clear = gray_skies(clear_skies(suns, height=height))
    if weather != "mixed":
        return SkyDay(day, minutes, step / 2, clear if weather == "clear" else overcast_skies(clear), ONE_SKY)
    variants = Skies.join([broken_skies(clear, np.full(len(clear), shines)) for shines in (False, True)])
    return SkyDay(day, minutes, step / 2, variants, draw_sunshine(CLOUD_DRAWS, SPELLS, seed=0).astype(np.intp))


def _sun_path(location: ClockLocation, days: Sequence[date], minutes: Floats) -> Floats:
    """Unit vectors (days x T, 3) to the sun at minutes (T,) since midnight of each day."""
    midnights = np.array([day.isoformat() for day in days], dtype="datetime64[s]")
    seconds = np.rint(60 * (minutes - 60 * location.utc_offset)).astype("timedelta64[s]")
    return sun_directions((midnights[:, None] + seconds).ravel(), location.latitude, location.longitude)


def clear_brightness(location: ClockLocation, days: Sequence[date]) -> float:
    """Return the length of the brightest mean light vector under clear skies: of a patch that faces the highest sun.

    Args:
        location: where, and by which clock.
        days: that are compared.

    Raises:
        ParameterError: the sun does not rise on any.
    """
    suns = _sun_path(location, days, np.arange(0.0, DAY_MINUTES, 15.0))
    highest = suns[np.argmax(suns[:, 1])][None]
    if highest[0, 1] <= 0:
        raise ParameterError(_night_sentence(location, days[0], days[-1]), "first", ErrorCode.NIGHT)
    light = illumination_matrices(gray_skies(clear_skies(highest)), highest)
    return float(np.linalg.norm(light))


def _night_sentence(location: ClockLocation, first: date, last: date) -> str:
    where = f"{abs(location.latitude):g}° {'N' if location.latitude >= 0 else 'S'}"
    when = f"on {first}" if first == last else f"from {first} to {last}"
    return f"The sun does not rise at {where} {when}; it is night all day."


def gray_skies(skies: Skies) -> Skies:
    """Return skies in one channel, luminance.

    Args:
        skies: in linear Rec.709.
    """
    radiance = (skies.radiance @ LUMINANCE_WEIGHTS)[..., None]
    return Skies(radiance, skies.sun_direction, (skies.sun_irradiance @ LUMINANCE_WEIGHTS)[:, None])


# Windows of a day, scored.

START_STEP = 15.0  # min between the starts of windows
MIN_WINDOW = 30.0  # min
_CHUNK = 1 << 16  # matrices held at once: what of them is summed stays in a processor's cache


@dataclass(frozen=True)
class _Windows:
    """W windows of a day, each with the same number of photos."""

    start: Floats  # (W,) min since midnight
    end: Floats  # (W,)
    moments: NDArray[np.intp]  # (K, W, shots), the photos' moments in the day's light, under each draw of the clouds

    def __len__(self) -> int:
        return len(self.start)


@dataclass(frozen=True)
class _WindowScores:
    """Medians (W,) over orientations and draws of the clouds, per unit of the skies' radiance; inf where hopeless."""

    angular_std: Floats  # of `angular_std`: expected turn of the normal [rad] per unit of noise
    gain: Floats  # of lambda_max


def list_windows(day: SkyDay, hours: float, shots: int) -> _Windows:
    """List the windows of one length that start on quarters of an hour and lie in light.

    Args:
        day: its skies.
        hours: the windows' length.
        shots: photos of each.
    """
    start = np.arange(0.0, DAY_MINUTES - 60 * hours + 1e-6, START_STEP)
    return _windows_in_light(day, start, start + 60 * hours, shots)


def _all_windows(day: SkyDay, shots: int, step: float) -> _Windows:
    """The windows that start and end on multiples of `step` minutes, SHORTEST or longer, and lie in light."""
    grid = np.arange(0.0, DAY_MINUTES + 1e-6, step)
    start, end = (side.ravel() for side in np.meshgrid(grid, grid, indexing="ij"))
    long = end - start >= MIN_WINDOW
    return _windows_in_light(day, start[long], end[long], shots)


def _score_windows(windows: _Windows, light: Floats, normals: Floats) -> _WindowScores:
    """Score windows by what they are worth for normals.

    Args:
        windows: of one day.
        light: (N, V x T, 3) mean light vectors of that day.
        normals: (N, 3) unit vectors.
    """
    step = max(1, _CHUNK // (len(windows.moments) * len(normals)))
    scores = _WindowScores(np.empty(len(windows)), np.empty(len(windows)))
    for chunk in (slice(start, start + step) for start in range(0, len(windows), step)):
        inverses = window_gram_inverses(light, windows.moments[:, chunk])
        scores.angular_std[chunk] = np.median(angular_std(inverses, normals[:, None, None]), axis=(0, 1))
        scores.gain[chunk] = np.median(gain_from_inverse(inverses).max(axis=-1), axis=(0, 1))
    return scores


def _windows_in_light(day: SkyDay, start: Floats, end: Floats, shots: int) -> _Windows:
    moments, lit = day.moments(start, end, shots)
    return _Windows(start[lit], end[lit], moments[:, lit])


# The plan of the best day.

DayProgress = Callable[[Sequence[date]], Iterable[date]]
DayReader = Callable[[date, bool], SkyDay]  # a day's light; coarse for a first look at one of many, else fine

MAX_DAYS = 366  # of a plan: a leap year
SPHERE_SIZE = 31  # normals across a drawn half sphere


def days_between(first: date, last: date) -> list[date]:
    """List all days of a range.

    Args:
        first: the first day.
        last: the last day, included.

    Raises:
        ParameterError: they are reversed or more than MAX_DAYS.
    """
    count = (last - first).days + 1
    if count < 1:
        raise ParameterError(f"The last day, {last}, is before the first, {first}.", "last", ErrorCode.CONTRADICTION)
    if count > MAX_DAYS:
        sentence = f"From {first} to {last} are {count} days; a plan covers {MAX_DAYS} at most."
        raise ParameterError(sentence, "last", ErrorCode.OUT_OF_RANGE)
    return [first + timedelta(days=i) for i in range(count)]


def make_plan(
    days: Sequence[date],
    read: DayReader,
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
    scores = tuple(DayScore(day, tuple(map(float, row))) for day, row in zip(days, errors, strict=True))
    normals = normals_of_interest(question.facing)
    light = best.light(normals) / scale
    windows = tuple(_best_windows(best, light, normals, question, scale))
    step = START_STEP if len(best.clouds) == 1 else 2 * START_STEP
    listed = _all_windows(best, question.shots, step)
    table = WindowTable(step, listed.start, listed.end, _score_windows(listed, light, normals).gain)
    return Plan(best.date, question, windows, scores, table)


@dataclass(frozen=True)
class _DaySummary:
    """What a first look at a day found."""

    angular_std: Floats  # (len(HOURS),) of the best window of each length; inf where none fits
    has_window: bool  # whether a window of any length does
    brightest: float  # mean light vector's length
    objection: str  # a sentence, if none fits
    day_light: SkyDay | None = None  # its light, if it is fine


def _summarize_day(day: date, read: DayReader, question: PlanRequest, *, coarse: bool) -> _DaySummary:
    try:
        day_light = read(day, coarse)
    except ParameterError as error:
        return _DaySummary(np.full(len(HOURS), np.inf), False, 0.0, str(error))
    normals = normals_of_interest(question.facing)
    light = day_light.light(normals)
    windows = [list_windows(day_light, hours, question.shots) for hours in HOURS]
    angular_std = np.array([_score_windows(each, light, normals).angular_std.min(initial=np.inf) for each in windows])
    brightest = float(np.linalg.norm(light, axis=-1).max())  # the longest mean light vector
    objection = f"On {day} light is never there for an hour on end; photometric stereo needs that."
    return _DaySummary(angular_std, any(map(len, windows)), brightest, objection, None if coarse else day_light)


def _best_windows(day: SkyDay, light: Floats, normals: Floats, question: PlanRequest, scale: float) -> Iterable[Window]:
    """The best of each length, of a day's scaled mean light vectors (N, moments, 3)."""
    for hours in HOURS:
        windows = list_windows(day, hours, question.shots)
        if not len(windows):
            continue
        scores = _score_windows(windows, light, normals)
        best = int(np.argmin(scores.angular_std))
        moments = windows.moments[:, best]
        start, end, gain = (float(each[best]) for each in (windows.start, windows.end, scores.gain))
        error = float(angular_error(scores.angular_std[best], question.noise / 100))
        free_gain = float(np.median(rotation_free_gain(light[:, moments])))
        orientations = tuple(_predict_orientations(day, moments, question, scale))
        sphere = _sphere_gains(day, moments, question, scale)
        yield Window(hours, start, end, error, gain, free_gain, orientations, sphere)


def _predict_orientations(
    day: SkyDay, moments: NDArray[np.intp], question: PlanRequest, scale: float
) -> Iterator[SurfaceOrientation]:
    """What each named orientation gets of photos at moments (K, shots)."""
    names, normals = named_normals(question.facing)
    inverses, noise = _gram_inverses(day, moments, normals, scale), question.noise / 100
    error = np.median(angular_error(angular_std(inverses, normals[:, None]), noise), axis=1)
    gain = np.median(gain_from_inverse(inverses), axis=1)
    for name, e, g, interval in zip(names, error, gain, interval_95(gain, noise), strict=True):
        east, up, south = map(float, interval)
        yield SurfaceOrientation(*name, float(e), float(g.max()), (east, up, south))


def _sphere_gains(day: SkyDay, moments: NDArray[np.intp], question: PlanRequest, scale: float) -> Floats:
    normals = half_sphere_normals(question.facing, SPHERE_SIZE).reshape(-1, 3)
    gain = gain_from_inverse(_gram_inverses(day, moments, normals, scale)).max(axis=-1)
    return np.asarray(np.median(gain, axis=1).reshape(SPHERE_SIZE, SPHERE_SIZE))


def _gram_inverses(day: SkyDay, moments: NDArray[np.intp], normals: Floats, scale: float) -> Floats:
    """(M^T M)^-1 (N, K, 3, 3) of photos at moments (K, shots) for normals (N, 3)."""
    used, index = np.unique(moments, return_inverse=True)
    light = illumination_matrices(day.skies.at(used), normals)[..., 0] / scale
    return window_gram_inverses(light, index.reshape(moments.shape))

"""Whether the noise gain says what noise does: triplets of lights, noisy pixels, and the plan's choice of windows."""

from dataclasses import dataclass, replace
from datetime import date

import numpy as np

from lighting.geometry import Floats, angle_between, direction
from lighting.stereo import schedule
from lighting.stereo.light_vectors import (
    CLOUD_DRAWS,
    SPELLS,
    ClockLocation,
    Skies,
    SkyDay,
    Weather,
    clear_brightness,
    draw_sunshine,
    illumination_matrices,
    modelled_day,
)
from lighting.stereo.noise_gain import (
    angular_std,
    gain_from_inverse,
    window_gram_inverses,
)
from lighting.stereo.schedule import Plan, PlanRequest, normals_of_interest

_NOISE_STD = 0.001  # noise of the simulations, of the brightest light: small enough for errors to grow in proportion
_SHOTS = 8
_TRIALS = 64  # simulated noises of a window, shared among draws of the clouds
_ITERATIONS = 3


@dataclass(frozen=True)
class _Case:
    """A place, a day and its sky."""

    name: str
    place: ClockLocation
    day: date
    sky: Weather = "clear"

    def light(self, *, coarse: bool = False) -> SkyDay:
        """Its light, scaled to the brightest clear sky."""
        day = modelled_day(self.place, self.day, self.sky, coarse=coarse)
        scale = clear_brightness(self.place, [self.day])
        return replace(day, skies=_scaled(day.skies, 1 / scale))


CASES = (
    _Case("47° N, 20 March", ClockLocation(47.0, 10.0, 1.0), date(2026, 3, 20)),
    _Case("47° N, 21 June", ClockLocation(47.0, 10.0, 1.0), date(2026, 6, 21)),
    _Case("35° N, 21 December", ClockLocation(35.0, 10.0, 1.0), date(2026, 12, 21)),
)
CLOUDY = replace(CASES[1], sky="mixed")


def triplet(arc: float, lift: float) -> Floats:
    """Unit vectors (3, 3): two on the solar plane `arc` degrees apart, one midway lifted `lift` degrees out of it."""
    return direction([-arc / 2, arc / 2, 0.0], [0.0, 0.0, lift])


def spread_of_noise(day: SkyDay, hours: float, noise: float, draws: int) -> tuple[float, float]:
    """Mean ratios of what noisy pixels scatter to what the covariance predicts: of normals' components, of their turn.

    Pixels of every orientation of interest over one window about noon, estimated by iterated least squares.
    """
    normals, window = normals_of_interest(None), schedule.list_windows(day, hours, _SHOTS)
    noon = int(np.argmin(np.abs(window.start + 30 * hours - 720)))
    skies = day.skies.at(window.moments[0, noon])
    matrix = illumination_matrices(skies, normals)[..., 0]
    resolved = noise * angular_std(gram_inverses(matrix), normals) < 0.05
    normals, matrix = normals[resolved], matrix[resolved]
    estimate = _estimates(skies, normals, noise, draws, np.random.default_rng(5))
    scatter = (estimate - normals).std(axis=0) / (noise * gain_from_inverse(gram_inverses(matrix)))
    rotation = np.radians(_rms(angle_between(estimate, normals)))
    expected = noise * angular_std(gram_inverses(matrix), normals)
    return float(scatter.mean()), float((rotation / expected).mean())


def _estimates(skies: Skies, normals: Floats, noise: float, draws: int, rng: np.random.Generator) -> Floats:
    """Normals x albedo (draws, N, 3) from noisy pixels (draws, N, T): least squares, with the light of the normal
    estimated before, from the true one on."""
    matrix = illumination_matrices(skies, normals)[..., 0]
    bright = np.einsum("ntk,nk->nt", matrix, normals)
    noisy = bright + noise * rng.standard_normal((draws, *bright.shape))
    estimate = _solve(matrix, noisy)
    for _ in range(_ITERATIONS):
        unit = estimate / np.linalg.norm(estimate, axis=-1, keepdims=True)
        estimate = _solve(illumination_matrices(skies, unit)[..., 0], noisy)
    return estimate


@dataclass(frozen=True)
class _PlannedCase:
    """A case with its light and its plan."""

    case: _Case
    day: SkyDay
    plan: Plan


def study(case: _Case, *, coarse: bool = False) -> _PlannedCase:
    """The case planned."""
    day = case.light(coarse=coarse)
    plan = schedule.make_plan([case.day], lambda *_: day, PlanRequest(shots=_SHOTS), reference=1.0)
    return _PlannedCase(case, day, plan)


def _simulated(light: Floats, normals: Floats, draws: int) -> float:
    """Error [deg] of normals (N, 3) from noisy pixels, by least squares with their mean light vectors (N, K, T, 3). It
    is the median over normals and draws of the clouds of the root mean square."""
    bright = np.einsum("nctk,nk->nct", light, normals)
    noisy = bright + _NOISE_STD * np.random.default_rng(7).standard_normal((draws, *bright.shape))
    estimate = _solve(light, noisy) + 1e-30  # where nothing is resolved a direction like any other
    return float(np.median(_rms(angle_between(estimate, np.broadcast_to(normals[:, None], estimate.shape)))))


def choice(planned: _PlannedCase, hours: int) -> tuple[float, float]:
    """The simulated error [deg] in the plan's window, and the least over windows; of clouds that the plan never saw."""
    day, normals = planned.day, normals_of_interest(None)
    if len(day.clouds) > 1:
        day = replace(day, clouds=draw_sunshine(CLOUD_DRAWS, SPELLS, seed=1).astype(np.intp))
    windows, light = schedule.list_windows(day, hours, _SHOTS), day.light(normals)
    (chosen,) = (window for window in planned.plan.windows if window.hours == hours)
    draws = -(-_TRIALS // len(day.clouds))
    errors = [_simulated(light[:, windows.moments[:, i]], normals, draws) for i in range(len(windows))]
    return errors[int(np.flatnonzero(windows.start == chosen.start)[0])], min(errors)


def _solve(matrix: Floats, bright: Floats) -> Floats:
    """Least squares (..., N, 3) of matrices (..., N, T, 3) and brightnesses (..., N, T)."""
    projected = np.einsum("...tk,...t->...k", matrix, bright)
    inverses = gram_inverses(matrix)
    solvable = np.where(np.isfinite(inverses), inverses, 0.0)
    return np.asarray(np.einsum("...ij,...j->...i", solvable, projected))


def gram_inverses(matrix: Floats) -> Floats:
    """(M^T M)^-1 (..., 3, 3) of illumination matrices (..., T, 3)."""
    flat = matrix.reshape(-1, *matrix.shape[-2:])
    return window_gram_inverses(flat, np.arange(flat.shape[1])).reshape(*matrix.shape[:-2], 3, 3)


def _rms(values: Floats) -> Floats:
    return np.asarray(np.sqrt(np.mean(np.square(values), axis=0)))


def _scaled(skies: Skies, factor: float) -> Skies:
    return Skies(skies.radiance * np.float32(factor), skies.sun_direction, skies.sun_irradiance * factor)


def largest_gain(matrix: Floats) -> Floats:
    """The largest noise gain (...) of the three axes, by illumination matrices (..., T, 3)."""
    return np.asarray(gain_from_inverse(gram_inverses(matrix)).max(axis=-1))

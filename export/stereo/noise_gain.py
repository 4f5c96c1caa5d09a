"""Whether the noise gain says what noise does: triplets of lights, noisy pixels, and the plan's choice of windows."""

from collections.abc import Callable, Sequence
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
    gram_matrix,
    invert_symmetric,
    largest_gain,
    noise_gain,
    rotation_free_gain,
)
from lighting.stereo.schedule import HOURS, Plan, PlanRequest, normals_of_interest

LIFTS = (10, 15, 20, 30, 45, 60, 75, 90)  # deg out of the solar plane
DEGREES_PER_HOUR = 15
FULL_ARC = 6  # h
NOISE_STD = 0.001  # noise of the simulations, of the brightest light: small enough for errors to grow in proportion
SHOTS = 8
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


def _triplet(arc: float, lift: float) -> Floats:
    """Unit vectors (3, 3): two on the solar plane `arc` degrees apart, one midway lifted `lift` degrees out of it."""
    return direction([-arc / 2, arc / 2, 0.0], [0.0, 0.0, lift])


def _cost_of_an_hour(lift: float, full: float) -> float:
    """Noise gain of one hour with a light lifted `lift` degrees over that of a full arc with one lifted `full`."""
    hour, arc = _triplet(DEGREES_PER_HOUR, lift), _triplet(FULL_ARC * DEGREES_PER_HOUR, full)
    return float(largest_gain(hour) / largest_gain(arc))


def _spread_of_noise(day: SkyDay, hours: float, noise: float, draws: int) -> tuple[float, float]:
    """Mean ratios of what noisy pixels scatter to what the covariance predicts: of normals' components, of their turn.

    Pixels of every orientation of interest over one window about noon, estimated by iterated least squares.
    """
    normals, window = normals_of_interest(None), schedule.list_windows(day, hours, SHOTS)
    noon = int(np.argmin(np.abs(window.start + 30 * hours - 720)))
    skies = day.skies.at(window.moments[0, noon])
    matrix = illumination_matrices(skies, normals)[..., 0]
    resolved = noise * angular_std(invert_symmetric(gram_matrix(matrix)), normals) < 0.05
    normals, matrix = normals[resolved], matrix[resolved]
    estimate = _estimates(skies, normals, noise, draws, np.random.default_rng(5))
    scatter = (estimate - normals).std(axis=0) / (noise * noise_gain(matrix))
    rotation = np.radians(_rms(angle_between(estimate, normals)))
    expected = noise * angular_std(invert_symmetric(gram_matrix(matrix)), normals)
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


def _study(case: _Case, *, coarse: bool = False) -> _PlannedCase:
    """The case planned."""
    day = case.light(coarse=coarse)
    plan = schedule.make_plan([case.day], lambda *_: day, PlanRequest(shots=SHOTS), reference=1.0)
    return _PlannedCase(case, day, plan)


def _simulated(light: Floats, normals: Floats, draws: int) -> float:
    """Error [deg] of normals (N, 3) from noisy pixels, by least squares with their mean light vectors (N, K, T, 3). It
    is the median over normals and draws of the clouds of the root mean square."""
    bright = np.einsum("nctk,nk->nct", light, normals)
    noisy = bright + NOISE_STD * np.random.default_rng(7).standard_normal((draws, *bright.shape))
    estimate = _solve(light, noisy) + 1e-30  # where nothing is resolved a direction like any other
    return float(np.median(_rms(angle_between(estimate, np.broadcast_to(normals[:, None], estimate.shape)))))


def _choice(planned: _PlannedCase, hours: int) -> tuple[float, float]:
    """The simulated error [deg] in the plan's window, and the least over windows; of clouds that the plan never saw."""
    day, normals = planned.day, normals_of_interest(None)
    if len(day.clouds) > 1:
        day = replace(day, clouds=draw_sunshine(CLOUD_DRAWS, SPELLS, seed=1).astype(np.intp))
    windows, light = schedule.list_windows(day, hours, SHOTS), day.light(normals)
    (chosen,) = (window for window in planned.plan.windows if window.hours == hours)
    draws = -(-_TRIALS // len(day.clouds))
    errors = [_simulated(light[:, windows.moments[:, i]], normals, draws) for i in range(len(windows))]
    return errors[int(np.flatnonzero(windows.start == chosen.start)[0])], min(errors)


def print_noise_gain(echo: Callable[[str], None]) -> None:
    """Print what the gain predicts beside what simulated noise does.

    Args:
        echo: takes each part as text.
    """
    echo(_triplets())
    echo(_noise())
    planned = [_study(case) for case in (*CASES, CLOUDY)]
    echo(_hours(planned))
    echo(_choices(planned))


def _triplets() -> str:
    lines = ["Noise gain of two lights on the solar plane and one lifted out of it (largest of the axes)"]
    lines.append("  lift [deg]" + "".join(f"{lift:7d}" for lift in LIFTS))
    for hours in HOURS:
        gains = [float(largest_gain(_triplet(hours * DEGREES_PER_HOUR, lift))) for lift in LIFTS]
        lines.append(f"  {hours} h apart  " + "".join(f"{gain:7.2f}" for gain in gains))
    free = float(rotation_free_gain(_triplet(90, 90)))
    lines.append(f"  three orthogonal lights: 1 / sigma_min {free:.3f}")
    lines.append("  1 h / 6 h, the third light as far out of the plane in both")
    lines.append(" " * 13 + "".join(f"{_cost_of_an_hour(lift, lift):7.2f}" for lift in LIFTS))
    lines.append("  1 h / 6 h with the third light upright on the plane")
    lines.append(" " * 13 + "".join(f"{_cost_of_an_hour(lift, 90):7.2f}" for lift in LIFTS))
    return "\n".join(lines)


def _noise() -> str:
    lines = ["Scatter of noisy pixels / predicted, 6 hours about noon, 8 photos: of the components, of the turn"]
    for case in CASES:
        components, turn = _spread_of_noise(case.light(coarse=True), 6, NOISE_STD, 200)
        lines.append(f"  {case.name:20}{components:7.3f}{turn:7.3f}")
    return "\n".join(lines)


def _hours(planned: Sequence[_PlannedCase]) -> str:
    lines = ["Median noise gain in the best window, 8 photos, by hours", " " * 34 + "".join(f"{h:>7} h" for h in HOURS)]
    for each in planned:
        gains = [window.gain for window in each.plan.windows]
        row = "".join(f"{gain:9.1f}" for gain in gains)
        lines.append(f"  {each.case.name:22}{each.case.sky:10}{row}   1 h / 6 h {gains[0] / gains[-1]:.1f}")
    return "\n".join(lines)


def _choices(planned: Sequence[_PlannedCase]) -> str:
    lines = ["Simulated error in the plan's window / in the best window, at a noise of 0.1 % [deg]"]
    for each in planned:
        pairs = [(hours, *_choice(each, hours)) for hours in HOURS]
        row = "  ".join(f"{hours} h {chosen:.2f}/{best:.2f} = {chosen / best:.2f}" for hours, chosen, best in pairs)
        lines.append(f"  {each.case.name:22}{each.case.sky:7}{row}")
    return "\n".join(lines)


def _solve(matrix: Floats, bright: Floats) -> Floats:
    """Least squares (..., N, 3) of matrices (..., N, T, 3) and brightnesses (..., N, T)."""
    projected = np.einsum("...tk,...t->...k", matrix, bright)
    inverses = invert_symmetric(gram_matrix(matrix))
    solvable = np.where(np.isfinite(inverses), inverses, 0.0)
    return np.asarray(np.einsum("...ij,...j->...i", solvable, projected))


def _rms(values: Floats) -> Floats:
    return np.asarray(np.sqrt(np.mean(np.square(values), axis=0)))


def _scaled(skies: Skies, factor: float) -> Skies:
    return Skies(skies.radiance * np.float32(factor), skies.sun_direction, skies.sun_irradiance * factor)

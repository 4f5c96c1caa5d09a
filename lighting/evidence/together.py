"""Several photos of one place and light: their distributions in one frame, multiplied with a discount.

Crops of one scene share its misleading sides, so the errors of the network are alike: n photos count as fewer. Each is
raised to the power 1 / (1 + (n - 1) correlation), whose sum over the photos never exceeds 1 / correlation.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lighting.circular import HEADINGS, Heading, blur, correlate, heading
from lighting.errors import ParameterError
from lighting.evidence.fusion import (
    GROSS_ERRORS,
    Evidence,
    Fused,
    compass_prior,
    daylight,
    fuse,
    on_grid,
    on_rings,
    ring_density,
)
from lighting.geometry import Floats, angles, direction
from lighting.records import EVIDENCE, Prediction, check_range
from lighting.sun_grid import grid_directions, grid_solid_angle, smooth_density

# learnt by `python -m export evaluate --with-metadata` on places that training never saw
CORRELATION = 0.3  # of the sun's distribution in one frame
AZIMUTH_CORRELATION = 0.1  # of its azimuth at a known elevation
ELEVATION_CORRELATION = 0.6  # of its elevation alone

TURN_NOISE = 10.0  # deg, spread of the turn between two compass headings of one phone, whose larger error is shared

_BLUR_STEPS = (-1.5, -0.75, 0.0, 0.75, 1.5)  # in spreads, over which a noisy heading is averaged on the grid
_ELEVATION_SPREAD = 4.0  # deg, kernel of an elevation's density
_LOWEST = 1e-12  # density that stands for none


def fuse_together(
    predictions: Sequence[Prediction], evidence: Sequence[Evidence], headings: Sequence[float] | None = None
) -> tuple[Fused, ...]:
    """One answer a photo, in its own camera's frame, for photos of one place and light.

    `headings` [deg, clockwise from any common direction] are exact; without them the compass headings are used where
    all photos have one, and else relative headings are unknown. A photo without time takes the candidates of the first
    that has one. Times may differ (a time-lapse): then candidate k of each photo is the sun in the same zone k.
    """
    alone = [fuse(p, e) for p, e in zip(predictions, evidence, strict=True)]
    if len(alone) == 1:
        return tuple(alone)
    shared = _share_sky(predictions)
    known = _share_time(evidence)
    turns, noise = _relative_headings(known, headings)
    if known[0].candidates:
        answers = _on_rings(shared, known, turns, noise)
    elif turns is not None:
        answers = [on_grid(p, e, q) for p, e, q in zip(shared, known, _in_one_frame(shared, turns, noise), strict=True)]
    else:
        answers = _with_unknown_headings(shared, known)
    by_compass = turns is not None and headings is None
    return tuple(
        replace(a, warnings=single.warnings, used=_used(a, by_compass))
        for a, single in zip(answers, alone, strict=True)
    )


def _used(fused: Fused, by_compass: bool) -> tuple[str, ...]:
    """What counts for the answer; compass headings also where they only say how the photos lie to each other."""
    used = {*fused.used, "other photos", *(["heading"] if by_compass else [])}
    return tuple(name for name in EVIDENCE if name in used)


def read_headings(text: str) -> list[float]:
    """Degrees in "0,45,90", as `together` takes them; ParameterError otherwise."""
    try:
        headings = [float(part) for part in text.split(",")]
    except ValueError as error:
        raise ParameterError(f"{text!r} is not a list of degrees such as 0,45,90.") from error
    for angle in headings:
        check_range("heading", angle, -360.0, 360.0)
    return headings


def check_headings(photos: int, headings: Sequence[float] | None) -> None:
    """Raise ParameterError unless there is one heading for each of several photos, or none at all."""
    if headings is not None and photos == 1:
        raise ParameterError("headings are those of several photos; one photo has a heading.")
    if headings is not None and len(headings) != photos:
        raise ParameterError(f"There are {len(headings)} headings for {photos} photos.")


def check_heading(photos: int, heading: float | None) -> None:
    """Raise ParameterError where the one heading is given for several photos."""
    if heading is not None and photos > 1:
        raise ParameterError("heading is that of one photo; photos taken together have headings.")


def power(count: int, correlation: float) -> float:
    """Exponent of each of `count` distributions whose errors correlate."""
    return 1.0 / (1.0 + (count - 1) * correlation)


def _share_sky(predictions: Sequence[Prediction]) -> list[Prediction]:
    """The predictions with their common turbidity and exposure: geometric means."""
    logs = np.log([[max(p.turbidity, _LOWEST), max(p.exposure, _LOWEST)] for p in predictions])
    turbidity, exposure = map(float, np.exp(logs.mean(axis=0)))
    return [replace(p, turbidity=turbidity, exposure=exposure) for p in predictions]


def _share_time(evidence: Sequence[Evidence]) -> list[Evidence]:
    """The evidence with only candidates with the sun up in every photo, all of one number."""
    first = next((e.candidates for e in evidence if e.candidates), ())
    given = [e.candidates or first for e in evidence]
    if len({len(c) for c in given}) > 1:
        raise ParameterError("The times of photos taken together must all have a zone, or none.")
    up = [k for k in range(len(first)) if all(c[k][0] >= 0.0 for c in given)]
    if first and not up:
        raise ParameterError("In one of the photos the sun is below the horizon whatever the zone.")
    return [replace(e, candidates=tuple(c[k] for k in up)) for e, c in zip(evidence, given, strict=True)]


def _relative_headings(evidence: Sequence[Evidence], headings: Sequence[float] | None) -> tuple[Floats | None, float]:
    """Headings (n,) in one frame, or None, and their noise [deg]."""
    if headings is not None:
        check_headings(len(evidence), headings)
        return np.array(headings, dtype=np.float64), 0.0
    compass = [e.heading for e in evidence if e.heading is not None]
    return (np.array(compass), TURN_NOISE) if len(compass) == len(evidence) else (None, 0.0)


def _in_one_frame(predictions: Sequence[Prediction], turns: Floats, noise: float) -> list[Floats]:
    """Probabilities (N,) of each photo over its own cells, all photos counted."""
    layout = predictions[0].spec.sun_grid
    exponent = power(len(predictions), CORRELATION)
    blurred = [_with_noise_on_grid(p, noise) for p in predictions]
    answers = []
    for own in turns:
        seen = [seen_from(q, own - turn, layout) for q, turn in zip(blurred, turns, strict=True)]
        log = exponent * np.sum(np.log(np.maximum(seen, _LOWEST)), axis=0)
        weight = np.exp(log - log.max()) * grid_solid_angle(layout)
        answers.append(weight / weight.sum())
    return answers


def _with_noise_on_grid(prediction: Prediction, noise: float) -> Floats:
    """Probabilities (N,) over the prediction's cells after an error of its heading [deg], which may be gross."""
    if not noise:
        return prediction.sun_probability
    layout = prediction.spec.sun_grid
    weight = np.exp(-0.5 * np.square(_BLUR_STEPS))
    seen = [seen_from(prediction.sun_probability, noise * step, layout) for step in _BLUR_STEPS]
    near = weight @ np.array(seen) / weight.sum()
    anywhere = elevation_density(prediction, angles(grid_directions(layout))[1])
    density = (1 - GROSS_ERRORS) * near + GROSS_ERRORS * anywhere
    return np.asarray(density * grid_solid_angle(layout))


def seen_from(probability: Floats, turn: float, layout: str) -> Floats:
    """The density (N,) at the cells of a camera that is turned by `turn` [deg] clockwise from the probability's."""
    azimuth, elevation = angles(grid_directions(layout))
    return smooth_density(probability, direction(azimuth + turn, elevation), layout)


def ring_of(prediction: Prediction, elevation: float, turn: float) -> Floats:
    """The density (360,) along an elevation [deg], by azimuth from 0 to 359, as `seen_from` gives that of the cells."""
    suns = direction(HEADINGS + turn, elevation)
    return smooth_density(prediction.sun_probability, suns, prediction.spec.sun_grid)


def _on_rings(
    predictions: Sequence[Prediction], evidence: Sequence[Evidence], turns: Floats | None, noise: float
) -> list[Fused]:
    """The answers where time and place are known."""
    density = [ring_density(p, daylight(e)) for p, e in zip(predictions, evidence, strict=True)]
    prior = [compass_prior(e) for e in evidence]
    if turns is None:
        weights = _share_zone(density, prior)
    else:
        weights = _share_heading([_with_noise(d, noise) for d in density], prior, turns)
    return [on_rings(p, e, w) for p, e, w in zip(predictions, evidence, weights, strict=True)]


def _share_zone(density: Sequence[Floats], prior: Sequence[Floats]) -> list[Floats]:
    """Weights (K, 360) of each photo when only the candidates are common."""
    joint = [d * p for d, p in zip(density, prior, strict=True)]
    mass = [np.maximum(j.sum(axis=1, keepdims=True), _LOWEST) for j in joint]
    zone = np.exp(power(len(joint), ELEVATION_CORRELATION) * np.sum(np.log(mass), axis=0))
    return [j / m * zone for j, m in zip(joint, mass, strict=True)]


def _with_noise(density: Floats, noise: float) -> Floats:
    """Densities (K, 360) after an error of the heading [deg], which may be gross."""
    if not noise:
        return density
    anywhere = density.mean(axis=1, keepdims=True)
    return np.asarray((1 - GROSS_ERRORS) * blur(density, noise) + GROSS_ERRORS * anywhere)


def _share_heading(density: Sequence[Floats], prior: Sequence[Floats], turns: Floats) -> list[Floats]:
    """Weights (K, 360) of each photo when one heading gives all; compass errors are shared, so priors are averaged."""
    exponent = power(len(turns), AZIMUTH_CORRELATION)
    compasses = max(1, sum(p.min() < p.max() for p in prior))
    log = np.sum(
        [
            _turned(exponent * np.log(np.maximum(d, _LOWEST)) + np.log(p) / compasses, turn)
            for d, p, turn in zip(density, prior, turns, strict=True)
        ],
        axis=0,
    )
    weight = np.exp(log - np.max(log))
    return [_turned(weight, -turn) for turn in turns]


def _turned(value: Floats, turn: float) -> Floats:
    """Values (..., 360) over HEADINGS as functions of the heading less `turn` [deg]."""
    at = (HEADINGS + turn) % 360.0
    low = np.floor(at).astype(int)
    share = at - low
    return np.asarray((1 - share) * value[..., low % 360] + share * value[..., (low + 1) % 360])


def _with_unknown_headings(predictions: Sequence[Prediction], evidence: Sequence[Evidence]) -> list[Fused]:
    """The answers where no more than the sun's elevation is common; headings relative to the first photo follow."""
    layout = predictions[0].spec.sun_grid
    cells = angles(grid_directions(layout))[1]
    own = [np.maximum(elevation_density(p, cells), _LOWEST) for p in predictions]
    common = np.exp(power(len(own), ELEVATION_CORRELATION) * np.sum(np.log(own), axis=0))
    weights = [p.sun_probability * common / m for p, m in zip(predictions, own, strict=True)]
    answers = [on_grid(p, e, w / w.sum()) for p, e, w in zip(predictions, evidence, weights, strict=True)]
    return [replace(a, relative_heading=_relative(answers[0], a)) for a in answers]


def elevation_density(prediction: Prediction, elevation: Floats) -> Floats:
    """Density [1/sr] (N,) at elevations (N,) [deg], averaged over azimuth."""
    layout = prediction.spec.sun_grid
    cells = angles(grid_directions(layout))[1]
    weight = np.exp(-0.5 * ((elevation[:, None] - cells) / _ELEVATION_SPREAD) ** 2)
    return np.asarray(weight @ prediction.sun_probability / (weight @ grid_solid_angle(layout)))


def _relative(first: Fused, other: Fused) -> Heading:
    """How far the other camera is turned from the first, from where both see the one sun."""
    azimuths = [_azimuths(fused) for fused in (first, other)]
    return heading(correlate(*azimuths))


def _azimuths(fused: Fused) -> Floats:
    """Probability (360,) of the sun's azimuth over whole degrees, smoothed by the size of a cell."""
    azimuth = np.round(angles(fused.directions)[0]).astype(int) % 360
    return blur(np.bincount(azimuth, fused.probability, 360).astype(np.float64), _ELEVATION_SPREAD)

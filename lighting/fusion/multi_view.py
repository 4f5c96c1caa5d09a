"""Posterior of several photos of one place.

Crops of one scene share its misleading sides, so the errors of the network are alike: n photos count as fewer. Each is
raised to a power that overlap.py gives.
"""

import reprlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lighting.circular import (
    HEADINGS,
    Heading,
    blur_headings,
    circular_correlation,
    circular_mean,
    heading_from_probability,
    von_mises,
)
from lighting.decoding import light_from_vector, light_to_vector, predicted_sun_elevation
from lighting.errors import ErrorCode, ParameterError
from lighting.fusion.likelihood import (
    AZIMUTH_CORRELATION,
    ELEVATION_KERNEL_STD,
    SUN_CORRELATION,
    SUN_MOTION_SCALE,
    blur_grid_heading,
    blur_ring_heading,
    effective_weights,
    elevation_density,
    optical_axes,
    pool_log_likelihoods,
    pooling_exponent,
    rotate_density,
)
from lighting.fusion.single_view import (
    COMPASS_OUTLIER_RATE,
    Observations,
    Posterior,
    candidates_above_horizon,
    compass_prior,
    daylight_candidates,
    fuse_gravity,
    fuse_with_gravity,
    likelihood_by_heading,
    posterior_on_grid,
    posterior_on_rings,
)
from lighting.geometry import Floats, angle_between, angles, direction, up_in_camera, wrap_azimuth
from lighting.records import CodedWarning, EvidenceKind, Light, Prediction, SunEstimate, WarningCode
from lighting.sun_grid import grid_directions, grid_solid_angle
from lighting.validation import check_range, is_finite

if TYPE_CHECKING:
    from lighting.registration.photo_set import RegisteredView

# Which photos taken together share a frame, and how they are turned in it.

_MATCH_OUTLIER_RATE = (
    0.01  # share of the turns by matches that are useless; `export report photo-sets` found none in 75 pairs
)
_MAX_UP_DISAGREEMENT = (
    25.0  # deg between two verticals, five times what nine of ten photos err in their camera's elevation
)
RELATIVE_HEADING_STD = (
    10.0  # deg, spread of the turn between two compass headings of one phone, whose larger error is shared
)


@dataclass(frozen=True, eq=False)
class _Frames:
    """How photos are turned: those of one group against each other, and nothing between the groups."""

    group: NDArray[np.intp]  # (n,) number of each photo's group
    turn: Floats  # (n,) deg clockwise from the group's zero
    noise: Floats  # (n,) deg, one standard deviation of that
    useless: float = 0.0  # share of the turns that say nothing, whatever their standard deviation
    source: EvidenceKind | None = None  # HEADING by compass, TURNS by matches

    def members(self) -> list[NDArray[np.intp]]:
        """The photos (m,) of each group."""
        return [np.flatnonzero(self.group == number) for number in np.unique(self.group)]

    def part(self, own: NDArray[np.intp]) -> "_Frames":
        """The same of some photos alone."""
        return replace(self, group=self.group[own], turn=self.turn[own], noise=self.noise[own])

    def has_company(self, photo: int) -> bool:
        """Whether something connects this photo with another one."""
        return bool(np.count_nonzero(self.group == self.group[photo]) > 1)

    def heading_of_first(self, photo: int) -> float | None:
        """Deg clockwise from the first photo to this one; None where they are of two groups."""
        same = self.group[photo] == self.group[0]
        return float(self.turn[photo] - self.turn[0]) if same else None


def _contrary_up(prediction: Prediction, placed: "RegisteredView") -> tuple[str, ...]:
    """A warning where the photo alone has up elsewhere than what it has in common with the others."""
    angles = ((p.camera_elevation, p.camera_roll) for p in (prediction, placed))
    apart = float(angle_between(*(up_in_camera(*tilt) for tilt in angles)))
    if apart < _MAX_UP_DISAGREEMENT:
        return ()
    return (
        f"Alone it has up {apart:.0f}° from where the photos have it together: one of them may lie on its side, "
        "and the turns may be wrong.",
    )


def check_headings(photos: int, headings: Sequence[float] | None) -> None:
    """Raise ParameterError unless there is one heading, a finite number, for each of several photos, or none at all."""
    if not isinstance(headings, Sequence | np.ndarray | None):
        sentence = f"headings are a list of degrees, not {reprlib.repr(headings)}."
        raise ParameterError(sentence, "headings", ErrorCode.WRONG_TYPE)
    if headings is not None and photos == 1:
        sentence = "headings are those of several photos; one photo has a heading."
        raise ParameterError(sentence, "headings", ErrorCode.CONTRADICTION)
    if headings is not None and len(headings) != photos:
        sentence = f"{photos} photos need {photos} headings, not {len(headings)}."
        raise ParameterError(sentence, "headings", ErrorCode.CONTRADICTION)
    for one in () if headings is None else headings:
        if not is_finite(one.item() if isinstance(one, np.generic) else one):
            sentence = f"A heading must be a finite number, not {reprlib.repr(one)}."
            raise ParameterError(sentence, "headings", ErrorCode.WRONG_TYPE)


def check_heading(photos: int, heading: float | None) -> None:
    """Raise ParameterError where the one heading is given for several photos."""
    if heading is not None and photos > 1:
        sentence = "heading is that of one photo; photos taken together have headings."
        raise ParameterError(sentence, "heading", ErrorCode.CONTRADICTION)


def read_headings(text: str) -> list[float]:
    """Degrees in "0,45,90", as `together` takes them; ParameterError otherwise."""
    try:
        headings = [float(part) for part in text.split(",")]
    except ValueError as error:
        sentence = f"{text!r} is not a list of degrees such as 0,45,90."
        raise ParameterError(sentence, "headings", ErrorCode.MALFORMED) from error
    for angle in headings:
        check_range("headings", angle, -360.0, 360.0, "A heading")
    return headings


def _frames(
    evidence: Sequence[Observations], headings: Sequence[float] | None, placed: "Sequence[RegisteredView] | None" = None
) -> _Frames:
    """By exact headings [deg] if given; else by matches, by compass headings where all have one, or unknown.

    Compass headings bring groups that matches left apart into one frame.
    """
    count = len(evidence)
    together = np.zeros(count, dtype=np.intp)
    compass = [e.heading for e in evidence if e.heading is not None]
    if headings is not None:
        check_headings(count, headings)
        return _Frames(together, np.array(headings, dtype=np.float64), np.zeros(count))
    if placed is not None and len({p.group for p in placed}) < count:
        matched = _frames_by_matches(placed)
        return _joined(matched, np.array(compass)) if len(compass) == count and matched.group.any() else matched
    if len(compass) == count:
        return _Frames(
            together,
            np.array(compass),
            np.full(count, RELATIVE_HEADING_STD),
            COMPASS_OUTLIER_RATE,
            EvidenceKind.HEADING,
        )
    return _Frames(np.arange(count), np.zeros(count), np.zeros(count))


def _frames_by_matches(placed: "Sequence[RegisteredView]") -> _Frames:
    group, turn, noise = ([getattr(p, name) for p in placed] for name in ("group", "heading", "heading_std"))
    return _Frames(
        np.array(group, dtype=np.intp), np.array(turn), np.array(noise), _MATCH_OUTLIER_RATE, EvidenceKind.TURNS
    )


def _joined(matched: _Frames, compass: Floats) -> _Frames:
    """One frame of all groups: each is turned as its compasses say in the mean."""
    turn, noise = matched.turn.copy(), matched.noise.copy()
    for own in matched.members():
        turn[own] += circular_mean(wrap_azimuth(compass[own] - matched.turn[own]))
        noise[own] = np.hypot(noise[own], RELATIVE_HEADING_STD / np.sqrt(len(own)))
    return _Frames(np.zeros_like(matched.group), turn, noise, COMPASS_OUTLIER_RATE, EvidenceKind.TURNS)


# Several photos of one place and light: their distributions in one frame, multiplied with a discount.

ELEVATION_CORRELATION = 0.6  # of the sun's elevation alone; by `python -m export evaluate --with-metadata`

_APART = CodedWarning(
    "Nothing in the photos that overlap with it was found in the first photo: how it is turned against that one is "
    "inferred from their light alone.",
    WarningCode.TURN_INFERRED,
)
_LOWEST = 1e-12  # density that stands for none
_BIN_SPREAD = 0.5  # deg, least spread of a heading over whole degrees


def fuse_views(
    predictions: Sequence[Prediction],
    evidence: Sequence[Observations],
    headings: Sequence[float] | None = None,
    placed: "Sequence[RegisteredView] | None" = None,
) -> tuple[Posterior, ...]:
    """One answer a photo, in its own camera's frame, for two or more photos of one place and light.

    `headings` [deg, clockwise from any common direction] are exact; without them `placed` says how matches turn the
    photos, compass headings are used where all have one, and else relative headings are unknown. A photo without time
    takes the candidates of the first that has one. Times may differ (a time-lapse): then candidate k of each photo is
    the sun in the same zone k.
    """
    stood = [fuse_gravity(p, e) for p, e in zip(predictions, evidence, strict=True)]
    alone = [fuse_with_gravity(s) for s in stood]
    predictions, evidence = [s.prediction for s in stood], [s.observations for s in stood]
    turns = _frames(evidence, headings, placed)
    shared = _share_sky(_as_matched(predictions, placed) if placed else predictions)
    known = _share_time(evidence)
    said = float(np.mean([predicted_sun_elevation(p) for p in predictions]))  # as of their light, the mean
    answers = _on_rings(shared, known, turns) if known[0].candidates else _on_cells(shared, known, turns)
    return tuple(
        replace(
            a,
            warnings=(*single.warnings, *_match_warnings(i, predictions[i], turns, placed)),
            used=_used(a, turns.source if turns.has_company(i) else None),
            predicted_sun_elevation=said,
        )
        for i, (a, single) in enumerate(zip(answers, alone, strict=True))
    )


def _as_matched(predictions: Sequence[Prediction], placed: "Sequence[RegisteredView]") -> list[Prediction]:
    """The predictions with the lens and the levels that matches reveal."""
    return [
        p
        if m.vertical_fov is None
        else replace(p, vertical_fov=m.vertical_fov, camera_elevation=m.camera_elevation, camera_roll=m.camera_roll)
        for p, m in zip(predictions, placed, strict=True)
    ]


def _match_warnings(
    photo: int, prediction: Prediction, turns: _Frames, placed: "Sequence[RegisteredView] | None"
) -> tuple[str, ...]:
    """A warning where matching left this photo or its group alone, or contradicts what is up in it."""
    if placed is None:
        return ()
    if not turns.has_company(photo):
        sentence = "Nothing in it was found in the other photos: how it is turned is inferred from its light alone."
        return (CodedWarning(sentence, WarningCode.TURN_INFERRED),)
    apart = () if turns.heading_of_first(photo) is not None else (_APART,)
    return (*apart, *_contrary_up(prediction, placed[photo]))


def _used(fused: Posterior, source: EvidenceKind | None) -> tuple[EvidenceKind, ...]:
    """What counts for the answer; compass headings also where they only say how the photos lie to each other."""
    used = {*fused.used, EvidenceKind.OTHER_PHOTOS, source}
    return tuple(kind for kind in EvidenceKind if kind in used)


def _share_sky(predictions: Sequence[Prediction]) -> list[Prediction]:
    """The predictions with their common turbidity, exposure and irradiances, geometric means, and their mean cover."""
    logs = np.log([[max(p.turbidity, _LOWEST), max(p.exposure, _LOWEST)] for p in predictions])
    turbidity, exposure = map(float, np.exp(logs.mean(axis=0)))
    light = _common_light([p.light for p in predictions])
    return [
        replace(p, turbidity=turbidity, exposure=exposure, light=light and _own(light, p.light)) for p in predictions
    ]


def _common_light(lights: Sequence[Light | None]) -> Light | None:
    """The mean of lights; None unless every photo has one."""
    known = [light_to_vector(light) for light in lights if light is not None]
    return light_from_vector(np.mean(known, axis=0)) if len(known) == len(lights) else None


def _own(common: Light, own: Light | None) -> Light:
    """The common light with what one photo alone tells: whether it is suitable, and the place all around."""
    return common if own is None else replace(common, suitable=own.suitable, around=own.around)


def _share_time(evidence: Sequence[Observations]) -> list[Observations]:
    """The evidence with only candidates with the sun up in every photo, all of one number."""
    first = next((e.candidates for e in evidence if e.candidates), ())
    given = [e.candidates or first for e in evidence]
    if len({len(c) for c in given}) > 1:
        raise ParameterError(
            "The times of photos taken together must all have a zone, or none.", code=ErrorCode.CONTRADICTION
        )
    up = daylight_candidates(given)
    if first and not up:
        raise ParameterError(
            "Whatever the zone of their times, the sun is below the horizon in one of the photos.", code=ErrorCode.NIGHT
        )
    return [replace(e, candidates=tuple(c[k] for k in up)) for e, c in zip(evidence, given, strict=True)]


def _on_cells(predictions: Sequence[Prediction], evidence: Sequence[Observations], turns: _Frames) -> list[Posterior]:
    """The answers where no time is known: each group in its frame, and one elevation for all groups."""
    weights: dict[int, Floats] = {}
    for own in turns.members():
        found = _in_one_frame([predictions[i] for i in own], turns.part(own))
        weights |= dict(zip(own.tolist(), found, strict=True))
    in_order = _share_elevation(predictions, [weights[i] for i in range(len(predictions))], turns)
    apart = [posterior_on_grid(p, e, w) for p, e, w in zip(predictions, evidence, in_order, strict=True)]
    answers = [replace(a, sun=_sun_of_group(i, apart, turns)) for i, a in enumerate(apart)]
    if turns.source != EvidenceKind.TURNS and not turns.group.any():
        return answers
    return [replace(a, relative_heading=_relative(i, answers, turns)) for i, a in enumerate(answers)]


def _sun_of_group(photo: int, answers: Sequence[Posterior], turns: _Frames) -> SunEstimate:
    """The sun of the group's first photo as this one sees it: cells that lie otherwise would put it a little aside."""
    first = int(np.flatnonzero(turns.group == turns.group[photo])[0])
    sun = answers[first].sun
    return replace(sun, azimuth=float(wrap_azimuth(sun.azimuth + turns.turn[first] - turns.turn[photo])))


def _share_elevation(predictions: Sequence[Prediction], weights: Sequence[Floats], turns: _Frames) -> list[Floats]:
    """The probabilities (N,) of all photos with the elevation that every group says something of."""
    if not turns.group.any():
        return list(weights)
    cells = angles(grid_directions(predictions[0].spec.sun_grid))[1]
    firsts = [int(own[0]) for own in turns.members()]
    said = [replace(predictions[i], sun_probability=weights[i]) for i in firsts]
    own = {turns.group[i]: np.maximum(elevation_density(p, cells), _LOWEST) for i, p in zip(firsts, said, strict=True)}
    common = np.exp(pooling_exponent(len(own), ELEVATION_CORRELATION) * np.sum(np.log(list(own.values())), axis=0))
    shared = [w * common / own[g] for w, g in zip(weights, turns.group, strict=True)]
    return [w / w.sum() for w in shared]


def _in_one_frame(predictions: Sequence[Prediction], turns: _Frames) -> list[Floats]:
    """Probabilities (N,) of each photo of one group over its own cells, all photos counted."""
    if len(predictions) == 1:
        return [predictions[0].sun_probability]
    layout = predictions[0].spec.sun_grid
    exponent = effective_weights(*optical_axes(predictions, turns.turn), SUN_CORRELATION)
    blurred = [blur_grid_heading(p, float(n), turns.useless) for p, n in zip(predictions, turns.noise, strict=True)]
    answers = []
    for own in turns.turn:
        seen = [rotate_density(q, own - turn, layout) for q, turn in zip(blurred, turns.turn, strict=True)]
        answers.append(
            pool_log_likelihoods(np.log(np.maximum(seen, _LOWEST)), exponent, SUN_CORRELATION, grid_solid_angle(layout))
        )
    return answers


def _on_rings(predictions: Sequence[Prediction], evidence: Sequence[Observations], turns: _Frames) -> list[Posterior]:
    """The answers where time and place are known: each group in its frame, and one zone for all groups."""
    density = [
        likelihood_by_heading(p, candidates_above_horizon(e)) for p, e in zip(predictions, evidence, strict=True)
    ]
    prior = [compass_prior(e) for e in evidence]
    weights: dict[int, Floats] = {}
    for own in turns.members():
        noisy = [blur_ring_heading(density[i], float(turns.noise[i]), turns.useless) for i in own]
        alike = _likeness([evidence[i] for i in own])
        exponent = effective_weights(
            *optical_axes([predictions[i] for i in own], turns.turn[own]), AZIMUTH_CORRELATION, alike
        )
        found = _share_heading(noisy, [prior[i] for i in own], turns.turn[own], exponent)
        weights |= dict(zip(own.tolist(), found, strict=True))
    in_order = _share_zone([weights[i] for i in range(len(weights))], turns)
    return [posterior_on_rings(p, e, w) for p, e, w in zip(predictions, evidence, in_order, strict=True)]


def _likeness(evidence: Sequence[Observations]) -> Floats:
    """How alike the light of photos is (n, n), by how far their suns lie apart."""
    suns = direction([e.candidates[0][1] for e in evidence], [e.candidates[0][0] for e in evidence])
    return np.asarray(np.exp(-angle_between(suns[:, None], suns[None]) / SUN_MOTION_SCALE))


def _share_zone(weights: Sequence[Floats], turns: _Frames) -> list[Floats]:
    """Weights (K, 360) of each photo when the groups have no more than the candidates in common."""
    mass = [np.maximum(w.sum(axis=1, keepdims=True), _LOWEST) for w in weights]
    firsts = [int(own[0]) for own in turns.members()]
    zone = np.exp(
        pooling_exponent(len(firsts), ELEVATION_CORRELATION) * np.sum(np.log([mass[i] for i in firsts]), axis=0)
    )
    return [w / m * zone for w, m in zip(weights, mass, strict=True)]


def _share_heading(density: Sequence[Floats], prior: Sequence[Floats], turns: Floats, exponent: Floats) -> list[Floats]:
    """Weights (K, 360) of each photo when one heading gives all; compass errors are shared, so priors are averaged."""
    compasses = max(1, sum(p.min() < p.max() for p in prior))
    log = np.stack([_turned(np.log(np.maximum(d, _LOWEST)), turn) for d, turn in zip(density, turns, strict=True)])
    compass = np.sum([_turned(np.log(p) / compasses, turn) for p, turn in zip(prior, turns, strict=True)], axis=0)
    weight = pool_log_likelihoods(log, exponent, AZIMUTH_CORRELATION) * np.exp(compass - compass.max())
    return [_turned(weight, -turn) for turn in turns]


def _turned(value: Floats, turn: float) -> Floats:
    """Values (..., 360) over HEADINGS as functions of the heading less `turn` [deg]."""
    at = (HEADINGS + turn) % 360.0
    low = np.floor(at).astype(int)
    share = at - low
    return np.asarray((1 - share) * value[..., low % 360] + share * value[..., (low + 1) % 360])


def _relative(photo: int, answers: Sequence[Posterior], turns: _Frames) -> Heading:
    """How far a camera is turned from the first: as matched, or from where both see the one sun."""
    turn = turns.heading_of_first(photo) if turns.source == EvidenceKind.TURNS else None
    if turn is None:
        return heading_from_probability(circular_correlation(_azimuths(answers[0]), _azimuths(answers[photo])))
    bell = von_mises(HEADINGS - turn, max(float(turns.noise[photo]), _BIN_SPREAD))
    return replace(heading_from_probability(bell / bell.sum()), best=turn % 360.0)


def _azimuths(fused: Posterior) -> Floats:
    """Probability (360,) of the sun's azimuth over whole degrees, smoothed by the size of a cell."""
    azimuth = np.round(angles(fused.directions)[0]).astype(int) % 360
    return blur_headings(np.bincount(azimuth, fused.probability, 360).astype(np.float64), ELEVATION_KERNEL_STD)

"""Posterior of several photos of one scene and light.

Each group of photos that match each other has a frame; compasses join the groups. Views are rotated, blurred and
pooled with the weights of `pooling`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

import lighting.fusion.pooling as pooling
import lighting.fusion.single_view as single_view
import lighting.sun_grid as sun_grid
from lighting.calibration import up_in_camera
from lighting.decoding import light_from_vector, light_to_vector
from lighting.errors import CodedWarning, ErrorCode, ParameterError, WarningCode
from lighting.fusion.pooling import AZIMUTH_CORRELATION, ELEVATION_KERNEL_STD, MIN_POOLED_DENSITY, SUN_CORRELATION
from lighting.fusion.single_view import Observations, Posterior, posterior_on_grid, posterior_on_rings
from lighting.fusion.user_input import check_headings
from lighting.geometry import Floats, angle_between, angles, direction, wrap_azimuth
from lighting.prediction import Prediction, SunEstimate
from lighting.records import EvidenceKind

if TYPE_CHECKING:
    from lighting.registration.photo_set import RegisteredView

    Views = Sequence[RegisteredView]


_ELEVATION_CORRELATION = 0.6  # of the sun's elevation alone; by `python -m export evaluate --with-metadata`
_RELATIVE_HEADING_STD = 10.0  # deg between two compass headings of one phone, whose larger error is shared
_MIN_HEADING_STD = 0.5  # deg, of a heading over whole degrees
_MATCH_OUTLIER_RATE = 0.01  # share of useless rotations by matches; there were none in 75 pairs
_MAX_UP_DISAGREEMENT = 25.0  # deg, five times what nine of ten photos err in their camera's elevation
_SUN_MOTION_SCALE = 30.0  # deg of the sun's motion after which the same view is another witness

_SEPARATE_GROUP = CodedWarning(
    "It does not overlap the first photo: only light says where it points.", WarningCode.TURN_INFERRED
)
_SEPARATE_PHOTO = CodedWarning(
    "It overlaps no other photo: only light says where it points.", WarningCode.TURN_INFERRED
)


def fuse_views(
    predictions: Sequence[Prediction],
    observations: Sequence[Observations],
    headings: Sequence[float] | None = None,
    views: "Views | None" = None,
) -> tuple[Posterior, ...]:
    """Fuse two or more photos of one scene and light; one posterior a photo, in its own camera's frame.

    A photo without time takes the candidates of the first that has one. Times may differ (a time-lapse): then
    candidate k of each photo is the sun in the same zone k.

    Args:
        predictions: of n photos.
        observations: of the same photos.
        headings: n exact ones, deg clockwise from any common direction; None where they are not stated.
        views: the photos as registration places them, used without headings. Without them compass headings are used
            where all photos have one, and else relative headings are unknown.

    Raises:
        ParameterError: headings are not one a photo; only some times have a zone; the sun is below the horizon.
    """
    leveled = [single_view.fuse_gravity(p, o) for p, o in zip(predictions, observations, strict=True)]
    singles = [single_view.fuse_with_gravity(one) for one in leveled]
    predictions, observations = [one.prediction for one in leveled], [one.observations for one in leveled]
    frames = _frames(observations, headings, views)
    shared = _share_sky(_with_registered_cameras(predictions, views) if views else predictions)
    timed = _share_time(observations)
    elevation = float(np.mean([angles(p.sun_direction)[1] for p in predictions]))  # as of their light, the mean
    posteriors = (_fuse_on_rings if timed[0].candidates else _fuse_on_grid)(shared, timed, frames)
    fused = []
    for i, (posterior, single) in enumerate(zip(posteriors, singles, strict=True)):
        warnings = (*single.warnings, *_match_warnings(i, predictions[i], frames, views))
        used = {*posterior.used, EvidenceKind.OTHER_PHOTOS, frames.source if frames.is_connected(i) else None}
        kinds = tuple(kind for kind in EvidenceKind if kind in used)  # a compass also where it tells turns alone
        fused.append(replace(posterior, warnings=warnings, used=kinds, predicted_sun_elevation=elevation))
    return tuple(fused)


# Which photos share a frame, and their headings in it.


@dataclass(frozen=True, eq=False)
class _Frames:
    """Headings of photos within their groups; nothing is known between the groups."""

    group: NDArray[np.intp]  # (n,) number of each photo's group
    heading: Floats  # (n,) deg clockwise from the group's zero
    heading_std: Floats  # (n,) deg, one standard deviation of that
    outlier_rate: float = 0.0  # share of the headings that say nothing, whatever their standard deviation
    source: EvidenceKind | None = None  # HEADING by compass, TURNS by matches

    def members(self) -> list[NDArray[np.intp]]:
        """The photos (m,) of each group."""
        return [np.flatnonzero(self.group == number) for number in np.unique(self.group)]

    def by_photo(self, pool: Callable[[NDArray[np.intp]], list[Floats]]) -> list[Floats]:
        """What a function of the photos (m,) of a group gives each of them, in the order of all photos."""
        pooled = {photo: one for group in self.members() for photo, one in zip(group, pool(group), strict=True)}
        return [pooled[photo] for photo in range(len(self.group))]

    def subset(self, photos: NDArray[np.intp]) -> "_Frames":
        """The same of some photos alone."""
        heading, std = self.heading[photos], self.heading_std[photos]
        return replace(self, group=self.group[photos], heading=heading, heading_std=std)

    def is_connected(self, photo: int) -> bool:
        """Whether something connects this photo with another one."""
        return bool(np.count_nonzero(self.group == self.group[photo]) > 1)

    def heading_of_first(self, photo: int) -> float | None:
        """Deg clockwise from the first photo to this one; None where they are of two groups."""
        return float(self.heading[photo] - self.heading[0]) if self.group[photo] == self.group[0] else None


def _frames(
    observations: Sequence[Observations], headings: Sequence[float] | None, views: "Views | None" = None
) -> _Frames:
    """By exact headings [deg] if stated; else by matches, by compass headings where all have one, or unknown.

    Compass headings bring groups that matches leave separate into one frame.
    """
    count = len(observations)
    one_group = np.zeros(count, dtype=np.intp)
    compass = [o.heading for o in observations if o.heading is not None]
    if headings is not None:
        check_headings(count, headings)
        return _Frames(one_group, np.array(headings, dtype=np.float64), np.zeros(count))
    if views is not None and len({view.group for view in views}) < count:
        group = np.array([view.group for view in views], dtype=np.intp)
        heading, std = np.array([view.heading for view in views]), np.array([view.heading_std for view in views])
        matched = _Frames(group, heading, std, _MATCH_OUTLIER_RATE, EvidenceKind.TURNS)
        can_join = len(compass) == count and matched.group.any()
        return _join_by_compass(matched, np.array(compass)) if can_join else matched
    if len(compass) == count:
        std = np.full(count, _RELATIVE_HEADING_STD)
        return _Frames(one_group, np.array(compass), std, single_view.COMPASS_OUTLIER_RATE, EvidenceKind.HEADING)
    return _Frames(np.arange(count), np.zeros(count), np.zeros(count))


def _join_by_compass(matched: _Frames, compass: Floats) -> _Frames:
    """One frame of all groups: each is rotated as its compasses say in the mean."""
    heading, std = matched.heading.copy(), matched.heading_std.copy()
    for group in matched.members():
        heading[group] += sun_grid.circular_mean(wrap_azimuth(compass[group] - matched.heading[group]))
        std[group] = np.hypot(std[group], _RELATIVE_HEADING_STD / np.sqrt(len(group)))
    return _Frames(np.zeros_like(matched.group), heading, std, single_view.COMPASS_OUTLIER_RATE, EvidenceKind.TURNS)


def _with_registered_cameras(predictions: Sequence[Prediction], views: "Sequence[RegisteredView]") -> list[Prediction]:
    """The predictions with the lens and the tilt that matches reveal."""
    return [
        p
        if v.vertical_fov is None
        else replace(p, vertical_fov=v.vertical_fov, camera_elevation=v.camera_elevation, camera_roll=v.camera_roll)
        for p, v in zip(predictions, views, strict=True)
    ]


def _match_warnings(photo: int, prediction: Prediction, frames: _Frames, views: "Views | None") -> tuple[str, ...]:
    """A warning where matching left this photo or its group alone, or contradicts what is up in it."""
    if views is None:
        return ()
    if not frames.is_connected(photo):
        return (_SEPARATE_PHOTO,)
    warnings = () if frames.heading_of_first(photo) is not None else (_SEPARATE_GROUP,)
    tilts = ((camera.camera_elevation, camera.camera_roll) for camera in (prediction, views[photo]))
    difference = float(angle_between(*(up_in_camera(*tilt) for tilt in tilts)))
    if difference < _MAX_UP_DISAGREEMENT:
        return warnings
    return (*warnings, f"Its up is {difference:.0f}° off that of the others: one may lie on its side.")


# What the photos share: one sky, one time zone.


def _share_sky(predictions: Sequence[Prediction]) -> list[Prediction]:
    """The predictions with their common turbidity, exposure and irradiances, geometric means, and their mean cover.

    There is no light unless every photo has one.
    """
    logs = np.log([[max(p.turbidity, MIN_POOLED_DENSITY), max(p.exposure, MIN_POOLED_DENSITY)] for p in predictions])
    turbidity, exposure = map(float, np.exp(logs.mean(axis=0)))
    common = [replace(p, turbidity=turbidity, exposure=exposure, light=None) for p in predictions]
    lights = [p.light for p in predictions if p.light is not None]
    if len(lights) < len(predictions):
        return common
    light = light_from_vector(np.mean(list(map(light_to_vector, lights)), axis=0))
    own = [replace(light, suitable=one.suitable, surroundings=one.surroundings) for one in lights]  # of one photo alone
    return [replace(p, light=light) for p, light in zip(common, own, strict=True)]


def _share_time(observations: Sequence[Observations]) -> list[Observations]:
    """The observations with only candidates with the sun up in every photo, all of one number."""
    timed = next((o for o in observations if o.candidates), Observations())
    first, weights = timed.candidates, timed.weights or (1.0,) * len(timed.candidates)
    candidates = [o.candidates or first for o in observations]
    if len({len(suns) for suns in candidates}) > 1:
        sentence = "The times of photos taken together must all have a zone, or none."
        raise ParameterError(sentence, code=ErrorCode.CONTRADICTION)
    up = single_view.daylight_candidates(candidates)
    if first and not up:
        sentence = "Whatever the zone of their times, the sun is below the horizon in one of the photos."
        raise ParameterError(sentence, code=ErrorCode.NIGHT)
    shared = tuple(weights[k] for k in up)
    each = zip(observations, candidates, strict=True)
    return [replace(o, candidates=tuple(suns[k] for k in up), weights=shared) for o, suns in each]


def _optical_axes(predictions: Sequence[Prediction], headings: Floats) -> tuple[Floats, Floats]:
    """Optical axes (n, 3) and vertical fields of view (n,) [deg] of views at headings (n,) [deg]."""
    elevation = [p.camera_elevation for p in predictions]
    return direction(headings, elevation), np.array([p.vertical_fov for p in predictions])


# Without a time: each group in its frame, and one elevation for all groups.


def _fuse_on_grid(predictions: list[Prediction], observations: list[Observations], frames: _Frames) -> list[Posterior]:
    """The posteriors where no time is known."""
    pooled = frames.by_photo(lambda group: _pool_on_grid([predictions[i] for i in group], frames.subset(group)))
    probability = _share_elevation(predictions, pooled, frames)
    fused = [replace(p, sun_probability=w) for p, w in zip(predictions, probability, strict=True)]
    alone = list(map(posterior_on_grid, fused, observations))
    posteriors = [replace(one, sun=_sun_of_group(i, alone, frames)) for i, one in enumerate(alone)]
    if frames.source != EvidenceKind.TURNS and not frames.group.any():
        return posteriors
    return [replace(one, relative_heading=_relative_heading(i, posteriors, frames)) for i, one in enumerate(posteriors)]


def _pool_on_grid(predictions: Sequence[Prediction], frames: _Frames) -> list[Floats]:
    """Probabilities (N,) of each photo of one group over its own cells, all photos counted."""
    if len(predictions) == 1:
        return [predictions[0].sun_probability]
    layout = predictions[0].spec.sun_grid
    area = sun_grid.grid_solid_angle(layout)
    weight = pooling.effective_weights(*_optical_axes(predictions, frames.heading), SUN_CORRELATION)
    errors = zip(predictions, frames.heading_std, strict=True)
    blurred = [pooling.blur_grid_heading(p, float(std), frames.outlier_rate) for p, std in errors]
    pooled = []
    for target in frames.heading:
        density = [pooling.rotate_density(p, target - h, layout) for p, h in zip(blurred, frames.heading, strict=True)]
        log_density = np.log(np.maximum(density, MIN_POOLED_DENSITY))
        pooled.append(pooling.pool_log_likelihoods(log_density, weight, SUN_CORRELATION, area))
    return pooled


def _share_elevation(predictions: Sequence[Prediction], probability: Sequence[Floats], frames: _Frames) -> list[Floats]:
    """The probabilities (N,) of all photos with the elevation that every group tells something of."""
    if not frames.group.any():
        return list(probability)
    cells = angles(sun_grid.grid_directions(predictions[0].spec.sun_grid))[1]
    firsts = [int(group[0]) for group in frames.members()]
    fused = {i: replace(predictions[i], sun_probability=probability[i]) for i in firsts}
    of_group = {frames.group[i]: pooling.elevation_density(p, cells) for i, p in fused.items()}
    of_group = {number: np.maximum(density, MIN_POOLED_DENSITY) for number, density in of_group.items()}
    exponent = pooling.pooling_exponent(len(of_group), _ELEVATION_CORRELATION)
    common = np.exp(exponent * np.sum(np.log(list(of_group.values())), axis=0))
    shared = [p * common / of_group[number] for p, number in zip(probability, frames.group, strict=True)]
    return [p / p.sum() for p in shared]


def _sun_of_group(photo: int, posteriors: Sequence[Posterior], frames: _Frames) -> SunEstimate:
    """The sun of the group's first photo in this one's frame: other cells would shift it a little."""
    first = int(np.flatnonzero(frames.group == frames.group[photo])[0])
    sun = posteriors[first].sun
    return replace(sun, azimuth=float(wrap_azimuth(sun.azimuth + frames.heading[first] - frames.heading[photo])))


def _relative_heading(photo: int, posteriors: Sequence[Posterior], frames: _Frames) -> sun_grid.Heading:
    """The camera's heading from the first one's: as matched, or from where both have the one sun."""
    heading = frames.heading_of_first(photo) if frames.source == EvidenceKind.TURNS else None
    if heading is None:
        azimuths = _azimuth_probability(posteriors[0]), _azimuth_probability(posteriors[photo])
        return sun_grid.heading_from_probability(sun_grid.circular_correlation(*azimuths))
    bell = sun_grid.von_mises(sun_grid.HEADINGS - heading, max(float(frames.heading_std[photo]), _MIN_HEADING_STD))
    return replace(sun_grid.heading_from_probability(bell / bell.sum()), best=heading % 360.0)


def _azimuth_probability(posterior: Posterior) -> Floats:
    """Probability (360,) of the sun's azimuth over whole degrees, smoothed by the size of a cell."""
    azimuth = np.round(angles(posterior.directions)[0]).astype(int) % 360
    by_degree = np.bincount(azimuth, posterior.probability, 360).astype(np.float64)
    return sun_grid.blur_headings(by_degree, ELEVATION_KERNEL_STD)


# With time and place: each group in its frame, and one zone for all groups.


def _fuse_on_rings(predictions: list[Prediction], observations: list[Observations], frames: _Frames) -> list[Posterior]:
    """The posteriors where time and place are known."""
    candidates, weights = zip(*map(single_view.candidates_above_horizon, observations), strict=True)
    likelihood = list(map(single_view.likelihood_by_heading, predictions, candidates))
    prior = [single_view.compass_prior(o) for o in observations]

    def pool(group: NDArray[np.intp]) -> list[Floats]:
        stds = frames.heading_std.tolist()
        blurred = [pooling.blur_ring_heading(likelihood[i], stds[i], frames.outlier_rate) for i in group]
        axes = _optical_axes([predictions[i] for i in group], frames.heading[group])
        suns = np.array([observations[i].candidates[0] for i in group])  # elevation and azimuth
        towards = direction(suns[:, 1], suns[:, 0])
        similarity = np.exp(-angle_between(towards[:, None], towards[None]) / _SUN_MOTION_SCALE)  # of their light
        weight = pooling.effective_weights(*axes, AZIMUTH_CORRELATION, similarity)
        return _pool_on_rings(blurred, [prior[i] for i in group], frames.heading[group], weight)

    shared = _share_zone(frames.by_photo(pool), frames)
    weighted = [w * of_suns[:, None] for w, of_suns in zip(shared, weights, strict=True)]
    return list(map(posterior_on_rings, predictions, observations, weighted))


def _pool_on_rings(likelihood: list[Floats], prior: list[Floats], headings: Floats, weight: Floats) -> list[Floats]:
    """Weights (K, 360) of each photo when one heading gives all; compass errors are shared, so priors are averaged."""
    compasses = max(1, sum(p.min() < p.max() for p in prior))
    logs = [np.log(np.maximum(density, MIN_POOLED_DENSITY)) for density in likelihood]
    log_likelihood = [_shift_headings(log, h) for log, h in zip(logs, headings, strict=True)]
    log_priors = [_shift_headings(np.log(p) / compasses, h) for p, h in zip(prior, headings, strict=True)]
    log_prior = np.sum(log_priors, axis=0)
    pooled = pooling.pool_log_likelihoods(np.stack(log_likelihood), weight, AZIMUTH_CORRELATION)
    posterior = pooled * np.exp(log_prior - log_prior.max())
    return [_shift_headings(posterior, -h) for h in headings]


def _share_zone(weights: Sequence[Floats], frames: _Frames) -> list[Floats]:
    """Weights (K, 360) of each photo when the groups have no more than the candidates in common."""
    mass = [np.maximum(w.sum(axis=1, keepdims=True), MIN_POOLED_DENSITY) for w in weights]
    firsts = [int(group[0]) for group in frames.members()]
    exponent = pooling.pooling_exponent(len(firsts), _ELEVATION_CORRELATION)
    zone = np.exp(exponent * np.sum(np.log([mass[i] for i in firsts]), axis=0))
    return [w / m * zone for w, m in zip(weights, mass, strict=True)]


def _shift_headings(values: Floats, rotation: float) -> Floats:
    """Values (..., 360) over HEADINGS as functions of the heading less `rotation` [deg]."""
    at = (sun_grid.HEADINGS + rotation) % 360.0
    low = np.floor(at).astype(int)
    share = at - low
    return np.asarray((1 - share) * values[..., low % 360] + share * values[..., (low + 1) % 360])

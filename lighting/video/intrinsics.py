"""The lens of a shot: its field of view, and how its focal length changes where it is zoomed.

The field of view is the user's, or what rotations, metadata and the network agree upon.

Keyframes tell whether a lens is zoomed at all. A rotation with a focal length for each must explain nearly all points,
and a rotation or a walk fewer (registration/two_view.py). If so, each frame's focal length by its keyframe's is
followed together with its rotation. Points of a picture that is divided by its zoom obey all that points of one lens
do.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lighting.geometry import Floats, zoomed_fov
from lighting.registration.features import Matches
from lighting.registration.rotations import cross_matrix, focal_from_fov, rays_through, rotation_about
from lighting.registration.two_view import RelativeRotation, estimate_rotation
from lighting.video.tracking import (
    GAP_KEYFRAMES,
    TRACKING_TOLERANCE,
    ClipMetadata,
    Keyframe,
    ShotObservations,
    TrackedFrame,
    match_keyframes,
)

MAX_PAIRS = 10  # of keyframes, from which the lens is learnt
MIN_PAIRS = 4  # fewer keyframes tell too little of the lens
MIN_MEDIAN_MOTION = 0.1  # half diagonals that points move, below which a rotation says nothing of the lens
NETWORK_FOV_STD = 5.0  # deg, one standard deviation of the network's field of view
_METADATA_FOV_STD = 2.5  # deg, of a focal length in the metadata: stabilisation crops the picture
MIN_ROTATION_SHARE = 0.5  # share of matches that agree with a rotation, below which it tells nothing of the lens
MAX_FOV_STDS = 3.0  # of the network's field of view, within which a walk is believed
MIN_FOV_STD = 0.4  # deg, below which a pair's own error is not believed

GUESSED_FOV_STD = 7.0  # deg, of the field of view before anything was followed
MIN_ZOOM_AGREEMENT = 0.5  # share of the points that must agree with a zoom, or the one of the frame before stays
MIN_ZOOMED_FRAMES = 0.9  # share of a shot's frames whose zoom must be told, or the answer says that it is not sure
FIRST_SECONDS = 1.0  # s of a shot, whose estimates tell the lens that it begins with
MIN_PAIR_AGREEMENT = 0.9  # share of the points that must agree with a zoom alone, where one pair of frames decides
_START_FACTORS = (1.0, 0.8, 1.25)  # times that lens, from where the zoom is followed: one far off is lost on the way
_ONE_LENS = 0.06  # logarithm of the ratio of two focal lengths up to which they may be those of one lens
_PASSES = 4  # the zoom is followed by the lens, and the lens known by the zoom
_REWEIGHTINGS = 8  # of re-weighting, from eight times the tolerance down to it
_SMOOTHING_WINDOW = 5  # frames that a parabola is fitted to; tracking trembles faster than hands do


def fit_fov(tracked: ShotObservations, clip: ClipMetadata) -> tuple[float, float]:
    """Fit a shot's vertical field of view: the user's, or what rotations, metadata and the network agree upon.

    Args:
        tracked: a shot that is not zoomed.
        clip: what is known of the clip.

    Returns:
        The field of view and its standard deviation, deg.
    """
    prior = prior_fov(tracked, clip)[0]
    rotations = [r for r in _lens_rotations(tracked) if r is not None and constrains_fov(r, prior)]
    return _combine_fovs(tracked, clip, ((r.vertical_fov[0], r.fov_std) for r in rotations))


def _combine_fovs(
    tracked: ShotObservations, clip: ClipMetadata, fovs: Iterable[tuple[float, float]]
) -> tuple[float, float]:
    """The same from fields of view and their standard deviations [deg] that rotations say."""
    if clip.user_input.vertical_fov is not None:
        return clip.user_input.vertical_fov, 0.0
    told = [prior_fov(tracked, clip), *((fov, math.hypot(std, MIN_FOV_STD)) for fov, std in fovs)]
    values, stds = np.array(told).T
    weight = np.square(1.0 / stds)
    for _ in range(5):  # those far off count for less
        mean = float(weight @ values / weight.sum())
        weight = 1.0 / (np.square(stds) + np.square(values - mean) / 4.0)
    return mean, float(1.0 / math.sqrt(weight.sum()))


def prior_fov(tracked: ShotObservations, clip: ClipMetadata) -> tuple[float, float]:
    """Return the vertical field of view that metadata or else the network say, and its standard deviation, deg.

    Args:
        tracked: a shot with one estimate or more.
        clip: what is known of the clip.
    """
    if clip.user_input.metadata and (metadata_fov := clip.metadata.vertical_fov):
        return metadata_fov, _METADATA_FOV_STD
    logs = [math.log(estimate.prediction.vertical_fov) for estimate in tracked.estimates.values()]
    return math.exp(float(np.mean(logs))), NETWORK_FOV_STD


def _lens_rotations(tracked: ShotObservations) -> Iterator[RelativeRotation | None]:
    """Rotations by an unknown lens: between keyframes, or where those are few, by points that were followed."""
    pairs = _lens_pairs(list(tracked.keys.values()))
    for a, b in pairs:
        yield match_keyframes(a, b, None)
    if len(pairs) < MIN_PAIRS:
        distant = [m for step in _distant_frames(tracked) if len(m := step.matches)]
        moved = [m for m in distant if np.median(np.linalg.norm(m.b - m.a, axis=1)) > MIN_MEDIAN_MOTION]
        for matches in moved[-MIN_PAIRS:]:
            yield estimate_rotation(matches, tracked.size, tracked.size)


def _distant_frames(tracked: ShotObservations) -> list[TrackedFrame]:
    """Frames that are far from their keyframes: those that became the next one, and the last that was followed."""
    followed = [step for step in tracked.steps if len(step.matches)]
    return [step for step in tracked.steps if step.next_key is not None] + followed[-1:]


def constrains_fov(rotation: RelativeRotation, prior: float) -> bool:
    """Tell whether a rotation by an unknown lens says what the lens is.

    A camera that walks ahead tells next to nothing of its lens, and now and then something far off. One that is zoomed
    has no lens of the whole shot.

    Args:
        rotation: between two pictures of one unknown lens.
        prior: deg, vertical field of view by metadata or the network.
    """
    if rotation.zoomed:
        return False
    is_far = abs(rotation.vertical_fov[0] - prior) > MAX_FOV_STDS * NETWORK_FOV_STD
    is_clear = not is_far if rotation.translates else rotation.inliers >= MIN_ROTATION_SHARE * rotation.matches
    return is_clear and rotation.fov_std < 2 * NETWORK_FOV_STD


def _lens_pairs(keys: Sequence[Keyframe]) -> list[tuple[Keyframe, Keyframe]]:
    """Keyframes two apart: they overlap by half or more and are turned far enough to tell the lens."""
    apart = [pair for gap in (2, 1) for pair in zip(keys, keys[gap:], strict=False)]
    pairs = [(a, b) for a, b in apart if a.stretch == b.stretch]
    step = max(1, math.ceil(len(pairs) / MAX_PAIRS))
    return pairs[::step]


@dataclass(frozen=True, eq=False)
class UnzoomedShot:
    """A shot as if all of it had been seen through the lens of its first frame."""

    tracked: ShotObservations
    """The shot as if its lens were fixed."""
    zoom: Floats
    """(N,) focal lengths of the frames by the first one's."""
    lens: tuple[float, float]
    """Vertical field of view of the first frame and its standard deviation [deg]."""
    zoom_share: float = 1.0
    """Share of the frames whose zoom their points told."""


def remove_zoom(tracked: ShotObservations, clip: ClipMetadata) -> UnzoomedShot | None:
    """Return a zoomed shot as if one lens had seen all of it; None where it is not zoomed.

    Args:
        tracked: a shot with one estimate or more.
        clip: what is known of the clip.
    """
    rotations = _zoomed_rotations(tracked, _combine_fovs(tracked, clip, ())[0])
    time = {step.frame: step.time for step in tracked.steps}
    end = min(time[frame] for frame in tracked.estimates) + FIRST_SECONDS
    at_first = {frame: estimate for frame, estimate in tracked.estimates.items() if time[frame] <= end}
    first = _combine_fovs(replace(tracked, estimates=at_first), clip, ())[0]
    best: UnzoomedShot | None = None
    for start in _START_FACTORS if rotations else ():
        unzoomed = _track_from_fov(tracked, clip, rotations, start * first)
        if best is None or unzoomed.zoom_share > best.zoom_share:
            best = unzoomed
        if best.zoom_share >= MIN_ZOOMED_FRAMES:
            break
    return None if best is None or np.all(best.zoom == 1.0) else best


def _track_from_fov(
    tracked: ShotObservations, clip: ClipMetadata, rotations: Sequence[tuple[int, RelativeRotation]], start: float
) -> UnzoomedShot:
    """The shot through a lens that is taken to be `start` [deg] at first, or through the user's."""
    fixed = clip.user_input.vertical_fov
    lens = (start, GUESSED_FOV_STD) if fixed is None else (fixed, 0.0)
    for _ in range(_PASSES):
        zoom, zoom_share = _track_zoom(tracked, lens[0])
        unzoomed = _divide_by_zoom(tracked, zoom)
        keys = unzoomed.keys
        fovs = [(zoomed_fov(r.vertical_fov[0], 1.0 / keys[key].zoom), r.fov_std) for key, r in rotations]
        lens = _combine_fovs(unzoomed, clip, fovs)
    return UnzoomedShot(unzoomed, zoom, lens, zoom_share)


def _zoomed_rotations(tracked: ShotObservations, vertical_fov: float) -> list[tuple[int, RelativeRotation]]:
    """Rotations of zoomed cameras against keyframes of these numbers, `vertical_fov` [deg] being a guess of the lens.

    None where more rotations are those of a walk.
    """
    focal = focal_from_fov(vertical_fov, *tracked.size)
    candidates = []
    for step in _distant_frames(tracked):
        fit = _fit_rotation_and_zoom(step.matches, focal, np.eye(3), 1.0)
        if fit is None or abs(np.log(fit[1])) <= 0.5 * _ONE_LENS or step.key not in tracked.keys:
            continue
        fovs, size = (vertical_fov, vertical_fov), tracked.size
        if (rotation := estimate_rotation(step.matches, size, size, fovs, GUESSED_FOV_STD)) is not None:
            candidates.append((step.key, rotation))
    zoomed = [(key, rotation) for key, rotation in candidates if rotation.zoomed]
    return zoomed if len(zoomed) >= sum(rotation.translates for _, rotation in candidates) else []


def _track_zoom(tracked: ShotObservations, vertical_fov: float) -> tuple[Floats, float]:
    """Focal lengths (N,) of the frames by the first one's, whose lens has about `vertical_fov` [deg].

    Beside them the share of the frames whose points tell it. All are 1 where they change by less than those of two
    photos of one lens may.
    """
    focal = focal_from_fov(vertical_fov, *tracked.size)
    of_key: dict[int, float] = {}
    rotation: Floats = np.eye(3)
    zooms, agreeing, zoom, last = [], [True], 1.0, -1
    for step in tracked.steps:
        if step.is_start:
            of_key[step.key] = zoom = _zoom_after_gap(tracked, step, of_key, zoom)
        elif len(step.matches):
            base = of_key.setdefault(step.key, zoom)
            guess = rotation if step.key == last else np.eye(3)
            fit = _fit_rotation_and_zoom(step.matches, focal * base, guess, zoom / base)
            agreeing.append(fit is not None)
            rotation, growth = fit or (guess, zoom / base)
            zoom = base * growth
        if step.next_key is not None:
            of_key[step.next_key] = zoom
        zooms.append(zoom)
        last = step.key
    logs = smooth_parabolic(np.array([step.time for step in tracked.steps]), np.log(zooms))
    relative = np.exp(logs - logs[0]) if np.ptp(logs) > _ONE_LENS else np.ones(len(logs))
    return relative, float(np.mean(agreeing))


def _divide_by_zoom(tracked: ShotObservations, zoom: Floats) -> ShotObservations:
    """The shot with all points, keyframes and fields of view divided by the frames' zooms (N,)."""
    of_key: dict[int, float] = {}
    steps = []
    for step, factor in zip(tracked.steps, zoom.tolist(), strict=True):
        base = of_key.setdefault(step.key, factor)
        if step.next_key is not None:
            of_key[step.next_key] = factor
        m = step.matches
        steps.append(replace(step, matches=Matches(m.a / base, m.b / factor, m.pixel / min(base, factor))))
    of_frame = {step.frame: factor for step, factor in zip(tracked.steps, zoom.tolist(), strict=True)}
    keys = {number: replace(key, zoom=of_frame[key.frame]) for number, key in tracked.keys.items()}
    estimates = {}
    for frame, estimate in tracked.estimates.items():
        fov = zoomed_fov(estimate.prediction.vertical_fov, 1.0 / of_frame[frame])
        estimates[frame] = replace(estimate, prediction=replace(estimate.prediction, vertical_fov=fov))
    return replace(tracked, steps=steps, keys=keys, estimates=estimates)


def is_zoomed(matches: Matches, vertical_fov: float, size: tuple[int, int]) -> bool:
    """Tell by points alone whether the lens was zoomed between a keyframe and a frame.

    Args:
        matches: of the keyframe's points to the frame's.
        vertical_fov: deg, of the keyframe.
        size: width and height of the frames, pixels.
    """
    fit = _fit_rotation_and_zoom(matches, focal_from_fov(vertical_fov, *size), np.eye(3), 1.0, MIN_PAIR_AGREEMENT)
    return fit is not None and abs(np.log(fit[1])) > _ONE_LENS


def _zoom_after_gap(tracked: ShotObservations, step: TrackedFrame, of_key: dict[int, float], last: float) -> float:
    """The zoom of a keyframe that begins a stretch, by those before the gap that show the same."""
    if (key := tracked.keys.get(step.key)) is None:
        return last
    for before in sorted((k for k in of_key if k < step.key and k in tracked.keys), reverse=True)[:GAP_KEYFRAMES]:
        if (rotation := match_keyframes(tracked.keys[before], key, None)) is not None:
            first, second = (focal_from_fov(fov, *key.picture.shape[::-1]) for fov in rotation.vertical_fov)
            return of_key[before] * (second / first if rotation.zoomed else 1.0)
    return last


def _fit_rotation_and_zoom(
    matches: Matches, focal: float, rotation: Floats, zoom: float, least: float = MIN_ZOOM_AGREEMENT
) -> tuple[Floats, float] | None:
    """The rotation (3, 3) of a frame and its focal length by its keyframe's `focal` [half diagonals], from guesses.

    Gauss-Newton on both together under Geman and McClure's weights; None where less than a share `least` of the points
    obeys.
    """
    a, reach = rays_through(matches.a, focal), TRACKING_TOLERANCE * matches.pixel
    fitted, factor = rotation, zoom
    for wider in np.geomspace(8.0, 1.0, _REWEIGHTINGS):
        rotated = a @ fitted.T
        ahead = np.maximum(-rotated[:, 2:], 1e-3)
        projected = factor * focal * rotated[:, :2] / ahead
        error = matches.b - projected
        weight = np.square(1.0 / (1.0 + np.sum(np.square(error), axis=1) / (wider * reach) ** 2))
        jacobian = -cross_matrix(rotated)  # (N, 3, 3): by small rotations about each axis, in its columns
        sideways = jacobian[:, :2] + (rotated[:, :2] / ahead)[:, :, None] * jacobian[:, 2:]
        by_rotation = factor * focal * sideways / ahead[:, :, None]
        by_parameter = np.concatenate([by_rotation, projected[:, :, None]], axis=2)
        normal = np.einsum("n,nki,nkj->ij", weight, by_parameter, by_parameter)
        step = np.linalg.solve(normal + 1e-12 * np.eye(4), np.einsum("n,nki,nk->i", weight, by_parameter, error))
        fitted, factor = rotation_about(step[:3]) @ fitted, factor * float(np.exp(np.clip(step[3], -0.2, 0.2)))
    agreeing = np.mean(np.sum(np.square(error), axis=1) < (2.0 * reach) ** 2)
    return (fitted, factor) if agreeing >= least else None


def smooth_parabolic(time: Floats, values: Floats) -> Floats:
    """Replace each value by the parabola through its neighbors.

    Args:
        time: (N,) s, rising.
        values: (N,).
    """
    count, window = len(time), _SMOOTHING_WINDOW
    if count < window:
        return values
    first = np.clip(np.arange(count) - window // 2, 0, count - window)
    neighbors = first[:, None] + np.arange(window)
    offset = time[neighbors] - time[:, None]
    scale = np.maximum(np.abs(offset).max(axis=1, keepdims=True), 1e-9)
    basis = np.stack([np.ones_like(offset), offset / scale, (offset / scale) ** 2], axis=-1)
    fitted = np.linalg.pinv(basis) @ values[neighbors][..., None]
    return np.asarray(fitted[:, 0, 0])

"""Orientations of a shot's frames: loops closed, gaps bridged, trembling smoothed.

Errors of a chain of rotations add up. Where the camera comes back to what it saw, features of keyframes are matched and
the loop is closed. Orientations then are those with the least sum of squared differences to all rotations (rotation
averaging, Chatterjee and Govindu 2013), rotations far off counting little.

Orientations are rotations (3, 3) from the frame of the shot's first camera (x right, y up, it looks along -z) to that
of a later one.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats, angle_between
from lighting.registration.features import match_features
from lighting.registration.rotations import (
    camera_up,
    consensus_up,
    focal_from_fov,
    heading_elevation_roll,
    rotation_about,
    rotation_vector,
)
from lighting.registration.two_view import RelativeRotation, estimate_rotation
from lighting.video.telemetry import Gimbal
from lighting.video.tracking import FrameRotation, Keyframe, ShotObservations, estimate_frame_rotation, is_reliable

GAP_KEYFRAMES = 2  # keyframes to either side of a gap that are compared
MIN_LOOP_KEYFRAMES = 5  # keyframes; those nearer in time need no loop
MAX_LOOP_ANGLE = 0.5  # of the vertical field of view, up to which two keyframes are compared
MAX_LOOPS = 60  # compared in a shot
MAX_AVERAGED_KEYFRAMES = 1200  # beyond which the chain is left as it is: the graph would take too much memory
_MAX_ROUNDS = 12  # of the averaging, at most
_OUTLIER_ANGLE = 0.5  # deg, beyond which a rotation counts for ever less


@dataclass(frozen=True, eq=False)
class _Link:
    """A rotation between two keyframes."""

    a: int
    b: int
    rotation: Floats  # (3, 3) directions in a's camera to b's
    weight: float = 1.0


def match_keyframes(
    a: Keyframe, b: Keyframe, vertical_fov: float | None, fov_std: float = 0.0
) -> RelativeRotation | None:
    """Estimate the rotation from one keyframe to another by their features; None where too little is common.

    Args:
        a: the first keyframe.
        b: the second one.
        vertical_fov: deg, of both; None is unknown.
        fov_std: deg, of that; 0 is exact.
    """
    if a.picture.shape != b.picture.shape:
        return None
    size = (a.picture.shape[1], a.picture.shape[0])
    return estimate_rotation(match_features(a.features, b.features), size, size, (vertical_fov, vertical_fov), fov_std)


def _chain_orientations(count: int, links: Sequence[_Link]) -> tuple[Floats, NDArray[np.intp]]:
    """Orientations (K, 3, 3) along the links, and which part (K,) each keyframe belongs to.

    Each part's first keyframe has the identity.
    """
    orientation, part = np.tile(np.eye(3), (count, 1, 1)), np.full(count, -1)
    neighbors: list[list[tuple[int, Floats]]] = [[] for _ in range(count)]
    for link in links:
        neighbors[link.a].append((link.b, link.rotation))
        neighbors[link.b].append((link.a, link.rotation.T))
    for start in range(count):
        queue = [start] if part[start] < 0 else []
        part[queue] = start
        while queue:
            current = queue.pop(0)
            for other, rotation in neighbors[current]:
                if part[other] < 0:
                    part[other], orientation[other] = start, rotation @ orientation[current]
                    queue.append(other)
    return orientation, part


def _average_rotations(orientation: Floats, links: Sequence[_Link], fixed: NDArray[np.bool_]) -> Floats:
    """Orientations (K, 3, 3) that fit the links best, from ones nearby; those `fixed` (K,) stay."""
    count = len(orientation)
    if len(links) < count or count > MAX_AVERAGED_KEYFRAMES:
        return orientation
    a, b = (np.array([getattr(link, end) for link in links]) for end in ("a", "b"))
    rotations, link_weight = np.stack([link.rotation for link in links]), np.array([link.weight for link in links])
    for _ in range(_MAX_ROUNDS):
        error = np.swapaxes(orientation[b], 1, 2) @ rotations @ orientation[a]
        residual = np.stack([rotation_vector(r) for r in error])
        weight = link_weight / (1.0 + np.sum(residual**2, axis=1) / np.radians(_OUTLIER_ANGLE) ** 2)
        step = _rotation_steps(a, b, residual, weight, fixed)
        orientation = orientation @ rotation_about(step)
        if np.abs(step).max() < 1e-7:
            break
    return orientation


def _rotation_steps(
    a: NDArray[np.intp], b: NDArray[np.intp], residual: Floats, weight: Floats, fixed: NDArray[np.bool_]
) -> Floats:
    """Small rotation vectors (K, 3) in the first camera's frame, by which orientations are to be turned."""
    count = len(fixed)
    laplacian, right = np.zeros((count, count)), np.zeros((count, 3))
    for row, column, entry in ((a, a, weight), (b, b, weight), (a, b, -weight), (b, a, -weight)):
        np.add.at(laplacian, (row, column), entry)
    np.add.at(right, b, weight[:, None] * residual)
    np.add.at(right, a, -weight[:, None] * residual)
    laplacian[fixed] = 0.0
    laplacian[fixed, fixed] = 1.0
    right[fixed] = 0.0
    return np.linalg.solve(laplacian + 1e-9 * np.eye(count), right)


def _close_loops(
    keys: Sequence[Keyframe], orientation: Floats, part: NDArray[np.intp], vertical_fov: float
) -> list[_Link]:
    """Rotations by features between keyframes that look nearly the same way and are not neighbours."""
    pairs = list(_near_pairs(orientation, part, MAX_LOOP_ANGLE * vertical_fov))
    step = max(1, math.ceil(len(pairs) / MAX_LOOPS))
    rotations = [(i, j, match_keyframes(keys[i], keys[j], vertical_fov)) for i, j in pairs[::step]]
    return [_Link(i, j, rotation.rotation, 0.5) for i, j, rotation in rotations if rotation is not None]


def _near_pairs(orientation: Floats, part: NDArray[np.intp], within: float) -> Iterator[tuple[int, int]]:
    """Pairs of keyframes that look the same way to an angle [deg], each with the nearest of those long before it."""
    for j in range(MIN_LOOP_KEYFRAMES, len(orientation)):
        older = np.flatnonzero(part[: j - MIN_LOOP_KEYFRAMES + 1] == part[j])
        angle = angle_between(orientation[older, 2], orientation[j, 2])
        if angle.min(initial=np.inf) < within:
            yield int(older[int(np.argmin(angle))]), j


# Orientations of all frames, and up.

GIMBAL_INTERVAL = 0.5  # s between the gimbal's angles that count


def estimate_orientations(
    tracked: ShotObservations, rotations: Sequence[FrameRotation], fov: float
) -> tuple[Floats, NDArray[np.bool_]]:
    """Estimate the frames' orientations from all rotations between keyframes and frames.

    Args:
        tracked: a shot.
        rotations: those of `estimate_frame_rotations`, one a frame.
        fov: deg, vertical field of view.

    Returns:
        Orientations (N, 3, 3) against the shot's first camera, and which of them are to be used (N,).

    References:
        [1] Chatterjee and Govindu, Efficient and robust large-scale rotation averaging, ICCV 2013.
    """
    lowest = tracked.steps[0].key
    numbers = [n for s in tracked.steps for n in (s.key, s.next_key) if n is not None]
    count = max(numbers) - lowest + 1
    steps = zip(tracked.steps, rotations, strict=True)
    ends = [(s.key - lowest, s.next_key - lowest, r.rotation) for s, r in steps if s.next_key is not None]
    chain = [*(_Link(*end, 2.0) for end in ends), *_bridge_gaps(tracked, lowest, fov)]
    orientation, part = _chain_orientations(count, chain)
    keys = sorted(tracked.keys.values(), key=lambda k: k.number)
    where = np.array([k.number - lowest for k in keys], dtype=np.intp)
    loops = _close_loops(keys, orientation[where], part[where], fov) if len(keys) > 3 else []
    closed = [replace(link, a=int(where[link.a]), b=int(where[link.b])) for link in loops]
    orientation = _average_rotations(orientation, [*chain, *closed], part == np.arange(count))
    key_index = np.array([step.key - lowest for step in tracked.steps])
    frames = np.stack([t.rotation for t in rotations]) @ orientation[key_index]
    main = np.bincount(part[key_index]).argmax()
    reliable = [is_reliable(t, is_start=s.is_start) for t, s in zip(rotations, tracked.steps, strict=True)]
    is_used = np.array(reliable) & (part[key_index] == main)
    return frames @ frames[int(np.argmax(is_used))].T, is_used


def estimate_frame_rotations(tracked: ShotObservations, fov: float) -> list[FrameRotation]:
    """Estimate each frame's rotation against its keyframe.

    Args:
        tracked: a shot.
        fov: deg, vertical field of view.
    """
    focal = focal_from_fov(fov, *tracked.size)
    result: list[FrameRotation] = []
    last = -1
    for step in tracked.steps:
        if step.is_start or not len(step.matches):
            result.append(FrameRotation(np.eye(3), 1.0 if step.is_start else 0.0, len(step.matches)))
        else:
            guess = result[-1].rotation if step.key == last else np.eye(3)
            result.append(estimate_frame_rotation(step.matches, focal, guess))
        last = step.key
    return result


def _bridge_gaps(tracked: ShotObservations, lowest: int, fov: float) -> Iterator[_Link]:
    """Rotations over the gaps between stretches."""
    stretches = sorted({k.stretch for k in tracked.keys.values()})
    keys = {s: [k for k in tracked.keys.values() if k.stretch == s] for s in stretches}
    for before, after in pairwise(stretches):
        for a, b in product(keys[before][-GAP_KEYFRAMES:], keys[after][:GAP_KEYFRAMES]):
            if (rotation := match_keyframes(a, b, fov)) is not None:
                yield _Link(a.number - lowest, b.number - lowest, rotation.rotation)


def estimate_up(tracked: ShotObservations, orientation: Floats, time: Floats, gimbal: Gimbal) -> Floats:
    """Estimate up (3,) in the shot's first camera: by the gimbal if there is one, else what most estimates agree upon.

    Args:
        tracked: a shot with one estimate or more.
        orientation: (N, 3, 3) of the frames against the first camera.
        time: (N,) s, of the frames, rising.
        gimbal: may be empty.
    """
    if samples := sample_gimbal(gimbal, time):
        ups = np.stack([camera_up(elevation, roll) for _, (_, elevation, roll) in samples])
        return consensus_up(orientation[[i for i, _ in samples]], ups)
    position = {step.frame: i for i, step in enumerate(tracked.steps)}
    predictions = [estimate.prediction for estimate in tracked.estimates.values()]
    ups = np.stack([camera_up(p.camera_elevation, p.camera_roll) for p in predictions])
    return consensus_up(orientation[[position[f] for f in tracked.estimates]], ups)


def sample_gimbal(gimbal: Gimbal, time: Floats) -> list[tuple[int, tuple[float, float, float]]]:
    """Read a gimbal every GIMBAL_INTERVAL.

    Args:
        gimbal: may be empty.
        time: (N,) s, of the frames, rising.

    Returns:
        Indices into `time`, each with heading, elevation and roll, deg.
    """
    first = np.unique((time - time[0]) // GIMBAL_INTERVAL, return_index=True)[1]
    return [(int(i), angles) for i in first if (angles := gimbal.at(float(time[i]))) is not None]


# The camera's path.

SMOOTHING_WINDOW = 5  # frames that a parabola is fitted to; tracking trembles faster than hands do


@dataclass(frozen=True, eq=False)
class CameraPath:
    """How the camera pointed, frame by frame."""

    time: Floats
    """Time, (N,) s."""
    heading: Floats
    """(N,) deg clockwise from the first frame's, continuous: it may pass 180."""
    elevation: Floats
    """Elevation, (N,) deg."""
    roll: Floats
    """Roll, (N,) deg."""
    bridged: NDArray[np.bool_]
    """(N,) where nothing could be followed and the neighbours tell."""


def make_camera_path(time: Floats, orientations: Floats, is_used: NDArray[np.bool_], leveling: Floats) -> CameraPath:
    """Make a camera's path: gaps bridged, trembling smoothed.

    Args:
        time: (N,) s, rising.
        orientations: (N, 3, 3) against the shot's first camera.
        is_used: (N,), which of them are reliable; at least one.
        leveling: (3, 3) rotation that levels the first camera.
    """
    heading, elevation, roll = heading_elevation_roll(orientations, leveling)
    heading, elevation, roll = heading[is_used], elevation[is_used], roll[is_used]
    heading, roll = (np.degrees(np.unwrap(np.radians(angle))) for angle in (heading, roll))
    interpolated = (np.interp(time, time[is_used], angle) for angle in (heading, elevation, roll))
    heading, elevation, roll = (smooth_parabolic(time, v) for v in interpolated)
    return CameraPath(time, heading, np.clip(elevation, -90.0, 90.0), roll, ~is_used)


def smooth_parabolic(time: Floats, values: Floats, window: int = SMOOTHING_WINDOW) -> Floats:
    """Replace each value by the parabola through its neighbours.

    Args:
        time: (N,) s, rising.
        values: (N,).
        window: neighbours that a parabola is fitted to, odd.
    """
    count = len(time)
    if count < window:
        return values
    first = np.clip(np.arange(count) - window // 2, 0, count - window)
    neighbors = first[:, None] + np.arange(window)
    offset = time[neighbors] - time[:, None]
    scale = np.maximum(np.abs(offset).max(axis=1, keepdims=True), 1e-9)
    basis = np.stack([np.ones_like(offset), offset / scale, (offset / scale) ** 2], axis=-1)
    fitted = np.linalg.pinv(basis) @ values[neighbors][..., None]
    return np.asarray(fitted[:, 0, 0])

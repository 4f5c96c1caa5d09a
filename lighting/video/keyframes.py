"""Loop closure, orientations of all frames, smoothing.

Errors of a chain of turns add up; where the camera comes back to what it saw, features of keyframes are matched and
the loop is closed. Orientations then are those with the least sum of squared differences to all turns (rotation
averaging; Chatterji and Govindu 2013 describe the steps taken here), turns far off counting little.

Orientations are rotations (3, 3) from the frame of the shot's first camera (x right, y up, it looks along -z) to that
of a later one.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

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

# Keyframes in one frame: a graph of turns between them, and the orientations that fit all of them best.

GAP_KEYFRAMES = 2  # keyframes to either side of a gap that are compared
MIN_LOOP_KEYFRAMES = 5  # keyframes; those nearer in time need no loop
MAX_LOOP_ANGLE = 0.5  # of the vertical field of view, up to which two keyframes are compared
MAX_LOOPS = 60  # compared in a shot
MAX_AVERAGED_KEYFRAMES = 1200  # beyond which the chain is left as it is: the graph would take too much memory
_MAX_ROUNDS = 12  # of the averaging, at most
_OUTLIER_ANGLE = 0.5  # deg, beyond which a turn counts for ever less


@dataclass(frozen=True, eq=False)
class _Link:
    """A turn between two keyframes."""

    a: int
    b: int
    rotation: Floats  # (3, 3) directions in a's camera to b's
    weight: float = 1.0


def match_keyframes(
    a: Keyframe, b: Keyframe, vertical_fov: float | None, fov_sigma: float = 0.0
) -> RelativeRotation | None:
    """The turn from a to b by their features, None where they have too little in common.

    The lens is given [deg], exactly or with a standard deviation of both pictures' lenses, or unknown.
    """
    if a.picture.shape != b.picture.shape:
        return None
    size = (a.picture.shape[1], a.picture.shape[0])
    return estimate_rotation(
        match_features(a.features, b.features), size, size, (vertical_fov, vertical_fov), fov_sigma
    )


def _chain_orientations(count: int, links: Sequence[_Link]) -> tuple[Floats, NDArray[np.intp]]:
    """Orientations (K, 3, 3) along the links, and which part (K,) each keyframe belongs to.

    Each part's first keyframe has the identity.
    """
    orientation, part = np.tile(np.eye(3), (count, 1, 1)), np.full(count, -1)
    near: list[list[tuple[int, Floats]]] = [[] for _ in range(count)]
    for link in links:
        near[link.a].append((link.b, link.rotation))
        near[link.b].append((link.a, link.rotation.T))
    for start in range(count):
        waiting = [start] if part[start] < 0 else []
        if waiting:
            part[start] = start
        while waiting:
            here = waiting.pop(0)
            for there, rotation in near[here]:
                if part[there] < 0:
                    part[there], orientation[there] = start, rotation @ orientation[here]
                    waiting.append(there)
    return orientation, part


def _average_rotations(orientation: Floats, links: Sequence[_Link], fixed: NDArray[np.bool_]) -> Floats:
    """Orientations (K, 3, 3) that fit the links best, from ones nearby; those `fixed` (K,) stay."""
    count = len(orientation)
    if len(links) < count or count > MAX_AVERAGED_KEYFRAMES:
        return orientation
    a, b = (np.array([getattr(link, end) for link in links]) for end in ("a", "b"))
    turns, given = np.stack([link.rotation for link in links]), np.array([link.weight for link in links])
    for _ in range(_MAX_ROUNDS):
        off = np.swapaxes(orientation[b], 1, 2) @ turns @ orientation[a]
        residual = np.stack([rotation_vector(r) for r in off])
        weight = given / (1.0 + np.sum(residual**2, axis=1) / np.radians(_OUTLIER_ANGLE) ** 2)
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
    np.add.at(laplacian, (a, a), weight)
    np.add.at(laplacian, (b, b), weight)
    np.add.at(laplacian, (a, b), -weight)
    np.add.at(laplacian, (b, a), -weight)
    np.add.at(right, b, weight[:, None] * residual)
    np.add.at(right, a, -weight[:, None] * residual)
    laplacian[fixed] = 0.0
    laplacian[fixed, fixed] = 1.0
    right[fixed] = 0.0
    return np.linalg.solve(laplacian + 1e-9 * np.eye(count), right)


def _close_loops(
    keys: Sequence[Keyframe], orientation: Floats, part: NDArray[np.intp], vertical_fov: float
) -> list[_Link]:
    """Turns by features between keyframes that look nearly the same way and are not neighbours."""
    pairs = _near_pairs(orientation, part, MAX_LOOP_ANGLE * vertical_fov)
    step = max(1, math.ceil(len(pairs) / MAX_LOOPS))
    found = [(i, j, match_keyframes(keys[i], keys[j], vertical_fov)) for i, j in pairs[::step]]
    return [_Link(i, j, turn.rotation, 0.5) for i, j, turn in found if turn is not None]


def _near_pairs(orientation: Floats, part: NDArray[np.intp], within: float) -> list[tuple[int, int]]:
    """Pairs of keyframes that look the same way to an angle [deg], each with the nearest of those long before it."""
    pairs = []
    for j in range(MIN_LOOP_KEYFRAMES, len(orientation)):
        older = np.flatnonzero(part[: j - MIN_LOOP_KEYFRAMES + 1] == part[j])
        if not len(older):
            continue
        apart = angle_between(orientation[older, 2], orientation[j, 2])
        if apart.min() < within:
            pairs.append((int(older[int(np.argmin(apart))]), j))
    return pairs


# How the camera of a shot was turned, frame by frame, and which way is up.

GIMBAL_INTERVAL = 0.5  # s between the gimbal's angles that count


def estimate_orientations(
    watched: ShotObservations, turnings: Sequence[FrameRotation], fov: float
) -> tuple[Floats, NDArray[np.bool_]]:
    """Orientations (N, 3, 3) of the frames against the shot's first camera, and which of them are believed (N,).

    `turnings` are those of `turnings_of`, `fov` the vertical field of view [deg].
    """
    lowest = watched.steps[0].key
    numbers = [n for s in watched.steps for n in (s.key, s.makes) if n is not None]
    count = max(numbers) - lowest + 1
    chain = [
        _Link(step.key - lowest, step.makes - lowest, turn.rotation, 2.0)
        for step, turn in zip(watched.steps, turnings, strict=True)
        if step.makes is not None
    ]
    chain += _bridge_gaps(watched, lowest, fov)
    orientation, part = _chain_orientations(count, chain)
    keys = sorted(watched.keys.values(), key=lambda k: k.number)
    where = np.array([k.number - lowest for k in keys], dtype=np.intp)
    closed = [
        replace(link, a=int(where[link.a]), b=int(where[link.b]))
        for link in (_close_loops(keys, orientation[where], part[where], fov) if len(keys) > 3 else [])
    ]
    orientation = _average_rotations(orientation, [*chain, *closed], part == np.arange(count))
    own = np.array([step.key - lowest for step in watched.steps])
    frames = np.stack([t.rotation for t in turnings]) @ orientation[own]
    main = np.bincount(part[own]).argmax()
    sure = [is_reliable(t, begins=s.begins) for t, s in zip(turnings, watched.steps, strict=True)]
    believed = np.array(sure) & (part[own] == main)
    return frames @ frames[int(np.argmax(believed))].T, believed


def estimate_frame_rotations(watched: ShotObservations, fov: float) -> list[FrameRotation]:
    """Each frame's turn against its keyframe, through a lens of a vertical field of view [deg]."""
    focal = focal_from_fov(fov, *watched.size)
    found: list[FrameRotation] = []
    guess: Floats = np.eye(3)
    last = -1
    for step in watched.steps:
        guess = np.eye(3) if step.key != last else guess
        if step.begins or not len(step.matches):
            found.append(FrameRotation(np.eye(3), 1.0 if step.begins else 0.0, len(step.matches)))
        else:
            found.append(estimate_frame_rotation(step.matches, focal, guess))
        guess, last = found[-1].rotation, step.key
    return found


def _bridge_gaps(watched: ShotObservations, lowest: int, fov: float) -> list[_Link]:
    """Turns over the gaps between stretches."""
    stretches = sorted({k.stretch for k in watched.keys.values()})
    keys = {s: [k for k in watched.keys.values() if k.stretch == s] for s in stretches}
    found = []
    for before, after in pairwise(stretches):
        for a in keys[before][-GAP_KEYFRAMES:]:
            for b in keys[after][:GAP_KEYFRAMES]:
                if (turn := match_keyframes(a, b, fov)) is not None:
                    found.append(_Link(a.number - lowest, b.number - lowest, turn.rotation))
    return found


def estimate_up(watched: ShotObservations, orientation: Floats, time: Floats, gimbal: Gimbal) -> Floats:
    """Up (3,) in the shot's first camera: the gimbal's if there is one, or what most looks agree upon."""
    if stated := sample_gimbal(gimbal, time):
        return consensus_up(
            orientation[[i for i, _ in stated]], np.stack([camera_up(at[1], at[2]) for _, at in stated])
        )
    position = {step.frame: i for i, step in enumerate(watched.steps)}
    said = [seen.prediction for seen in watched.looks.values()]
    ups = np.stack([camera_up(p.camera_elevation, p.camera_roll) for p in said])
    return consensus_up(orientation[[position[f] for f in watched.looks]], ups)


def sample_gimbal(gimbal: Gimbal, time: Floats) -> list[tuple[int, tuple[float, float, float]]]:
    """What a gimbal says at some of the times (N,) [s]: their indices, each with heading, elevation and roll [deg]."""
    first = np.unique((time - time[0]) // GIMBAL_INTERVAL, return_index=True)[1]
    return [(int(i), at) for i in first if (at := gimbal.at(float(time[i]))) is not None]


# A camera's path of orientations: its angles, gaps bridged, and what trembles smoothed.

SMOOTHING_WINDOW = (
    5  # frames over which a parabola is fitted; tracking trembles from frame to frame, hands do more slowly
)


@dataclass(frozen=True, eq=False)
class CameraPath:
    """How the camera pointed, frame by frame."""

    time: Floats  # (N,) s
    heading: Floats  # (N,) deg clockwise from the first frame's, continuous: it may pass 180
    elevation: Floats  # (N,) deg
    roll: Floats  # (N,) deg
    bridged: NDArray[np.bool_]  # (N,) where nothing could be followed and the neighbours tell


def make_camera_path(time: Floats, orientations: Floats, known: NDArray[np.bool_], levelled: Floats) -> CameraPath:
    """The path of cameras (N, 3, 3) of which those `known` (N,), at least one, are believed."""
    heading, elevation, roll = heading_elevation_roll(orientations, levelled)
    turned = np.empty_like(heading)
    turned[known] = np.degrees(np.unwrap(np.radians(heading[known])))
    rolled = np.empty_like(roll)
    rolled[known] = np.degrees(np.unwrap(np.radians(roll[known])))
    bridged = (np.interp(time, time[known], v[known]) for v in (turned, elevation, rolled))
    heading, elevation, roll = (smooth_parabolic(time, v) for v in bridged)
    return CameraPath(time, heading, np.clip(elevation, -90.0, 90.0), roll, ~known)


def smooth_parabolic(time: Floats, values: Floats, window: int = SMOOTHING_WINDOW) -> Floats:
    """Values (N,) at rising times (N,), each replaced by the parabola through its `window` neighbours."""
    count = len(time)
    if count < window:
        return values
    first = np.clip(np.arange(count) - window // 2, 0, count - window)
    near = first[:, None] + np.arange(window)
    apart = time[near] - time[:, None]
    scale = np.maximum(np.abs(apart).max(axis=1, keepdims=True), 1e-9)
    basis = np.stack([np.ones_like(apart), apart / scale, (apart / scale) ** 2], axis=-1)
    fitted = np.linalg.pinv(basis) @ values[near][..., None]
    return np.asarray(fitted[:, 0, 0])

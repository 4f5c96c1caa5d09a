"""How the camera of a shot was turned, frame by frame, and which way is up."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats
from lighting.turns import common_up, focal_of, own_up
from lighting.video.keyframes import JOINS, Link, averaged, chained, loops, turn_between
from lighting.video.telemetry import Gimbal
from lighting.video.turning import Turning, is_believed, turning
from lighting.video.watched import Watched

GIMBAL_EVERY = 0.5  # s between the gimbal's angles that count


def orientations(watched: Watched, turnings: Sequence[Turning], fov: float) -> tuple[Floats, NDArray[np.bool_]]:
    """Orientations (N, 3, 3) of the frames against the shot's first camera, and which of them are believed (N,).

    `turnings` are those of `turnings_of`, `fov` the vertical field of view [deg].
    """
    lowest = watched.steps[0].key
    numbers = [n for s in watched.steps for n in (s.key, s.makes) if n is not None]
    count = max(numbers) - lowest + 1
    chain = [
        Link(step.key - lowest, step.makes - lowest, turn.rotation, 2.0)
        for step, turn in zip(watched.steps, turnings, strict=True)
        if step.makes is not None
    ]
    chain += _joins(watched, lowest, fov)
    orientation, part = chained(count, chain)
    keys = sorted(watched.keys.values(), key=lambda k: k.number)
    where = np.array([k.number - lowest for k in keys], dtype=np.intp)
    closed = [
        replace(link, a=int(where[link.a]), b=int(where[link.b]))
        for link in (loops(keys, orientation[where], part[where], fov) if len(keys) > 3 else [])
    ]
    orientation = averaged(orientation, [*chain, *closed], part == np.arange(count))
    own = np.array([step.key - lowest for step in watched.steps])
    frames = np.stack([t.rotation for t in turnings]) @ orientation[own]
    main = np.bincount(part[own]).argmax()
    sure = [is_believed(t, begins=s.begins) for t, s in zip(turnings, watched.steps, strict=True)]
    believed = np.array(sure) & (part[own] == main)
    return frames @ frames[int(np.argmax(believed))].T, believed


def turnings_of(watched: Watched, fov: float) -> list[Turning]:
    """Each frame's turn against its keyframe, through a lens of a vertical field of view [deg]."""
    focal = focal_of(fov, *watched.size)
    found: list[Turning] = []
    guess: Floats = np.eye(3)
    last = -1
    for step in watched.steps:
        guess = np.eye(3) if step.key != last else guess
        if step.begins or not len(step.matches):
            found.append(Turning(np.eye(3), 1.0 if step.begins else 0.0, len(step.matches)))
        else:
            found.append(turning(step.matches, focal, guess))
        guess, last = found[-1].rotation, step.key
    return found


def _joins(watched: Watched, lowest: int, fov: float) -> list[Link]:
    """Turns over the gaps between stretches."""
    stretches = sorted({k.stretch for k in watched.keys.values()})
    keys = {s: [k for k in watched.keys.values() if k.stretch == s] for s in stretches}
    found = []
    for before, after in pairwise(stretches):
        for a in keys[before][-JOINS:]:
            for b in keys[after][:JOINS]:
                if (turn := turn_between(a, b, fov)) is not None:
                    found.append(Link(a.number - lowest, b.number - lowest, turn.rotation))
    return found


def up_of(watched: Watched, orientation: Floats, time: Floats, gimbal: Gimbal) -> Floats:
    """Up (3,) in the shot's first camera: the gimbal's if there is one, or what most looks agree upon."""
    if stated := told_by(gimbal, time):
        return common_up(orientation[[i for i, _ in stated]], np.stack([own_up(at[1], at[2]) for _, at in stated]))
    position = {step.frame: i for i, step in enumerate(watched.steps)}
    said = [seen.prediction for seen in watched.looks.values()]
    ups = np.stack([own_up(p.camera_elevation, p.camera_roll) for p in said])
    return common_up(orientation[[position[f] for f in watched.looks]], ups)


def told_by(gimbal: Gimbal, time: Floats) -> list[tuple[int, tuple[float, float, float]]]:
    """What a gimbal says at some of the times (N,) [s]: their indices, each with heading, elevation and roll [deg]."""
    first = np.unique((time - time[0]) // GIMBAL_EVERY, return_index=True)[1]
    return [(int(i), at) for i in first if (at := gimbal.at(float(time[i]))) is not None]

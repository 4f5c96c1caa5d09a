"""A clip taken apart into shots, and each shot solved: its lens, the camera's path, its one sun.

What `watch` gathers of a clip is small: followed points, features of keyframes, and what the network said of some
frames. All else follows from it once a shot's end is known.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import timedelta
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lighting.errors import VideoError
from lighting.evidence import Fused, Given, Known, known
from lighting.geometry import Floats
from lighting.photo import PhotoFacts
from lighting.records import Prediction
from lighting.turns.rays import focal_of
from lighting.turns.rotation import Turn, rotation_of
from lighting.video.follow import Key, Step
from lighting.video.keyframes import Link, averaged, chained, loops, turn_between
from lighting.video.light import Look, ShotLight
from lighting.video.path import Path, common_up, level, path_of, up_in_camera
from lighting.video.telemetry import Gimbal
from lighting.video.turning import Turning, turning

SHORT = 5  # frames, fewer than which are no shot but a gap in one
JOINS = 2  # keyframes to either side of a gap that are compared
BELIEVED = 0.3  # share of followed points that must agree with a turn
FEWEST_AGREEING = 12
LENS_PAIRS = 10  # of keyframes, from which the lens is learnt
FEW_PAIRS = 4  # fewer keyframes tell too little of the lens
LENS_SPREAD = 5.0  # deg, one standard deviation of the network's field of view
STATED_LENS_SPREAD = 2.5  # deg, of a focal length in the metadata: stabilisation crops the picture
LENS_FLOOR = 0.4  # deg, below which a pair's own error is not believed
GIMBAL_EVERY = 0.5  # s between the gimbal's angles that count


@dataclass(frozen=True, eq=False)
class Watched:
    """What was gathered of a clip, or of one shot of it."""

    size: tuple[int, int]  # width and height of the frames, pixels
    steps: Sequence[Step]  # one a frame
    keys: dict[int, Key]  # by number
    looks: dict[int, Prediction]  # by the frame's index


@dataclass(frozen=True, eq=False)
class Circumstances:
    """What is known of a clip beside its pixels."""

    facts: PhotoFacts = field(default_factory=PhotoFacts)  # of the clip's first moment
    gimbal: Gimbal = field(default_factory=Gimbal)
    given: Given = field(default_factory=Given)

    def known_at(self, seconds: float, heading: float | None = None) -> Known:
        """What is known of a frame at a time [s]; `heading` is where the gimbal points it, deg clockwise from north."""
        later = timedelta(seconds=seconds)
        moved = {
            name: moment + later
            for name in ("local_time", "utc_time")
            if (moment := getattr(self.facts, name)) is not None
        }
        facts = replace(self.facts, **moved)
        given = self.given if self.given.time is None else replace(self.given, time=self.given.time + later)
        if heading is not None:
            facts = replace(facts, heading=heading, heading_reference="true")
        elif seconds > 0.0:  # the one that is known is of the clip's first frame
            facts, given = replace(facts, heading=None), replace(given, heading=None)
        return known(facts, given)


@dataclass(frozen=True, eq=False)
class Shot:
    """One shot: where the camera points in each frame, and the light in the axes of its first frame."""

    frames: NDArray[np.intp]  # (N,) indices in the clip
    path: Path
    gains: Floats  # (N, 3) of the linear values, relative to the shot's first frame
    vertical_fov: float  # deg
    fov_sigma: float  # deg, one standard deviation of that
    fused: Fused  # the sun, as the shot's first camera sees it, its tilt removed
    known: Known
    north: float | None  # deg clockwise from true north, where azimuth 0 points; None unknown


def split(watched: Watched) -> list[Watched]:
    """The shots of a clip, in order; frames in which nothing can be followed belong to the shot before them."""
    long = _long_stretches(watched.steps)
    keys = {s: sorted((k for k in watched.keys.values() if k.stretch == s), key=lambda k: k.number) for s in long}
    shot_of, number = {}, 0
    for before, after in zip([None, *long[:-1]], long, strict=True):
        if before is not None and not _is_joined(keys[before], keys[after]):
            number += 1
        shot_of[after] = number
    current, members = 0, []
    for step in watched.steps:
        current = shot_of.get(step.stretch, current)
        members.append(current)
    return [_part(watched, [i for i, m in enumerate(members) if m == n]) for n in range(number + 1)]


def _long_stretches(steps: Sequence[Step]) -> list[int]:
    stretches, counts = np.unique([step.stretch for step in steps], return_counts=True)
    long = stretches[counts >= SHORT]
    return [int(s) for s in (long if len(long) else stretches[[int(np.argmax(counts))]])]


def _is_joined(before: Sequence[Key], after: Sequence[Key]) -> bool:
    """Whether keyframes to both sides of a gap show the same things."""
    return any(turn_between(a, b, None) is not None for a in before[-JOINS:] for b in after[:JOINS])


def _part(watched: Watched, positions: Sequence[int]) -> Watched:
    steps = [watched.steps[i] for i in positions]
    frames = {step.frame for step in steps}
    keys = {n: k for n, k in watched.keys.items() if k.frame in frames}
    return Watched(watched.size, steps, keys, {f: p for f, p in watched.looks.items() if f in frames})


def solve(watched: Watched, around: Circumstances) -> Shot:
    """The shot's lens, path and light; VideoError where the network saw none of its frames.

    Raises ParameterError where the user's own time and place are of night.
    """
    if not watched.looks:
        raise VideoError("No frame of the shot is bright enough for daylight.")
    fov, sigma = lens_of(watched, around)
    turnings = _turnings(watched, focal_of(fov, *watched.size))
    orientation, believed = _orientations(watched, turnings, fov)
    time = np.array([step.time for step in watched.steps])
    up = _up(watched, orientation, time, around.gimbal)
    path = path_of(time, orientation, believed, level(up))
    gains = _gains(watched.steps)
    return _lit(watched, around, path, gains, (fov, sigma))


# --- lens


def lens_of(watched: Watched, around: Circumstances) -> tuple[float, float]:
    """Vertical field of view and its standard deviation [deg]: given, or what turning pictures and the network say."""
    if around.given.vertical_fov is not None:
        return around.given.vertical_fov, 0.0
    seen = math.exp(float(np.mean([math.log(p.vertical_fov) for p in watched.looks.values()])))
    stated = around.facts.vertical_fov if around.given.use_exif else None
    values, spreads = [stated or seen], [STATED_LENS_SPREAD if stated else LENS_SPREAD]
    for turn in _lens_turns(watched):
        if turn is not None and not turn.translates and turn.fov_sigma < 2 * LENS_SPREAD:
            values.append(turn.vertical_fov[0])
            spreads.append(math.hypot(turn.fov_sigma, LENS_FLOOR))
    weight = np.square(1.0 / np.array(spreads))
    for _ in range(5):
        mean = float(weight @ values / weight.sum())
        weight = 1.0 / (np.square(spreads) + np.square(np.array(values) - mean) / 4.0)
    return mean, float(1.0 / math.sqrt(weight.sum()))


def _lens_turns(watched: Watched) -> Iterator[Turn | None]:
    """Turns by an unknown lens: between keyframes, or where there are few of those, by points that were followed."""
    pairs = _lens_pairs(list(watched.keys.values()))
    for a, b in pairs:
        yield turn_between(a, b, None)
    if len(pairs) < FEW_PAIRS:
        far = [step for step in watched.steps if step.makes is not None] + [watched.steps[-1]]
        for step in far[-FEW_PAIRS:]:
            yield rotation_of(step.matches, watched.size, watched.size)


def _lens_pairs(keys: Sequence[Key]) -> list[tuple[Key, Key]]:
    """Keyframes two apart: they overlap by half or more and are turned far enough to tell the lens."""
    pairs = [
        (a, keys[i + gap])
        for gap in (2, 1)
        for i, a in enumerate(keys)
        if i + gap < len(keys) and keys[i + gap].stretch == a.stretch
    ]
    step = max(1, math.ceil(len(pairs) / LENS_PAIRS))
    return pairs[::step]


# --- orientations


def _turnings(watched: Watched, focal: float) -> list[Turning]:
    """Each frame's turn against its keyframe."""
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


def is_believed(turn: Turning, *, begins: bool) -> bool:
    """Whether a frame's turn is to be used."""
    return begins or (turn.share >= BELIEVED and turn.agreeing >= FEWEST_AGREEING)


def _orientations(watched: Watched, turnings: Sequence[Turning], fov: float) -> tuple[Floats, NDArray[np.bool_]]:
    """Orientations (N, 3, 3) of the frames against the shot's first camera, and which of them are believed (N,)."""
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


def _up(watched: Watched, orientation: Floats, time: Floats, gimbal: Gimbal) -> Floats:
    """Up (3,) in the shot's first camera: the gimbal's if there is one, or what most looks agree upon."""
    stated = [(i, at) for i in _every(time, GIMBAL_EVERY) if (at := gimbal.at(float(time[i]))) is not None]
    if stated:
        return common_up(
            orientation[[i for i, _ in stated]], np.stack([up_in_camera(at[1], at[2]) for _, at in stated])
        )
    position = {step.frame: i for i, step in enumerate(watched.steps)}
    ups = np.stack([up_in_camera(p.camera_elevation, p.camera_roll) for p in watched.looks.values()])
    return common_up(orientation[[position[f] for f in watched.looks]], ups)


def _every(time: Floats, seconds: float) -> NDArray[np.intp]:
    """Indices of the first frame of each interval."""
    return np.asarray(np.unique((time - time[0]) // seconds, return_index=True)[1])


# --- light


def _gains(steps: Sequence[Step]) -> Floats:
    """Gains (N, 3) of linear values against the first frame's, by way of the keyframes."""
    found: list[Floats] = []
    of_key: dict[int, Floats] = {}
    last: Floats = np.ones(3)
    for step in steps:
        base = of_key.setdefault(step.key, last)
        last = base * step.gain
        if step.makes is not None:
            of_key[step.makes] = last
        found.append(last)
    gains = np.array(found)
    return np.asarray(gains / gains[0])


def _lit(watched: Watched, around: Circumstances, path: Path, gains: Floats, lens: tuple[float, float]) -> Shot:
    fov, sigma = lens
    light = ShotLight()
    position = {step.frame: i for i, step in enumerate(watched.steps)}
    for frame, prediction in watched.looks.items():
        i = position[frame]
        evidence = around.known_at(float(path.time[i])).evidence
        light.add(Look(prediction, float(path.heading[i]), fov, luminance_gain(gains[i]), evidence))
    compass = _compass(path, around.gimbal)
    there = around.known_at(float(path.time[0]), compass)
    fused = light.answer(there.evidence)
    fused = replace(fused, prediction=replace(fused.prediction, vertical_fov=fov))
    frames = np.array([step.frame for step in watched.steps])
    return Shot(frames, path, gains, fov, sigma, fused, there, north_of(fused, there))


def luminance_gain(gain: Floats) -> float:
    """One number for gains (3,) of linear red, green and blue."""
    return float(gain @ np.array([0.2126, 0.7152, 0.0722]))


def _compass(path: Path, gimbal: Gimbal) -> float | None:
    """Where azimuth 0 points by the gimbal, deg clockwise from north; None without one."""
    said = [(i, at[0]) for i in _every(path.time, GIMBAL_EVERY) if (at := gimbal.at(float(path.time[i]))) is not None]
    if not said:
        return None
    off = np.radians([heading - path.heading[i] for i, heading in said])
    return float(np.degrees(np.arctan2(np.sin(off).mean(), np.cos(off).mean())) % 360.0)


def north_of(fused: Fused, known: Known) -> float | None:
    """Where azimuth 0 points from true north [deg], by sun and compass together or by the compass alone."""
    if fused.camera_heading is not None:
        return fused.camera_heading.best
    return known.evidence.heading

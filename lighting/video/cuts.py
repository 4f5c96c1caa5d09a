"""A clip taken apart into shots, where nothing connects what is before with what comes after, or it fades into it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lighting.turns import Matches
from lighting.video.dissolves import Dissolve
from lighting.video.follow import Key, Step
from lighting.video.keyframes import JOINS, turn_between
from lighting.video.watched import Watched

SHORT = 5  # frames, fewer than which are no shot but a gap in one


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


def divided(watched: Watched, dissolve: Dissolve) -> list[Watched]:
    """What is before the middle of a dissolve, if that is a shot, and what is after it.

    Nothing counts as followed or seen while it lasts; nor does what is followed from before it later on.
    """
    steps = watched.steps
    clear = [step for step in steps if step.time < dissolve.first]
    old = {number for step in clear for number in (step.key, step.makes)}
    late = [i for i, step in enumerate(steps) if step.time > dissolve.last and step.key not in old]
    if not late:
        return [watched]
    middle = 0.5 * (dissolve.first + dissolve.last)
    begin = sum(step.time < middle for step in steps) if len(clear) >= SHORT else 0
    ending = [*clear, *(_lost(step, clear[-1]) for step in steps[len(clear) : begin])][:begin]
    beginning = [_lost(step, steps[late[0]]) for step in steps[begin : late[0]]]
    mixed = {step.frame for step in steps if dissolve.first <= step.time <= dissolve.last}
    unmixed = replace(
        watched,
        steps=[*ending, *beginning, *steps[late[0] :]],
        keys={n: key for n, key in watched.keys.items() if key.frame not in mixed},
        looks={frame: seen for frame, seen in watched.looks.items() if frame not in mixed},
    )
    return [_part(unmixed, part) for part in (range(begin), range(begin, len(steps))) if part]


def _lost(step: Step, like: Step) -> Step:
    """A frame in which nothing can be followed, in the stretch of another one."""
    nothing = np.empty((0, 2), np.float32)
    matches = Matches(nothing, nothing, step.matches.pixel)
    return replace(like, frame=step.frame, time=step.time, matches=matches, begins=False, makes=None)


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

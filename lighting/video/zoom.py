"""A lens that is zoomed while it films: how the focal length changes, and the shot as through the lens it began with.

Whether it is zoomed at all is judged between keyframes, where a rotation with a focal length for each must explain
nearly all points and a rotation or a walk less (turns/zoomed.py). If so, each frame's focal length by its keyframe's is
followed together with its turn. Points of a picture that is divided by its zoom obey all that points of one lens do.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import atan, degrees, radians, tan

import numpy as np

from lighting.geometry import Floats
from lighting.turns import ONE_LENS, Matches, Turn, cross_matrix, focal_of, rays, rotation_about, rotation_of
from lighting.video.follow import Key, Step
from lighting.video.keyframes import JOINS, turn_between
from lighting.video.lens import far_steps, lens_by
from lighting.video.path import smoothed
from lighting.video.turning import TOLERANCE
from lighting.video.watched import Circumstances, Seen, Watched

GUESS_SPREAD = 7.0  # deg, of the field of view before anything was followed
LEAST_TOLD = 0.5  # share of the points that must agree with a zoom, or the one of the frame before stays
TOLD = 0.9  # share of a shot's frames whose zoom must be told, or the answer says that it is not sure
BEGINNING = 1.0  # s of a shot, whose looks tell the lens that it begins with
LEAST_SEEN = 0.9  # share of the points that must agree with a zoom alone, where one pair of frames decides
_STARTS = (1.0, 0.8, 1.25)  # times that lens, from which the zoom is followed: from one far off it is lost on the way
_PASSES = 4  # the zoom is followed by the lens, and the lens known by the zoom
_ROUNDS = 8  # of re-weighting, from eight times the tolerance down to it


@dataclass(frozen=True, eq=False)
class OneLens:
    """A shot as if all of it had been seen through the lens of its first frame."""

    watched: Watched
    zoom: Floats  # (N,) focal lengths of the frames by the first one's
    lens: tuple[float, float]  # vertical field of view of the first frame and its standard deviation [deg]
    told: float = 1.0  # share of the frames whose zoom their points told


def as_one_lens(watched: Watched, around: Circumstances) -> OneLens | None:
    """A shot whose lens is zoomed, as through one lens; None where one lens does."""
    turns = _zooming(watched, lens_by(watched, around, ())[0])
    first = lens_by(_beginning(watched), around, ())[0]
    found: OneLens | None = None
    for start in _STARTS if turns else ():
        one = _followed(watched, around, turns, start * first)
        if found is None or one.told > found.told:
            found = one
        if found.told >= TOLD:
            break
    return None if found is None or np.all(found.zoom == 1.0) else found


def _beginning(watched: Watched) -> Watched:
    """The shot with its first looks alone."""
    time = {step.frame: step.time for step in watched.steps}
    end = min(time[frame] for frame in watched.looks) + BEGINNING
    return replace(watched, looks={frame: seen for frame, seen in watched.looks.items() if time[frame] <= end})


def _followed(watched: Watched, around: Circumstances, turns: Sequence[tuple[int, Turn]], start: float) -> OneLens:
    """The shot through a lens that is taken to be `start` [deg] at first, or through the one given."""
    lens = (start, GUESS_SPREAD) if around.given.vertical_fov is None else (around.given.vertical_fov, 0.0)
    for _ in range(_PASSES):
        zoom, told = zooms_of(watched, lens[0])
        one = _through_the_first(watched, zoom)
        by_turns = [(zoomed_fov(turn.vertical_fov[0], 1.0 / one.keys[key].zoom), turn.fov_sigma) for key, turn in turns]
        lens = lens_by(one, around, by_turns)
    return OneLens(one, zoom, lens, told)


def _zooming(watched: Watched, vertical_fov: float) -> list[tuple[int, Turn]]:
    """Turns of zoomed cameras against keyframes of these numbers, `vertical_fov` [deg] being a guess of the lens.

    None where more turns are those of a walk.
    """
    focal = focal_of(vertical_fov, *watched.size)
    found = []
    for step in far_steps(watched):
        grown = _grown(step.matches, focal, np.eye(3), 1.0)
        if grown is not None and abs(np.log(grown[1])) > 0.5 * ONE_LENS:
            turn = rotation_of(step.matches, watched.size, watched.size, (vertical_fov, vertical_fov), GUESS_SPREAD)
            if turn is not None and step.key in watched.keys:
                found.append((step.key, turn))
    zoomed = [(key, turn) for key, turn in found if turn.zoomed]
    return zoomed if len(zoomed) >= sum(turn.translates for _, turn in found) else []


def zooms_of(watched: Watched, vertical_fov: float) -> tuple[Floats, float]:
    """Focal lengths (N,) of the frames by the first one's, whose lens has about `vertical_fov` [deg].

    Beside them the share of the frames whose points tell it. All are 1 where they change by less than those of two
    photos of one lens may.
    """
    focal = focal_of(vertical_fov, *watched.size)
    of_key: dict[int, float] = {}
    turned: Floats = np.eye(3)
    found, told, zoom, last = [], [True], 1.0, -1
    for step in watched.steps:
        if step.begins:
            of_key[step.key] = zoom = _rejoined(watched, step, of_key, zoom)
        elif len(step.matches):
            base = of_key.setdefault(step.key, zoom)
            guess = turned if step.key == last else np.eye(3)
            grown = _grown(step.matches, focal * base, guess, zoom / base)
            told.append(grown is not None)
            turned, growth = grown or (guess, zoom / base)
            zoom = base * growth
        if step.makes is not None:
            of_key[step.makes] = zoom
        found.append(zoom)
        last = step.key
    logs = smoothed(np.array([step.time for step in watched.steps]), np.log(found))
    zooms = np.exp(logs - logs[0]) if np.ptp(logs) > ONE_LENS else np.ones(len(logs))
    return zooms, float(np.mean(told))


def _through_the_first(watched: Watched, zoom: Floats) -> Watched:
    of_key: dict[int, float] = {}
    steps = []
    for step, own in zip(watched.steps, zoom.tolist(), strict=True):
        base = of_key.setdefault(step.key, own)
        if step.makes is not None:
            of_key[step.makes] = own
        steps.append(replace(step, matches=_divided(step.matches, base, own)))
    of_frame = {step.frame: own for step, own in zip(watched.steps, zoom.tolist(), strict=True)}
    keys = {number: replace(key, zoom=of_frame[key.frame]) for number, key in watched.keys.items()}
    looks = {frame: _seen_unzoomed(seen, of_frame[frame]) for frame, seen in watched.looks.items()}
    return replace(watched, steps=steps, keys=keys, looks=looks)


def is_zoomed(matches: Matches, vertical_fov: float, size: tuple[int, int]) -> bool:
    """Whether the lens was zoomed between a keyframe with `vertical_fov` [deg] and a frame, by their points alone."""
    grown = _grown(matches, focal_of(vertical_fov, *size), np.eye(3), 1.0, LEAST_SEEN)
    return grown is not None and abs(np.log(grown[1])) > ONE_LENS


def zoomed_fov(vertical_fov: float, zoom: float) -> float:
    """The vertical field of view [deg] where a focal length is `zoom` times that of one with `vertical_fov` [deg]."""
    return degrees(2.0 * atan(tan(radians(vertical_fov) / 2.0) / zoom))


def _seen_unzoomed(seen: Seen, zoom: float) -> Seen:
    said = seen.prediction
    return replace(seen, prediction=replace(said, vertical_fov=zoomed_fov(said.vertical_fov, 1.0 / zoom)))


def _divided(matches: Matches, a: float, b: float) -> Matches:
    """Matches of two pictures, each made smaller by its zoom."""
    return Matches(matches.a / a, matches.b / b, matches.pixel / min(a, b))


def _rejoined(watched: Watched, step: Step, of_key: dict[int, float], last: float) -> float:
    """The zoom of a keyframe that begins a stretch, by those before the gap that show the same."""
    if (key := watched.keys.get(step.key)) is None:
        return last
    for before in sorted((k for k in of_key if k < step.key and k in watched.keys), reverse=True)[:JOINS]:
        if (turn := turn_between(watched.keys[before], key, None)) is not None:
            return of_key[before] * _ratio(turn, key)
    return last


def _ratio(turn: Turn, key: Key) -> float:
    """The second focal length of a turn by its first."""
    if not turn.zoomed:
        return 1.0
    first, second = (focal_of(fov, *key.picture.shape[::-1]) for fov in turn.vertical_fov)
    return second / first


def _grown(
    matches: Matches, focal: float, rotation: Floats, growth: float, least: float = LEAST_TOLD
) -> tuple[Floats, float] | None:
    """The turn (3, 3) of a frame and its focal length by its keyframe's `focal` [half diagonals]; from guesses of both.

    Gauss-Newton on both together under Geman and McClure's weights; None where less than a share `least` of the points
    obeys.
    """
    a, reach = rays(matches.a, focal), TOLERANCE * matches.pixel
    turned, grown = rotation, growth
    for wider in np.geomspace(8.0, 1.0, _ROUNDS):
        there = a @ turned.T
        ahead = np.maximum(-there[:, 2:], 1e-3)
        at = grown * focal * there[:, :2] / ahead
        off = matches.b - at
        weight = np.square(1.0 / (1.0 + np.sum(np.square(off), axis=1) / (wider * reach) ** 2))
        moved = -cross_matrix(there)  # (N, 3, 3): by small rotations about each axis, in its columns
        by_turn = grown * focal * (moved[:, :2] + (there[:, :2] / ahead)[:, :, None] * moved[:, 2:]) / ahead[:, :, None]
        slope = np.concatenate([by_turn, at[:, :, None]], axis=2)
        normal = np.einsum("n,nki,nkj->ij", weight, slope, slope)
        change = np.linalg.solve(normal + 1e-12 * np.eye(4), np.einsum("n,nki,nk->i", weight, slope, off))
        turned, grown = rotation_about(change[:3]) @ turned, grown * float(np.exp(np.clip(change[3], -0.2, 0.2)))
    agreeing = np.mean(np.sum(np.square(off), axis=1) < (2.0 * reach) ** 2)
    return (turned, grown) if agreeing >= least else None

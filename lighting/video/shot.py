"""A shot solved, once its end is known: its lens, the camera's path, its one sun."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lighting.circular import mean_angle
from lighting.colour import luminance
from lighting.errors import VideoError
from lighting.evidence import Fused, Known
from lighting.geometry import Floats
from lighting.turns import level
from lighting.video.follow import gains_of
from lighting.video.lens import LENS_SPREAD, MOST_SPREADS, lens_of, said_lens
from lighting.video.light import Look, ShotLight
from lighting.video.orientations import orientations, told_by, turnings_of, up_of
from lighting.video.path import Path, path_of
from lighting.video.telemetry import Gimbal
from lighting.video.turning import Turning
from lighting.video.watched import Circumstances, Watched
from lighting.video.zoom import TOLD, OneLens, as_one_lens, zoomed_fov

LEAST_AGREED = 0.45  # share of the points that must agree in the median frame, or the answer says that it is not sure
_NIGHT_FALLS = (
    "By time and place it is night at {:.1f} s, too dark for these skies: such frames do not tell of the sun."
)
_ZOOM_LOST = (
    "The lens is zoomed, and in {:.0f} % of the frames their points do not tell by how much: headings and fields of "
    "view may be off."
)
_AT_ODDS = (
    "In most frames only {:.0f} % of the points agree with one turn, or fewer, as where things move before the camera: "
    "headings and the sun may be off."
)
_ODD_LENS = (
    "The points tell a field of view of {:.0f}°, the pictures or metadata one of {:.0f}°: they may be those of moving "
    "things, and headings and the sun off."
)


@dataclass(frozen=True, eq=False)
class Shot:
    """One shot: where the camera points in each frame, and the light in the axes of its first frame."""

    frames: NDArray[np.intp]  # (N,) indices in the clip
    path: Path
    gains: Floats  # (N, 3) of the linear values, relative to the shot's first frame
    vertical_fov: float  # deg, of the shot's first frame
    fov_sigma: float  # deg, one standard deviation of that
    zoom: Floats  # (N,) focal length by the first frame's; 1 throughout unless the lens was zoomed
    fused: Fused  # the sun, as the shot's first camera sees it, its tilt removed
    ground: Floats | None  # (3,) reflectance; None where no look shows it
    known: Known
    north: float | None  # deg clockwise from true north, where azimuth 0 points; None unknown


def solve(watched: Watched, around: Circumstances) -> Shot:
    """The shot's lens, path and light; VideoError where the network saw none of its frames.

    Raises ParameterError where the user's own time and place are of night at the clip's first frame.
    """
    if not watched.looks:
        raise VideoError("No frame of the shot is bright enough for daylight.")
    one = as_one_lens(watched, around) or _unzoomed(watched, around)
    watched, fov = one.watched, one.lens[0]
    turnings = turnings_of(watched, fov)
    orientation, believed = orientations(watched, turnings, fov)
    time = np.array([step.time for step in watched.steps])
    up = up_of(watched, orientation, time, around.gimbal)
    path = path_of(time, orientation, believed, level(up))
    gains = gains_of(watched.steps)
    return _lit(one, around, path, gains, tuple(_doubts(one, around, turnings)))


def _unzoomed(watched: Watched, around: Circumstances) -> OneLens:
    return OneLens(watched.through_known_lens(), np.ones(len(watched.steps)), lens_of(watched, around))


def _doubts(one: OneLens, around: Circumstances, turnings: Sequence[Turning]) -> Iterator[str]:
    """Sentences on why headings may be wrong though points were followed."""
    shares = [turn.share for turn, step in zip(turnings, one.watched.steps, strict=True) if len(step.matches)]
    fov, said = one.lens[0], said_lens(one.watched, around)[0]
    if one.told < TOLD:
        yield _ZOOM_LOST.format(100.0 * (1.0 - one.told))
    if shares and (agreed := float(np.median(shares))) < LEAST_AGREED:
        yield _AT_ODDS.format(100.0 * agreed)
    if around.given.vertical_fov is None and abs(fov - said) > MOST_SPREADS * LENS_SPREAD:
        yield _ODD_LENS.format(fov, said)


def _lit(one: OneLens, around: Circumstances, path: Path, gains: Floats, doubts: tuple[str, ...]) -> Shot:
    """The shot along a path with gains (N, 3): the light of its looks, with the warnings `doubts`."""
    watched, (fov, sigma) = one.watched, one.lens
    there = around.known_at(float(path.time[0]), _compass(path, around.gimbal))
    position = {step.frame: i for i, step in enumerate(watched.steps)}
    at = {frame: around.known_at(float(path.time[position[frame]])) for frame in watched.looks}
    used = _by_day(at, there)
    light = ShotLight()
    for frame, seen in watched.looks.items():
        if frame in used:
            i = position[frame]
            gain = float(luminance(gains[i]))
            own = zoomed_fov(fov, float(one.zoom[i]))
            light.add(Look(seen, float(path.heading[i]), own, gain, at[frame].evidence))
    if dark := [float(path.time[position[frame]]) for frame in at if frame not in used]:
        there = replace(there, warnings=(*there.warnings, _NIGHT_FALLS.format(min(dark))))
    there = replace(there, warnings=(*there.warnings, *doubts))
    fused = light.answer(there.evidence)
    fused = replace(fused, prediction=replace(fused.prediction, vertical_fov=fov))
    frames = np.array([step.frame for step in watched.steps])
    return Shot(frames, path, gains, fov, sigma, one.zoom, fused, light.ground, there, north_of(fused, there))


def _by_day(at: Mapping[int, Known], first: Known) -> set[int]:
    """The frames that count, of those with what is known `at` each: not those of night in a shot that begins by day."""
    day = {frame for frame, known in at.items() if not known.is_night}
    return day if day and not first.is_night else set(at)


def _compass(path: Path, gimbal: Gimbal) -> float | None:
    """Where azimuth 0 points by the gimbal, deg clockwise from north; None without one."""
    said = told_by(gimbal, path.time)
    if not said:
        return None
    return mean_angle([heading - path.heading[i] for i, (heading, *_) in said]) % 360.0


def north_of(fused: Fused, known: Known) -> float | None:
    """Where azimuth 0 points from true north [deg], by sun and compass together or by the compass alone."""
    if fused.camera_heading is not None:
        return fused.camera_heading.best
    return known.evidence.heading

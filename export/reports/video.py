"""How well clips are tracked: accuracy, trembling and drift, with exact truth."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from export import CLIP_KINDS
from export.data.panoramas import DataError, Panorama, read_index
from export.evaluation.metrics import figures_table
from export.reports.clips import RenderedClip, film_panorama
from lighting.color import luminance
from lighting.fusion.single_view import Observations
from lighting.geometry import (
    Floats,
    angle_between,
    direction,
    wrap_azimuth,
    zoomed_fov,
)
from lighting.model import Model
from lighting.prediction import SunEstimate
from lighting.video.intrinsics import smooth_parabolic
from lighting.video.observation import NETWORK_INTERVAL, FrameObservation, ShotLight, estimate_frame, observe_shots
from lighting.video.shot import Shot, solve_shot
from lighting.video.tracking import ClipMetadata

SMOOTHING = 1.0  # s of the smooth curve that trembling is measured against
CLIPS_NOTE = (
    "Medians over the clips, angles in deg. `heading`: error of the camera's heading against the first frame, in the "
    "median and at 90 % of a clip's frames. `trembling`: of the sun's azimuth in each frame, the standard deviation of "
    "its error against a smooth curve (a parabola through one second). `to best`: from the clip's sun to what the "
    "network says of five frames a second, truly rotated. `sun`, `best's sun`: errors of both. `gain`: error "
    "of the exposure against the first frame [%]. `bridged`: frames in which nothing could be followed [%]. `split`: "
    "clips that were taken for several shots. `doubted`: clips whose answer has a warning."
)
_OF_CAMERA = ("heading", "heading, 90 %", "trembling", "field of view", "elevation", "roll")
MEDIANS = (*_OF_CAMERA, "to best", "sun", "best's sun", "gain")


def report_video(data: Path, model: Model, kinds: Sequence[str] = (), count: int = 8) -> str:
    """A table in Markdown of clips of 6 s, a row a kind.

    Args:
        data: folder of panoramas.
        model: the network to ask.
        kinds: of CLIP_KINDS; none for all.
        count: clips of each kind, each of another panorama of `val`.

    Raises:
        DataError: if no panorama of `val` shows its sun.
    """
    panoramas = _choose_panoramas(data, count)
    rows = {}
    for kind in kinds or CLIP_KINDS:
        rows[kind] = _kind_figures([_measure_clip(film_panorama(p, kind), model) for p in panoramas])
    title = f"## Clips of 6 s, 640 x 360 pixels, {len(panoramas)} of each kind, in places that training never saw"
    return f"{title}\n\n{CLIPS_NOTE}\n\n{figures_table(rows, digits=2)}"


def _choose_panoramas(data: Path, count: int) -> list[Panorama]:
    """`val` panoramas that show their sun, in a fixed order: each of another place as long as there are some."""
    suited = [p for p in read_index(data, "val") if p.sun == "visible" and p.sun_azimuth is not None]
    if not suited:
        raise DataError(f"{data} has no panorama in `val` that shows a given sun.")
    order = np.random.default_rng(21).permutation(len(suited))
    first: dict[str, Panorama] = {}
    for i in order:
        first.setdefault(suited[i].place, suited[i])
    rest = [suited[i] for i in order if suited[i] not in first.values()]
    return [*first.values(), *rest][:count]


# Figures of a clip, and of all clips of a kind.


def _measure_clip(clip: RenderedClip, model: Model) -> dict[str, float]:
    shots = list(observe_shots(clip.frames(), model))
    longest = max(shots, key=lambda watched: len(watched.steps))
    shot = solve_shot(longest, ClipMetadata())
    first = int(shot.frames[0])
    best = _sun_vector(_sun_by_true_rotations(clip, first, model))
    true = direction(clip.sun[0] - clip.path[0][first], clip.sun[1])  # as the shot's first frame sees it
    sun, fovs = _sun_vector(shot.posterior.sun), _fovs(shot.vertical_fov, shot.zoom)
    error = float(angle_between(sun, true))
    return {
        **_tracking_errors(shot, clip),
        "field of view": float(np.median(np.abs(fovs - _fovs(clip.vertical_fov, clip.zoom[shot.frames])))),
        "to best": float(angle_between(sun, best)),
        "sun": error,
        "best's sun": float(angle_between(best, true)),
        "in 50 %": 100.0 * (error <= shot.posterior.sun.radius_50),
        "in 90 %": 100.0 * (error <= shot.posterior.sun.radius_90),
        "split": float(len(shots) > 1),
        "doubted": float(bool(shot.prior.warnings)),
    }


def _sun_vector(sun: SunEstimate) -> Floats:
    return direction(sun.azimuth, sun.elevation)


def _fovs(vertical_fov: float, zoom: Floats) -> Floats:
    """Of each frame (N,) [deg]."""
    return np.array([zoomed_fov(vertical_fov, z) for z in zoom.tolist()])


def _tracking_errors(shot: Shot, clip: RenderedClip) -> dict[str, float]:
    """Errors of the camera's angles and of the exposure."""
    path, part = shot.path, shot.frames
    azimuth, elevation, roll = (angle[part] for angle in clip.path)
    heading = np.abs(wrap_azimuth(path.heading - path.heading[0] - (azimuth - azimuth[0])))
    sun = np.degrees(np.unwrap(np.radians(shot.posterior.sun.azimuth - path.heading - (clip.sun[0] - azimuth))))
    window = min(len(sun), round(SMOOTHING / float(np.median(np.diff(path.time)))) // 2 * 2 + 1)
    true_gains = clip.gain[part] / clip.gain[part[0]]
    gains = [float(luminance(gain) / luminance(true)) for gain, true in zip(shot.gains, true_gains, strict=True)]
    return {
        "heading": float(np.median(heading)),
        "heading, 90 %": float(np.percentile(heading, 90)),
        "trembling": float((sun - smooth_parabolic(path.time, sun, window)).std()),
        "elevation": float(np.median(np.abs(path.elevation - elevation))),
        "roll": float(np.median(np.abs(path.roll - roll))),
        "gain": 100.0 * float(np.median(np.abs(np.array(gains) - 1.0))),
        "bridged": 100.0 * float(path.bridged.mean()),
    }


def _sun_by_true_rotations(clip: RenderedClip, first: int, model: Model) -> SunEstimate:
    """The sun that many frames give with true rotations, as frame `first` sees it."""
    light, azimuth = ShotLight(), clip.path[0]
    every = max(1, round(NETWORK_INTERVAL / float(np.median(np.diff(clip.time)))))
    for frame in clip.frames(every):
        heading = float(azimuth[frame.index] - azimuth[first])
        fov = zoomed_fov(clip.vertical_fov, float(clip.zoom[frame.index]))
        light.add(FrameObservation(estimate_frame(model, frame.pixels), heading, fov))
    return light.answer(Observations()).sun


def _kind_figures(clips: Sequence[dict[str, float]]) -> dict[str, float]:
    """One row of the table: medians, worst cases, means and counts."""
    values = {name: np.array([clip[name] for clip in clips]) for name in clips[0]}
    return {
        **{name: float(np.median(values[name])) for name in MEDIANS},
        **{f"{name}, worst": float(values[name].max()) for name in ("trembling", "to best")},
        **{name: float(values[name].mean()) for name in ("in 50 %", "in 90 %", "bridged")},
        **{name: float(values[name].sum()) for name in ("split", "doubted")},
    }

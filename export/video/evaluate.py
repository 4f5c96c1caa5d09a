"""The figures of `python -m export video`."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np

from export.data import DataError, Panorama, read_index
from export.evaluation.tables import table
from export.video.dissolves import dissolve_report
from export.video.sequences import Sequenced, sequences
from export.video.speed import speed_report
from export.video.streams import stream_report
from lighting.colour import luminance
from lighting.evidence import Evidence
from lighting.geometry import Floats, angle_between, direction, wrap_azimuth
from lighting.model import Model
from lighting.records import SunEstimate
from lighting.video.light import Look, ShotLight
from lighting.video.path import smoothed
from lighting.video.shot import Shot, solve
from lighting.video.watch import EVERY, see, shots_watched
from lighting.video.watched import Circumstances
from lighting.video.zoom import zoomed_fov

SMOOTH = 1.0  # s of the smooth curve that trembling is measured against
EXPLAINED = (
    "Medians over the clips, angles in deg. `heading`: error of the camera's heading against the first frame, in the "
    "median and at 90 % of a clip's frames. `trembling`: of the sun's azimuth in each frame, the standard deviation of "
    "its error against a smooth curve (a parabola through one second). `to best`: from the clip's sun to what the "
    "network says of five frames a second, truly turned. `sun`, `best's sun`: errors of both. `gain`: error "
    "of the exposure against the first frame [%]. `bridged`: frames in which nothing could be followed [%]. `split`: "
    "clips that were taken for several shots. `doubted`: clips whose answer has a warning."
)
MEDIANS = (
    "heading",
    "heading, 90 %",
    "trembling",
    "field of view",
    "elevation",
    "roll",
    "to best",
    "sun",
    "best's sun",
    "gain",
)


def evaluate(data: Path, count: int, kinds: Sequence[str], model: Model, only: str | None = None) -> Iterator[str]:
    """The report's parts: clips and dissolves of `count` `val` panoramas, streams and speed, or `only` one of PARTS."""
    panoramas = chosen(data, count)
    if only in (None, "clips"):
        yield clip_report(panoramas, kinds, model)
    if only in (None, "dissolves"):
        yield dissolve_report(panoramas, kinds, model)
    if only in (None, "streams"):
        yield stream_report(panoramas, model)
    if only in (None, "speed"):
        yield speed_report(panoramas[0], model)


def clip_report(panoramas: Sequence[Panorama], kinds: Sequence[str], model: Model) -> str:
    """The table of clips, a row a kind."""
    rows = {kind: figures([measured(s, model) for s in sequences(panoramas, kind)]) for kind in kinds}
    title = f"## Clips of 6 s, 640 x 360 pixels, {len(panoramas)} of each kind, in places that training never saw"
    return f"{title}\n\n{EXPLAINED}\n\n{shown(rows)}"


def shown(rows: dict[str, dict[str, float]]) -> str:
    """A table with two decimals."""
    columns = list(next(iter(rows.values())))
    return table(["", *columns], [[name, *(f"{row[c]:.2f}" for c in columns)] for name, row in rows.items()])


def chosen(data: Path, count: int) -> list[Panorama]:
    """`val` panoramas that show their sun, each of another place as long as there are some, in a fixed order.

    DataError if there are none.
    """
    suited = [p for p in read_index(data, "val") if p.sun == "visible" and p.sun_azimuth is not None]
    if not suited:
        raise DataError(f"{data} has no panorama in `val` that shows a given sun.")
    order = np.random.default_rng(21).permutation(len(suited))
    first: dict[str, Panorama] = {}
    for i in order:
        first.setdefault(suited[i].place, suited[i])
    rest = [suited[i] for i in order if suited[i] not in first.values()]
    return [*first.values(), *rest][:count]


def measured(truth: Sequenced, model: Model) -> dict[str, float]:
    """What one clip gives."""
    shots = list(shots_watched(truth.frames(), model))
    longest = max(shots, key=lambda w: len(w.steps))
    shot = solve(longest, Circumstances())
    best, true = best_sun(truth, int(shot.frames[0]), model), _true_sun(truth, shot)
    sun, fovs = toward(shot.fused.sun), _fovs(shot.vertical_fov, shot.zoom)
    error = float(angle_between(sun, true))
    return {
        **_followed(shot, truth),
        "field of view": float(np.median(np.abs(fovs - _fovs(truth.vertical_fov, truth.zoom[shot.frames])))),
        "to best": float(angle_between(sun, toward(best))),
        "sun": error,
        "best's sun": float(angle_between(toward(best), true)),
        "in 50 %": 100.0 * (error <= shot.fused.sun.radius_50),
        "in 90 %": 100.0 * (error <= shot.fused.sun.radius_90),
        "split": float(len(shots) > 1),
        "doubted": float(bool(shot.known.warnings)),
    }


def _fovs(vertical_fov: float, zoom: Floats) -> Floats:
    """Of each frame (N,) [deg]."""
    return np.array([zoomed_fov(vertical_fov, z) for z in zoom.tolist()])


def _followed(shot: Shot, truth: Sequenced) -> dict[str, float]:
    """How well the camera was followed."""
    path, part = shot.path, shot.frames
    azimuth, elevation, roll = (angle[part] for angle in truth.path)
    heading = np.abs(wrap_azimuth(path.heading - path.heading[0] - (azimuth - azimuth[0])))
    off = np.degrees(np.unwrap(np.radians(shot.fused.sun.azimuth - path.heading - (truth.sun[0] - azimuth))))
    window = min(len(off), round(SMOOTH / float(np.median(np.diff(path.time)))) // 2 * 2 + 1)
    return {
        "heading": float(np.median(heading)),
        "heading, 90 %": float(np.percentile(heading, 90)),
        "trembling": float((off - smoothed(path.time, off, window)).std()),
        "elevation": float(np.median(np.abs(path.elevation - elevation))),
        "roll": float(np.median(np.abs(path.roll - roll))),
        "gain": _gain_error(shot, truth),
        "bridged": 100.0 * float(path.bridged.mean()),
    }


def toward(sun: SunEstimate) -> Floats:
    """Unit vector (3,)."""
    return direction(sun.azimuth, sun.elevation)


def _true_sun(truth: Sequenced, shot: Shot) -> Floats:
    """Where the sun stands as the shot's first frame sees it."""
    return direction(truth.sun[0] - truth.path[0][shot.frames[0]], truth.sun[1])


def best_sun(truth: Sequenced, first: int, model: Model) -> SunEstimate:
    """The sun that many frames give with true rotations, as frame `first` sees it."""
    light, azimuth = ShotLight(), truth.path[0]
    every = max(1, round(EVERY / float(np.median(np.diff(truth.time)))))
    for frame in truth.frames(every):
        turn = float(azimuth[frame.index] - azimuth[first])
        fov = zoomed_fov(truth.vertical_fov, float(truth.zoom[frame.index]))
        light.add(Look(see(model, frame.pixels), turn, fov))
    return light.answer(Evidence()).sun


def _gain_error(shot: Shot, truth: Sequenced) -> float:
    """Percent, in the median over the frames."""
    true = truth.gain[shot.frames] / truth.gain[shot.frames[0]]
    said = [float(luminance(g) / luminance(t)) for g, t in zip(shot.gains, true, strict=True)]
    return 100.0 * float(np.median(np.abs(np.array(said) - 1.0)))


def figures(clips: Iterable[dict[str, float]]) -> dict[str, float]:
    """One row of the table."""
    all_of = list(clips)
    every = {name: np.array([clip[name] for clip in all_of]) for name in all_of[0]}
    found = {name: float(np.median(every[name])) for name in MEDIANS}
    worst = {f"{name}, worst": float(every[name].max()) for name in ("trembling", "to best")}
    means = {name: float(every[name].mean()) for name in ("in 50 %", "in 90 %", "bridged")}
    return {**found, **worst, **means, **{name: float(every[name].sum()) for name in ("split", "doubted")}}

"""How far normals are off: by shape and season, by what the photographer gets wrong, by how many photos there are.

Every figure is of simulated photos under Hosek-Wilkie skies, median / mean angle in degrees over all pixels; none is of
real photographs.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from export.stereo.days import hours_of
from export.stereo.objects import Subject, subjects
from export.stereo.trials import SEASONS, Errors, Trial, errors, solved
from lighting.errors import LightingError
from lighting.stereo.normals_depth import depth_error, integrate
from lighting.stereo.normals_network import Network

Image = NDArray[np.float32]
Say = Callable[[str], None]

COARSE = 3  # every so many pixels of the shapes, in the tables beside the first

_DATES = ("2024-03-21", "2024-06-21", "2024-12-21")
_WRONG: dict[str, dict[str, Any]] = {
    "nothing wrong": {},
    "heading off by 2°": {"heading_error": 2.0},
    "clock off by 5 min": {"clock_error": 5.0},
    "turbidity off by 2": {"turbidity_error": 2.0},
    "cast shadows": {"shadows": True},
    "all four": {"heading_error": 2.0, "clock_error": 5.0, "turbidity_error": 2.0, "shadows": True},
}


def evaluate(data: Path, network: Network, say: Say, *, quick: bool = False) -> None:
    """Print every table; `quick` thins the shapes of the first one too. LightingError where no shape is at hand."""
    coarse = list(subjects(data, COARSE))
    if not coarse:
        raise LightingError(f"{data} holds no scanned_objects and no meshes.")
    fine = coarse if quick else list(subjects(data))
    _seasons(fine, network, say)
    _objects(fine, network, say)
    scanned = [subject for subject in coarse if subject.scale] or coarse
    _depths(scanned, network, say)
    _table("What is wrong", _WRONG, scanned, network, say)
    _counts(scanned, network, say)
    _table("Heading off by", {f"{d:+d}°": {"heading_error": float(d)} for d in (-5, -2, 0, 2, 5)}, scanned, network, say)
    told = {f"{t:g}": {"turbidity_error": 3.0 - t, "sky": t} for t in (2.0, 3.0, 4.0, 6.0)}
    _table("Turbidity, told 3", told, scanned, network, say)
    _table("Gloss", {f"{g:g}": {"gloss": g} for g in (0.0, 0.05, 0.1, 0.2)}, scanned, network, say)


def _seasons(shapes: Sequence[Subject], network: Network, say: Say) -> None:
    say("\nSearch and network by season; eight photos from 9 to 16 h, 1 % noise, level camera that looks north\n")
    _head(("shapes", "channels", "cast shadows"), say)
    for group in dict.fromkeys(shape.group for shape in shapes):
        for colour in (False, True):
            for shadows in (False, True):
                trials = [Trial(day, shadows=shadows, colour=colour) for day in SEASONS.values()]
                chosen = [shape for shape in shapes if shape.group == group]
                cells = [_cell(chosen, trial, network) for trial in trials]
                _row((group, "3" if colour else "1", "yes" if shadows else "no"), cells, say)


def _objects(shapes: Sequence[Subject], network: Network, say: Say) -> None:
    say("\nThe same by shape; one channel, no cast shadows\n")
    _head(("shape",), say)
    for shape in shapes:
        _row((shape.name,), [_cell([shape], Trial(day), network) for day in SEASONS.values()], say)


def _depths(shapes: Sequence[Subject], network: Network, say: Say) -> None:
    say("\nMean error of the integrated depth [mm] on the scanned objects: of true normals, search, network\n")
    _head(("shape",), say)
    for shape in shapes:
        _row((shape.name,), [_depth(shape, Trial(day), network) for day in SEASONS.values()], say)


def _depth(shape: Subject, trial: Trial, network: Network) -> str:
    alone, both = solved(shape, trial, network)
    surface = shape.surface
    found = (integrate(normal, surface.mask) for normal in (surface.normals, alone.normal, both.normal))
    scale = shape.scale or 1.0
    return ", ".join(f"{scale * depth_error(depth, surface.height, surface.mask):.1f}" for depth in found)


def _counts(shapes: Sequence[Subject], network: Network, say: Say) -> None:
    rows: dict[str, dict[str, Any]] = {f"{count}": {"count": count} for count in range(3, 9)}
    _table("Photos from 9 to 16 h", rows, shapes, network, say)


def _table(title: str, rows: dict[str, dict[str, Any]], shapes: Sequence[Subject], network: Network, say: Say) -> None:
    say(f"\n{title}; scanned objects, every {COARSE}rd pixel, one channel\n")
    _head((title,), say)
    for name, change in rows.items():
        cells = [_cell(shapes, _trial(season, change), network) for season in range(len(SEASONS))]
        _row((name,), cells, say)


def _trial(season: int, change: dict[str, Any]) -> Trial:
    """A season's trial with fields of it, the true turbidity `sky` or the `count` of photos changed."""
    day = list(SEASONS.values())[season]
    rest = dict(change)
    if count := rest.pop("count", None):
        day = replace(day, times=hours_of(_DATES[season], np.linspace(9.0, 16.0, count)))
    if sky := rest.pop("sky", None):
        day = replace(day, turbidity=sky)
    return Trial(day, **rest)


def _cell(shapes: Sequence[Subject], trial: Trial, network: Network) -> str:
    found = Errors()
    for shape in shapes:
        found.add(errors(shape, trial, network))
    return f"{_both(found.search)}, {_both(found.network)}"


def _both(parts: Iterable[Image]) -> str:
    values = np.concatenate(list(parts))
    return f"{np.median(values):.1f} / {values.mean():.1f}"


def _head(names: Sequence[str], say: Say) -> None:
    columns = [*names, *(f"{season}: search, network" for season in SEASONS)]
    say("| " + " | ".join(columns) + " |")
    say("|" + "---|" * len(columns))


def _row(names: Sequence[str], cells: Sequence[str], say: Say) -> None:
    say("| " + " | ".join([*names, *cells]) + " |")

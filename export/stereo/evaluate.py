"""How far normals are off: by shape and season, by what the photographer gets wrong, by how many photos there are.

Every figure is of simulated photos under Hosek-Wilkie skies, median / mean angle in degrees over all pixels; none is of
real photographs.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from export.stereo.days import hours_of
from export.stereo.objects import Subject, subjects
from export.stereo.trials import SEASONS, Found, Trial, session
from lighting.errors import LightingError
from lighting.stereo.normals.depth import depth_error, integrate
from lighting.stereo.normals.network import Network

Image = NDArray[np.float32]
Say = Callable[[str], None]

FINE, COARSE = 2, 4  # every so many pixels of the shapes, in the first tables and in the others

_DATES = ("2024-03-21", "2024-06-21", "2024-12-21")
_WRONG: dict[str, dict[str, Any]] = {
    "nothing wrong": {},
    "heading off by 2°": {"heading_error": 2.0},
    "clock off by 5 min": {"clock_error": 5.0},
    "turbidity off by 2": {"turbidity_error": 2.0},
    "turbidity found from the photos": {"fitted": True},
    "cast shadows": {"shadows": True},
    "all four": {"heading_error": 2.0, "clock_error": 5.0, "turbidity_error": 2.0, "shadows": True},
    "the same, turbidity found": {"heading_error": 2.0, "clock_error": 5.0, "fitted": True, "shadows": True},
}


Table = Literal["seasons", "wrong", "photos", "heading", "turbidity", "gloss"]
TABLES = get_args(Table)

_CHANGES: dict[Table, tuple[str, dict[str, dict[str, Any]]]] = {
    "wrong": ("What is wrong", _WRONG),
    "photos": ("Photos from 9 to 16 h", {f"{count}": {"count": count} for count in range(3, 9)}),
    "heading": ("Heading off by", {f"{d:+d}°": {"heading_error": float(d)} for d in (-5, -2, 0, 2, 5)}),
    "turbidity": (
        "Turbidity, told 3",
        {f"{t:g}": {"turbidity_error": 3.0 - t, "sky": t} for t in (2.0, 3.0, 4.0, 6.0)},
    ),
    "gloss": ("Gloss", {f"{g:g}": {"gloss": g} for g in (0.0, 0.05, 0.1, 0.2)}),
}


def evaluate(data: Path, network: Network, say: Say, *, quick: bool = False, tables: Sequence[Table] = TABLES) -> None:
    """Print tables; `quick` thins the shapes of `seasons` too. LightingError where no shape is at hand."""
    coarse = list(subjects(data, COARSE))
    if not coarse:
        raise LightingError(f"{data} holds no scanned_objects and no meshes.")
    scanned = [subject for subject in coarse if subject.scale] or coarse
    for table in tables:
        if table == "seasons":
            _seasons(coarse if quick else list(subjects(data, FINE)), network, say)
        else:
            _table(*_CHANGES[table], scanned, network, say)


def _seasons(shapes: Sequence[Subject], network: Network, say: Say) -> None:
    """By group of shapes, channels and cast shadows; then the shapes one by one, and their depths."""
    say("\nSearch and network by season; eight photos from 9 to 16 h, 1 % noise, level camera that looks north\n")
    _head(("shapes", "channels", "cast shadows"), say)
    plain: list[list[Found]] = []
    for group in dict.fromkeys(shape.group for shape in shapes):
        chosen = [shape for shape in shapes if shape.group == group]
        for colour, shadows in ((False, False), (False, True), (True, False), (True, True)):
            trials = [Trial(day, shadows=shadows, colour=colour) for day in SEASONS.values()]
            found = [session(chosen, trial, network) for trial in trials]
            plain += [] if colour or shadows else [list(row) for row in zip(*found, strict=True)]
            names = (group, "3" if colour else "1", "yes" if shadows else "no")
            _row(names, [_cell(season) for season in found], say)
    _each(plain, say)


def _each(found: Sequence[Sequence[Found]], say: Say) -> None:
    say("\nThe same by shape; one channel, no cast shadows\n")
    _head(("shape",), say)
    for seasons in found:
        _row((seasons[0].subject.name,), [_cell([season]) for season in seasons], say)
    say("\nMean error of the integrated depth [mm] on the scanned objects: of true normals, search, network\n")
    _head(("shape",), say)
    for seasons in found:
        if seasons[0].subject.scale:
            _row((seasons[0].subject.name,), [_depth(season) for season in seasons], say)


def _depth(found: Found) -> str:
    surface, scale = found.subject.surface, found.subject.scale
    depths = (integrate(normals, surface.mask) for normals in (surface.normals, found.search, found.network))
    return ", ".join(f"{scale * depth_error(depth, surface.height, surface.mask):.1f}" for depth in depths)


def _table(title: str, rows: dict[str, dict[str, Any]], shapes: Sequence[Subject], network: Network, say: Say) -> None:
    say(f"\n{title}; scanned objects, every {COARSE}th pixel, one channel\n")
    _head((title,), say)
    for name, change in rows.items():
        cells = [_cell(session(shapes, _trial(season, change), network)) for season in range(len(SEASONS))]
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


def _cell(found: Sequence[Found]) -> str:
    """Median / mean error of the search, and of search and network together."""
    return ", ".join(_both(parts) for parts in zip(*(shape.errors() for shape in found), strict=True))


def _both(parts: Iterable[Image]) -> str:
    values = np.concatenate(list(parts))
    return f"{np.median(values):.1f} / {values.mean():.1f}"


def _head(names: Sequence[str], say: Say) -> None:
    columns = [*names, *(f"{season}: search, network" for season in SEASONS)]
    say("| " + " | ".join(columns) + " |")
    say("|" + "---|" * len(columns))


def _row(names: Sequence[str], cells: Sequence[str], say: Say) -> None:
    say("| " + " | ".join([*names, *cells]) + " |")

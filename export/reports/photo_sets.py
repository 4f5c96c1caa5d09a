"""The tables of photos of one place: their turns, and what these make of the sun."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from export import PHOTO_SET_PARTS
from export.data.panoramas import DataError, Panorama, read_index
from export.evaluation.metrics import table
from export.reports.multi_view import (
    GROUP_KINDS,
    TILTED_EACH,
    VIEW_COUNTS,
    cross_fit_correlation,
    fit_correlation,
    fuse_sets,
    group_kinds,
    has_certain_sun,
    predict_panoramas,
    region_coverage,
    set_figures,
    set_sun_figures,
)
from export.reports.registration import (
    match_sweeps,
    match_walks,
    match_zooms,
    one_panorama_per_place,
    pair_figures,
    split_by_overlap,
)
from lighting.model import Model

WALKS, SETS = 24, 36  # rendered places walked through, places with a set


@dataclass(frozen=True)
class PhotoSetOptions:
    """What is to be measured, and with which network."""

    data: Path
    parts: Sequence[str] = PHOTO_SET_PARTS
    split: str = "val"
    last: int | None = None  # only so many last rows of the index, from places that no earlier row has
    count: int | None = None  # at most so many places and walks of each part
    model: Path | None = None  # None: the one in the package

    def most(self, usual: int) -> int:
        """How many of a part to measure, `usual` unless fewer are asked for."""
        return usual if self.count is None else min(usual, self.count)


def report_photo_sets(asked: PhotoSetOptions) -> str:
    """The tables asked for; DataError if no panorama is left for them."""
    panoramas = _rows(asked.data, asked.split, asked.last)
    if not panoramas and set(asked.parts) != {"walks"}:  # which are rendered
        raise DataError(f"No panorama of {asked.data} is left in `{asked.split}`.")
    made = {"pairs": _pairs, "zooms": _zooms, "walks": _walks, "sets": _sets, "overlap": _overlap}
    return "\n\n".join(made[part](asked, panoramas) for part in asked.parts) + "\n"


def _rows(data: Path, split: str, last: int | None) -> list[Panorama]:
    rows = read_index(data)
    older = {p.place for p in rows[:-last]} if last else set()
    return [p for p in rows if p.split == split and p.place not in older]


def _network(asked: PhotoSetOptions) -> Model:
    return Model.load(asked.model, threads=1)


def _pairs(asked: PhotoSetOptions, panoramas: Sequence[Panorama]) -> str:
    answers, strangers = match_sweeps(one_panorama_per_place(panoramas)[: asked.count])
    rows = {"all": pair_figures(answers)}
    rows |= {name: pair_figures(part) for name, part in split_by_overlap(answers).items() if part}
    false = sum(turn is not None for turn in strangers)
    return "\n\n".join(
        [
            f"## Two photos of one panorama ({len(answers)} places), unknown lens, gains of 0.7 to 1.3 [deg]",
            _figures(rows),
            f"Photos of two different places: {false} of {len(strangers)} pairs were given a turn.",
        ]
    )


def _zooms(asked: PhotoSetOptions, panoramas: Sequence[Panorama]) -> str:
    answers = list(match_zooms(one_panorama_per_place(panoramas)[: asked.count]))
    title = f"## Two photos of one panorama ({len(answers)} places), one zoomed, their mean lens known to 5° [deg]"
    return f"{title}\n\n{_figures({'all': pair_figures(answers)})}"


def _walks(asked: PhotoSetOptions, _: Sequence[Panorama]) -> str:
    answers = list(match_walks(asked.most(WALKS)))
    title = (
        f"## Two photos of {len(answers)} rendered places from standpoints 0.3 to 3 m apart, the lens known to 5° [deg]"
    )
    return f"{title}\n\n{_figures({'all': pair_figures(answers)})}"


def _sets(asked: PhotoSetOptions, panoramas: Sequence[Panorama]) -> str:
    found = fuse_sets(_network(asked), one_panorama_per_place(panoramas)[: asked.most(SETS)])
    return "\n\n".join(
        [
            f"## Sets of 3 to 5 overlapping photos ({len(found)} places)",
            _figures({"all": set_figures(found)}),
            _figures(set_sun_figures(found)),
        ]
    )


def _overlap(asked: PhotoSetOptions, panoramas: Sequence[Panorama]) -> str:
    network, certain = _network(asked), list(filter(has_certain_sun, panoramas))[: asked.count]
    views, tilted = predict_panoramas(network, certain), predict_panoramas(network, certain, tilted=True)
    rows = {f"{size}, {kind}": region_coverage(views, size, kind) for size in VIEW_COUNTS for kind in group_kinds(size)}
    sizes = [size for size in VIEW_COUNTS if size <= TILTED_EACH]
    rows |= {f"{size}, tilted by up to 20°": region_coverage(tilted, size, GROUP_KINDS[0]) for size in sizes}
    title = f"## Views of {len(views)} panoramas of {len({v.place for v in views})} places"
    learnt = _figures(
        {**cross_fit_correlation(views), "all places": fit_correlation(views) | {"NLL of the other half": np.nan}}
    )
    return "\n\n".join([title, "How the errors correlate", learnt, _figures(rows)])


def _figures(rows: dict[str, dict[str, float]]) -> str:
    """Rows of figures, with as many digits as each needs."""
    names = list(next(iter(rows.values())))
    return table(["", *names], [[name, *(_shown(row[key]) for key in names)] for name, row in rows.items()])


def _shown(value: float) -> str:
    if not np.isfinite(value):
        return "-"
    if value >= 100 and value == round(value):
        return f"{value:.0f}"
    return f"{value:.2f}" if abs(value) < 10 else f"{value:.1f}"

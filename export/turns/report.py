"""The tables that `python -m export turns` prints, in Markdown."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from export.data import DataError, Panorama, read_index
from export.evaluation.tables import table
from export.turns import PARTS, groups, overlap, pairs
from export.turns.sets import one_each
from lighting.model import Model

WALKS, SETS = 24, 36  # rendered places walked through, places with a set


@dataclass(frozen=True)
class Asked:
    """What is to be measured, and with which network."""

    data: Path
    parts: Sequence[str] = PARTS
    split: str = "val"
    last: int | None = None  # only so many last rows of the index, from places that no earlier row has
    count: int | None = None  # at most so many places and walks of each part
    model: Path | None = None  # None: the one in the package

    def most(self, usual: int) -> int:
        """How many of a part to measure, `usual` unless fewer are asked for."""
        return usual if self.count is None else min(usual, self.count)


def report(asked: Asked) -> str:
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


def _network(asked: Asked) -> Model:
    return Model.load(asked.model, threads=1)


def _pairs(asked: Asked, panoramas: Sequence[Panorama]) -> str:
    answers, strangers = pairs.turned(one_each(panoramas)[: asked.count])
    rows = {"all": pairs.figures(answers)}
    rows |= {name: pairs.figures(part) for name, part in pairs.by_overlap(answers).items() if part}
    false = sum(turn is not None for turn in strangers)
    return "\n\n".join(
        [
            f"## Two photos of one panorama ({len(answers)} places), unknown lens, gains of 0.7 to 1.3 [deg]",
            _figures(rows),
            f"Photos of two different places: {false} of {len(strangers)} pairs were given a turn.",
        ]
    )


def _zooms(asked: Asked, panoramas: Sequence[Panorama]) -> str:
    answers = list(pairs.zoomed(one_each(panoramas)[: asked.count]))
    title = f"## Two photos of one panorama ({len(answers)} places), one zoomed, their mean lens known to 5° [deg]"
    return f"{title}\n\n{_figures({'all': pairs.figures(answers)})}"


def _walks(asked: Asked, _: Sequence[Panorama]) -> str:
    answers = list(pairs.walked(asked.most(WALKS)))
    title = (
        f"## Two photos of {len(answers)} rendered places from standpoints 0.3 to 3 m apart, the lens known to 5° [deg]"
    )
    return f"{title}\n\n{_figures({'all': pairs.figures(answers)})}"


def _sets(asked: Asked, panoramas: Sequence[Panorama]) -> str:
    found = groups.groups(_network(asked), one_each(panoramas)[: asked.most(SETS)])
    return "\n\n".join(
        [
            f"## Sets of 3 to 5 overlapping photos ({len(found)} places)",
            _figures({"all": groups.figures(found)}),
            _figures(groups.sun_figures(found)),
            _figures(groups.tilt_figures(found)),
        ]
    )


def _overlap(asked: Asked, panoramas: Sequence[Panorama]) -> str:
    network, certain = _network(asked), list(filter(overlap.is_certain, panoramas))[: asked.count]
    views, tilted = overlap.views_of(network, certain), overlap.views_of(network, certain, tilted=True)
    rows = {
        f"{size}, {kind}": overlap.coverage(views, size, kind) for size in overlap.SIZES for kind in overlap.kinds(size)
    }
    sizes = [size for size in overlap.SIZES if size <= overlap.TILTED]
    rows |= {f"{size}, tilted by up to 20°": overlap.coverage(tilted, size, overlap.KINDS[0]) for size in sizes}
    title = f"## Views of {len(views)} panoramas of {len({v.place for v in views})} places"
    learnt = _figures({**overlap.halves(views), "all places": overlap.learn(views) | {"NLL of the other half": np.nan}})
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

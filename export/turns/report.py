"""The tables that `python -m export turns` prints, in Markdown."""

from collections.abc import Sequence
from pathlib import Path

from export.data import Panorama, read_index
from export.turns import groups, overlap, pairs
from export.turns.sets import one_each
from lighting.model import Model

PARTS = ("pairs", "walks", "sets", "overlap", "days")
WALKS, DAYS = 24, 6
SETS = 36  # places
PER_PLACE = 1  # panoramas for the correlation


def report(data: Path, split: str, parts: Sequence[str], last: int | None = None) -> str:
    """The tables asked for; `last` keeps the last rows of the index, from places that no earlier row has."""
    panoramas = _rows(data, split, last)
    made = {
        "pairs": lambda: _pairs(panoramas),
        "walks": _walks,
        "sets": lambda: _sets(panoramas),
        "overlap": lambda: _overlap(panoramas, split),
        "days": _days,
    }
    return "\n\n".join(made[part]() for part in parts) + "\n"


def _rows(data: Path, split: str, last: int | None) -> list[Panorama]:
    rows = read_index(data)
    older = {p.place for p in rows[:-last]} if last else set()
    return [p for p in rows if p.split == split and p.place not in older]


def _pairs(panoramas: Sequence[Panorama]) -> str:
    answers, strangers = pairs.turned(one_each(panoramas))
    rows = {"all": pairs.figures(answers)}
    rows |= {name: pairs.figures(part) for name, part in pairs.by_overlap(answers).items() if part}
    false = sum(turn is not None for turn in strangers)
    return "\n\n".join(
        [
            f"## Two photos of one panorama ({len(answers)} places), unknown lens, gains of 0.7 to 1.3 [deg]",
            table(rows),
            f"Photos of two different places: {false} of {len(strangers)} pairs were given a turn.",
        ]
    )


def _walks() -> str:
    answers = list(pairs.walked(WALKS))
    title = f"## Two photos of {WALKS} rendered places from standpoints 0.3 to 3 m apart, the lens known to 5° [deg]"
    return f"{title}\n\n{table({'all': pairs.figures(answers)})}"


def _sets(panoramas: Sequence[Panorama]) -> str:
    found = groups.groups(Model.load(threads=1), one_each(panoramas)[:SETS])
    return "\n\n".join(
        [
            f"## Sets of 3 to 5 overlapping photos ({len(found)} places)",
            table({"all": groups.figures(found)}),
            table(groups.sun_figures(found)),
            table(groups.tilt_figures(found)),
        ]
    )


def _overlap(panoramas: Sequence[Panorama], split: str) -> str:
    views = overlap.views_of(Model.load(threads=1), _few_of_each(panoramas))
    rows = {
        f"{size}, {kind}": overlap.coverage(views, size, kind) for size in overlap.SIZES for kind in overlap.kinds(size)
    }
    title = f"## Views of {len(views)} panoramas of {len({v.place for v in views})} places"
    learnt = ["Correlation of the errors", table({"learnt": overlap.learn(views)})] if split == "train" else []
    return "\n\n".join([title, *learnt, table(rows)])


def _few_of_each(panoramas: Sequence[Panorama]) -> list[Panorama]:
    seen: dict[str, int] = {}
    kept = []
    for panorama in panoramas:
        seen[panorama.place] = seen.get(panorama.place, 0) + (panorama.sun_azimuth is not None)
        kept += [panorama] if seen[panorama.place] <= PER_PLACE else []
    return kept


def _days() -> str:
    from export.turns.days import figures

    title = f"## The sun's path over {DAYS} rendered days, photos from a tripod"
    return f"{title}\n\n{table(figures(DAYS))}"


def table(rows: dict[str, dict[str, float]]) -> str:
    """Rows of figures as Markdown, with as many digits as each needs."""
    names = list(next(iter(rows.values())))
    lines = [["", *names], ["---"] * (len(names) + 1)]
    lines += [[name, *(_shown(row[key]) for key in names)] for name, row in rows.items()]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _shown(value: float) -> str:
    if value >= 100 and value == round(value):
        return f"{value:.0f}"
    return f"{value:.2f}" if abs(value) < 10 else f"{value:.1f}"

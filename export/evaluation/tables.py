"""Tables in Markdown."""

import math
from collections.abc import Sequence

DECIMALS = {  # 1 in all other columns
    "crops": 0,
    "places": 0,
    "fitted to": 0,
    "temperature": 2,
    "NLL": 2,
    "NLL, before": 2,
    "NLL, after": 2,
    "visibility AUC": 2,
}


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def figures_table(rows: dict[str, dict[str, float]]) -> str:
    """One row per method or group, one column per figure."""
    columns = list(next(iter(rows.values())))
    return table(["", *columns], [[name, *(number(row[c], c) for c in columns)] for name, row in rows.items()])


def number(value: float, column: str) -> str:
    """A figure as the tables show it; "-" if there is none."""
    if not math.isfinite(value):
        return "-"
    return f"{value:.{decimals(column)}f}"


def decimals(column: str) -> int:
    """How many decimals a column shows."""
    return DECIMALS.get(column, 1)


def interval(ends: tuple[float, float], decimals: int = 1) -> str:
    """An interval as the tables show it."""
    return f"{ends[0]:.{decimals}f} to {ends[1]:.{decimals}f}"

"""Markdown as the generated pages have it."""

import re
from collections.abc import Iterable, Sequence

WRITTEN = "`python -m scripts.reference` writes this page."


def write_table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a table, and the empty one after it.

    Args:
        head: of the columns.
        rows: a cell for each column.
    """
    lines = [head, ["---"] * len(head), *([_cell(text) for text in row] for row in rows)]
    return [*(f"| {' | '.join(line)} |" for line in lines), ""]


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def escape_marks(text: str) -> str:
    """Return a help text or a docstring as Markdown that takes no letter of it for a mark.

    Args:
        text: with code between backquotes.
    """
    return re.sub(r"(`[^`]*`)|(\*|<(?=\w))", lambda found: found[1] or f"\\{found[2]}", text)

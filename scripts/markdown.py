"""Markdown as the generated pages have it."""

import re
from collections.abc import Iterable, Sequence

from scripts.book import read_terms

WRITTEN = "`python -m scripts.reference` writes this page."
_MARKS = re.compile(r"(`[^`]*`)|(\b\d{4}-\d\d-\d\d(?:T[\d:+]*\d)?)|(\*|<(?=\w))")  # code, an example's time, a mark
_CODE_OR_LINK = re.compile(r"(`[^`]*`|\[[^\]]*\]\([^)]*\))")


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


def link_terms(page: str, glossary: str) -> str:
    """Return a page whose first use of each term of the glossary is a link.

    Args:
        page: in Markdown.
        glossary: the address of the glossary, from the page.
    """
    lines = page.split("\n")
    for term, anchor in read_terms().items():
        _link_first(lines, term, f"{glossary}#{anchor}")
    return "\n".join(lines)


def _link_first(lines: list[str], term: str, address: str) -> None:
    use = re.compile(rf"(?<![\w-]){re.escape(term)}s?(?![\w-])", re.IGNORECASE)
    is_code = False
    for number, line in enumerate(lines):
        is_code ^= line.startswith("```")
        if is_code or line.startswith(("#", "```")):
            continue
        parts = _CODE_OR_LINK.split(line)  # what is neither, and what is, by turns
        for place, part in enumerate(parts):
            found = use.search(part) if place % 2 == 0 else None
            if found:
                parts[place] = f"{part[: found.start()]}[{found[0]}]({address}){part[found.end() :]}"
            elif part == f"`{term}`":
                parts[place] = f"[{part}]({address})"
            else:
                continue
            lines[number] = "".join(parts)
            return


def escape_marks(text: str) -> str:
    """Return a help text or a docstring as Markdown that takes no letter of it for a mark.

    Args:
        text: with code between backquotes.
    """
    return _MARKS.sub(lambda found: found[1] or (f"`{found[2]}`" if found[2] else f"\\{found[3]}"), text)

"""The rules of the book's pages: `python -m scripts.book [PAGE...]` prints what breaks one."""

import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path

from markdown_it import MarkdownIt
from markdown_it.token import Token

ROOT = Path(__file__).parents[1]
WORDS = "docs/words.md"
GALLERY = "## Gallery"  # of docs/README.md: its captions and credits do not count
BUDGETS = {  # words of a page, as `wc -w` counts them
    "README.md": 460,
    "docs/README.md": 200,
    "docs/learn/blender.md": 600,
    "docs/learn/web-page.md": 600,
    "docs/learn/python.md": 500,
    "docs/learn/train.md": 500,
    "docs/do/correct-the-sun.md": 630,
    "docs/do/engines.md": 600,
    "docs/do/other-programs.md": 540,
    "docs/do/blender-extension.md": 250,
    "docs/do/assistants.md": 250,
    "docs/do/comfyui.md": 200,
    "docs/do/send-a-page.md": 130,
    "docs/do/sun-study.md": 230,
    "docs/do/many-photos.md": 250,
    "docs/do/several-photos.md": 350,
    "docs/do/clips.md": 460,
    "docs/do/measure-a-sky.md": 300,
    "docs/do/photometric-stereo.md": 400,
    "docs/do/run-the-service.md": 620,
    "docs/do/your-own-panoramas.md": 450,
    "docs/understand/how-it-works.md": 550,
    "docs/understand/trust.md": 490,
    "docs/understand/axes-and-units.md": 450,
    WORDS: 400,
    "lighting/data/MODEL_CARD.md": 600,
    "export/README.md": 750,
}
MOST_WORDS = 10700  # of all of them but `export/README.md`, which is no page of the book
BESIDE = ("SECURITY.md", "CONTRIBUTING.md", "examples/CREDITS.md")  # pages without a budget, whose sentences are short
MEAN_SENTENCE, LONGEST_SENTENCE = 15, 30  # words
_FIGURES = {
    "docs/understand/trust.md",
    "docs/do/other-programs.md",
    "lighting/data/MODEL_CARD.md",
}  # dates, percentages
_ONE_LINE_OF_FIGURES = "README.md"
_NO_LINKS = {WORDS, "lighting/data/MODEL_CARD.md"}  # the glossary itself, and a card that is read on another host
_MONTHS = "January|February|March|April|May|June|July|August|September|October|November|December"
_DATE = re.compile(rf"\b(?:19|20)\d\d-\d\d\b|\b(?:{_MONTHS})\s(?:\d{{1,2}},?\s)?(?:19|20)\d\d\b")
_PERCENTAGE = re.compile(r"\d\s?%|\bper ?cent\b")
_SENTENCE_END = re.compile(r"(?<=[.!?])[\"'”)\]]*\s+(?=[\"'“(\[`]*[A-Z0-9`+-])")
_MARK = re.compile(r"<!-- ci: (.*?) -->")
_PARSER = MarkdownIt("commonmark", {"html": True}).enable("table")


@dataclass(frozen=True)
class Piece:
    """A stretch of a passage's text."""

    text: str
    is_code: bool = False
    link: str | None = None


@dataclass(frozen=True)
class Passage:
    """A paragraph, a heading or a table's cell."""

    kind: str  # paragraph, heading, th or td
    pieces: tuple[Piece, ...]

    @property
    def sentences(self) -> list[str]:
        """Its sentences; code is a part of them."""
        pieces = (f"`{piece.text.replace('.', '·')}`" if piece.is_code else piece.text for piece in self.pieces)
        text = "".join(pieces)
        return [sentence for sentence in _SENTENCE_END.split(" ".join(text.split())) if count_words(sentence)]

    @property
    def prose(self) -> str:
        """Its text without code."""
        return "".join("`" if piece.is_code else piece.text for piece in self.pieces)


@dataclass(frozen=True)
class CodeBlock:
    """A block of code, and the mark `<!-- ci: ... -->` above it; empty if there is none."""

    language: str
    text: str
    mark: str


def count_words(text: str) -> int:
    """Count the words that have a letter or a digit.

    Args:
        text: of a sentence.
    """
    return sum(any(letter.isalnum() for letter in word) for word in text.split())


def count_page_words(text: str) -> int:
    """Count a page's words as `wc -w` does: code, tables and marks too; a gallery does not count.

    Args:
        text: of the page.
    """
    return len(text.partition(f"\n{GALLERY}\n")[0].split())


def read_passages(text: str) -> list[Passage]:
    """Return the passages of a page in their order.

    Args:
        text: of the page, in Markdown; the front matter of a card is left out.
    """
    tokens = _PARSER.parse(re.sub(r"\A---\n.*?\n---\n", "", text, flags=re.DOTALL))
    return [
        Passage(before.type.removesuffix("_open"), tuple(_pieces(token.children or ())))
        for before, token in pairwise(tokens)
        if token.type == "inline"
    ]


def _pieces(children: list[Token] | tuple[Token, ...]) -> Iterator[Piece]:
    link: str | None = None
    for child in children:
        match child.type:
            case "link_open":
                link = str(child.attrs["href"])
            case "link_close":
                link = None
            case "text" | "code_inline":
                yield Piece(child.content, child.type == "code_inline", link)
            case "softbreak" | "hardbreak":
                yield Piece(" ", link=link)


def read_code_blocks(text: str) -> list[CodeBlock]:
    """Return the blocks of code of a page in their order.

    Args:
        text: of the page, in Markdown.
    """
    found, mark = [], ""
    for token in _PARSER.parse(text):
        if token.type == "fence":
            found.append(CodeBlock(token.info.partition(" ")[0], token.content, mark))
        mark = named[1] if token.type == "html_block" and (named := _MARK.search(token.content)) else ""
    return found


@cache
def read_terms() -> dict[str, str]:
    """Return the terms of the glossary and the anchors of their headings; none before it is written."""
    if not (ROOT / WORDS).is_file():
        return {}
    passages = read_passages((ROOT / WORDS).read_text(encoding="utf-8"))
    terms = ["".join(piece.text for piece in p.pieces) for p in passages if p.kind == "heading"][1:]
    return {term: re.sub(r"[^\w\- ]", "", term.lower()).replace(" ", "-") for term in terms}


def find_broken_rules(name: str) -> list[str]:
    """Return what breaks a rule on a page: words, sentences, dates, percentages, links of terms.

    Args:
        name: of the page, from the repository's root.
    """
    text = (ROOT / name).read_text(encoding="utf-8")
    passages = read_passages(text)
    if name in BESIDE:
        return list(_check_sentences(passages))
    return [
        *_check_budget(name, text),
        *_check_sentences(passages),
        *_check_figures(name, passages),
        *_check_terms(name, passages),
    ]


def _check_budget(name: str, text: str) -> Iterator[str]:
    words = count_page_words(text)
    if name in BUDGETS and words > BUDGETS[name]:
        yield f"{words} words; its budget is {BUDGETS[name]}"


def _sentence_lengths(passages: list[Passage]) -> list[int]:
    """Of paragraphs and items of lists: headings and cells are no sentences."""
    return [count_words(s) for p in passages if p.kind == "paragraph" for s in p.sentences]


def _mean(lengths: list[int]) -> float:
    return sum(lengths) / len(lengths) if lengths else 0.0


def _check_sentences(passages: list[Passage]) -> Iterator[str]:
    mean = _mean(_sentence_lengths(passages))
    if mean > MEAN_SENTENCE:
        yield f"a mean sentence of {mean:.1f} words; {MEAN_SENTENCE} at most"
    for sentence in (sentence for passage in passages for sentence in passage.sentences):
        if count_words(sentence) > LONGEST_SENTENCE:
            yield f"{count_words(sentence)} words in one sentence: {sentence}"


def _check_figures(name: str, passages: list[Passage]) -> Iterator[str]:
    if name in _FIGURES:
        return
    found = [passage.prose for passage in passages if _DATE.search(passage.prose) or _PERCENTAGE.search(passage.prose)]
    for prose in found[1:] if name == _ONE_LINE_OF_FIGURES else found:
        yield f"a date or a percentage: {prose}"


def _check_terms(name: str, passages: list[Passage]) -> Iterator[str]:
    if name in _NO_LINKS:
        return
    pieces = [piece for passage in passages if passage.kind != "heading" for piece in (*passage.pieces, Piece("\n"))]
    for term, anchor in read_terms().items():
        first = next((piece for piece in pieces if _uses(piece, term)), None)
        if first and not (first.link or "").endswith(f"words.md#{anchor}"):
            yield f"the first {term!r} is no link to {WORDS}#{anchor}: {first.text.strip()}"


def _uses(piece: Piece, term: str) -> bool:
    """Whether a piece has the term, or its plural; of code, whether it is the term."""
    if piece.is_code:
        return piece.text == term
    is_other_link = piece.link is not None and "words.md#" not in piece.link
    return not is_other_link and re.search(rf"(?<![\w-]){re.escape(term)}s?(?![\w-])", piece.text, re.I) is not None


def main() -> None:
    """Print the figures of pages and what breaks a rule; exit with 1 where something does."""
    broken = False
    if unknown := set(sys.argv[1:]) - {*BUDGETS, *BESIDE}:
        sys.exit(f"{', '.join(sorted(unknown))}: no page that has rules; scripts/book.py lists these.")
    for name in sys.argv[1:] or [name for name in BUDGETS if (ROOT / name).is_file()]:
        text = (ROOT / name).read_text(encoding="utf-8")
        found = find_broken_rules(name)
        mean = _mean(_sentence_lengths(read_passages(text)))
        print(f"{name}: {count_page_words(text)} words of {BUDGETS.get(name, '-')}, mean sentence {mean:.1f}")
        for line in found:
            print(f"  {line}")
        broken = broken or bool(found)
    sys.exit(broken)


if __name__ == "__main__":
    main()

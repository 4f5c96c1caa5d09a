"""The book: the Markdown pages of docs/ as HTML, with contents, links between them and an index for the search."""

import json
import posixpath
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from html import escape
from itertools import pairwise
from pathlib import Path

from markdown_it import MarkdownIt
from markdown_it.token import Token

PICTURES = frozenset({".webp", ".jpg", ".jpeg", ".png", ".svg", ".gif"})
FILES = Path(__file__).with_name("book_files")  # the style sheet and the script
_CLONE = Path(__file__).parents[1]
_PACKAGED = Path(__file__).with_name("book_pages")  # in a wheel, which has no docs/
_INDEX = "docs/README.md"
_CHAPTERS = {  # pages of docs/ in the order of the contents; a chapter's other pages follow
    "Start": ("README.md", "start.md"),
    "Learn": ("learn/blender.md", "learn/web-page.md", "learn/python.md", "learn/train.md"),
    "Do": (
        "do/correct-the-sun.md",
        "do/engines.md",
        "do/other-programs.md",
        "do/blender-extension.md",
        "do/many-photos.md",
        "do/several-photos.md",
        "do/clips.md",
        "do/measure-a-sky.md",
        "do/photometric-stereo.md",
        "do/run-the-service.md",
        "do/your-own-panoramas.md",
    ),
    "Understand": ("understand/how-it-works.md", "understand/trust.md", "understand/axes-and-units.md", "words.md"),
    "Look up": (
        "reference/command-line.md",
        "reference/python.md",
        "reference/http.md",
        "reference/fields.md",
        "reference/settings.md",
        "reference/problems.md",
        "reference/exceptions.md",
    ),
    "More": ("more/model-card.md", "more/security.md", "more/changes.md"),
}
_ELSEWHERE = {  # pages that lie elsewhere in the repository, by their names in the book and in the wheel
    "start.md": "README.md",
    "more/model-card.md": "lighting/data/MODEL_CARD.md",
    "more/security.md": "SECURITY.md",
    "more/changes.md": "CHANGELOG.md",
}
_TITLES = {"more/model-card": "Model card"}  # by address; its heading is the network's name
_TEMPLATE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{title}</title>
<link rel="icon" href="{root}../favicon.ico" type="image/png">
<link rel="stylesheet" href="{root}book.css">
<script src="{root}book.js" defer></script>
</head>
<body data-root="{root}">
<a class="skip" href="#text">Skip to the text</a>
<header>
<a class="home" href="{root}">Outdoor lighting</a>
<search>
<label class="unseen" for="search">Search the book</label>
<input type="search" id="search" placeholder="Search ( / )" autocomplete="off" spellcheck="false" aria-controls="found">
<div id="found" hidden><p id="count" role="status"></p><ul></ul></div>
</search>
<nav aria-label="Service"><a href="{root}../">Try a photo</a> <a href="{root}../docs">API</a></nav>
</header>
<div class="columns">
<details class="contents"><summary>Contents</summary><nav aria-label="Contents">{contents}</nav></details>
<main id="text" tabindex="-1">
{text}
<nav class="turn" aria-label="Next pages">{neighbors}</nav>
</main>
{sections}
</div>
</body>
</html>
"""


_TABLE = '<div class="table" tabindex="0" role="group" aria-label="Table">'
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)


@dataclass(frozen=True)
class BookPage:
    """A page of the book."""

    source: str
    """Its file, from the repository's root."""
    address: str
    """Its path below /book/; empty for the index."""
    chapter: str
    """The heading in the contents under which it stands."""
    path: Path
    """Its file, in a clone or in a wheel."""

    @cached_property
    def markdown(self) -> str:
        """Its text without the front matter of a model card."""
        return re.sub(r"\A---\n.*?\n---\n", "", self.path.read_text(encoding="utf-8"), flags=re.DOTALL)

    @cached_property
    def title(self) -> str:
        """Its first heading, or what the contents call it in its place."""
        found = re.search(r"^# (.+)$", self.markdown, re.MULTILINE)
        return _TITLES.get(self.address) or (found[1].replace("`", "") if found else self.address)


class Book:
    """The pages of the book, read and rendered when they are asked for."""

    def __init__(self, root: Path | None = None) -> None:
        """Find the pages.

        Args:
            root: a clone's folder; None: this package's, or the pages in the wheel.
        """
        clone = root or _CLONE
        is_clone = (clone / _INDEX).is_file()
        self.docs = clone / "docs" if is_clone else _PACKAGED
        """The folder that holds the pages and their pictures."""
        self.pages = tuple(_find_pages(self.docs, clone if is_clone else None))
        """In the order of the contents."""
        self._by_source = {page.source: page for page in self.pages}
        self._by_address = {page.address: page for page in self.pages}

    def find_page(self, address: str) -> BookPage | None:
        """Return the page at a path below /book/; None where there is none.

        Args:
            address: without `.md`; empty for the index.
        """
        return self._by_address.get(address)

    @lru_cache(128)  # noqa: B019  # a service has one book, as long as it runs
    def render_page(self, page: BookPage) -> bytes:
        """Return a page as HTML.

        Args:
            page: of this book.
        """
        tokens = self._parse(page)
        found = self.pages.index(page)
        neighbors = [("Before", found - 1), ("Next", found + 1)]
        html = _TEMPLATE.format(
            title=escape(page.title if page.address == "" else f"{page.title} · Outdoor lighting"),
            root="../" * page.address.count("/") or "./",
            contents=self._contents(page),
            text=_MARKDOWN.renderer.render(tokens, _MARKDOWN.options, {}),
            neighbors="".join(
                f'<a href="{_relative(page, self.pages[number].address)}"><span>{word}</span> '
                f"{escape(self.pages[number].title)}</a>"
                for word, number in neighbors
                if 0 <= number < len(self.pages)
            ),
            sections=_list_sections(tokens),
        )
        return html.encode()

    @cached_property
    def search_index(self) -> bytes:
        """The sections of all pages as JSON: a list of address, page, heading and text."""
        entries = [entry for page in self.pages for entry in self._index_page(page)]
        return json.dumps(entries, ensure_ascii=False, separators=(",", ":")).encode()

    def _index_page(self, page: BookPage) -> Iterator[list[str]]:
        heading, anchor, texts = page.title, "", list[str]()
        tokens = self._parse(page)
        for before, token in zip([None, *tokens], tokens, strict=False):
            if before and before.type == "heading_open" and before.tag in ("h2", "h3"):
                yield [page.address + anchor, page.title, heading, " ".join(texts)]
                heading, anchor, texts = _plain(token), f"#{before.attrs['id']}", []
            elif token.type in ("inline", "fence"):
                texts.append(" ".join((_plain(token) if token.children else token.content).split()))
        yield [page.address + anchor, page.title, heading, " ".join(texts)]

    def _contents(self, here: BookPage) -> str:
        parts, chapter = [], ""
        for page in self.pages:
            if page.chapter != chapter:
                parts.append(f"{'</ul>' if chapter else ''}<h2>{page.chapter}</h2><ul>")
                chapter = page.chapter
            current = ' aria-current="page"' if page == here else ""
            parts.append(f'<li><a href="{_relative(here, page.address)}"{current}>{escape(page.title)}</a></li>')
        return "".join([*parts, "</ul>"])

    def _parse(self, page: BookPage) -> list[Token]:
        """The tokens of a page, with anchors, and with links to where the book has their targets."""
        tokens = _MARKDOWN.parse(page.markdown)
        taken: dict[str, int] = {}
        for before, token in zip([None, *tokens], tokens, strict=False):
            if before and before.type == "heading_open":
                slug = re.sub(r"[^\w\- ]", "", _plain(token).lower()).replace(" ", "-")
                taken[slug] = taken.get(slug, -1) + 1
                before.attrs["id"] = f"{slug}-{taken[slug]}" if taken[slug] else slug
            if token.type in ("html_block", "html_inline"):
                token.content = _COMMENT.sub("", token.content)
            self._direct_links(page, token.children or [])
        return tokens

    def _direct_links(self, page: BookPage, tokens: list[Token]) -> None:
        dropped = False
        for token in tokens:
            if token.type == "link_open":
                address = self._address(page, str(token.attrs["href"]))
                dropped = address is None
                token.attrs["href"] = address or ""
            elif token.type == "image":
                token.attrs["src"] = self._address(page, str(token.attrs["src"])) or ""
                token.attrs["loading"] = "lazy"
            elif token.type == "html_inline":
                token.content = _COMMENT.sub("", token.content)
            if dropped and token.type in ("link_open", "link_close"):  # what is linked is in the repository alone
                dropped = token.type == "link_open"
                token.type, token.tag, token.nesting, token.content = "text", "", 0, ""

    def _address(self, page: BookPage, link: str) -> str | None:
        """A link as the book has it; None where the book does not have its target."""
        target, _, fragment = link.partition("#")
        if not target or ":" in target:
            return link
        source = posixpath.normpath(posixpath.join(posixpath.dirname(page.source), target))
        anchor = f"#{fragment}" if fragment else ""
        if found := self._by_source.get(source):
            return _relative(page, found.address) + anchor
        name = source.removeprefix("docs/")
        if Path(name).suffix in PICTURES and source.startswith("docs/") and (self.docs / name).is_file():
            return _relative(page, name)
        return None


def _find_pages(docs: Path, clone: Path | None) -> Iterator[BookPage]:
    present = sorted(path.relative_to(docs).as_posix() for path in docs.glob("**/*.md"))
    for chapter, names in _CHAPTERS.items():
        folders = {posixpath.dirname(name) for name in names} - {""}
        rest = [name for name in present if posixpath.dirname(name) in folders and name not in names]
        for name in (*names, *rest):
            source = _ELSEWHERE.get(name, f"docs/{name}")
            path = _locate_page(name, docs, clone)
            if path.is_file():
                yield BookPage(source, _to_address(name), chapter, path)


def _locate_page(name: str, docs: Path, clone: Path | None) -> Path:
    """The file of a page; the model card is a part of the package."""
    source = _ELSEWHERE.get(name)
    if source and (clone or source.startswith("lighting/")):
        return (clone or _CLONE) / source
    return docs / name


def _to_address(name: str) -> str:
    return "" if name == "README.md" else name.removesuffix(".md")


def _relative(page: BookPage, address: str) -> str:
    """The link from a page to a path below /book/."""
    folder = posixpath.dirname(page.address)
    return posixpath.relpath(address, folder or ".") if address else posixpath.relpath(".", folder or ".") + "/"


def _plain(token: Token) -> str:
    """The text of an inline token without its marks."""
    return "".join(
        " " if child.type in ("softbreak", "hardbreak") else child.content
        for child in token.children or ()
        if child.type not in ("image", "html_inline")
    )


def _list_sections(tokens: list[Token]) -> str:
    """The headings of a page, where it has several."""
    headings = [
        f'<li><a href="#{before.attrs["id"]}">{escape(_plain(token))}</a></li>'
        for before, token in pairwise(tokens)
        if before.type == "heading_open" and before.tag == "h2"
    ]
    if len(headings) < 2:
        return '<div class="sections"></div>'
    return f'<nav class="sections" aria-label="On this page"><h2>On this page</h2><ul>{"".join(headings)}</ul></nav>'


def _make_parser() -> MarkdownIt:
    """A parser of what the pages hold, with tables and blocks that can be scrolled by keys."""
    parser = MarkdownIt("commonmark", {"html": True}).enable("table")
    parser.add_render_rule("table_open", lambda *_: f"{_TABLE}<table>\n")
    parser.add_render_rule("table_close", lambda *_: "</table></div>\n")
    parser.add_render_rule("fence", _render_code)
    return parser


def _render_code(_renderer: object, tokens: list[Token], number: int, *_: object) -> str:
    text = escape(tokens[number].content, quote=False)
    return f'<div class="code"><pre tabindex="0"><code>{text}</code></pre></div>\n'


_MARKDOWN = _make_parser()

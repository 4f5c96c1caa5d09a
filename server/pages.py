"""The pages for browsers: the web page that vite builds from server/web, and the book, docs/ as HTML with a search.

Both lie in the repository and in the wheel.
"""

import gzip
import json
import posixpath
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from hmac import compare_digest
from html import escape
from itertools import pairwise
from mimetypes import guess_type
from pathlib import Path

from anyio import to_thread
from fastapi import APIRouter, Request
from markdown_it import MarkdownIt
from markdown_it.token import Token
from starlette.exceptions import HTTPException
from starlette.responses import FileResponse, RedirectResponse, Response
from starlette.staticfiles import StaticFiles

from server.responses import tag_response

_PICTURES = frozenset({".webp", ".jpg", ".jpeg", ".png", ".svg", ".gif"})
_BOOK_FILES = Path(__file__).with_name("book_files")  # the style sheet, the script, and the frame of a page
_CLONE = Path(__file__).parents[1]
_PACKAGED = Path(__file__).with_name("book_pages")  # in a wheel, which has no docs/
_INDEX = "docs/README.md"
_LAB = "lab/"  # pages for whoever works on the project, which the book leaves out
_ELSEWHERE = {  # pages that lie elsewhere in the repository, by their names in the book and in the wheel
    "start.md": "README.md",
    "more/model-card.md": "lighting/data/MODEL_CARD.md",
    "more/changes.md": "CHANGELOG.md",
    "more/security.md": "SECURITY.md",
}
_TITLES = {"more/model-card": "Model card"}  # by address; its heading is the network's name
_TABLE = '<div class="table" tabindex="0" role="group" aria-label="Table">'
_INDEX_MARKS = re.compile(r"^## (.+)$|\]\(([^)#:]+\.md)\)", re.MULTILINE)  # its headings, and its links to pages
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
_FAVICON = Path(__file__).with_name("favicon.png")
BUNDLE = Path(__file__).parent / "web" / "dist"
_TEXT_SUFFIXES = frozenset({".html", ".css", ".js", ".svg", ".tsv"})  # pictures and tables are compressed already
_KEPT_FILES = 128  # gzipped copies in memory, more than page and book have texts
_CACHE_A_DAY = "public, max-age=86400"
_CACHE_FOREVER = "public, max-age=31536000, immutable"  # built files have names that depend on their content


@dataclass(frozen=True)
class _BookPage:
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

    def __init__(self) -> None:
        is_clone = (_CLONE / _INDEX).is_file()
        self.docs = _CLONE / "docs" if is_clone else _PACKAGED
        """The folder that holds the pages and their pictures."""
        self.pages = tuple(_find_pages(self.docs, _CLONE if is_clone else None))
        """In the order of the contents."""
        self._frame = (_BOOK_FILES / "page.html").read_text(encoding="utf-8")
        self._by_source = {page.source: page for page in self.pages}
        self.by_address = {page.address: page for page in self.pages}
        """The same by their paths below /book/; empty for the index."""

    @lru_cache(128)  # noqa: B019  # a service has one book, as long as it runs
    def render_page(self, page: _BookPage) -> bytes:
        """Return a page as HTML.

        Args:
            page: of this book.
        """
        tokens = self._parse(page)
        found = self.pages.index(page)
        neighbors = [("Before", found - 1), ("Next", found + 1)]
        html = self._frame.format(
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

    def _index_page(self, page: _BookPage) -> Iterator[list[str]]:
        heading, anchor, texts = page.title, "", list[str]()
        tokens = self._parse(page)
        for before, token in zip([None, *tokens], tokens, strict=False):
            if before and before.type == "heading_open" and before.tag in ("h2", "h3"):
                yield [page.address + anchor, page.title, heading, " ".join(texts)]
                heading, anchor, texts = _plain(token), f"#{before.attrs['id']}", []
            elif token.type in ("inline", "fence"):
                texts.append(" ".join((_plain(token) if token.children else token.content).split()))
        yield [page.address + anchor, page.title, heading, " ".join(texts)]

    def _contents(self, here: _BookPage) -> str:
        parts, chapter = [], ""
        for page in self.pages:
            if page.chapter != chapter:
                parts.append(f"{'</ul>' if chapter else ''}<h2>{page.chapter}</h2><ul>")
                chapter = page.chapter
            current = ' aria-current="page"' if page == here else ""
            parts.append(f'<li><a href="{_relative(here, page.address)}"{current}>{escape(page.title)}</a></li>')
        return "".join([*parts, "</ul>"])

    def _parse(self, page: _BookPage) -> list[Token]:
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

    def _direct_links(self, page: _BookPage, tokens: list[Token]) -> None:
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

    def _address(self, page: _BookPage, link: str) -> str | None:
        """A link as the book has it; None where the book does not have its target."""
        target, _, fragment = link.partition("#")
        if not target or ":" in target:
            return link
        source = posixpath.normpath(posixpath.join(posixpath.dirname(page.source), target))
        anchor = f"#{fragment}" if fragment else ""
        if found := self._by_source.get(source):
            return _relative(page, found.address) + anchor
        name = source.removeprefix("docs/")
        if Path(name).suffix in _PICTURES and source.startswith("docs/") and (self.docs / name).is_file():
            return _relative(page, name)
        return None


def _find_pages(docs: Path, clone: Path | None) -> Iterator[_BookPage]:
    """The pages that the index links, in its order and below its headings."""
    names = {source: name for name, source in _ELSEWHERE.items()}
    chapter, found = "Start", {"README.md": "Start", "start.md": "Start"}
    for heading, link in _INDEX_MARKS.findall((docs / "README.md").read_text(encoding="utf-8")):
        chapter = heading or chapter
        name = names.get(link.removeprefix("../"), link)
        if link and not name.startswith(("../", _LAB)):
            found.setdefault(name, chapter)
    for name, chapter in found.items():
        source = _ELSEWHERE.get(name, f"docs/{name}")
        in_repository = name in _ELSEWHERE and (clone or source.startswith("lighting/"))  # which the package has, too
        path = (clone or _CLONE) / source if in_repository else docs / name
        yield _BookPage(source, "" if name == "README.md" else name.removesuffix(".md"), chapter, path)


def _relative(page: _BookPage, address: str) -> str:
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


def make_page_router(bundle: Path = BUNDLE, photo: tuple[Path, str] | None = None) -> APIRouter:
    """The routes of the page.

    Args:
        bundle: the folder that vite writes.
        photo: the file that the page shows at `/#opened/SECRET/NAME`, and the secret; None offers none.
    """
    router = APIRouter(include_in_schema=False)
    icon = _FAVICON.read_bytes()
    root = StaticFiles(directory=bundle, check_dir=False)
    assets = StaticFiles(directory=bundle / "assets", check_dir=False)

    @router.get("/")
    async def page(request: Request) -> Response:
        return await _serve_file(root, "index.html", request, "no-cache")

    @router.get("/docs")
    async def docs(request: Request) -> Response:
        """The reference of the API, drawn from /openapi.json."""
        return await _serve_file(root, "docs.html", request, "no-cache")

    @router.get("/opened/{secret}")
    async def opened(secret: str) -> Response:
        """For who knows the secret: any program of this machine reaches the address."""
        file, expected = photo or (None, "")
        if file is None or not compare_digest(secret.encode(), expected.encode()) or not file.is_file():
            raise HTTPException(404)
        return FileResponse(file, filename=file.name, headers={"Cache-Control": "no-store"})

    @router.get("/favicon.ico")
    async def favicon() -> Response:
        """A sun over a horizon, as PNG, which browsers take under this name."""
        return Response(icon, media_type="image/png", headers={"Cache-Control": _CACHE_A_DAY})

    @router.get("/assets/{path:path}")
    async def asset(request: Request, path: str) -> Response:
        return await _serve_file(assets, path, request, _CACHE_FOREVER)

    return router


def make_book_router(book: Book | None = None) -> APIRouter:
    """The routes of the book.

    Args:
        book: None takes this package's.
    """
    router = APIRouter(include_in_schema=False)
    shown = book or Book()
    files = {".css": StaticFiles(directory=_BOOK_FILES), ".js": StaticFiles(directory=_BOOK_FILES)}
    files |= dict.fromkeys(_PICTURES, StaticFiles(directory=shown.docs, check_dir=False))

    @router.get("/book")
    async def start() -> Response:
        return RedirectResponse("book/", 308)

    @router.get("/book/{path:path}")
    async def page(request: Request, path: str) -> Response:
        if path == "search.json":
            return await _serve_text(lambda: shown.search_index, "application/json", request)
        if found := shown.by_address.get(path):
            return await _serve_text(partial(shown.render_page, found), "text/html", request)
        suffix = Path(path).suffix
        if suffix not in files:
            raise HTTPException(404)
        return await _serve_file(files[suffix], path, request, "no-cache")

    return router


async def _serve_text(read: Callable[[], bytes], kind: str | None, request: Request) -> Response:
    """A text that a thread reads or makes, gzipped if the client accepts that."""
    data, headers = await to_thread.run_sync(read), {"Vary": "Accept-Encoding"}
    if _accepts_gzip(request):
        data = await to_thread.run_sync(_gzip_text, data)
        headers["Content-Encoding"] = "gzip"
    return tag_response(request, Response(data, media_type=kind, headers=headers))


@lru_cache(_KEPT_FILES)
def _gzip_text(data: bytes) -> bytes:
    return gzip.compress(data, mtime=0)


async def _serve_file(files: StaticFiles, path: str, request: Request, cache_control: str) -> Response:
    """A whole file, or its gzipped copy if it is a text and the client accepts that.

    A `Range` is ignored, as by routes that make their answers.
    """
    request.scope["headers"] = [pair for pair in request.scope["headers"] if pair[0] != b"range"]
    response = await files.get_response(path, request.scope)
    headers = {"Accept-Ranges": "none", "Cache-Control": cache_control}
    if Path(path).suffix in _TEXT_SUFFIXES:
        headers["Vary"] = "Accept-Encoding"
        if _accepts_gzip(request):
            response = await _serve_text(Path(files.lookup_path(path)[0]).read_bytes, guess_type(path)[0], request)
    response.headers.update(headers)
    return response


def _accepts_gzip(request: Request) -> bool:
    """Whether the client accepts gzip, by name or by `*`, and with a weight that is not 0 (RFC 9110, 12.5.3)."""
    codings = ",".join(request.headers.getlist("accept-encoding")).lower().replace(" ", "").split(",")
    weights = {coding: weight or "1" for coding, _, weight in (item.partition(";q=") for item in codings)}
    return weights.get("gzip", weights.get("*", "0")).strip("0.") != ""

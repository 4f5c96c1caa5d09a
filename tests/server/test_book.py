"""The book: every page, link and picture is served, from a clone and from a wheel; nothing comes from elsewhere."""

import json
import posixpath
import re
import shutil
import tomllib
from collections.abc import Iterator
from functools import cache
from html.parser import HTMLParser
from pathlib import Path

import pytest
from fastapi import FastAPI
from starlette.testclient import TestClient

from server import book
from server.book import Book
from server.static_page import make_book_router
from tests.helpers.pages import ROOT

INCLUDED = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
LOADING = {"script": "src", "img": "src", "source": "srcset", "link": "href", "video": "src", "iframe": "src"}
REFUSED = re.compile(r"^(?:[a-z]+:)?//", re.IGNORECASE)


class Elements(HTMLParser):
    """The elements of a page with their attributes."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str]]] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, {name: value or "" for name, value in attrs}))

    def values(self, name: str) -> Iterator[str]:
        """The values of an attribute, of all elements."""
        return (attributes[name] for _, attributes in self.found if name in attributes)


@cache
def shown() -> Book:
    return Book()


@cache
def elements(address: str) -> Elements:
    page = shown().find_page(address)
    assert page, address
    return Elements(shown().render_page(page).decode())


ADDRESSES = [page.address for page in shown().pages]


@pytest.fixture(scope="module")
def reader() -> TestClient:
    app = FastAPI(openapi_url=None)
    app.include_router(make_book_router(shown()))
    return TestClient(app, base_url="http://localhost", follow_redirects=False)


@pytest.mark.parametrize("address", ADDRESSES)
def test_a_page_leads_to_what_is_there_and_loads_nothing_from_elsewhere(address: str, reader: TestClient) -> None:
    page = elements(address)
    assert not [tag for tag, attributes in page.found if REFUSED.match(attributes.get(LOADING.get(tag, ""), ""))]
    assert not {"style", "onclick", "onload"} & {name for _, attributes in page.found for name in attributes}
    assert "style" not in {tag for tag, _ in page.found}
    for link in {*page.values("href"), *page.values("src"), *page.values("srcset")}:
        target, _, fragment = link.partition("#")
        if ":" in target:
            assert target.startswith("https://"), link
            continue
        path = posixpath.normpath(posixpath.join("/book", posixpath.dirname(address), target))
        if not path.startswith("/book"):
            assert path in ("/", "/docs", "/favicon.ico"), link
            continue
        name = address if not target else path.removeprefix("/book").removeprefix("/")
        if shown().find_page(name):
            assert not fragment or fragment in elements(name).values("id"), link
        else:
            assert reader.get(f"/book/{name}").status_code == 200, link


def test_the_contents_have_every_page_of_the_documentation() -> None:
    pages = {path.relative_to(ROOT).as_posix() for path in (ROOT / "docs").glob("**/*.md")}
    kept = {page for page in pages if not page.startswith("docs/lab/")}
    assert {page.source for page in shown().pages} >= {page for page in kept if page.count("/") > 1}
    links = set(elements("").values("href"))
    assert links >= set(ADDRESSES) - {""}


def test_the_search_finds_every_section() -> None:
    entries = json.loads(shown().search_index)
    assert {entry[0].partition("#")[0] for entry in entries} == set(ADDRESSES)
    for address, _, heading, _ in entries:
        name, _, anchor = address.partition("#")
        assert heading
        assert not anchor or anchor in elements(name).values("id")
    assert any("--height" in text for _, _, heading, text in entries if heading == "lighting envmap")


def test_a_wheel_has_what_a_clone_shows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its files lie as `force-include` of pyproject.toml copies them."""
    for source, target in INCLUDED["force-include"].items():
        path = tmp_path / target
        path.parent.mkdir(parents=True, exist_ok=True)
        (shutil.copytree if (ROOT / source).is_dir() else shutil.copy)(ROOT / source, path)
    card = tmp_path / "lighting" / "data" / "MODEL_CARD.md"
    card.parent.mkdir(parents=True)
    shutil.copy(ROOT / "lighting" / "data" / card.name, card)
    monkeypatch.setattr(book, "_CLONE", tmp_path)
    monkeypatch.setattr(book, "_PACKAGED", tmp_path / "server" / "book_pages")
    wheel = Book()
    assert [page.address for page in wheel.pages] == ADDRESSES
    for page in wheel.pages:
        original = shown().find_page(page.address)
        assert original
        assert wheel.render_page(page) == shown().render_page(original), page.address
    assert wheel.search_index == shown().search_index


def test_pages_come_gzipped_and_with_a_tag(reader: TestClient) -> None:
    for path, kind in (
        ("/book/", "text/html"),
        ("/book/search.json", "application/json"),
        ("/book/book.js", "text/jav"),
    ):
        plain = reader.get(path, headers={"Accept-Encoding": "identity"})
        packed = reader.get(path, headers={"Accept-Encoding": "gzip"})
        assert (plain.status_code, packed.headers["Content-Encoding"]) == (200, "gzip")
        assert plain.content == packed.content
        assert plain.headers["Content-Type"].startswith(kind)
        tag = packed.headers["ETag"]
        assert tag != plain.headers["ETag"]
        assert reader.get(path, headers={"Accept-Encoding": "gzip", "If-None-Match": tag}).status_code == 304


def test_the_book_without_a_slash_is_its_index(reader: TestClient) -> None:
    answer = reader.get("/book")
    assert (answer.status_code, answer.headers["Location"]) == (308, "book/")


@pytest.mark.parametrize(
    "path",
    ["none", "README.md", "lab/experiments", "lab/README.md", "learn/", "..%2Fbook.py", "../book.py", "%00", "x.webp"],
)
def test_nothing_else_is_served(path: str, reader: TestClient) -> None:
    assert reader.get(f"/book/{path}").status_code == 404


def test_the_service_serves_it_under_its_own_policy(client: TestClient) -> None:
    answer = client.get("/book/")
    assert answer.status_code == 200
    assert "default-src 'none'" in answer.headers["content-security-policy"]

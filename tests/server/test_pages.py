"""The pages that the service shows: the page at /, and the book, from a clone and from a wheel."""

import gzip
import json
import posixpath
import re
import shutil
import tomllib
from collections.abc import Iterator
from functools import cache
from html.parser import HTMLParser
from io import BytesIO
from pathlib import Path

import pytest
from fastapi import FastAPI
from PIL import Image
from starlette.testclient import TestClient

from server import pages
from server.pages import BUNDLE, Book, make_book_router, make_page_router
from tests.helpers.pages import ROOT


def site(bundle: Path) -> TestClient:
    app = FastAPI()
    app.include_router(make_page_router(bundle))
    return TestClient(app)


def test_the_bundle_is_served(tmp_path: Path) -> None:
    (tmp_path / "assets").mkdir()
    (tmp_path / "index.html").write_text("<p>page</p>")
    (tmp_path / "assets" / "main-1.js").write_text("true")
    answer = site(tmp_path).get("/")
    assert (answer.text, answer.headers["Cache-Control"]) == ("<p>page</p>", "no-cache")
    again = site(tmp_path).get("/", headers={"If-None-Match": answer.headers["ETag"]})
    assert (again.status_code, again.content) == (304, b"")
    script = site(tmp_path).get("/assets/main-1.js")
    assert "immutable" in script.headers["Cache-Control"]
    assert script.headers["Content-Type"].startswith("text/javascript")


def packed_site(bundle: Path) -> TestClient:
    """A page with texts, which are sent gzipped, and a picture."""
    (bundle / "assets").mkdir()
    for name, data in (("index.html", b"<p>page</p>"), ("assets/main-1.js", b"true"), ("assets/icon-1.svg", b"<svg/>")):
        (bundle / name).write_bytes(data)
    (bundle / "assets" / "sky-1.jpg").write_bytes(b"\xff\xd8")
    return site(bundle)


@pytest.mark.parametrize("accepted", ["gzip", "br, GZIP;q=0.5", "*", "gzip, identity;q=0", "x, gzip ; q=1.0"])
def test_a_client_that_takes_gzip_gets_the_copy(tmp_path: Path, accepted: str) -> None:
    client, plain = packed_site(tmp_path), {"Accept-Encoding": "identity"}
    for path, text, kind in (("/", "<p>page</p>", "text/html"), ("/assets/icon-1.svg", "<svg/>", "image/svg+xml")):
        answer, other = client.get(path, headers={"Accept-Encoding": accepted}), client.get(path, headers=plain)
        assert answer.text == other.text == text
        assert answer.headers["Content-Encoding"] == "gzip"
        assert answer.headers["Content-Length"] == str(len(gzip.compress(text.encode(), mtime=0)))
        assert answer.headers["Vary"] == other.headers["Vary"] == "Accept-Encoding"
        assert answer.headers["Content-Type"] == other.headers["Content-Type"]
        assert answer.headers["Content-Type"].startswith(kind)
        assert answer.headers["ETag"] != other.headers["ETag"]
        known = {"Accept-Encoding": accepted, "If-None-Match": answer.headers["ETag"]}
        again = client.get(path, headers=known)
        assert (again.status_code, again.headers["Vary"]) == (304, "Accept-Encoding")
        assert "Content-Encoding" not in again.headers
        assert client.get(path, headers={**known, **plain}).status_code == 200


@pytest.mark.parametrize("accepted", ["", "identity", "br", "gzip;q=0", "gzip;q=0.000, *", "*;q=0"])
def test_another_client_gets_the_file_itself(tmp_path: Path, accepted: str) -> None:
    answer = packed_site(tmp_path).get("/assets/main-1.js", headers={"Accept-Encoding": accepted})
    assert (answer.text, answer.headers["Content-Length"]) == ("true", "4")
    assert "Content-Encoding" not in answer.headers
    assert answer.headers["Vary"] == "Accept-Encoding"


def test_a_picture_is_the_same_for_all(tmp_path: Path) -> None:
    client = packed_site(tmp_path)
    answer = client.get("/assets/sky-1.jpg", headers={"Accept-Encoding": "gzip"})
    assert (answer.status_code, answer.content) == (200, b"\xff\xd8")
    assert not {"content-encoding", "vary"} & set(answer.headers)
    for path in ("/assets/none.js", "/assets/%00", f"/assets/{'a' * 300}", "/assets/../../page.py", "/assets/"):
        assert client.get(path, headers={"Accept-Encoding": "gzip"}).status_code == 404


def test_the_built_page_is_in_the_repository() -> None:
    for name in ("index.html", "docs.html"):
        html = (BUNDLE / name).read_text()
        assert 'src="./assets/' in html
        assert all((BUNDLE / asset).is_file() for asset in re.findall(r'\./(assets/[^"\s]+)', html))


def test_the_reference_of_the_api_loads_nothing_from_elsewhere(client: TestClient) -> None:
    answer = client.get("/docs")
    assert (answer.status_code, answer.headers["content-type"]) == (200, "text/html; charset=utf-8")
    assert answer.headers["content-security-policy"].startswith("default-src 'none'; script-src 'self' ")
    loaded = re.findall(r'(?:src|href)="([^"]+)"', answer.text.partition("<body>")[0])
    assert len(loaded) >= 3
    assert all(client.get(f"/{address.removeprefix('./')}").status_code == 200 for address in loaded)


@pytest.mark.parametrize("asked", ["bytes=0-1", "bytes=9-", "bytes=0-1,9-", "bytes=a-b", "lines=0-1"])
def test_a_file_of_the_page_comes_whole_whatever_range_is_asked_for(tmp_path: Path, asked: str) -> None:
    (tmp_path / "assets").mkdir()
    (tmp_path / "index.html").write_text("page")
    (tmp_path / "assets" / "main-1.js").write_text("true")
    for path, text in (("/", "page"), ("/assets/main-1.js", "true")):
        answer = site(tmp_path).get(path, headers={"Range": asked})
        assert (answer.status_code, answer.text) == (200, text)
        assert answer.headers["Accept-Ranges"] == "none"


def test_browsers_get_an_icon(client: TestClient) -> None:
    answer = client.get("/favicon.ico")
    assert (answer.status_code, answer.headers["content-type"]) == (200, "image/png")
    assert Image.open(BytesIO(answer.content)).size == (32, 32)
    assert answer.headers["cache-control"] == "public, max-age=86400"


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
    page = shown().by_address.get(address)
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
        if shown().by_address.get(name):
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
    monkeypatch.setattr(pages, "_CLONE", tmp_path)
    monkeypatch.setattr(pages, "_PACKAGED", tmp_path / "server" / "book_pages")
    wheel = Book()
    assert [page.address for page in wheel.pages] == ADDRESSES
    for page in wheel.pages:
        original = shown().by_address.get(page.address)
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

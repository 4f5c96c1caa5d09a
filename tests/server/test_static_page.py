"""The page at /: what the service serves of it."""

import gzip
import re
from io import BytesIO
from pathlib import Path

import pytest
from fastapi import FastAPI
from PIL import Image
from starlette.testclient import TestClient

from server.static_page import BUNDLE, make_page_router


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

"""The book in Chromium, visited by tests/browser/book.mjs."""

import pytest
from fastapi import FastAPI

from server.auth import SecurityHeadersMiddleware
from server.static_page import make_book_router, make_page_router
from tests.helpers.processes import serve_app
from tests.helpers.visits import Seen, missing, visit_feature

pytestmark = [pytest.mark.slow, pytest.mark.skipif(bool(missing()), reason=missing() or "all is there")]


@pytest.fixture(scope="module")
def seen() -> Seen:
    app = FastAPI(openapi_url=None)
    app.include_router(make_page_router())
    app.include_router(make_book_router())
    app.add_middleware(SecurityHeadersMiddleware)
    port = serve_app(app, "h11")
    with port as number:
        return visit_feature(f"http://127.0.0.1:{number}/", "book", {})


def test_the_browser_has_nothing_to_complain_of(seen: Seen) -> None:
    """No script error, nothing the content policy stops, nothing from another host."""
    assert (seen["complaints"], seen["requests"]) == ([], [])


def test_axe_finds_nothing(seen: Seen) -> None:
    assert (seen["searchFaults"], seen["phoneFaults"]) == ([], [])


def test_the_search_is_worked_by_keys(seen: Seen) -> None:
    assert "found" in seen["count"]
    assert seen["closed"]
    assert seen["focused"].startswith("lighting envmap · Command line")
    assert seen["copied"].startswith("lighting envmap [OPTIONS]")


def test_a_phone_has_the_contents_folded_and_scrolls_down_alone(seen: Seen) -> None:
    assert seen["titles"][1] == "Command line"
    assert (seen["folded"], seen["overflow"]) == (True, 0)

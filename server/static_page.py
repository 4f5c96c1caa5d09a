"""The web page that vite builds from server/web, and the book; both lie in the repository and in the wheel."""

import gzip
from functools import lru_cache
from hmac import compare_digest
from mimetypes import guess_type
from pathlib import Path

from anyio import to_thread
from fastapi import APIRouter, Request
from starlette.exceptions import HTTPException
from starlette.responses import FileResponse, RedirectResponse, Response
from starlette.staticfiles import NotModifiedResponse, StaticFiles

from server.book import FILES, PICTURES, Book
from server.dependencies import tag_bytes
from server.responses import is_fresh

_FAVICON = Path(__file__).with_name("favicon.png")
BUNDLE = Path(__file__).parent / "web" / "dist"
_TEXT_SUFFIXES = frozenset({".html", ".css", ".js", ".svg", ".tsv"})  # pictures and tables are compressed already
_KEPT_FILES = 64  # gzipped copies in memory, more than the page has texts
_CACHE_A_DAY = "public, max-age=86400"
_CACHE_FOREVER = "public, max-age=31536000, immutable"  # built files have names that depend on their content


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
    files = {".css": StaticFiles(directory=FILES), ".js": StaticFiles(directory=FILES)}
    files |= dict.fromkeys(PICTURES, StaticFiles(directory=shown.docs, check_dir=False))

    @router.get("/book")
    async def start() -> Response:
        return RedirectResponse("book/", 308)

    @router.get("/book/{path:path}")
    async def page(request: Request, path: str) -> Response:
        if path == "search.json":
            return await _serve_text(await to_thread.run_sync(lambda: shown.search_index), "application/json", request)
        if found := shown.find_page(path):
            return await _serve_text(await to_thread.run_sync(shown.render_page, found), "text/html", request)
        suffix = Path(path).suffix
        if suffix not in files:
            raise HTTPException(404)
        return await _serve_file(files[suffix], path, request, "no-cache")

    return router


async def _serve_text(data: bytes, kind: str, request: Request) -> Response:
    """A text that is in memory, gzipped if the client accepts that."""
    headers = {"Cache-Control": "no-cache", "Vary": "Accept-Encoding"}
    if _accepts_gzip(request):
        data = await to_thread.run_sync(_gzip_text, data)
        headers["Content-Encoding"] = "gzip"
    headers["ETag"] = tag_bytes(data)
    response = Response(data, media_type=kind, headers=headers)
    if is_fresh(request, headers["ETag"]):
        return NotModifiedResponse(response.headers)
    return response


@lru_cache(_KEPT_FILES)
def _gzip_text(data: bytes) -> bytes:
    return gzip.compress(data, mtime=0)


async def _serve_file(files: StaticFiles, path: str, request: Request, cache_control: str) -> Response:
    """A whole file, or its gzipped copy if it is a text and the client accepts that.

    A `Range` is ignored, as by the other routes: starlette answers an impossible one in plain text.
    """
    request.scope["headers"] = [pair for pair in request.scope["headers"] if pair[0] != b"range"]
    response = await files.get_response(path, request.scope)
    headers = {"Accept-Ranges": "none", "Cache-Control": cache_control}
    if Path(path).suffix in _TEXT_SUFFIXES:
        headers["Vary"] = "Accept-Encoding"
        if _accepts_gzip(request):
            response = await _gzip_response(files, path, request)
    response.headers.update(headers)
    return response


async def _gzip_response(files: StaticFiles, path: str, request: Request) -> Response:
    """The gzipped copy of a file that exists, with a tag of its own."""
    full_path, stat = files.lookup_path(path)
    data = await to_thread.run_sync(_gzip_file, full_path, stat.st_mtime_ns if stat else 0)
    headers = {"ETag": tag_bytes(data), "Content-Encoding": "gzip"}
    response = Response(data, media_type=guess_type(path)[0], headers=headers)
    if files.is_not_modified(response.headers, request.headers):
        return NotModifiedResponse(response.headers)
    return response


@lru_cache(_KEPT_FILES)
def _gzip_file(path: str, modified_ns: int) -> bytes:  # noqa: ARG001  # a file that changed is another
    return gzip.compress(Path(path).read_bytes(), mtime=0)


def _accepts_gzip(request: Request) -> bool:
    """Whether the client accepts gzip, by name or by `*`, and with a weight that is not 0 (RFC 9110, 12.5.3)."""
    codings = ",".join(request.headers.getlist("accept-encoding")).lower().replace(" ", "").split(",")
    weights = {coding: weight or "1" for coding, _, weight in (item.partition(";q=") for item in codings)}
    return weights.get("gzip", weights.get("*", "0")).strip("0.") != ""

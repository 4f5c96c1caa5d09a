"""The web page that vite builds from server/web, or a short notice if it was not built."""

from pathlib import Path

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from starlette.responses import Response
from starlette.staticfiles import StaticFiles

_FAVICON = Path(__file__).with_name("favicon.png")
BUNDLE = Path(__file__).parent / "web" / "dist"
_GZIP_SUFFIX = ".gz"  # the end of the name of a file's gzipped copy, which server/web/pack.mjs makes
_CACHE_A_DAY = "public, max-age=86400"
_CACHE_FOREVER = "public, max-age=31536000, immutable"  # built files have names that depend on their content

_NOT_BUILT_HTML = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Outdoor lighting</title></head><body>
<h1>Outdoor lighting</h1>
<p>The service runs. Its page is not built: run <code>npm ci &amp;&amp; npm run build</code> in
<code>server/web</code>.</p>
<p>The API is described in <a href="openapi.json">openapi.json</a>.</p>
</body></html>
"""


def make_page_router(bundle: Path = BUNDLE) -> APIRouter:
    """The routes of the page.

    Args:
        bundle: the folder that vite writes; it may be built after the service has started.
    """
    router = APIRouter(include_in_schema=False)
    icon = _FAVICON.read_bytes()
    root = StaticFiles(directory=bundle, check_dir=False)
    assets = StaticFiles(directory=bundle / "assets", check_dir=False)

    @router.get("/")
    async def page(request: Request) -> Response:
        if not (bundle / "index.html").is_file():
            return HTMLResponse(_NOT_BUILT_HTML)
        return await _serve_file(root, "index.html", request, "no-cache")

    @router.get("/favicon.ico")
    async def favicon() -> Response:
        """A sun over a horizon, as PNG, which browsers take under this name."""
        return Response(icon, media_type="image/png", headers={"Cache-Control": _CACHE_A_DAY})

    @router.get("/assets/{path:path}")
    async def asset(request: Request, path: str) -> Response:
        return await _serve_file(assets, path, request, _CACHE_FOREVER)

    return router


async def _serve_file(files: StaticFiles, path: str, request: Request, cache_control: str) -> Response:
    """A whole file, or its gzipped copy if there is one and the client accepts it.

    A `Range` is ignored, as by the other routes: starlette answers an impossible one in plain text.
    """
    request.scope["headers"] = [pair for pair in request.scope["headers"] if pair[0] != b"range"]
    response = await files.get_response(path, request.scope)
    headers = {"Accept-Ranges": "none", "Cache-Control": cache_control}
    if files.lookup_path(path + _GZIP_SUFFIX)[1]:
        headers["Vary"] = "Accept-Encoding"
        if _accepts_gzip(request):
            response = await files.get_response(path + _GZIP_SUFFIX, request.scope)
            headers |= {"Content-Encoding": "gzip"} if response.status_code == 200 else {}
    response.headers.update(headers)
    return response


def _accepts_gzip(request: Request) -> bool:
    """Whether the client accepts gzip, by name or by `*`, and with a weight that is not 0 (RFC 9110, 12.5.3)."""
    codings = ",".join(request.headers.getlist("accept-encoding")).lower().replace(" ", "").split(",")
    weights = {coding: weight or "1" for coding, _, weight in (item.partition(";q=") for item in codings)}
    return weights.get("gzip", weights.get("*", "0")).strip("0.") != ""

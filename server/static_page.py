"""The web page that vite builds from server/web, or a short notice if it was not built."""

from pathlib import Path

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from starlette.responses import Response
from starlette.staticfiles import StaticFiles

FAVICON = Path(__file__).with_name("favicon.png")
BUNDLE = Path(__file__).parent / "web" / "dist"
PACKED = ".gz"  # the end of the name of a file's gzipped copy, which server/web/pack.mjs makes
A_DAY = "public, max-age=86400"
FOREVER = "public, max-age=31536000, immutable"  # built files have names that depend on their content

NOT_BUILT = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>Outdoor lighting</title></head><body>
<h1>Outdoor lighting</h1>
<p>The service runs. Its page is not built: run <code>npm ci &amp;&amp; npm run build</code> in
<code>server/web</code>.</p>
<p>The API is described in <a href="openapi.json">openapi.json</a>.</p>
</body></html>
"""


def page_router(bundle: Path = BUNDLE) -> APIRouter:
    """Routes of the page in the folder `bundle`, which may be built after the service has started."""
    router = APIRouter(include_in_schema=False)
    icon = FAVICON.read_bytes()
    whole = StaticFiles(directory=bundle, check_dir=False)
    files = StaticFiles(directory=bundle / "assets", check_dir=False)

    @router.get("/")
    async def page(request: Request) -> Response:
        if not (bundle / "index.html").is_file():
            return HTMLResponse(NOT_BUILT)
        return await _served(whole, "index.html", request, "no-cache")

    @router.get("/favicon.ico")
    async def favicon() -> Response:
        """A sun over a horizon, as PNG, which browsers take under this name."""
        return Response(icon, media_type="image/png", headers={"Cache-Control": A_DAY})

    @router.get("/assets/{path:path}")
    async def asset(request: Request, path: str) -> Response:
        return await _served(files, path, request, FOREVER)

    return router


async def _served(files: StaticFiles, path: str, request: Request, kept: str) -> Response:
    """A whole file, which caches keep as `kept` says; its gzipped copy, where there is one and the client takes it.

    A `Range` is ignored, as the other routes ignore it: one that cannot be given would be answered in plain text.
    """
    request.scope["headers"] = [pair for pair in request.scope["headers"] if pair[0] != b"range"]
    response, told = await files.get_response(path, request.scope), {"Accept-Ranges": "none", "Cache-Control": kept}
    if files.lookup_path(path + PACKED)[1]:
        told["Vary"] = "Accept-Encoding"
        if _takes_gzip(request):
            response = await files.get_response(path + PACKED, request.scope)
            told |= {"Content-Encoding": "gzip"} if response.status_code == 200 else {}
    response.headers.update(told)
    return response


def _takes_gzip(request: Request) -> bool:
    """Whether the client accepts gzip, by name or by `*`, and with a weight that is not 0 (RFC 9110, 12.5.3)."""
    listed = ",".join(request.headers.getlist("accept-encoding")).lower().replace(" ", "").split(",")
    weights = {coding: weight or "1" for coding, _, weight in (item.partition(";q=") for item in listed)}
    return weights.get("gzip", weights.get("*", "0")).strip("0.") != ""

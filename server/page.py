"""The web page that vite builds from server/web, or a short notice if it was not built."""

from pathlib import Path

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse
from starlette.responses import Response
from starlette.staticfiles import StaticFiles

BUNDLE = Path(__file__).parent / "web" / "dist"
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
    whole = StaticFiles(directory=bundle, check_dir=False)
    files = StaticFiles(directory=bundle / "assets", check_dir=False)

    @router.get("/")
    async def page(request: Request) -> Response:
        if not (bundle / "index.html").is_file():
            return HTMLResponse(NOT_BUILT)
        response = await whole.get_response("index.html", request.scope)
        response.headers["Cache-Control"] = "no-cache"
        return response

    @router.get("/assets/{path:path}")
    async def asset(request: Request, path: str) -> Response:
        response = await files.get_response(path, request.scope)
        response.headers["Cache-Control"] = FOREVER
        return response

    return router

"""The ASGI app, and its OpenAPI document at /openapi.json, which /docs shows: its words, its schemas, its examples."""

import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from threading import Lock

from anyio import create_task_group, to_thread
from fastapi import APIRouter, Depends, FastAPI, Request, Response
from fastapi.responses import JSONResponse

from lighting.estimator import Estimator
from lighting.fields import Json
from lighting.runtime import ONE_BLAS_THREAD
from lighting.version import __version__
from server import job_routes, middleware, pages, problems, routes
from server.dependencies import Service, enforce_rate_limit, require_api_key
from server.query_params import refuse_duplicates
from server.request_body import FORM_TYPE, PHOTO_FIELD
from server.responses import tag_response
from server.schemas import LightingRecord, Problem
from server.settings import Settings, read_settings
from server.tracing import NO_TELEMETRY

log = logging.getLogger(__name__)


class _DescribedApp(FastAPI):
    """An app whose document has the schemas of bodies and errors, every problem, and how many photos a form takes."""

    _lock = Lock()  # two threads that generate a document at a time disturb each other
    _document: Json | None = None

    def openapi(self) -> Json:
        with self._lock:
            self._document = self._document or self._describe()
        return self._document

    def _describe(self) -> Json:
        document = super().openapi()
        _add_schemas(document["components"]["schemas"])
        document["components"]["examples"] = {
            kind.name: {"summary": kind.title, "description": kind.meaning, "value": problems.problem_example(kind)}
            for kind in problems.KINDS
        }
        _add_tags(document["paths"])
        form = document["paths"]["/v1/lightings"]["post"]["requestBody"]["content"][FORM_TYPE]["schema"]
        form["properties"][PHOTO_FIELD]["maxItems"] = self.state.service.settings.max_photos
        return document


def create_app(settings: Settings | None = None, estimator: Estimator | None = None) -> FastAPI:
    """The service as an ASGI app.

    Args:
        settings: None reads them from the environment.
        estimator: None loads the network when the app starts, which may raise ModelError.

    Raises:
        SettingsError: a variable of the environment is no setting, or the file of API keys is unusable.
        MissingExtraError: traces are asked for, and OpenTelemetry is not installed.
    """
    service = Service(settings or read_settings(), estimator)
    app = _DescribedApp(
        title="Outdoor lighting",
        summary="Where the sun is, what the sky is like and how the camera is tilted, from one outdoor photo.",
        description=_DESCRIPTION,
        version=__version__,
        license_info={"name": "Apache-2.0", "identifier": "Apache-2.0"},
        openapi_tags=_TAGS,
        servers=[{"url": service.settings.root_path or "/", "description": "This service"}],
        openapi_url=None,  # server/app.py answers it, with a tag
        docs_url=None,  # these documentation pages load scripts from another host
        redoc_url=None,
        redirect_slashes=False,  # to whatever the client calls its Host
        lifespan=_lifespan,
        exception_handlers=dict.fromkeys(problems.EXPECTED_ERRORS, problems.problem_response),
        generate_unique_id_function=lambda route: route.name.removeprefix("_"),
        telemetry=service.tracer.telemetry(middleware.is_unmeasured) if service.tracer else NO_TELEMETRY,
    )
    app.state.service = service
    _add_routes(app, service)
    middleware.add_middleware(app, service)
    return app


def _add_routes(app: FastAPI, service: Service) -> None:
    dependencies, statuses = [], [400, 403, 421, 422, 431]
    if service.rate_limiter or service.cpu_limiter:  # first, so that keys cannot be guessed quickly
        dependencies.append(Depends(enforce_rate_limit))
        statuses.append(429)
    if service.keys:
        dependencies.append(Depends(require_api_key))
        statuses.append(401)
    dependencies.append(Depends(refuse_duplicates))
    responses = problems.problem_responses(*statuses)
    app.include_router(routes.router, dependencies=dependencies, responses=responses)
    app.include_router(job_routes.router, dependencies=dependencies, responses=responses)
    app.include_router(routes.operations_router)
    app.include_router(_router)
    app.include_router(pages.make_page_router(photo=service.settings.opened_photo))
    app.include_router(pages.make_book_router())


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    service: Service = app.state.service
    await to_thread.run_sync(service.load)
    with ONE_BLAS_THREAD:  # whoever runs the application
        async with create_task_group() as tasks:
            tasks.start_soon(_warm_up, app, service)
            if service.jobs:
                tasks.start_soon(service.jobs.run)
            yield
            tasks.cancel_scope.cancel()
    if service.jobs:
        service.jobs.store.close()
        service.jobs = None
    if service.tracer:
        await to_thread.run_sync(service.tracer.close)


async def _warm_up(app: FastAPI, service: Service) -> None:
    """Run the network once; until then /readyz answers 503."""
    try:
        await to_thread.run_sync(service.warm_up)
        await to_thread.run_sync(app.openapi)  # it takes a while, and errors read it
    except Exception:
        log.exception("The network cannot answer.")


_DESCRIPTION = """Send a photo taken outdoors by daylight; get its light as JSON, as an environment map or as a scene.

```sh
curl -F photo=@photo.jpg http://127.0.0.1:8000/v1/lighting
curl -F photo=@photo.jpg -F height=256 -F format=hdr http://127.0.0.1:8000/v1/envmap -o sky.hdr
```

- **A photo** is the file `photo` of a form, or the whole body: JPEG, PNG, WebP, TIFF, AVIF or HEIC. URLs of photos and
  photos inside JSON are refused.
- **Parameters** go into the URL or the form, each once.
- **Angles** are degrees. Azimuth 0 is where the camera points, positive to the right. Colors are linear Rec.709.
- **`ETag`** is in every answer: the same one, the same answer. `GET` with it in `If-None-Match` answers 304.
  `POST` ignores that header, as RFC 9110 (13.2.1) says of methods that neither read nor change what lies at an address.
- **Errors** are `application/problem+json`. Programs read `type`, and each error's `field` and `code`.
- **Photos are not kept.** They stay in memory while they are worked on.
"""
_TAGS = [
    {"name": "lighting", "description": "From photos to their light, and from light to environment maps and scenes."},
    {"name": "jobs", "description": "Long work: clips, many photos, normals. Off unless the operator names a folder."},
    {"name": "operations", "description": "For operators."},
]

_ETAG = {"description": "Of the answer's bytes, or of what they follow from", "schema": {"type": "string"}}

_router = APIRouter(include_in_schema=False)


@_router.get("/openapi.json")
async def _describe_api(request: Request) -> Response:
    return tag_response(request, JSONResponse(request.app.openapi()))


def _add_tags(paths: Json) -> None:
    """Say that the answers under /v1 have tags, other than those of jobs."""
    for path, operations in paths.items():
        if path.startswith("/v1/") and not path.startswith("/v1/jobs"):
            for operation in operations.values():
                operation["responses"]["200"].setdefault("headers", {})["ETag"] = _ETAG


def _add_schemas(schemas: Json) -> None:
    """Add what no route of FastAPI's own names: the record of a body, and the problem."""
    for model in (Problem, LightingRecord):
        if model.__name__ not in schemas:
            schema = model.model_json_schema(ref_template="#/components/schemas/{model}")
            schemas.update({**schema.pop("$defs", {}), model.__name__: schema, **schemas})

"""The ASGI app."""

import logging
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

from anyio import create_task_group, to_thread
from fastapi import Depends, FastAPI
from fastapi.routing import APIRoute
from starlette.middleware.cors import CORSMiddleware

from lighting.estimator import Estimator
from lighting.version import __version__
from server import inference_protocol, job_routes, middleware, openapi, problems, routes, static_page
from server.auth import BrowserGuardMiddleware, SecurityHeadersMiddleware, enforce_rate_limit, require_api_key
from server.dependencies import Service
from server.middleware import DrainBodyMiddleware
from server.query_params import refuse_duplicates
from server.responses import WARNINGS_HEADER
from server.settings import Settings, read_settings
from server.tracing import NO_TELEMETRY

_EXPOSED_HEADERS = ("ETag", "Location", "Retry-After", "X-Request-ID", "Lighting-Model", WARNINGS_HEADER)

log = logging.getLogger(__name__)


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
    app = FastAPI(
        title="Outdoor lighting",
        summary="Where the sun is, what the sky is like and how the camera is tilted, from one outdoor photo.",
        description=openapi.DESCRIPTION,
        version=__version__,
        license_info={"name": "Apache-2.0", "identifier": "Apache-2.0"},
        openapi_tags=openapi.TAGS,
        servers=[{"url": service.settings.root_path or "/", "description": "This service"}],
        openapi_url=None,  # server/openapi.py answers it, with a tag
        docs_url=None,  # these documentation pages load scripts from another host
        redoc_url=None,
        redirect_slashes=False,  # to whatever the client calls its Host
        lifespan=_lifespan,
        generate_unique_id_function=_operation_id,
        telemetry=service.tracer.telemetry(middleware.is_unmeasured) if service.tracer else NO_TELEMETRY,
    )
    app.state.service = service
    problems.install_handlers(app)
    _add_routes(app, service)
    _add_middleware(app, service)
    openapi.complete_document(app, service.settings)
    return app


def _add_routes(app: FastAPI, service: Service) -> None:
    guards: list[tuple[object, Callable[..., Any], tuple[int, ...]]] = [
        (
            service.rate_limiter or service.cpu_limiter,
            enforce_rate_limit,
            (429,),
        ),  # first, so that keys cannot be guessed quickly
        (service.keys, require_api_key, (401, 403)),
    ]
    active = [(guard, statuses) for enabled, guard, statuses in guards if enabled]
    dependencies = [*(Depends(guard) for guard, _ in active), Depends(refuse_duplicates)]
    statuses = [status for _, statuses in active for status in statuses]
    responses = problems.problem_responses(400, 403, 421, 422, 431, *statuses)
    app.include_router(routes.router, dependencies=dependencies, responses=responses)
    app.include_router(job_routes.router, dependencies=dependencies, responses=responses)
    app.include_router(inference_protocol.router, dependencies=dependencies)
    app.include_router(inference_protocol.health_router)
    app.include_router(middleware.router)
    app.include_router(openapi.router)
    app.include_router(static_page.make_page_router(photo=service.settings.opened_photo))
    app.include_router(static_page.make_book_router())


def _add_middleware(app: FastAPI, service: Service) -> None:
    """Middleware, from the inside out."""
    app.add_middleware(middleware.ExceptionMiddleware)
    app.add_middleware(middleware.HeadAsGetMiddleware)
    if service.settings.cors_origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=service.settings.cors_origins,
            allow_methods=["GET", "POST", "DELETE"],
            allow_headers=["Authorization", "Content-Type", "If-None-Match", "X-Request-ID"],
            expose_headers=_EXPOSED_HEADERS,
        )
    app.add_middleware(BrowserGuardMiddleware, settings=service.settings)
    app.add_middleware(SecurityHeadersMiddleware, frame_origins=service.settings.frame_origins)
    app.add_middleware(middleware.AccessLogMiddleware, service=service)
    app.add_middleware(DrainBodyMiddleware)
    app.add_middleware(middleware.SliceMiddleware)


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    service: Service = app.state.service
    await to_thread.run_sync(service.load)
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


def _operation_id(route: APIRoute) -> str:
    return route.name

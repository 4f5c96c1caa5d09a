"""The routes: each reads its parameters, has the work done and makes the response.

The API, version 1, and the routes for operators.
"""

import json
from collections.abc import Awaitable, Callable, Coroutine
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any

from anyio import to_thread
from fastapi import APIRouter, Depends, Query, Request, Response
from fastapi.responses import JSONResponse
from fastapi.types import DecoratedCallable
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest

from lighting.fields import Json
from lighting.files import MAP_FORMATS
from lighting.model import METRICS, packaged_model
from lighting.prediction import ModelSpec
from lighting.record_json import record_with_coefficients
from lighting.records import Lighting
from lighting.registration import features
from lighting.scene import EXPORTERS
from lighting.sky import SKY_MODELS
from lighting.version import __version__
from server import query_params as queries
from server import responses, tasks
from server.dependencies import (
    Admission,
    AdmissionDep,
    PhotoDep,
    PhotoOrLightingDep,
    ServiceDep,
    UploadsDep,
)
from server.problems import problem_responses
from server.query_params import refuse_parameters
from server.request_body import BINARY_SCHEMA, JSON_TYPE, PHOTO_FIELD, PHOTO_TYPES, FormRoute, describe_body
from server.schemas import DayLight, LightingEstimate, LightingEstimates, LitSpot, ModelCard, Status


def _file_response(*media_types: str) -> Json:
    """An answer that is a file, for the OpenAPI document."""
    return {"content": {media_type: {"schema": BINARY_SCHEMA} for media_type in media_types}}


_PHOTO_SCHEMA = {**BINARY_SCHEMA, "description": "the file of the photo"}
_PHOTO_BODY = describe_body(PHOTO_FIELD, _PHOTO_SCHEMA, PHOTO_TYPES)
_PHOTOS_SCHEMA = {"type": "array", "items": BINARY_SCHEMA, "minItems": 1}  # the app adds how many at most
_PHOTOS_BODY = describe_body(PHOTO_FIELD, _PHOTOS_SCHEMA, PHOTO_TYPES)
_RECORD_CONTENT = {JSON_TYPE: {"schema": {"$ref": "#/components/schemas/LightingRecord"}}}
_PHOTO_OR_RECORD_BODY = describe_body(PHOTO_FIELD, _PHOTO_SCHEMA, PHOTO_TYPES, _RECORD_CONTENT)
_MAP_RESPONSE = _file_response(*(entry.media_type for entry in MAP_FORMATS.values()))
_PROBE_RESPONSE = {"content": {JSON_TYPE: {"schema": {"type": "object"}}}}
_PNG_RESPONSE, _JPEG_RESPONSE = _file_response("image/png"), _file_response("image/jpeg")
_SCENE_RESPONSE = _file_response(responses.ZIP_TYPE) | {
    "headers": {
        responses.WARNINGS_HEADER: {
            "description": "Where there is any, a JSON array of sentences about the scene and its light",
            "schema": {"type": "string", "contentMediaType": JSON_TYPE},
        }
    },
}
_NOT_MODIFIED_RESPONSE: Json = {"description": "The client's copy is still good"}
_SKY_ANSWERS = {304: _NOT_MODIFIED_RESPONSE, **problem_responses(422, 500, 503)}
_PHOTO_PROBLEMS = problem_responses(400, 408, 413, 415, 422, 429, 500, 503)


class _TaggedRoute(FormRoute):
    """A route that takes a form, and whose answers have a tag: a client sees by it whether one is another."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        handle = super().get_route_handler()

        async def tag_answer(request: Request) -> Response:
            response = await handle(request)
            if response.status_code == 200 and "ETag" not in response.headers:
                tag = await to_thread.run_sync(responses.tag_bytes, response.body)  # a large file takes long
                response.headers["ETag"] = tag
            return response

        return tag_answer


router = APIRouter(prefix="/v1", tags=["lighting"], route_class=_TaggedRoute)
operations_router = APIRouter(tags=["operations"])


def _get_file_of_sky(path: str, summary: str, answer: Json) -> Callable[[DecoratedCallable], DecoratedCallable]:
    """A route whose answer is a file, and follows from its parameters alone."""
    return router.get(path, summary=summary, response_class=Response, responses={200: answer, **_SKY_ANSWERS})


def _post_photo(
    path: str, summary: str, answer: Json, body: Json = _PHOTO_BODY
) -> Callable[[DecoratedCallable], DecoratedCallable]:
    """A route that answers a photo with a file."""
    responses = {200: answer, **_PHOTO_PROBLEMS}
    return router.post(path, summary=summary, response_class=Response, responses=responses, openapi_extra=body)


_ask_of_photo = partial(router.post, responses=_PHOTO_PROBLEMS, openapi_extra=_PHOTO_BODY)  # answers are JSON


@_ask_of_photo(
    "/lighting",
    summary="The light of a photo",
    response_model=LightingEstimate,
    response_description="The record of the light: sun, sky, ground and camera",
)
async def _estimate_lighting(
    admission: AdmissionDep, photo: PhotoDep, query: Annotated[queries.LightingQuery, Query()]
) -> JSONResponse:
    """Where the sun is, what the sky is like and how the camera stood, by pixels, metadata and what is given.

    Edit the answer and send it to `POST /v1/envmap` for its map. Several photos go to `POST /v1/lightings`.
    """
    return JSONResponse(await admission.run(tasks.answer_photo, admission.service, photo, query, admission.request))


@router.post(
    "/lightings",
    summary="The light of several photos of one place and light",
    response_model=LightingEstimates,
    response_description="A record for each photo, in the order of the photos",
    responses=_PHOTO_PROBLEMS,
    openapi_extra=_PHOTOS_BODY,
)
async def _estimate_lightings(
    admission: AdmissionDep, photos: UploadsDep, query: Annotated[queries.LightingsQuery, Query()]
) -> JSONResponse:
    """A burst, a panorama sweep or a drive: several files `photo` in one form are taken together."""
    queries.check_photo_headings(len(photos), query)
    records = await admission.run(tasks.answer_photos, admission.service, photos, query, admission.request)
    return JSONResponse({"lightings": records})


@_get_file_of_sky("/envmap", "The environment map of a sky", _MAP_RESPONSE)
async def _render_envmap(admission: AdmissionDep, query: Annotated[queries.SkyQuery, Query()]) -> Response:
    """The same parameters always give the same map: any cache may keep it."""
    return await _answer_from_cache(admission, query, lambda: _answer_map(admission, query.to_lighting(), query))


@_post_photo("/envmap", "The environment map of a photo or of a lighting record", _MAP_RESPONSE, _PHOTO_OR_RECORD_BODY)
async def _estimate_envmap(
    admission: AdmissionDep, source: PhotoOrLightingDep, query: Annotated[queries.EnvmapQuery, Query()]
) -> Response:
    """From a record nothing is estimated: edit it and render again.

    The parameters of a light replace what is estimated of a photo.
    """
    if isinstance(source, Lighting):
        queries.refuse_photo_parameters(query)
    return await _answer_map(admission, source, query)


@_get_file_of_sky("/light-probe", "The light probe of a sky", _PROBE_RESPONSE)
async def _compute_probe(admission: AdmissionDep, query: Annotated[queries.SkyProbeQuery, Query()]) -> Response:
    """Nine coefficients of all light but the sun's, and the sun, as an engine takes them."""
    return await _answer_from_cache(admission, query, lambda: _answer_probe(admission, query.to_lighting(), query))


@_post_photo(
    "/light-probe", "The light probe of a photo or of a lighting record", _PROBE_RESPONSE, _PHOTO_OR_RECORD_BODY
)
async def _estimate_probe(
    admission: AdmissionDep, source: PhotoOrLightingDep, query: Annotated[queries.PhotoProbeQuery, Query()]
) -> Response:
    """Nine coefficients of all light but the sun's, and the sun, as an engine takes them."""
    if isinstance(source, Lighting):
        queries.refuse_photo_parameters(query)
    return await _answer_probe(admission, source, query)


@_post_photo("/photo", "A photo upright, as JPEG", _JPEG_RESPONSE)
async def _show_photo(admission: AdmissionDep, photo: PhotoDep) -> Response:
    """For clients that cannot decode every type themselves, as browsers cannot HEIC; without metadata."""
    await refuse_parameters(admission.request)  # here, for those in a form
    return Response(await admission.run(tasks.encode_upright_jpeg, admission.service, photo), media_type="image/jpeg")


@_post_photo("/preview", "A picture of a photo's light", _PNG_RESPONSE)
async def _draw_preview(
    admission: AdmissionDep, photo: PhotoDep, query: Annotated[queries.PreviewQuery, Query()]
) -> Response:
    """The photo with its horizon and sun, the sun's probability, the map, and three spheres lit by it."""
    return Response(await admission.run(tasks.encode_preview, admission.service, photo, query), media_type="image/png")


@_post_photo("/ground", "What a photo shows of the ground", _PNG_RESPONSE)
async def _draw_ground(
    admission: AdmissionDep, photo: PhotoDep, query: Annotated[queries.GroundQuery, Query()]
) -> Response:
    """A mask as PNG, at most 256 pixels wide or high.

    Red is the probability of firm, level ground near by. Green says how far the sun reaches the ground, and is 0 on
    what stands before it. Blue is 255 where an object would stand in the sun, and 0 where in shade.
    """
    return Response(await admission.run(tasks.encode_ground, admission.service, photo, query), media_type="image/png")


@_ask_of_photo(
    "/ground/lit-spot", summary="The nearest ground in the sun", response_model=LitSpot, response_description="The spot"
)
async def _locate_lit_spot(
    admission: AdmissionDep, photo: PhotoDep, query: Annotated[queries.LitSpotQuery, Query()]
) -> JSONResponse:
    """The nearest point to (`x`, `y`) where firm ground lies in the sun, with room for an object."""
    return JSONResponse({"spot": await admission.run(tasks.find_lit_spot_in_photo, admission.service, photo, query)})


@_ask_of_photo(
    "/day",
    summary="The light of a day at a photo's place",
    response_model=DayLight,
    response_description="A record for each time from sunrise to sunset",
)
async def _plan_day(
    admission: AdmissionDep, photo: PhotoDep, query: Annotated[queries.DayQuery, Query()]
) -> JSONResponse:
    """The sun follows from place and heading, which the file or the client states. The place around is a guess."""
    study = await admission.run(tasks.plan_day, admission.service, photo, query)
    hours = [
        {"time": hour.time.isoformat(), "lighting": record_with_coefficients(hour.lighting)} for hour in study.hours
    ]
    return JSONResponse({"hours": hours, "warnings": study.warnings})


@_get_file_of_sky("/scene", "A scene for another tool, of a sky", _SCENE_RESPONSE)
async def _render_scene(admission: AdmissionDep, query: Annotated[queries.SkySceneQuery, Query()]) -> Response:
    """Camera, sun, map, ground and a placeholder as a ZIP; a gray picture stands where a photo goes."""
    return await _answer_from_cache(admission, query, lambda: _answer_scene(admission, tasks.zip_scene_of_sky, query))


@_post_photo("/scene", "A scene for another tool, of a photo", _SCENE_RESPONSE)
async def _estimate_scene(
    admission: AdmissionDep, photo: PhotoDep, query: Annotated[queries.PhotoSceneQuery, Query()]
) -> Response:
    """The photo as the camera sees it, sun, map, ground and a placeholder for one's own object, as a ZIP.

    The parameters of a light replace what is estimated.
    """
    return await _answer_scene(admission, tasks.zip_scene_of_photo, admission.service, photo, query)


@router.get(
    "/model",
    summary="The network that answers",
    response_model=ModelCard,
    response_description="The network, and the values of `tool`, `sky` and `format`",
    responses={304: _NOT_MODIFIED_RESPONSE, **problem_responses(500, 503)},
    dependencies=[Depends(refuse_parameters)],
)
async def _describe_model(request: Request, service: ServiceDep) -> Response:
    """Its name, licence, grid and accuracy, whether photos are matched, and what this service can make."""
    spec = service.estimator.model.spec
    card = ModelCard(
        name=spec.name,
        version=spec.version,
        licence=spec.licence,
        grid=spec.sun_grid,
        accuracy=_read_accuracy(spec, service.settings.model or packaged_model()),
        matching=features.has_opencv(),
        jobs=service.jobs is not None,
        scene_tools=list(EXPORTERS),
        scene_labels={tool: entry.label for tool, entry in EXPORTERS.items()},
        sky_models=list(SKY_MODELS),
        map_formats=list(MAP_FORMATS),
    )
    return responses.tag_response(request, JSONResponse(card.model_dump(mode="json")))


@operations_router.get("/livez", summary="Whether the process answers")
async def _livez() -> Status:
    """For a supervisor that restarts a process that hangs."""
    return Status()


@operations_router.get(
    "/readyz",
    summary="Whether the network has answered once, a photo would be taken now and jobs are worked on",
    responses=problem_responses(503),
)
async def _readyz(service: ServiceDep) -> Status:
    """For a load balancer: 503 while the network loads, while the queue is full of many clients' requests, or jobs wait
    in vain, as when their disk is full.
    """
    if fault := service.find_fault():
        raise fault
    return Status()


@operations_router.get(
    "/metrics",
    summary="Counters for Prometheus",
    response_class=Response,
    responses={200: {"content": {"text/plain": {"schema": {"type": "string"}}}}},
)
async def _metrics(service: ServiceDep) -> Response:
    """Requests, times, queues, bytes and connections, as text."""
    return Response(generate_latest(service.metrics.registry), media_type=CONTENT_TYPE_LATEST)


async def _answer_map(admission: Admission, source: bytes | Lighting, query: queries.MapQuery) -> Response:
    data = await admission.run(tasks.encode_map, admission.service, source, query)
    return Response(data, media_type=MAP_FORMATS[query.file_options().format].media_type)


async def _answer_probe(admission: Admission, source: bytes | Lighting, query: queries.ProbeQuery) -> Response:
    data = await admission.run(tasks.encode_probe, admission.service, source, query)
    return Response(data, media_type=JSON_TYPE)


async def _answer_scene(admission: Admission, work: Callable[..., tasks.FileWithWarnings], *arguments: Any) -> Response:
    """A scene as a ZIP archive, with its warnings in a header."""
    data, warnings = await admission.run(work, *arguments)
    warned = {responses.WARNINGS_HEADER: json.dumps(warnings)} if warnings else {}  # JSON in ASCII, as a header must be
    return Response(data, media_type=responses.ZIP_TYPE, headers=warned)


async def _answer_from_cache(
    admission: Admission, query: queries.Query, answer: Callable[[], Awaitable[Response]]
) -> Response:
    """An answer that caches may keep, or 304; its tag is weak since the last bit may differ between machines."""
    service = admission.service
    digest = sha256(f"{__version__} {query.model_dump_json()}".encode()).hexdigest()[:32]
    scope = "private" if service.keys else "public"
    headers = {"ETag": f'W/"{digest}"', "Cache-Control": f"{scope}, max-age={service.settings.cache_seconds}"}
    if responses.is_fresh(admission.request, headers["ETag"]):
        return Response(status_code=304, headers=headers)
    response = await answer()
    response.headers.update(headers)
    return response


def _read_accuracy(spec: ModelSpec, network: Path) -> Json:
    """The accuracy of a network by evaluation protocol; empty if it has no published figures."""
    path = network.with_name(METRICS)
    metrics = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    is_of_network = (metrics.get("name"), metrics.get("version")) == (spec.name, spec.version)
    return dict(metrics["accuracy"]) if is_of_network else {}

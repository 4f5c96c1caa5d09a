"""The API, version 1: each route reads its parameters, asks for work and words the answer."""

from typing import Annotated, Any

from fastapi import APIRouter, Depends, Query, Request, Response
from fastapi.responses import JSONResponse

from lighting.files import MAP_FORMATS
from lighting.registration import features
from lighting.scene import EXPORTERS
from lighting.sky import SKY_MODELS
from server import tasks
from server.dependencies import Admitted, PhotoBytes, Services, Uploads
from server.problems import documented
from server.query_params import (
    EnvmapQuery,
    LightingQuery,
    PhotoSceneQuery,
    PreviewQuery,
    SkyQuery,
    SkySceneQuery,
    check_photos,
    refuse_given,
    refuse_parameters,
)
from server.request_body import FORM, JSON, PHOTO_FIELD, PHOTO_TYPES, media_type, parse_record
from server.responses import WARNINGS, ZIP, accuracy, caching, estimates_json, map_response, scene_response
from server.schemas import LightingEstimate, LightingEstimates, ModelCard

BINARY = {"type": "string", "format": "binary"}
FORM_SCHEMA = {
    "type": "object", "required": [PHOTO_FIELD], "properties": {PHOTO_FIELD: BINARY}, "additionalProperties": False,
}  # fmt: skip
PHOTO_BODY: dict[str, Any] = {
    FORM: {"schema": FORM_SCHEMA},
    **{photo_type: {"schema": BINARY} for photo_type in PHOTO_TYPES},
}
MANY = {"type": "array", "items": BINARY, "minItems": 1}  # the app adds how many at most
PHOTOS_FORM: dict[str, Any] = {FORM: {"schema": {**FORM_SCHEMA, "properties": {PHOTO_FIELD: MANY}}}}
RECORD_BODY: dict[str, Any] = {JSON: {"schema": {"$ref": "#/components/schemas/LightingRecord"}}}
MAPS: dict[str, Any] = {"content": {entry.media_type: {"schema": BINARY} for entry in MAP_FORMATS.values()}}
PNG: dict[str, Any] = {"content": {"image/png": {"schema": BINARY}}}
JPEG: dict[str, Any] = {"content": {"image/jpeg": {"schema": BINARY}}}
SCENES: dict[str, Any] = {
    "content": {ZIP: {"schema": BINARY}},
    "headers": {
        WARNINGS: {
            "description": "Where there is any, a JSON array of sentences about the scene and its light",
            "schema": {"type": "string", "contentMediaType": JSON},
        }
    },
}
FRESH: dict[str, Any] = {"description": "The client's copy is still good"}
PHOTO_PROBLEMS = documented(400, 408, 413, 415, 422, 429, 500, 503)

router = APIRouter(prefix="/v1", tags=["lighting"])


def _body(content: dict[str, Any]) -> dict[str, Any]:
    """A request body for the OpenAPI document."""
    return {"requestBody": {"required": True, "content": content}}


@router.post(
    "/lighting",
    summary="The light of a photo, or of several photos of one place and light",
    response_model=LightingEstimate | LightingEstimates,
    responses=PHOTO_PROBLEMS,
    openapi_extra=_body(PHOTO_BODY | PHOTOS_FORM),
)
async def estimate_lighting(
    request: Request, admission: Admitted, photos: Uploads, query: Annotated[LightingQuery, Query()]
) -> JSONResponse:
    """Where the sun is, what the sky is like and how the camera stood, by pixels, metadata and what is given.

    Several files `photo` in one form are taken together: a burst, a panorama sweep or a drive.
    """
    check_photos(len(photos), query)
    found = await admission.run(tasks.estimated_together, admission.service, photos, query)
    return JSONResponse(estimates_json(found, query, request.scope.get("root_path", "")))


@router.get(
    "/envmap",
    summary="The environment map of a sky",
    response_class=Response,
    responses={200: MAPS, 304: FRESH, **documented(422, 500, 503)},
)
async def render_envmap(request: Request, admission: Admitted, query: Annotated[SkyQuery, Query()]) -> Response:
    """The same parameters always give the same map: any cache may keep it."""
    headers, unchanged = caching(request, admission.service, query)
    if unchanged:
        return unchanged
    data = await admission.run(tasks.envmap_file, query.lighting(), query)
    return map_response(data, query.format, headers)


@router.post(
    "/envmap",
    summary="The environment map of a photo or of a lighting record",
    response_class=Response,
    responses={200: MAPS, **PHOTO_PROBLEMS},
    openapi_extra=_body(PHOTO_BODY | RECORD_BODY),
)
async def estimate_envmap(request: Request, admission: Admitted, query: Annotated[EnvmapQuery, Query()]) -> Response:
    """From a record nothing is estimated: edit it and render again."""
    if media_type(request) == JSON:
        refuse_given(query)
        lighting = parse_record(await admission.body.record())
        data = await admission.run(tasks.envmap_file, lighting, query)
    else:
        photo = await admission.body.photo(JSON)
        data = await admission.run(tasks.envmap_file_of_photo, admission.service, photo, query)
    return map_response(data, query.format)


@router.post(
    "/photo",
    summary="A photo upright, as JPEG",
    response_class=Response,
    responses={200: JPEG, **PHOTO_PROBLEMS},
    dependencies=[Depends(refuse_parameters)],
    openapi_extra=_body(PHOTO_BODY),
)
async def show_photo(admission: Admitted, photo: PhotoBytes) -> Response:
    """For clients that cannot decode every type themselves, as browsers cannot HEIC; without metadata."""
    return Response(await admission.run(tasks.upright_file, admission.service, photo), media_type="image/jpeg")


@router.post(
    "/preview",
    summary="A picture of a photo's light",
    response_class=Response,
    responses={200: PNG, **PHOTO_PROBLEMS},
    openapi_extra=_body(PHOTO_BODY),
)
async def draw_preview(admission: Admitted, photo: PhotoBytes, query: Annotated[PreviewQuery, Query()]) -> Response:
    """The photo with its horizon and sun, the sun's probability, the map, and three spheres lit by it."""
    return Response(await admission.run(tasks.preview_file, admission.service, photo, query), media_type="image/png")


@router.get(
    "/scene",
    summary="A scene for another tool, of a sky",
    response_class=Response,
    responses={200: SCENES, 304: FRESH, **documented(422, 500, 503)},
)
async def render_scene(request: Request, admission: Admitted, query: Annotated[SkySceneQuery, Query()]) -> Response:
    """Camera, sun, map, ground and a placeholder as a ZIP; a grey picture stands where a photo goes."""
    headers, unchanged = caching(request, admission.service, query)
    if unchanged:
        return unchanged
    data, warnings = await admission.run(tasks.scene_file_of_sky, query)
    return scene_response(data, warnings, headers)


@router.post(
    "/scene",
    summary="A scene for another tool, of a photo",
    response_class=Response,
    responses={200: SCENES, **PHOTO_PROBLEMS},
    openapi_extra=_body(PHOTO_BODY),
)
async def estimate_scene(
    admission: Admitted, photo: PhotoBytes, query: Annotated[PhotoSceneQuery, Query()]
) -> Response:
    """The photo as the camera sees it, sun, map, ground and a placeholder for one's own object, as a ZIP.

    The parameters of a light replace what is estimated.
    """
    return scene_response(*await admission.run(tasks.scene_file_of_photo, admission.service, photo, query))


@router.get(
    "/model",
    summary="The network that answers",
    responses=documented(500, 503),
    dependencies=[Depends(refuse_parameters)],
)
async def describe_model(service: Services) -> ModelCard:
    """Its name, licence, grid and accuracy, whether photos are matched, and what this service can make."""
    spec = service.estimator.model.spec
    return ModelCard(
        name=spec.name,
        version=spec.version,
        licence=spec.licence,
        grid=spec.sun_grid,
        accuracy=accuracy(spec, service.model_folder),
        matching=features.has_opencv(),
        scene_tools=list(EXPORTERS),
        sky_models=list(SKY_MODELS),
        map_formats=list(MAP_FORMATS),
    )

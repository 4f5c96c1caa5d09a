"""The Open Inference Protocol, version 2, by which Triton, KServe and their clients ask: one photo in, its record out.

The photo is the input `photo`, one element of BYTES in the protocol's binary form. A JSON header comes first; the
header Inference-Header-Content-Length says how long it is. Behind it come the element's length in four bytes and the
element. The output `lighting` is one element of BYTES, the JSON record of POST /v1/lighting.
"""

import json

from fastapi import APIRouter, Depends, Request, Response
from fastapi.responses import JSONResponse

from lighting.errors import ErrorCode
from lighting.records import Json, ModelSpec
from lighting.version import __version__
from server import problems, responses, tasks
from server.dependencies import AdmissionDep, Service, ServiceDep
from server.problems import INFERENCE_PREFIX, ProblemError, invalid_field_error
from server.query_params import LightingQuery, refuse_parameters
from server.tracing import SERVICE_NAME

_LENGTH_HEADER = "Inference-Header-Content-Length"
_LENGTH_BYTES = 4  # before each element
_INPUT, _OUTPUT = "photo", "lighting"

_VERSIONED = "/{name}/versions/{version}"

health_router = APIRouter(prefix=INFERENCE_PREFIX, include_in_schema=False)
router = APIRouter(
    prefix=f"{INFERENCE_PREFIX}/models", include_in_schema=False, dependencies=[Depends(refuse_parameters)]
)


@health_router.get("/health/live")
async def answer_live() -> Response:
    """200 while the process runs, as /livez."""
    return Response()


@health_router.get("/health/ready")
async def answer_ready(service: ServiceDep) -> Response:
    """200 where a photo would be taken, else 503, as /readyz."""
    return Response(status_code=200 if service.ready and not service.ending and not service.full else 503)


@health_router.get("")
async def describe_service() -> JSONResponse:
    """The service's metadata."""
    return JSONResponse({"name": SERVICE_NAME, "version": __version__, "extensions": ["binary_tensor_data"]})


@router.get("/{name}/ready")
@router.get(f"{_VERSIONED}/ready")
async def answer_model_ready(service: ServiceDep, name: str, version: str | None = None) -> Response:
    """The same for the model, by its name."""
    _check_model(service, name, version)
    return await answer_ready(service)


@router.get("/{name}")
@router.get(_VERSIONED)
async def describe_inference(service: ServiceDep, name: str, version: str | None = None) -> JSONResponse:
    """The model's metadata: input and output."""
    spec = _check_model(service, name, version)
    tensors = ({"name": tensor, "datatype": "BYTES", "shape": [1]} for tensor in (_INPUT, _OUTPUT))
    inputs, outputs = ([tensor] for tensor in tensors)
    described: Json = {"name": spec.name, "versions": [spec.version], "platform": "onnx"}
    return JSONResponse({**described, "inputs": inputs, "outputs": outputs})


@router.post("/{name}/infer")
@router.post(f"{_VERSIONED}/infer")
async def infer(request: Request, admission: AdmissionDep, name: str, version: str | None = None) -> JSONResponse:
    """The record of a photo."""
    spec = _check_model(admission.service, name, version)
    header, photo = _parse_request(await admission.body.inference(), request.headers.get(_LENGTH_HEADER, ""))
    query = LightingQuery()
    answer = await admission.run(tasks.answer_photo, admission.service, photo, query)
    record = responses.estimate_to_json(answer, query, request.scope.get("root_path", ""))
    output = {"name": _OUTPUT, "datatype": "BYTES", "shape": [1], "data": [json.dumps(record)]}
    named = {"id": header["id"]} if isinstance(header.get("id"), str) else {}
    return JSONResponse({"model_name": spec.name, "model_version": spec.version, **named, "outputs": [output]})


def _check_model(service: Service, name: str, version: str | None) -> ModelSpec:
    """The network's spec; ProblemError for another name or version."""
    spec = service.estimator.model.spec
    if name != spec.name:
        raise ProblemError(problems.NOT_FOUND, f"There is no model of this name; the model is {spec.name}.")
    if version not in (None, spec.version):
        raise ProblemError(problems.NOT_FOUND, f"There is no such version; the model has {spec.version}.")
    return spec


def _parse_request(body: bytes, length: str) -> tuple[Json, bytes]:
    """The JSON header of a request, and the photo behind it; ProblemError for another body."""
    if not length.isdecimal() or int(length) > len(body):
        detail = f"Send the photo as binary data after the JSON, and the JSON's length as {_LENGTH_HEADER}."
        raise ProblemError(problems.UNREADABLE_BODY, detail)
    try:
        header = json.loads(body[: int(length)])
        (tensor,) = header["inputs"]
        fits = (tensor["name"], tensor["datatype"], tensor["shape"]) == (_INPUT, "BYTES", [1])
    except (ValueError, TypeError, KeyError, RecursionError) as error:
        raise ProblemError(problems.UNREADABLE_BODY, "The JSON of the request has no one input.") from error
    data = body[int(length) :]
    if not fits or len(data) < _LENGTH_BYTES or int.from_bytes(data[:4], "little") != len(data) - _LENGTH_BYTES:
        detail = f"The request needs one input {_INPUT} of datatype BYTES and shape [1], as binary data."
        raise invalid_field_error("inputs", detail, "body", ErrorCode.WRONG_TYPE)
    return header, data[_LENGTH_BYTES:]

"""Long jobs over HTTP: submit a clip or a ZIP of photos, ask how far it is, take the result, delete it."""

import re
from collections.abc import Mapping
from dataclasses import asdict, fields
from datetime import UTC, datetime
from pathlib import PurePath
from typing import Annotated, Any, Self

from anyio import to_thread
from fastapi import APIRouter, Depends, Query, Request, Response
from fastapi.responses import FileResponse, JSONResponse
from pydantic import Field, model_validator

from lighting.color import DECODE_CURVES
from lighting.fields import Json
from lighting.fusion.user_input import UserInput
from lighting.map_options import Around
from lighting.scene import animated_tools
from server import field_types as types
from server import problems
from server.dependencies import ServiceDep
from server.field_types import InRange, NotNull, RegistryName, field_error
from server.job_kinds import DISK_FULL, JOB_KINDS, MAP_OPTIONS, RESULT_FILE, UPLOAD_STEM
from server.job_store import JobState, StoredJob
from server.jobs import JobRunner
from server.limits import client_of_request
from server.problems import ProblemError, problem_responses
from server.query_params import AdjustQuery, MapQuery, PlaceQuery, UserInputQuery, refuse_parameters
from server.request_body import BINARY_SCHEMA, FILE_TYPES, UPLOAD_FIELD, FormRoute, RequestBody, describe_body
from server.responses import ZIP_TYPE, link_from
from server.schemas import JobRecord

_UPLOAD_SECONDS = 3600.0  # for an upload, which may have hundreds of megabytes
_UPLOAD_PART = 2  # an upload may have this part of a job's bytes
_POLL_SECONDS = "2"  # after which a client may ask again
_SUFFIX = re.compile(r"\.[A-Za-z0-9]{1,5}")
_FILE_SCHEMA = {**BINARY_SCHEMA, "description": "the clip, or the ZIP of photos"}
_OFF = "This service takes no jobs; its operator can turn them on by LIGHTING_JOBS_FOLDER."

router = APIRouter(prefix="/v1/jobs", tags=["jobs"], route_class=FormRoute)


class _JobQuery(UserInputQuery, AdjustQuery, PlaceQuery, MapQuery):
    """What a job does, and what is known of its photos."""

    kind: Annotated[str, RegistryName(JOB_KINDS)] = Field(
        description="; ".join(f"`{name}`: {kind.upload}" for name, kind in JOB_KINDS.items())
    )
    every: Annotated[float, InRange(0.04, 60, description="s; of a clip the network sees a frame this often")] = 0.2
    curve: Annotated[str | None, RegistryName(DECODE_CURVES), NotNull()] = Field(
        None, description="of a clip: how it is coded, such as d-log or s-log3; by default as its file says"
    )
    tool: Annotated[str | None, RegistryName(animated_tools()), NotNull()] = Field(
        None, alias="for", description="of a clip: also a scene for this tool, its camera with key frames"
    )
    preview: types.Flag = Field(False, description="of a clip: also the clip with horizon, sun and balls drawn in")
    envmap: types.Flag = Field(False, description="of photos: also the environment map of each")
    camera_elevation: types.CameraElevation = 0.0
    camera_roll: types.CameraRoll = 0.0

    @model_validator(mode="after")
    def _check_options(self) -> Self:
        allowed = JOB_KINDS[self.kind].options | {"kind"}
        fields = type(self).model_fields
        names = {name: fields[name].alias or name for name in self.explicit_fields()}
        if others := sorted(name for name in names.values() if name not in allowed):
            kinds = [name for name, kind in JOB_KINDS.items() if others[0] in kind.options]
            raise field_error(others[0], f"goes with kind={' or '.join(kinds)}")
        if self.kind == "photos" and not self.envmap and (idle := sorted(MAP_OPTIONS.intersection(names))):
            raise field_error(idle[0], "goes with envmap=true")
        return self

    def to_request(self, upload: str, model: str | None) -> Json:
        """The request of a job's process."""
        known = self.user_input()
        stated = {field.name: getattr(known, field.name) for field in fields(UserInput)}
        names = ("every", "curve", "tool", "preview", "envmap", "camera_elevation", "camera_roll")
        options = {name: getattr(self, name) for name in names}
        return {
            "kind": self.kind,
            "upload": upload,
            "model": model,
            "user_input": {**stated, "time": known.time.isoformat() if known.time else None},
            "options": {**options, "view": asdict(self.view()), "file": asdict(self.file_options())},
        }

    @classmethod
    def _without_detail(cls, values: Mapping[str, Any]) -> str:
        return Around.PLAIN.value if values.get("kind") == "video" else super()._without_detail(values)


async def _get_jobs(service: ServiceDep) -> JobRunner:
    """The jobs of a service that takes some; raises ProblemError (404) otherwise."""
    if service.jobs is None:
        raise ProblemError(problems.NOT_FOUND, _OFF)
    return service.jobs


JobsDep = Annotated[JobRunner, Depends(_get_jobs)]


async def _find_job(id: str, jobs: JobsDep) -> StoredJob:
    """The job that a path names; raises ProblemError (404)."""
    job = jobs.store.find(id)
    if job is None:
        raise ProblemError(problems.UNKNOWN_JOB)
    return job


JobDep = Annotated[StoredJob, Depends(_find_job)]


async def _receive_upload(request: Request, service: ServiceDep, jobs: JobsDep) -> Any:
    """The number of a new job, whose upload lies in its folder; all of it is gone if the request fails."""
    limits = jobs.max_bytes // _UPLOAD_PART, _UPLOAD_SECONDS, service.settings.upload_rate
    try:
        async with jobs.store.reserve_place(client_of_request(request)) as number:
            path = jobs.store.work_folder(number) / UPLOAD_STEM
            name = await RequestBody(request, *limits, service.uploads.count_upload).save(path)
            suffix = PurePath(name).suffix
            yield number, path.rename(path.with_suffix(suffix if _SUFFIX.fullmatch(suffix) else ""))
    except OSError as error:
        full = ProblemError(problems.BUSY, "The disk for jobs is full.")
        raise (full if error.errno in DISK_FULL else error) from error


UploadDep = Annotated[Any, Depends(_receive_upload)]


@router.post(
    "",
    summary="Start a long job",
    status_code=202,
    response_model=JobRecord,
    response_description="The job waits for its turn; ask at `Location` how far it is",
    responses=problem_responses(404, 408, 413, 415, 429, 500, 503),
    openapi_extra=describe_body(UPLOAD_FIELD, _FILE_SCHEMA, FILE_TYPES),
)
async def _submit_job(
    request: Request, jobs: JobsDep, service: ServiceDep, upload: UploadDep, query: Annotated[_JobQuery, Query()]
) -> JSONResponse:
    """Upload a clip, or a ZIP of photos; the answer comes at once, and the result later.

    The upload is deleted when its job ends, the result a day later or by DELETE. Jobs are worked on one at a time.
    """
    number, path = upload
    model = service.settings.model
    wanted = query.to_request(path.name, str(model.resolve()) if model else None)
    if service.tracer:
        wanted["trace"] = service.tracer.current_context()
    await jobs.submit(StoredJob(number, client_of_request(request), wanted))
    return _answer_job(request, jobs, await _find_job(number, jobs), 202)


@router.get(
    "/{id}",
    summary="How far a job is",
    response_model=JobRecord,
    responses=problem_responses(404, 500),
    dependencies=[Depends(refuse_parameters)],
)
async def _describe_job(request: Request, jobs: JobsDep, job: JobDep) -> JSONResponse:
    """Ask again after `Retry-After` seconds until `state` is `finished` or `failed`."""
    return _answer_job(request, jobs, job, 200)


@router.get(
    "/{id}/result",
    summary="The result of a job",
    response_class=Response,
    response_description="A ZIP of what the command line writes for this kind of job",
    responses={200: {"content": {ZIP_TYPE: {"schema": BINARY_SCHEMA}}}, **problem_responses(404, 409, 500)},
    dependencies=[Depends(refuse_parameters)],
)
async def _download_result(jobs: JobsDep, job: JobDep) -> Response:
    """It is kept for a day after the job has finished."""
    if job.state is not JobState.FINISHED:
        raise ProblemError(problems.NO_RESULT, job.error or f"The job is {job.state.value}; ask again.")
    path = jobs.store.path(job.id) / RESULT_FILE
    if not await to_thread.run_sync(path.is_file):
        raise ProblemError(problems.UNKNOWN_JOB, "Somebody removed the result from the service's disk.")
    return FileResponse(path, media_type=ZIP_TYPE, headers={"Cache-Control": "private, no-store"})


@router.delete(
    "/{id}",
    summary="Stop and forget a job",
    status_code=204,
    response_description="Its files are deleted",
    responses=problem_responses(404, 500),
    dependencies=[Depends(refuse_parameters)],
)
async def _delete_job(jobs: JobsDep, job: JobDep) -> Response:
    """A job at work is ended; its upload and its result are deleted."""
    await jobs.remove(job.id)
    return Response(status_code=204)


def _answer_job(request: Request, jobs: JobRunner, job: StoredJob, status: int) -> JSONResponse:
    """The record of a job."""
    address = link_from(request, f"/v1/jobs/{job.id}")
    finished, ended = job.state is JobState.FINISHED, job.expires is not None
    record = JobRecord(
        id=job.id,
        kind=job.request["kind"],
        state=job.state.value,
        progress=jobs.progress(job),
        created=datetime.fromtimestamp(job.created, UTC),
        expires=datetime.fromtimestamp(job.expires, UTC) if job.expires is not None else None,
        warnings=list(job.warnings),
        error=job.error or None,
        code=job.code or None,
        links=JobRecord.JobLinks(self=address, result=f"{address}/result" if finished else None),
    )
    headers = {"Cache-Control": "no-store"} | ({"Location": address} if status == 202 else {})
    headers |= {} if ended else {"Retry-After": _POLL_SECONDS}
    return JSONResponse(record.model_dump(mode="json", exclude_none=True), status, headers)

"""The OpenAPI document: complete, stable, and true under thousands of generated requests."""

import json
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from itertools import count
from types import SimpleNamespace
from typing import Any

import pytest
import schemathesis
from fastapi import FastAPI
from hypothesis import strategies as st
from schemathesis.engine import from_schema
from schemathesis.engine.events import FatalError, NonFatalError, ScenarioFinished
from schemathesis.engine.recorder import ScenarioRecorder
from schemathesis.generation.case import Case
from schemathesis.generation.meta import CoveragePhaseData, CoverageScenario
from schemathesis.hooks import HookContext
from starlette.testclient import TestClient

import lighting.envmap.surroundings as surroundings
import lighting.scene.records as records
from lighting.envmap.surroundings import render_view
from lighting.estimator import Estimator
from lighting.photo_estimate import Estimate
from server import tasks
from server.app import create_app
from server.problems import KINDS
from server.request_body import FORM_TYPE, PHOTO_TYPES
from server.schemas import Problem
from server.settings import Settings
from tests.conftest import encode, scene

OPERATIONS = {
    "estimate_lighting": ("post", "/v1/lighting"),
    "estimate_lightings": ("post", "/v1/lightings"),
    "render_envmap": ("get", "/v1/envmap"),
    "estimate_envmap": ("post", "/v1/envmap"),
    "compute_probe": ("get", "/v1/light-probe"),
    "estimate_probe": ("post", "/v1/light-probe"),
    "show_photo": ("post", "/v1/photo"),
    "draw_preview": ("post", "/v1/preview"),
    "draw_ground": ("post", "/v1/ground"),
    "locate_lit_spot": ("post", "/v1/ground/lit-spot"),
    "plan_day": ("post", "/v1/day"),
    "render_scene": ("get", "/v1/scene"),
    "estimate_scene": ("post", "/v1/scene"),
    "describe_model": ("get", "/v1/model"),
    "submit_job": ("post", "/v1/jobs"),
    "describe_job": ("get", "/v1/jobs/{id}"),
    "download_result": ("get", "/v1/jobs/{id}/result"),
    "delete_job": ("delete", "/v1/jobs/{id}"),
    "livez": ("get", "/livez"),
    "readyz": ("get", "/readyz"),
    "metrics": ("get", "/metrics"),
}


@pytest.fixture
def document(client: TestClient) -> dict[str, Any]:
    answer: dict[str, Any] = client.get("/openapi.json").json()
    return answer


def operations(document: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {
        operation["operationId"]: {**operation, "at": (method, path)}
        for path, methods in document["paths"].items()
        for method, operation in methods.items()
    }


def test_operation_ids_are_stable(document: dict[str, Any]) -> None:
    assert {name: operation["at"] for name, operation in operations(document).items()} == OPERATIONS


def test_every_operation_has_a_tag_a_summary_and_only_problems_as_errors(document: dict[str, Any]) -> None:
    known = {tag["name"] for tag in document["tags"] if tag["description"]}
    for operation in operations(document).values():
        assert operation["summary"]
        assert set(operation["tags"]) <= known
        for status, answer in operation["responses"].items():
            if status >= "400":
                assert list(answer["content"]) == ["application/problem+json"], status
                examples = answer["content"]["application/problem+json"]["examples"].values()
                assert {str(Problem.model_validate(example["value"]).status) for example in examples} == {status}


def test_every_parameter_and_field_has_its_range_and_an_example(document: dict[str, Any]) -> None:
    numbers = [
        parameter["schema"]
        for operation in operations(document).values()
        for parameter in operation.get("parameters", [])
        if parameter["schema"].get("type") in ("number", "integer")
    ]
    for name in ("SunPart", "SkyPart", "CameraPart"):
        fields = document["components"]["schemas"][name]["properties"].values()
        numbers += [field for field in fields if field.get("type") == "number"]
    assert len(numbers) > 15
    for schema in numbers:
        assert schema["minimum"] < schema["maximum"]
        assert schema["description"]


def test_no_parameter_is_null_since_a_url_holds_texts(document: dict[str, Any]) -> None:
    for operation in operations(document).values():
        for parameter in operation.get("parameters", []):
            assert isinstance(parameter["schema"].get("type"), str), parameter["name"]


def test_every_reference_leads_somewhere(document: dict[str, Any]) -> None:
    text = json.dumps(document)
    for name in {part.split('"')[0] for part in text.split("#/components/schemas/")[1:]}:
        assert name in document["components"]["schemas"]


WITH_CONDITIONS = (
    "estimate_lighting",
    "estimate_lightings",
    "submit_job",
    "describe_job",
    "download_result",
    "delete_job",
    "render_envmap",
    "estimate_envmap",
    "draw_preview",
    "plan_day",
    "render_scene",
    "estimate_scene",
    "show_photo",
    "draw_ground",
    "locate_lit_spot",
    "compute_probe",
    "estimate_probe",
)
TOGETHER = {  # values that are each right may not fit each other, such as a time of night; a file may be empty (400)
    "positive_data_acceptance": {"expected-statuses": ["2xx", "400", "401", "403", "404", "422"]}
}

DRAWN = 10  # requests to each operation
SERIES = 15  # of requests, each with what the one before answered
WRONG_TYPES = 7  # one in so many is sent; most parameters have five, and are of several operations

PHOTOS = st.sampled_from([encode(scene(64, 48)), encode(scene(40, 90), quality=20)])
for media in PHOTO_TYPES:
    schemathesis.openapi.media_type(media, PHOTOS)  # what a photo is, the document cannot say
schemathesis.openapi.format("binary", PHOTOS)


@pytest.fixture
def quick_app(estimator: Estimator, monkeypatch: pytest.MonkeyPatch) -> FastAPI:
    """A service that draws small pictures, whatever the size asked for."""
    monkeypatch.setattr(
        surroundings, "render_view", lambda lighting, _, **options: render_view(lighting, 16, **options)
    )
    monkeypatch.setattr(Estimate, "preview", lambda *_: scene(16, 16))
    monkeypatch.setattr(tasks, "zip_scene", lambda *_, **__: b"PK")
    for module in (tasks, records):
        monkeypatch.setattr(module, "make_scene", lambda *_, **__: SimpleNamespace(warnings=("It was dark.",)))
    app = create_app(Settings(), estimator)
    app.state.service.warm_up()
    return app


def test_two_threads_that_ask_at_a_time_get_one_document(estimator: Estimator) -> None:
    app = create_app(Settings(root_path="/two"), estimator)  # of which no other test has the document
    with ThreadPoolExecutor(2) as threads:
        one, other = threads.map(lambda _: app.openapi(), range(2))
    assert one is other


@pytest.mark.slow
@pytest.mark.parametrize("thorough", [False, pytest.param(True, marks=pytest.mark.thorough)])
def test_the_document_holds_under_fuzzing(quick_app: FastAPI, thorough: bool) -> None:
    """All of schemathesis's checks: no 5xx, no undocumented status, type, header or body, nothing wrong accepted.

    A quick run draws few requests, and leaves out those at each bound of each parameter.
    """
    drawn, series, fewest = (DRAWN, SERIES, 3000) if thorough else (2, 2, 50)
    stateful = {"generation": {"max-examples": series}, "checks": TOGETHER}
    config = schemathesis.Config.from_dict(
        {
            "seed": 1,
            "generation": {"deterministic": True, "max-examples": drawn},
            "phases": {"coverage": {"enabled": thorough}, "stateful": stateful},
            "operations": [{"include-operation-id": name, "checks": TOGETHER} for name in WITH_CONDITIONS],
        }
    )
    schema = schemathesis.openapi.from_asgi("/openapi.json", quick_app, config=config)
    schema.hook("filter_case")(is_sent_whole)
    schema.hook("filter_case")(DrawnTypes())
    calls: Counter[str] = Counter()
    failures: dict[str, str] = {}
    for event in from_schema(schema).execute():
        assert not isinstance(event, FatalError | NonFatalError), event
        if isinstance(event, ScenarioFinished):
            calls[event.recorder.label] += len(event.recorder.interactions)
            failures |= failed_checks(event.recorder)
    assert not failures, "\n\n".join(failures.values())
    assert calls.total() > fewest, calls


def is_sent_whole(_: HookContext, case: Case[Any]) -> bool:
    """Whether every field of a form reaches the service: an empty list sends nothing, whatever its name is."""
    return case.media_type != FORM_TYPE or not isinstance(case.body, dict) or [] not in case.body.values()


class DrawnTypes:
    """Whether a value of a wrong type is sent: one in WRONG_TYPES is, so that each type comes at many parameters."""

    def __init__(self) -> None:
        self.number = count()

    def __call__(self, _: HookContext, case: Case[Any]) -> bool:
        phase = case.meta.phase.data if case.meta else None
        wrong = isinstance(phase, CoveragePhaseData) and phase.scenario == CoverageScenario.INCORRECT_TYPE
        return not wrong or next(self.number) % WRONG_TYPES == 0


def failed_checks(recorder: ScenarioRecorder) -> dict[str, str]:
    """What failed, with a command that repeats it, once for each kind of failure."""
    return {
        f"{recorder.label} {check.name}": f"{check.failure_info.failure}\n{check.failure_info.code_sample}"
        for checks in recorder.checks.values()
        for check in checks
        if check.failure_info
    }


def test_the_document_tells_strangers_where_and_what(document: dict[str, Any]) -> None:
    assert document["servers"] == [{"url": "/", "description": "This service"}]
    assert "curl -F photo=@" in document["info"]["description"]
    for operation in operations(document).values():
        assert operation["description"], operation["operationId"]
    examples = document["components"]["examples"]
    assert list(examples) == [kind.name for kind in KINDS]
    for example in examples.values():
        assert len(Problem.model_validate(example["value"]).detail) > 20


def test_one_photo_and_several_have_answers_of_one_kind(document: dict[str, Any]) -> None:
    for path, schema in (("/v1/lighting", "LightingEstimate"), ("/v1/lightings", "LightingEstimates")):
        (content,) = document["paths"][path]["post"]["responses"]["200"]["content"].values()
        assert content["schema"] == {"$ref": f"#/components/schemas/{schema}"}


@pytest.mark.parametrize("path", ["/openapi.json", "/v1/model"])
def test_what_seldom_changes_has_a_tag(client: TestClient, path: str) -> None:
    answer = client.get(path)
    again = client.get(path, headers={"If-None-Match": f'"x", {answer.headers["ETag"]}'})
    assert (again.status_code, again.content, again.headers["ETag"]) == (304, b"", answer.headers["ETag"])
    assert client.get(path, headers={"If-None-Match": '"x"'}).json() == answer.json()

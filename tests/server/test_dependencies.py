"""Tests of dependencies."""

import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import anyio
import numpy as np
import pytest
from fastapi import FastAPI
from numpy.typing import NDArray
from prometheus_client import generate_latest
from starlette.testclient import TestClient

from lighting.errors import MissingExtraError, ModelError, PhotoTooLargeError, WarningCode
from lighting.estimator import Estimator
from lighting.photo.reader import TARGET
from lighting.registration import features, photo_set
from server.app import create_app
from server.dependencies import NO_OPENCV, ROTATION_INFERRED, PhotoMatcher, Service, ServiceMetrics
from server.limits import UNKNOWN, ArrivingBody, ConnectionLimiter, PendingResponses, UploadLimiter
from server.problems import ProblemError
from server.query_params import LightingsQuery
from server.scheduling import WorkLimiter
from server.settings import Settings
from tests.conftest import encode, scene
from tests.helpers.cameras import picture, texture
from tests.helpers.pages import ROOT
from tests.server.conftest import Client, client_of, jpeg_headers, sample, together, until

pytestmark = pytest.mark.needs("cv2")
FOV = 50.0
ALONE = "It overlaps no other photo"


@pytest.fixture
def app(estimator: Estimator) -> FastAPI:
    """A service that has time, however slow this machine is."""
    return create_app(Settings(match_seconds=300), estimator)


def view(azimuth: float, seed: int = 0) -> bytes:
    """Rolled, so that no seam of the texture stands upright as a collage's would."""
    return encode(picture(texture(seed), (azimuth, 2.0, 6.0), FOV), quality=95)


def noise(seed: int) -> NDArray[np.uint8]:
    """As many features as are kept, in a picture as large as is kept."""
    cells = np.random.default_rng(seed).integers(0, 256, (256, 256), dtype=np.uint8)
    return np.repeat(np.kron(cells, np.ones((4, 4), np.uint8))[..., None], 3, axis=2)


FIRST, SECOND, STRANGER = view(0.0), view(25.0), view(0.0, seed=1)


def records(client: TestClient, *files: bytes, **query: Any) -> list[dict[str, Any]]:
    answer = together(client, *files, **query)
    assert answer.status_code == 200, answer.text
    found: list[dict[str, Any]] = answer.json()["lightings"]
    return found


def never(*_: Any) -> None:
    raise AssertionError("nothing is to be matched")


def test_overlapping_photos_are_turned_as_they_show(client: TestClient) -> None:
    first, second = records(client, FIRST, SECOND)
    assert second["camera"]["relative_heading"] == pytest.approx(25.0, abs=0.5)
    assert (first["sun"]["azimuth"] - second["sun"]["azimuth"]) % 360.0 == pytest.approx(25.0, abs=0.5)
    for record in (first, second):
        assert record["evidence"] == ["pixels", "turns", "other photos"]
        assert record["warnings"] == []
        assert record["camera"]["vertical_fov"] == pytest.approx(FOV, abs=1.0)


def test_a_photo_in_which_nothing_was_found_is_told(client: TestClient) -> None:
    *joined, stranger = records(client, FIRST, SECOND, STRANGER)
    assert ["turns" in record["evidence"] for record in (*joined, stranger)] == [True, True, False]
    assert [len(record["warnings"]) for record in joined] == [0, 0]
    assert stranger["warnings"][0].startswith(ALONE)


def test_photos_without_overlap_are_answered_as_before_and_told_so(client: TestClient) -> None:
    matched, inferred = (records(client, FIRST, STRANGER, match=match) for match in ("true", "false"))
    for one, other in zip(matched, inferred, strict=True):
        assert one["warnings"].pop().startswith(ALONE)
        assert one.pop("warning_codes") == ["turn-inferred"]
        assert one == other


@pytest.mark.parametrize("query", [{"headings": "0,40"}, {"headings": "0,40", "match": "true"}, {"match": "false"}])
def test_headings_that_are_given_win_and_matching_can_be_left_out(
    client: TestClient, monkeypatch: pytest.MonkeyPatch, query: dict[str, str]
) -> None:
    monkeypatch.setattr(photo_set, "register_views_isolated", never)
    first, second = records(client, FIRST, SECOND, **query)
    assert "turns" not in first["evidence"]
    assert first["warnings"] == []
    if "headings" in query:
        assert (first["sun"]["azimuth"] - second["sun"]["azimuth"]) % 360.0 == pytest.approx(40.0, abs=0.01)


def test_one_photo_is_matched_with_nothing(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(photo_set, "register_views_isolated", never)
    assert together(client, FIRST).json() == together(client, FIRST, match="false").json()
    assert together(client, FIRST, match="yes").json()["errors"][0]["field"] == "match"


def test_without_opencv_the_answer_is_as_before_and_says_so(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = records(client, FIRST, SECOND, match="false")
    monkeypatch.setattr(features, "has_opencv", lambda: False)
    for record, before in zip(records(client, FIRST, SECOND), expected, strict=True):
        assert record["warnings"].pop() == f"{NO_OPENCV} {ROTATION_INFERRED}"
        assert record.pop("warning_codes") == ["turn-inferred"]
        assert record == before
    assert PhotoMatcher(1.0).target == TARGET


def test_opencv_that_cannot_be_imported_is_told_in_words_for_clients(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    def without_opencv(*_: Any) -> None:
        raise MissingExtraError("OpenCV is not installed: pip install 'outdoor-lighting[all]'.")

    monkeypatch.setattr(photo_set, "register_views_isolated", without_opencv)
    for record in records(client, FIRST, SECOND):
        assert record["warnings"][-1] == f"{NO_OPENCV} {ROTATION_INFERRED}"


def test_what_takes_too_long_is_answered_without(estimator: Estimator) -> None:
    hurried = client_of(estimator, match_seconds=0.001)
    for record in records(hurried, *[encode(noise(seed), "PNG") for seed in range(3)]):
        assert record["warnings"] == [
            f"Matching the photos with each other takes longer than 0.001 seconds. {ROTATION_INFERRED}"
        ]
        assert "turns" not in record["evidence"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "pictures",
    [
        [noise(0), noise(1)],
        [noise(0)] * 3,
        [np.roll(np.tile(noise(0)[:32, :32], (32, 32, 1)), 7 * shift, axis=1) for shift in range(3)],
        [np.full((64, 64, 3), 128, np.uint8)] * 2,
        [noise(0)[:32, :256], noise(0)[:256, :32]],
    ],
    ids=["noise", "identical", "repeated", "flat", "slim"],
)
def test_hostile_photos_are_answered(client: TestClient, pictures: Sequence[NDArray[np.uint8]]) -> None:
    found = records(client, *(encode(pixels, "PNG") for pixels in pictures))
    assert len(found) == len(pictures)
    assert not any("memory" in warning for record in found for warning in record["warnings"])


def test_the_service_answers_others_while_it_matches(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    began, release = threading.Event(), threading.Event()

    def held(*_: Any) -> None:
        began.set()
        assert release.wait(60)

    monkeypatch.setattr(photo_set, "register_views_isolated", held)
    with ThreadPoolExecutor(1) as pool:
        answer = pool.submit(together, client, FIRST, SECOND)
        assert began.wait(60)
        assert client.get("/livez").status_code == 200
        assert not answer.done()
        release.set()
        assert answer.result().status_code == 200


def test_the_page_knows_the_code_of_an_inferred_rotation(client: TestClient) -> None:
    page = (ROOT / "server" / "web" / "src" / "text" / "format.ts").read_text(encoding="utf-8")
    assert f'"{WarningCode.TURN_INFERRED.value}"' in page
    first, _ = records(client, FIRST, STRANGER)
    assert first["warnings"][0].startswith(ALONE)
    assert first["warning_codes"][0] == WarningCode.TURN_INFERRED.value


def test_several_photos_are_matched_unless_their_headings_are_given() -> None:
    assert LightingsQuery.model_validate({}).needs_matching(2)
    assert not LightingsQuery.model_validate({}).needs_matching(1)
    assert not LightingsQuery.model_validate({"match": "false"}).needs_matching(2)
    assert not LightingsQuery.model_validate({"headings": "0,45"}).needs_matching(2)


def test_it_stops_when_the_client_goes_away(estimator: Estimator, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its photos would be matched for minutes."""
    endless = "import time, lighting.registration.photo_set as a; a.register_views = lambda _: time.sleep(600); "
    monkeypatch.setattr(photo_set, "CODE", endless + photo_set.CODE)
    began, register = threading.Event(), photo_set.register_views_isolated

    def observed(*arguments: Any) -> Any:
        began.set()
        return register(*arguments)

    monkeypatch.setattr(photo_set, "register_views_isolated", observed)
    boundary = "photos"
    part = f'--{boundary}\r\nContent-Disposition: form-data; name="photo"; filename="p.jpg"\r\n\r\n'.encode()
    body = b"".join(part + data + b"\r\n" for data in (FIRST, SECOND)) + f"--{boundary}--\r\n".encode()
    app = create_app(Settings(match_seconds=300), estimator)
    service: Service = app.state.service

    async def scenario() -> None:
        client = Client(app, body, kind=f"multipart/form-data; boundary={boundary}")
        client.path = "/v1/lightings"
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(client.ask)
            await until(began.is_set)
            client.gone.set()
        assert client.status == 499
        assert service.limiter.running == 0

    since = time.monotonic()
    anyio.run(scenario)
    assert time.monotonic() - since < 100


def test_a_service_without_a_network_is_not_ready_and_says_so() -> None:
    service = Service(Settings())
    assert (service.ready, service.model_name) == (False, "")
    with pytest.raises(ProblemError, match="not loaded yet"):
        _ = service.estimator


def test_a_service_is_ready_once_its_network_has_answered(estimator: Estimator) -> None:
    service = Service(Settings(), estimator)
    assert not service.ready
    service.warm_up()
    assert service.ready
    spec = estimator.model.spec
    assert service.model_name == f"{spec.name} {spec.version}"


def test_a_missing_network_is_a_model_error(tmp_path_factory: pytest.TempPathFactory) -> None:
    absent = tmp_path_factory.mktemp("none") / "absent.onnx"
    with pytest.raises(ModelError, match="There is no network at"):
        Service(Settings(model=absent)).load()


def test_photos_are_read_within_the_settings_limits_and_counted(estimator: Estimator) -> None:
    service = Service(Settings(max_pixels=10_000), estimator)
    with pytest.raises(PhotoTooLargeError, match="million pixels"):
        service.read_photo(encode(scene(640, 480)))
    data = encode(scene(96, 64))
    assert service.read_photo(data).pixels.shape == (64, 96, 3)
    counted = service.metrics.registry.get_sample_value
    assert counted("lighting_photo_bytes_total") == len(data)
    assert counted("lighting_photo_pixels_total") == 96 * 64


def test_requests_are_counted_by_route_and_status(client: TestClient, jpeg: bytes) -> None:
    client.post("/v1/lighting", content=jpeg, headers=jpeg_headers())
    client.post("/v1/lighting", content=b"text", headers=jpeg_headers())
    client.get("/v1/envmap")
    client.get("/nowhere/1")
    client.get("/nowhere/2")
    client.request("MADE-UP", "/nowhere/3")
    client.head("/v1/model")
    client.request("MADE-UP", "/v1/model")
    client.request("MADE-UP-TOO", "/v1/model")
    counts = {
        ("POST", "/v1/lighting", 200): 1,
        ("POST", "/v1/lighting", 400): 1,
        ("GET", "/v1/envmap", 422): 1,
        ("any", "unmatched", 404): 3,
        ("HEAD", "/v1/model", 200): 1,
        ("other", "/v1/model", 405): 2,
    }
    for (method, route, status), count in counts.items():
        labels = f'{{method="{method}",route="{route}",status="{status}"}}'
        assert sample(client, f"lighting_requests_total{labels}") == count, labels
    assert sample(client, 'lighting_request_seconds_count{route="/v1/lighting"}') == 2
    assert sample(client, "lighting_inference_seconds_count") == 1
    assert sample(client, "lighting_photo_bytes_total") == len(jpeg)
    assert sample(client, "lighting_photo_pixels_total") == 320 * 240
    assert sample(client, "lighting_queue_depth") == sample(client, "lighting_running") == 0


def test_two_services_count_apart(estimator: Estimator) -> None:
    one, other = client_of(estimator), client_of(estimator)
    one.get("/v1/model")
    assert sample(one, 'lighting_requests_total{method="GET",route="/v1/model",status="200"}') == 1
    assert sample(other, 'lighting_requests_total{method="GET",route="/v1/model",status="200"}') == 0


class Waiting:
    """A connection whose client has not taken 700 bytes yet."""

    def unsent_bytes(self) -> int:
        return 700

    def seconds_left(self) -> float:
        return 7.0

    def drop_answer(self) -> None:
        raise AssertionError

    def give_way(self) -> None:
        raise AssertionError


def test_the_gauges_follow_the_limits() -> None:
    limiter, uploads, pending = WorkLimiter(1, 2), UploadLimiter(3, 2), PendingResponses(1000)
    connections = ConnectionLimiter(9, 9)
    metrics = ServiceMetrics(limiter, uploads, pending, connections)
    pending.add(Waiting(), UNKNOWN)
    connections.open(Waiting(), UNKNOWN)
    with limiter.admission(), limiter.admission(), uploads.count_upload(ArrivingBody(UNKNOWN, lambda: None)):
        text = generate_latest(metrics.registry).decode()
    assert "lighting_queue_depth 2.0" in text
    assert "lighting_running 0.0" in text
    assert "lighting_uploads 1.0" in text
    assert "lighting_unsent_bytes 700.0" in text
    assert "lighting_connections 1.0" in text

"""Tests of responses."""

from dataclasses import replace
from datetime import datetime, timedelta, timezone
from pathlib import Path
from urllib.parse import SplitResult, parse_qs, urljoin, urlsplit

import numpy as np
import pytest
from pydantic import ValidationError
from starlette.requests import Request
from starlette.testclient import TestClient

from export.evaluation.metrics_file import collect_metrics, read_metrics, write_metrics
from export.evaluation.report import CAMERA_AND_SKY, SUN_COLUMNS, Figures
from lighting.estimator import Estimator
from lighting.geometry import angles
from lighting.model import METRICS, Model, packaged_model
from lighting.photo.metadata import HeadingReference, PhotoMetadata
from lighting.photo.reader import Photo, PhotoCrop
from lighting.photo_estimate import Estimate
from lighting.prediction import SunDistribution
from lighting.records import Lighting
from lighting.sun_grid import grid_directions
from server.app import create_app
from server.query_params import LightingQuery, SkyQuery
from server.responses import estimate_to_json, is_fresh
from server.schemas import LightingEstimate, ModelCard
from server.settings import Settings

GRID = "fibonacci:64"
LIGHT = Lighting(sun_azimuth=-41.2, sun_elevation=33.0, turbidity=3.4, exposure=0.02, sun_visibility=0.1)
ANSWERS_SUN = SunDistribution(GRID, np.full(64, 1 / 64, dtype=np.float32))
REQUEST = Request({"type": "http", "path": "/v1/lighting"})
PHOTO = Photo(np.full((48, 64, 3), 128, dtype=np.uint8), 64, 48, "JPEG")
ESTIMATE = Estimate(LIGHT, ANSWERS_SUN, photo=PHOTO, photo_lighting=LIGHT)


def request(if_none_match: str) -> Request:
    return Request({"type": "http", "headers": [(b"if-none-match", if_none_match.encode())]})


def linked(light: Lighting, path: str = "/v1/lighting") -> SplitResult:
    """The link to a light's map in the answer to a request."""
    answer = replace(ESTIMATE, lighting=light)
    asked = Request({"type": "http", "path": path})
    return urlsplit(str(estimate_to_json(asked, answer, LightingQuery())["links"]["envmap"]))


@pytest.mark.parametrize("path", ["/v1/lighting", "/v1/lightings", "/v1/jobs/a/record"])
def test_the_link_is_relative_to_the_requests_url(path: str) -> None:
    for root in ("", "/tools/light"):
        assert urljoin(f"{root}{path}", linked(LIGHT, path).path) == f"{root}/v1/envmap"


def test_the_link_has_the_parameters_of_the_light() -> None:
    link = linked(LIGHT)
    said = {name: values[0] for name, values in parse_qs(link.query).items()}
    assert said.pop("sun") == "false"
    assert SkyQuery.model_validate(said).to_lighting() == Lighting(
        sun_azimuth=-41.2, sun_elevation=33.0, turbidity=3.4, exposure=0.02
    )


def test_the_link_has_the_strength_of_the_light_where_it_is_known() -> None:
    strong = replace(
        LIGHT,
        sky_model="preetham",
        sun_irradiance=(1.9, 1.5, 0.9),
        sky_irradiance=(0.4, 0.5, 0.8),
        sky_cover=0.2,
        ground_color=(0.12, 0.11, 0.1),
    )
    said = {name: values[0] for name, values in parse_qs(linked(strong).query).items()}
    assert said["sun"] == "false"  # unlikely to shine
    query = SkyQuery.model_validate(said)
    assert query.view().sky == "preetham"
    assert replace(query.to_lighting(), sky_model="preetham", sun_visibility=0.1) == strong
    painted = replace(LIGHT, sky_painted="prague")
    assert parse_qs(linked(painted).query)["sky"] == ["prague"]


@pytest.mark.parametrize(
    "wrong",
    [
        {"sun_irradiance": "1,2"},
        {"sun_irradiance": "1,2,red", "sky_irradiance": "1,1,1"},
        {"sky_irradiance": "1,1,1"},
        {"sky_cover": "0.5"},
        {"ground_color": "0.1,0.1,2"},
        {"sky": "blue"},
    ],
)
def test_a_light_that_contradicts_itself_is_refused(wrong: dict[str, str]) -> None:
    plain = {"sun_azimuth": "9", "sun_elevation": "30", "turbidity": "3", "exposure": "1"}
    with pytest.raises(ValidationError):
        SkyQuery.model_validate(plain | wrong)


def test_an_estimate_is_a_record() -> None:
    record = estimate_to_json(REQUEST, ESTIMATE, LightingQuery.model_validate({}))
    assert record["sun"]["azimuth"] == -41.2
    assert "probability" not in record


def test_what_the_file_says_comes_without_what_it_does_not_say() -> None:
    moment = datetime(2024, 8, 10, 14, 28, 12)
    metadata = PhotoMetadata(moment, 2.0, heading=87.0, heading_reference=HeadingReference.TRUE, orientation=6)
    metadata = replace(metadata, gps_time=datetime(2024, 8, 10, 14, 28, 10, tzinfo=timezone(timedelta(hours=2))))
    query = LightingQuery.model_validate({"photo_metadata": "true"})
    answer = estimate_to_json(REQUEST, replace(ESTIMATE, photo=replace(PHOTO, metadata=metadata)), query)
    assert answer["photo_metadata"] == {
        **{"time": "2024-08-10T14:28:12", "utc_offset": 2.0, "gps_time": "2024-08-10T12:28:10+00:00"},
        **{"heading": 87.0, "heading_reference": "true", "orientation": 6},
    }
    located = replace(PHOTO, metadata=PhotoMetadata(latitude=48.1, longitude=-11.5))
    answer = estimate_to_json(REQUEST, replace(ESTIMATE, photo=located), query)
    assert answer["photo_metadata"] == {"latitude": 48.1, "longitude": -11.5}
    assert "photo_metadata" not in estimate_to_json(REQUEST, ESTIMATE, LightingQuery.model_validate({}))


def test_what_lies_inside_a_border_is_told() -> None:
    query = LightingQuery.model_validate({})
    bordered = replace(PHOTO, crop=PhotoCrop(0, 131, 1920, 818, 1920, 1080))
    told = estimate_to_json(REQUEST, replace(ESTIMATE, photo=bordered), query)
    sizes = {"width": 1920, "height": 818, "picture_width": 1920, "picture_height": 1080}
    assert told["crop"] == {"left": 0, "top": 131, **sizes}
    assert LightingEstimate.model_validate(told).crop == LightingEstimate.CropRecord(left=0, top=131, **sizes)
    assert "crop" not in estimate_to_json(REQUEST, ESTIMATE, query)


def test_the_probability_comes_with_the_angles_of_its_cells() -> None:
    told = estimate_to_json(REQUEST, ESTIMATE, LightingQuery.model_validate({"probability": "true"}))["probability"]
    azimuth, elevation = angles(grid_directions(GRID))
    assert told["azimuth"] == pytest.approx(azimuth, abs=0.01)
    assert told["elevation"] == pytest.approx(elevation, abs=0.01)
    assert told["probability"] == pytest.approx(ANSWERS_SUN.probability, abs=1e-5)
    assert sum(told["probability"]) == pytest.approx(1.0, abs=1e-4)
    assert np.sin(np.radians(told["elevation"])) == pytest.approx(grid_directions(GRID)[:, 1], abs=1e-4)


@pytest.mark.parametrize(
    ("copy", "fresh"), [('W/"a"', True), ('"a"', True), ('"b", W/"a"', True), ("*", True), ('"b"', False), ("", False)]
)
def test_a_clients_copyis_fresh_if_it_has_the_tag(copy: str, fresh: bool) -> None:
    assert is_fresh(request(copy), 'W/"a"') is fresh


def accuracy_of(network: Path | None, folder: Path) -> dict[str, dict[str, float]]:
    """What a service states of a network whose figures lie in a folder."""
    settings = Settings(model=folder / "network.onnx")
    client = TestClient(create_app(settings, Estimator(Model.load(network))))
    return dict(client.get("/v1/model").raise_for_status().json()["accuracy"])


def test_the_service_reads_what_the_evaluation_writes(tmp_path: Path, network: Path) -> None:
    measured: Figures = {name: float(i) for i, name in enumerate([*SUN_COLUMNS.values(), *CAMERA_AND_SKY.values()])}
    (tmp_path / "panoramas.csv").write_text("name,file,kind,place,split\n", encoding="utf-8")
    figures: dict[str, Figures] = {"phone": measured, "paper": {**measured, "sun_median": None}}
    write_metrics(collect_metrics(network, tmp_path, "", figures, "tiny"), tmp_path)
    # nothing is stated of a protocol without suns to score
    assert accuracy_of(network, tmp_path) == {"phone": measured}
    assert set(measured) == set(ModelCard.Accuracy.model_fields)


def test_the_packaged_network_s_figures_are_those_of_its_tables() -> None:
    """The row of the network in the table of the sun, which the same evaluation wrote."""
    folder = packaged_model().parent
    metrics, stated = read_metrics(folder / METRICS), accuracy_of(None, folder)
    assert set(stated) == {"paper", "phone"}
    for protocol, numbers in stated.items():
        assert set(numbers) == set(ModelCard.Accuracy.model_fields)
        for column, name in SUN_COLUMNS.items():
            assert metrics.figure(f"Protocol `{protocol}`", "Sun [", metrics.row, column) == numbers[name]


def test_nothing_is_stated_for_a_network_without_figures(tmp_path: Path, network: Path) -> None:
    assert accuracy_of(network, packaged_model().parent) == {}
    assert accuracy_of(network, tmp_path) == {}

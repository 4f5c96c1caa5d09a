"""The CPU work of requests, called as the limiter calls it."""

import json
import zipfile
from collections.abc import Callable
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any, TypeVar

import anyio
import numpy as np
import pytest
from fastapi import Request
from PIL import Image, ImageOps

from lighting.envmap.surroundings import surroundings_gain
from lighting.errors import PhotoError
from lighting.estimator import Estimator
from lighting.files.exr import read_exr
from lighting.model import Model
from server import tasks
from server.dependencies import Service
from server.query_params import EnvmapQuery, LightingsQuery, PhotoSceneQuery, PreviewQuery, SkySceneQuery
from server.request_body import Upload
from server.responses import estimate_to_json
from server.settings import Settings
from tests.conftest import encode, scene
from tests.server.conftest import SKY

T = TypeVar("T")
PHOTO = encode(scene(64, 48))
REQUEST = Request({"type": "http", "path": "/v1/lightings"})
EXAMPLE = Path(__file__).parents[2] / "examples" / "wide_street.jpg"


@pytest.fixture
def service(estimator: Estimator) -> Service:
    return Service(Settings(), estimator)


def in_a_thread(work: Callable[..., T], *arguments: Any) -> T:
    async def run() -> T:
        return await anyio.to_thread.run_sync(lambda: work(*arguments))

    return anyio.run(run)


def test_photos_together_give_one_estimate_each_and_a_bad_one_is_named(service: Service) -> None:
    query = LightingsQuery.model_validate({"headings": "0,45"})
    first, second = in_a_thread(tasks.estimate_photos, service, [Upload(PHOTO), Upload(PHOTO)], query)
    assert "other photos" in first.evidence
    assert "surroundings" not in estimate_to_json(REQUEST, first, query)
    turn = (first.lighting.sun_azimuth - second.lighting.sun_azimuth) % 360.0
    assert min(turn, 360.0 - turn) > 0.0
    with pytest.raises(PhotoError, match=r"^Photo 2 of 2: "):
        in_a_thread(tasks.estimate_photos, service, [Upload(PHOTO), Upload(b"no photo")], query)


def test_a_photo_becomes_a_map_of_the_size_and_format_asked_for(service: Service) -> None:
    query = EnvmapQuery.model_validate({"height": 32})
    image, lighting = read_exr(BytesIO(in_a_thread(tasks.encode_map, service, PHOTO, query)))
    (answer,) = in_a_thread(tasks.estimate_photos, service, [Upload(PHOTO)], LightingsQuery.model_validate({}))
    assert image.shape == (32, 64, 3)
    assert lighting == answer.lighting


def test_an_answer_says_what_the_place_makes_of_its_map_where_that_is_asked_for(lit_network: Path) -> None:
    query = LightingsQuery.model_validate({"surroundings": "true"})
    service = Service(Settings(), Estimator(Model.load(lit_network)))
    for estimate in in_a_thread(tasks.estimate_photos, service, [Upload(PHOTO), Upload(PHOTO)], query):
        told = estimate_to_json(REQUEST, estimate, query)["surroundings"]
        assert (told["rows"], told["columns"]) == (24, 48)
        context = estimate.context()
        assert context is not None
        gain = surroundings_gain(estimate.lighting, context)
        assert told["factors"] == pytest.approx(gain.reshape(-1, 3), rel=5e-3)
        assert 0 < gain.min() < 1 < gain.max()


def test_a_scene_of_a_photo_has_the_light_that_the_client_changed(service: Service) -> None:
    query = PhotoSceneQuery.model_validate({"for": "mitsuba", "height": 32, "sun_azimuth": 77.5, "turbidity": 2.5})
    data, _ = in_a_thread(tasks.zip_scene_of_photo, service, PHOTO, query)
    with zipfile.ZipFile(BytesIO(data)) as archive:
        record = json.loads(archive.read(next(name for name in archive.namelist() if name.endswith(".json"))))
    lighting = record.get("lighting", record)
    assert (lighting["sun"]["azimuth"], lighting["sky"]["turbidity"]) == (77.5, 2.5)


def letterboxed(width: int) -> tuple[bytes, int, int]:
    """An example between black bars, and the height of the bars and of the photo."""
    with Image.open(EXAMPLE) as example:
        photo = example.convert("RGB").resize((width, width * 9 // 16))
    bar = width // 10
    return encode(ImageOps.expand(photo, (0, bar), "black"), quality=85), bar, photo.height


@pytest.mark.parametrize("surroundings", [False, True])
def test_an_answer_says_where_the_photo_lies_inside_a_border(service: Service, surroundings: bool) -> None:
    data, bar, height = letterboxed(1000)
    query = LightingsQuery.model_validate({"surroundings": surroundings, "match": False})
    bordered, plain = in_a_thread(tasks.estimate_photos, service, [Upload(data), Upload(PHOTO)], query)
    assert plain.photo.crop is None
    assert (crop := bordered.photo.crop) is not None
    assert (crop.left, crop.width, crop.picture_width, crop.picture_height) == (0, 1000, 1000, height + 2 * bar)
    assert (crop.top, crop.height) == pytest.approx((bar, height), abs=8)


def test_pictures_for_people_show_what_lies_inside_a_border(service: Service) -> None:
    """Those of a scene, and the photo that a browser cannot decode."""
    data, _, height = letterboxed(1000)
    query = PhotoSceneQuery.model_validate({"for": "mitsuba", "height": 32})
    archived, _ = in_a_thread(tasks.zip_scene_of_photo, service, data, query)
    with zipfile.ZipFile(BytesIO(archived)) as archive:
        (name,) = (name for name in archive.namelist() if Path(name).stem == "plate")
        plate = archive.read(name)
    for picture in (plate, in_a_thread(tasks.encode_upright_jpeg, service, data)):
        with Image.open(BytesIO(picture)) as image:
            assert image.width == 1000
            assert image.height == pytest.approx(height, abs=8)
            assert np.asarray(image.convert("L"))[[0, -1]].mean() > 40  # no bar


def test_the_light_that_the_client_states_is_that_of_the_map_and_of_the_scene(service: Service) -> None:
    stated = {"sun_irradiance": "3.9,4.3,3.4", "sky_irradiance": "0.3,0.6,1.1", "ground_color": "0.1,0.2,0.3"}
    asked = {**stated, "height": 32, "sky_exposure": 2.0, "sky_cover": 0.5}
    query = EnvmapQuery.model_validate(asked)
    _, lighting = read_exr(BytesIO(in_a_thread(tasks.encode_map, service, PHOTO, query)))
    assert lighting
    assert (lighting.sun_irradiance, lighting.sky_irradiance) == ((3.9, 4.3, 3.4), (0.3, 0.6, 1.1))
    assert (lighting.ground_color, lighting.sky_cover, lighting.exposure) == ((0.1, 0.2, 0.3), 0.5, 2.0)
    scene_query = PhotoSceneQuery.model_validate({**asked, "for": "mitsuba"})
    data, _ = in_a_thread(tasks.zip_scene_of_photo, service, PHOTO, scene_query)
    with zipfile.ZipFile(BytesIO(data)) as archive:
        record = json.loads(archive.read("lighting.json"))
    assert record["sun"]["irradiance"] == [3.9, 4.3, 3.4]
    assert record["ground"]["color"] == [0.1, 0.2, 0.3]


def test_the_camera_that_the_client_states_is_that_of_the_map_and_of_the_scene(service: Service) -> None:
    asked = {"height": 32, "camera_elevation": -12.5, "camera_roll": 3.25, "camera_vertical_fov": 33.0}
    data = in_a_thread(tasks.encode_map, service, PHOTO, EnvmapQuery.model_validate({"height": 32}))
    _, before = read_exr(BytesIO(data))
    data = in_a_thread(tasks.encode_map, service, PHOTO, EnvmapQuery.model_validate(asked))
    _, lighting = read_exr(BytesIO(data))
    assert before
    assert lighting == replace(before, camera_elevation=-12.5, camera_roll=3.25, vertical_fov=33.0)
    scene_query = PhotoSceneQuery.model_validate({**asked, "for": "mitsuba"})
    data, _ = in_a_thread(tasks.zip_scene_of_photo, service, PHOTO, scene_query)
    with zipfile.ZipFile(BytesIO(data)) as archive:
        camera = json.loads(archive.read("lighting.json"))["camera"]
    assert (camera["elevation"], camera["roll"], camera["vertical_fov"]) == (-12.5, 3.25, 33.0)


def test_a_photo_is_as_bright_as_it_is_at_the_exposure_that_is_said_of_it(lit_network: Path) -> None:
    service = Service(Settings(), Estimator(Model.load(lit_network)))
    power = {"sun_irradiance": "3.9,4.3,3.4", "sky_irradiance": "0.3,0.6,1.1", "ground_color": "0.1,0.2,0.3"}

    def maps(**exposures: float) -> Any:
        query = EnvmapQuery.model_validate({**power, "height": 32, "surroundings": "true", **exposures})
        return read_exr(BytesIO(in_a_thread(tasks.encode_map, service, PHOTO, query)))[0]

    np.testing.assert_allclose(maps(exposure=2.0, photo_exposure=2.0), maps(), rtol=1e-3)
    assert not np.allclose(maps(exposure=2.0), maps(), rtol=0.1)


def test_a_photo_becomes_a_preview(service: Service) -> None:
    data = in_a_thread(tasks.encode_preview, service, PHOTO, PreviewQuery.model_validate({}))
    with Image.open(BytesIO(data)) as drawn:
        assert drawn.format == "PNG"


def test_a_sky_alone_becomes_a_scene_with_a_grey_plate() -> None:
    query = SkySceneQuery.model_validate({**SKY, "for": "usd", "plate_width": 64, "plate_height": 48, "height": 16})
    data, _ = in_a_thread(tasks.zip_scene_of_sky, query)
    with zipfile.ZipFile(BytesIO(data)) as archive:
        plate = Image.open(archive.open("plate.png"))
        assert plate.size == (64, 48)
        assert np.unique(np.asarray(plate)).tolist() == [tasks.MID_GRAY]

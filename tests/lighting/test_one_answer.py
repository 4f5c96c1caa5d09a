"""One photo has one answer to the last bit, whichever command, function or process gives it."""

import json
import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

import lighting
import lighting.envmap.detail_library as detail_library
import lighting.envmap.library_picture as library_picture
from lighting.batch.job import BatchJob, MapOutput, estimate_or_error, load_worker_estimator
from lighting.estimator import Estimator, render_lighting
from lighting.files.exr import read_exr_attributes
from lighting.map_options import MapOptions
from lighting.model import Model, preprocess
from lighting.photo.reader import read_photo
from lighting.records import Lighting
from server.app import create_app
from server.settings import Settings
from tests.helpers.processes import invoke_command, run_command

EXAMPLES = Path(__file__).parents[2] / "examples"
PHOTOS = [EXAMPLES / "wide_street.jpg", EXAMPLES / "snow_field.jpg"]
HEIGHT = "64"


def plain(record: dict[str, Any]) -> dict[str, Any]:
    """A record without the sky's coefficients, which follow from the rest."""
    return Lighting.from_dict(record).to_dict()


def test_a_network_for_one_run_and_one_for_many_give_the_same_bits_on_any_number_of_threads() -> None:
    loaded = [Model.load(threads=threads, for_one_photo=one) for threads, one in ((1, False), (1, True), (3, True))]
    for path in PHOTOS:
        tensor = preprocess(read_photo(path), loaded[0].spec)
        outputs = [model.session.run(list(model.outputs), {"photo": tensor}) for model in loaded]
        for other in outputs[1:]:
            for actual, expected in zip(other, outputs[0], strict=True):
                np.testing.assert_array_equal(actual, expected)


@pytest.mark.slow
def test_every_door_gives_one_record_and_one_map(tmp_path: Path) -> None:
    estimator = Estimator(Model.load(threads=1))
    estimates = [estimator(read_photo(path)) for path in PHOTOS]
    records = [estimate.lighting.to_dict() for estimate in estimates]
    assert lighting.estimate(PHOTOS[0]).lighting.to_dict() == records[0]

    # Commands: of one photo, of several, a scene, of a folder by two processes; they choose the threads of products.
    variables = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    alone = run_command("estimate", PHOTOS[1], "--json", env=variables).stdout
    map_options = ("-o", tmp_path / "a.exr", "--height", HEIGHT)
    assert run_command("envmap", PHOTOS[0], *map_options, env=variables).returncode == 0
    several = run_command("estimate", *PHOTOS, "--json", env=variables).stdout
    scene_options = ("--for", "blender", "-o", tmp_path / "scene", "--height", HEIGHT)
    assert run_command("scene", PHOTOS[0], *scene_options, env=variables).returncode == 0
    folder = tmp_path / "photos"
    folder.mkdir()
    for path in PHOTOS:
        shutil.copy(path, folder)
    options = ("--workers", "2", "--envmap", "--height", HEIGHT, "-q")
    assert run_command("batch", folder, tmp_path / "out", *options, env=variables).returncode == 0
    batch = [json.loads(line) for line in (tmp_path / "out" / "lighting.jsonl").read_bytes().splitlines()]
    (mapped,) = (tmp_path / "out").rglob("wide_street*.exr")

    assert plain(json.loads(alone)["lighting"]) == records[1]
    assert plain(json.loads(read_exr_attributes(tmp_path / "a.exr")["lighting.json"])) == records[0]
    assert [plain(json.loads(line)["lighting"]) for line in several.splitlines()] == records
    by_name = {line["file"]: plain(line["lighting"]) for line in batch}
    assert by_name == {path.name: record for path, record in zip(PHOTOS, records, strict=True)}

    # The service.
    with TestClient(create_app(Settings(), Estimator(Model.load(threads=2)))) as client:
        files = [{"photo": (path.name, path.read_bytes(), "image/jpeg")} for path in PHOTOS]
        told = [client.post("/v1/lighting", files=file).json() for file in files]
        served = client.post("/v1/envmap", params={"height": HEIGHT}, files=files[0])
    assert [plain(record) for record in told] == records
    (tmp_path / "served.exr").write_bytes(served.content)
    estimates[0].save(tmp_path / "python.exr", int(HEIGHT))
    for file in (tmp_path / "a.exr", mapped, tmp_path / "served.exr"):
        assert file.read_bytes() == (tmp_path / "python.exr").read_bytes(), file
    estimates[0].scene("blender", tmp_path / "python", height=int(HEIGHT))
    maps = [tmp_path / folder / "environment.exr" for folder in ("scene", "python")]
    assert maps[0].read_bytes() == maps[1].read_bytes()


EXAMPLE_NAMES = ("wide_street", "snow_field", "brick_street", "lake_clouds", "beach_storm", "garden_noon")


@pytest.mark.slow
@pytest.mark.thorough
@pytest.mark.parametrize("name", EXAMPLE_NAMES)
def test_every_door_shows_the_same_place(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Map, preview and scene of a command, a batch, the service and Python take their detail from one place."""
    photo, chosen = EXAMPLES / f"{name}.jpg", list[object]()
    make = library_picture.LibraryDetail

    def watch(choice: detail_library.DetailChoice, height: int) -> library_picture.LibraryDetail:
        chosen.append(choice)
        return make(choice, height)

    monkeypatch.setattr(library_picture, "LibraryDetail", watch)
    answer = lighting.estimate(photo)
    answer.envmap(64)
    answer.envmap(1024)
    answer.preview()
    answer.make_scene(MapOptions(64))
    render_lighting(answer.lighting, 64, photo=photo)
    for arguments in (
        ("envmap", photo, "-o", tmp_path / "a.exr", "--height", "1024", "--preview", tmp_path / "a.png"),
        ("preview", photo, "-o", tmp_path / "b.png", "--sun", "40,25"),
        ("scene", photo, "--for", "gltf", "-o", tmp_path / "scene", "--height", "64"),
    ):
        assert invoke_command(*arguments).exit_code == 0
    job = BatchJob(str(EXAMPLES), str(tmp_path), maps=MapOutput(MapOptions(64)))
    estimate_or_error(load_worker_estimator(job), photo, job)
    with TestClient(create_app(Settings(), Estimator(Model.load(threads=1)))) as client:
        for route, query in (("envmap", {"height": "64"}), ("preview", {}), ("scene", {"for": "gltf", "height": "64"})):
            files = {"photo": (photo.name, photo.read_bytes(), "image/jpeg")}
            assert client.post(f"/v1/{route}", params=query, files=files).status_code == 200
    assert len(chosen) == 13
    assert all(choice == chosen[0] for choice in chosen)

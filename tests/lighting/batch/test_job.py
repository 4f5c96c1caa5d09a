"""Tests of job."""

import json
from collections import Counter
from pathlib import Path

import pytest

from lighting.batch.job import (
    BatchJob,
    MapOutput,
    PhotoLight,
    Summary,
    check_settings,
    estimate_or_error,
    job_settings,
    load_worker_estimator,
)
from lighting.batch.photo_search import format_counts
from lighting.errors import BatchError, ModelError
from lighting.files import FileOptions
from lighting.fusion.user_input import NO_USER_INPUT, UserInput
from lighting.map_options import Adjustments, MapOptions
from lighting.photo.reader import read_photo
from tests.conftest import encode, scene


def test_settings_name_all_that_decides_about_the_results(network: Path, tmp_path: Path) -> None:
    job = BatchJob(
        str(tmp_path), "out", str(network), MapOutput(MapOptions(64)), user_input=UserInput(vertical_fov=40.0)
    )
    found = job_settings(job)
    assert found["maps"] == {
        "view": {
            "height": 64,
            "sun": None,
            "yaw": 0.0,
            "sky": None,
            "around": None,
            "backdrop": None,
            "disc": True,
            "adjustments": {"sun": None, "exposure": 0.0, "haze": None, "overcast": False, "pick": None},
        },
        "file": {"format": "exr", "compression": "zip", "colors": "rec709"},
    }
    assert found["metadata"] == {"vertical_fov": 40.0}
    assert found["network"] == network.name
    assert len(str(found["sha256"])) == 64
    json.dumps(found)


def test_where_results_go_does_not_decide_about_them(network: Path, tmp_path: Path) -> None:
    here, there = (job_settings(BatchJob(str(tmp_path), out, str(network))) for out in ("here", "there"))
    assert here == there
    with pytest.raises(ModelError, match="There is no network at"):
        job_settings(BatchJob(str(tmp_path), "out", str(tmp_path / "none.onnx")))


@pytest.mark.parametrize(
    ("found", "words"),
    [
        (None, "holds results, but no batch.json"),
        (b'{"maps": 1, "source": "a"}', r"other settings \(maps\);"),
        (b'{"maps": 1, "source": "b"}', r"other settings \(maps, source\);"),
        (b"[1]", r"other settings \(source\);"),
    ],
)
def test_other_settings_are_named(found: bytes | None, words: str) -> None:
    with pytest.raises(BatchError, match=words):
        check_settings(found, {"maps": None, "source": "a"}, True, "out")


def test_the_same_settings_or_no_results_allow_a_batch() -> None:
    check_settings(None, {"maps": None}, False, "out")
    check_settings(b'{"maps": 1}', {"maps": None}, False, "out")
    check_settings(b'{"maps": null, "added": 1}', {"maps": None}, True, "out")


def test_a_photo_has_its_light_or_a_reason(network: Path, tmp_path: Path) -> None:
    job = BatchJob(str(tmp_path), "out", str(network), user_input=UserInput(vertical_fov=40.0))
    estimator = load_worker_estimator(job)
    answer = estimate_or_error(estimator, encode(scene(64, 48)), job)
    assert isinstance(answer, PhotoLight)
    assert answer.lighting.vertical_fov == 40.0
    assert answer.rendered is None
    assert str(estimate_or_error(estimator, b"no photo", job)).startswith("This is a text")


def test_the_same_adjustments_go_on_with_a_batch(network: Path, tmp_path: Path) -> None:
    job = BatchJob(str(tmp_path), "out", str(network), MapOutput(MapOptions(16, adjustments=Adjustments(sun=(40, 25)))))
    settings = job_settings(job)
    check_settings(json.dumps(settings).encode(), settings, True, "out")
    assert settings["maps"]["view"]["adjustments"]["sun"] == [40, 25]  # type: ignore[index]


@pytest.mark.parametrize(
    "view", [MapOptions(32), MapOptions(32, around="plain", adjustments=Adjustments(sun=(40.0, 25.0), exposure=1.0))]
)
def test_a_map_is_that_of_the_estimate(tmp_path: Path, view: MapOptions) -> None:
    photo = tmp_path / "photo.jpg"
    photo.write_bytes(encode(scene(320, 240)))
    job = BatchJob(str(tmp_path), "out", maps=MapOutput(view, FileOptions("hdr")))
    estimator = load_worker_estimator(job)
    answer = estimate_or_error(estimator, photo, job)
    assert isinstance(answer, PhotoLight)
    assert answer.rendered
    expected = estimator(read_photo(photo), NO_USER_INPUT).render(view)
    assert answer.rendered.encode(FileOptions("hdr")) == expected.encode(FileOptions("hdr"))
    assert answer.rendered.lighting == expected.lighting
    assert job.maps
    assert job.maps.file_name("a/photo.jpg") == "a/photo.jpg.hdr"


@pytest.mark.parametrize(
    ("summary", "words"),
    [
        (Summary(10, 0, 0, 2.0), "10 done, 0 failed, 0 skipped; 5.0 photos a second."),
        (
            Summary(8, 2, 6, 0.5, Counter({".gif": 2, ".jxl": 1})),
            "8 done, 2 failed, 3 skipped (2 .gif, 1 .jxl); 6 by an earlier run, 8.0 photos a second.",
        ),
        (Summary(0, 0, 0, 0.0), "0 done, 0 failed, 0 skipped; 0.0 photos a second."),
    ],
)
def test_it_tells_what_became_of_the_photos(summary: Summary, words: str) -> None:
    assert str(summary) == words


def test_the_most_frequent_kind_comes_first() -> None:
    assert format_counts(Counter({".bmp": 1, ".gif": 3})) == " (3 .gif, 1 .bmp)"
    assert format_counts(Counter({".jxl": 1, ".bmp": 1})) == " (1 .bmp, 1 .jxl)"
    assert format_counts(Counter()) == ""

"""The settings of a batch, and which results it may resume."""

import json
from pathlib import Path

import pytest

from lighting.batch import Job, Maps
from lighting.batch.job import PhotoLight, check_settings, light_or_reason, load_estimator, settings, write_map
from lighting.envmap import place_of, view
from lighting.errors import BatchError, ModelError
from lighting.files import read_exr
from lighting.photo import read_photo
from tests.conftest import encode, scene


def test_settings_name_all_that_decides_about_the_results(network: Path, tmp_path: Path) -> None:
    job = Job(str(tmp_path), "out", str(network), Maps(64), given={"vertical_fov": 40.0})
    found = settings(job)
    assert found["maps"] == {
        "height": 64,
        "sun": None,
        "yaw": 0.0,
        "sky": None,
        "compression": "zip",
        "surroundings": None,
    }
    assert found["metadata"] == {"vertical_fov": 40.0}
    assert found["network"] == network.name
    assert len(str(found["sha256"])) == 64
    json.dumps(found)


def test_where_results_go_does_not_decide_about_them(network: Path, tmp_path: Path) -> None:
    here, there = (settings(Job(str(tmp_path), out, str(network))) for out in ("here", "there"))
    assert here == there
    with pytest.raises(ModelError, match="There is no network at"):
        settings(Job(str(tmp_path), "out", str(tmp_path / "none.onnx")))


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
    estimator, given = load_estimator(Job(str(tmp_path), "out", str(network), given={"vertical_fov": 40.0}))
    answer = light_or_reason(estimator, encode(scene(64, 48)), given, None)
    assert isinstance(answer, PhotoLight)
    assert answer.lighting.vertical_fov == 40.0
    assert answer.place is None
    assert str(light_or_reason(estimator, b"no photo", given, None)).startswith("The file is not a JPEG")


@pytest.mark.parametrize("wanted", [None, True, False])
def test_a_map_shows_the_place_as_envmap_does(tmp_path: Path, wanted: bool | None) -> None:
    photo = tmp_path / "photo.jpg"
    photo.write_bytes(encode(scene(320, 240)))
    estimator, given = load_estimator(Job(str(tmp_path), "out"))
    maps = Maps(32, surroundings=wanted)
    answer = light_or_reason(estimator, photo, given, maps)
    assert isinstance(answer, PhotoLight)
    write_map(tmp_path / "map.exr", answer, maps)
    picture = read_photo(photo)
    place = place_of(estimator(picture, given), picture.pixels, 32, picture.pixels.repeat, wanted=wanted)
    assert (place is None) == (wanted is False)  # the packaged network predicts what lies around
    expected, _ = view(answer.lighting, 32, place=place)
    found, _ = read_exr(tmp_path / "map.exr")
    assert found == pytest.approx(expected, rel=1e-3, abs=1e-6)

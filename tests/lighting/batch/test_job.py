"""Tests of job."""

import json
import os
from collections import Counter
from pathlib import Path

import pytest

from lighting.batch.job import (
    BatchJob,
    MapOptions,
    PhotoLight,
    Summary,
    _format_suffixes,
    check_settings,
    count_unread_pictures,
    estimate_or_error,
    find_photos,
    job_settings,
    load_worker_estimator,
    write_photo_map,
)
from lighting.envmap.surroundings import photo_context_for_height, render_view
from lighting.errors import BatchError, ModelError
from lighting.files.exr import read_exr
from lighting.fusion.user_input import NO_USER_INPUT, UserInput
from lighting.photo.reader import read_photo
from tests.conftest import encode, scene


def test_settings_name_all_that_decides_about_the_results(network: Path, tmp_path: Path) -> None:
    job = BatchJob(str(tmp_path), "out", str(network), MapOptions(64), user_input=UserInput(vertical_fov=40.0))
    found = job_settings(job)
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
    assert answer.context is None
    assert str(estimate_or_error(estimator, b"no photo", job)).startswith("The file is not a JPEG")


@pytest.mark.parametrize("wanted", [None, True, False])
def test_a_map_shows_the_place_as_envmap_does(tmp_path: Path, wanted: bool | None) -> None:
    photo = tmp_path / "photo.jpg"
    photo.write_bytes(encode(scene(320, 240)))
    maps = MapOptions(32, surroundings=wanted)
    job = BatchJob(str(tmp_path), "out", maps=maps)
    estimator = load_worker_estimator(job)
    answer = estimate_or_error(estimator, photo, job)
    assert isinstance(answer, PhotoLight)
    write_photo_map(tmp_path / "map.exr", answer, maps)
    picture = read_photo(photo)
    place = photo_context_for_height(
        estimator(picture, NO_USER_INPUT), picture.pixels, 32, picture.pixels.repeat, surroundings=wanted
    )
    assert (place is None) == (wanted is False)  # the packaged network predicts what lies around
    expected, _ = render_view(answer.lighting, 32, context=place)
    found, _ = read_exr(tmp_path / "map.exr")
    assert found == pytest.approx(expected, rel=1e-3, abs=1e-6)


def test_photos_of_a_folder_at_any_depth(photos: Path) -> None:
    expected = ["a.jpg", "b.PNG", "bad.jpg", "below/a.jpg", "ä b.webp"]
    assert find_photos(str(photos)) == (str(photos), expected)


@pytest.mark.parametrize(
    ("pattern", "names"),
    [
        ("*.jpg", ["a.jpg", "bad.jpg"]),
        ("**/*.jpg", ["a.jpg", "bad.jpg", "below/a.jpg"]),
        ("b*/a.jpg", ["below/a.jpg"]),
        ("notes.*", ["notes.txt"]),
        ("a.jpg", ["a.jpg"]),
    ],
)
def test_photos_of_a_glob_are_named_from_its_fixed_part(photos: Path, pattern: str, names: list[str]) -> None:
    assert find_photos(f"{photos}/{pattern}") == (str(photos), names)


def test_a_glob_may_be_relative(photos: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(photos.parent)
    assert find_photos("photos/below/*") == (str(Path("photos/below")), ["a.jpg"])
    monkeypatch.chdir(photos)
    assert find_photos("a.*") == (".", ["a.jpg"])


def test_a_glob_of_any_depth_follows_no_link_to_a_folder(photos: Path) -> None:
    for name in ("up", "round"):
        (photos / "below" / name).symlink_to(photos)  # each way round would be another photo
    assert find_photos(f"{photos}/**/*.jpg")[1] == ["a.jpg", "bad.jpg", "below/a.jpg"]
    assert find_photos(f"{photos}/below/up/a.*")[1] == ["a.jpg"]


def test_hidden_photos_match_where_the_glob_names_a_dot(photos: Path) -> None:
    (photos / ".thumbs").mkdir()
    for name in (".thumbs/a.jpg", "below/.b.jpg"):
        (photos / name).touch()
    assert find_photos(f"{photos}/**/a.jpg")[1] == ["a.jpg", "below/a.jpg"]
    assert find_photos(f"{photos}/*/.b.jpg")[1] == ["below/.b.jpg"]
    assert find_photos(f"{photos}/.thumbs/*")[1] == ["a.jpg"]


def test_two_stars_within_a_name_are_no_pattern(photos: Path) -> None:
    with pytest.raises(BatchError, match=r"a\*\*\.jpg is no pattern: "):
        find_photos(f"{photos}/a**.jpg")


def test_pictures_that_are_not_read_are_counted_by_kind(photos: Path) -> None:
    for name in ("a.gif", "below/b.GIF", "c.jxl", ".d.gif", "e.dng", "f.tif", "g.avif", "h.heics", "i.SRW"):
        (photos / name).touch()
    assert count_unread_pictures(str(photos)) == {".gif": 2, ".jxl": 1, ".heics": 1, ".srw": 1}
    assert count_unread_pictures(f"{photos}/*") == {}
    assert {"e.dng", "f.tif", "g.avif"} < set(find_photos(str(photos))[1])


def test_maps_beside_their_photos_are_not_told_as_skipped(tmp_path: Path) -> None:
    for name in ("a.JPG", "a.JPG.exr", "sky.exr"):
        (tmp_path / name).touch()
    assert count_unread_pictures(str(tmp_path)) == {".exr": 1}


def test_photos_have_less_common_names_too(tmp_path: Path) -> None:
    names = [f"a.{suffix}" for suffix in ("hif", "jfif", "jpe", "mpo", "nrw", "rwl", "x3f")]
    for name in names:
        (tmp_path / name).touch()
    assert find_photos(str(tmp_path))[1] == names


def test_a_folder_of_nothing_else_names_them(tmp_path: Path) -> None:
    (tmp_path / "a.gif").touch()
    with pytest.raises(BatchError, match=r"of kinds that are not read \(1 \.gif\)\.$"):
        find_photos(str(tmp_path))


def test_a_pipe_is_no_photo_and_a_broken_link_is_left_to_the_reading(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.jpg")
    (tmp_path / "broken.jpg").symlink_to(tmp_path / "absent.jpg")
    assert find_photos(str(tmp_path)) == (str(tmp_path), ["broken.jpg"])


def test_an_empty_name_is_not_the_current_folder(photos: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(photos)
    with pytest.raises(BatchError, match="The input is empty"):
        find_photos("")


@pytest.mark.parametrize("pattern", ["nothing", "photos/*.tif", "photos/.trash/none"])
def test_no_photo_at_all_is_an_error(photos: Path, pattern: str) -> None:
    with pytest.raises(BatchError, match="neither a folder with photos"):
        find_photos(str(photos.parent / pattern))


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
    assert _format_suffixes(Counter({".bmp": 1, ".gif": 3})) == " (3 .gif, 1 .bmp)"
    assert _format_suffixes(Counter({".jxl": 1, ".bmp": 1})) == " (1 .bmp, 1 .jxl)"
    assert _format_suffixes(Counter()) == ""

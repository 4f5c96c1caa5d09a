"""Which photos a folder or a glob stands for."""

import os
from pathlib import Path

import pytest

from lighting.batch import find_photos, other_pictures
from lighting.errors import BatchError


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
    assert other_pictures(str(photos)) == {".gif": 2, ".jxl": 1, ".heics": 1, ".srw": 1}
    assert other_pictures(f"{photos}/*") == {}
    assert {"e.dng", "f.tif", "g.avif"} < set(find_photos(str(photos))[1])


def test_maps_beside_their_photos_are_not_told_as_skipped(tmp_path: Path) -> None:
    for name in ("a.JPG", "a.JPG.exr", "sky.exr"):
        (tmp_path / name).touch()
    assert other_pictures(str(tmp_path)) == {".exr": 1}


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

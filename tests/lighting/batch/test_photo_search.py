"""Which photos of a folder or a pattern are taken, which are passed over, and what a table states of them."""

import json
import os
from pathlib import Path

import pytest

from lighting.batch.job import BatchJob, job_settings
from lighting.batch.photo_search import (
    IN_CACHES,
    PhotoInput,
    PhotoTable,
    check_photo_names,
    count_skipped,
    find_photos,
    read_photo_table,
)
from lighting.errors import BatchError
from lighting.estimator import Estimator
from lighting.fusion.marks import OwnShadow, Shadow
from lighting.fusion.user_input import UserInput
from lighting.model import Model
from lighting.photo.reader import read_photo
from tests.conftest import encode, scene
from tests.helpers.processes import invoke_command


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


def test_what_exists_as_it_is_written_is_no_pattern(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Folders of albums begin with a year in brackets; the letters in them never stand for another folder."""
    monkeypatch.chdir(tmp_path)
    for name in ("[2024] trip/1.jpg", "2 trip/2.jpg", "set [a-c]/x/3.jpg", "set a/x/4.jpg", "trip (1)/5.jpg"):
        (tmp_path / "albums" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "albums" / name).touch()
    (tmp_path / "albums" / "set a" / "photo[1].jpg").touch()
    (tmp_path / "albums" / "set a" / "photo1.jpg").touch()
    assert find_photos("albums/[2024] trip/*.jpg") == (str(Path("albums/[2024] trip")), ["1.jpg"])
    assert find_photos("albums/[12] trip/*.jpg") == ("albums", ["2 trip/2.jpg"])
    assert find_photos("albums/set [a-c]/**/*.jpg") == (str(Path("albums/set [a-c]")), ["x/3.jpg"])
    assert find_photos("albums/set [ab]/x/*.jpg") == ("albums", ["set a/x/4.jpg"])
    assert find_photos("albums/trip (1)/*.jpg")[1] == ["5.jpg"]
    assert find_photos("**/[2024] trip/*.jpg") == (".", ["albums/[2024] trip/1.jpg"])
    assert find_photos("*/set [a-c]/*/*") == (".", ["albums/set [a-c]/x/3.jpg"])
    assert find_photos("albums/set a/photo[1].jpg")[1] == ["photo[1].jpg"]
    assert find_photos("albums/set a/photo[1].*")[1] == ["photo[1].jpg"]
    assert find_photos("albums/set a/photo[12].*")[1] == ["photo1.jpg"]
    assert find_photos("albums/[2024]*/*.jpg")[1] == ["[2024] trip/1.jpg"]
    assert find_photos(f"{tmp_path}/albums/[2024] trip/1.jpg") == (str(tmp_path / "albums" / "[2024] trip"), ["1.jpg"])


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
    assert count_skipped(str(photos)) == {".gif": 2, ".jxl": 1, ".heics": 1, ".srw": 1}
    assert count_skipped(f"{photos}/*") == {}
    assert {"e.dng", "f.tif", "g.avif"} < set(find_photos(str(photos))[1])


def test_maps_beside_their_photos_are_not_told_as_skipped(tmp_path: Path) -> None:
    for name in ("a.JPG", "a.JPG.exr", "sky.exr"):
        (tmp_path / name).touch()
    assert count_skipped(str(tmp_path)) == {".exr": 1}


def test_a_preview_beside_its_photo_is_no_photo(photos: Path) -> None:
    (photos / "a-preview.png").touch()
    assert "a-preview.png" not in find_photos(str(photos))[1]
    assert count_skipped(str(photos)) == {"named as previews": 1}
    assert find_photos(f"{photos}/*-preview.png")[1] == ["a-preview.png"]


def test_photos_have_less_common_names_too(tmp_path: Path) -> None:
    names = [f"a.{suffix}" for suffix in ("hif", "jfif", "jpe", "mpo", "nrw", "rwl", "x3f")]
    for name in names:
        (tmp_path / name).touch()
    assert find_photos(str(tmp_path))[1] == names


def test_a_folder_of_nothing_else_names_them(tmp_path: Path) -> None:
    (tmp_path / "a.gif").touch()
    with pytest.raises(BatchError, match=r"what it holds is not taken \(1 \.gif\)\.$"):
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


CACHED = [
    "@eaDir/a.jpg/SYNOPHOTO_THUMB_M.jpg",
    "below/#recycle/a.jpg",
    "@Recycle/a.jpg",
    "$RECYCLE.BIN/S-1-5-21/$R1.JPG",
    "Photos Library.photoslibrary/resources/derivatives/a.jpeg",
    "Photos Library.photoslibrary/resources/renders/0/a.jpeg",
    "Photos Library.photoslibrary/scopes/cloudsharing/a.jpg",
    "Old.photolibrary/Thumbnails/2010/a.jpg",
    "resources/derivatives/masters/a.jpeg",
    "Catalog Smart Previews.lrdata/0/a.dng",
    "Thumbnails/a.jpg",
    "CaptureOne/Cache/Thumbnails/a.jpg",
    "_thumbs/a.jpg",
    "iPod Photo Cache/a.png",
    "appdata_oc1/preview/a.jpg",
    "lost+found/a.jpg",
    "files_trashbin/files/a.jpg",
    "System Volume Information/a.jpg",
    "Papierkorb/a.jpg",
    "__MACOSX/a.jpg",
    "TRASH/a.gif",
    "Recently Deleted/a.heic",
    "Recycle.Bin/a.jpg",
    "@sharesnap/a.jpg",
    "Корзина/a.jpg",
    "回收站/a.jpg",
    "ImageCache/a.png",
    "_vti_cnf/a.jpg",
    "MISC/THM/100/a.jpg",
]
TAKEN = [
    "Photos Library.photoslibrary/originals/0/a.heic",
    "Old.photolibrary/Masters/2010/a.jpg",
    "geocache/a.jpg",
    "thumbnailed.jpg",
    "cache.jpg",
    "resources/a.jpg",
    "derivatives/a.jpg",
]


def touch(folder: Path, names: list[str]) -> Path:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()
    return folder


@pytest.mark.parametrize("name", CACHED)
def test_what_stands_in_caches_is_counted_and_not_taken(tmp_path: Path, name: str) -> None:
    folder = str(touch(tmp_path, [name, "photo.jpg"]))
    assert find_photos(folder)[1] == ["photo.jpg"]
    assert count_skipped(folder) == {IN_CACHES: 1}
    assert find_photos(f"{folder}/**/*")[1] == ["photo.jpg"]
    assert count_skipped(f"{folder}/**/*") == {IN_CACHES: 1}


def test_what_stands_elsewhere_is_taken(tmp_path: Path) -> None:
    assert find_photos(str(touch(tmp_path, TAKEN)))[1] == sorted(TAKEN)
    assert count_skipped(str(tmp_path)) == {}


def test_a_cache_that_is_named_is_taken(tmp_path: Path) -> None:
    touch(tmp_path, ["@eaDir/a.jpg/SYNOPHOTO_THUMB_M.jpg", "Cache/b.jpg"])
    assert find_photos(str(tmp_path / "@eaDir"))[1] == ["a.jpg/SYNOPHOTO_THUMB_M.jpg"]
    assert find_photos(f"{tmp_path}/Cache/*.jpg")[1] == ["b.jpg"]


def test_other_cameras_files_and_clips_are_counted(tmp_path: Path) -> None:
    names = [
        "a.insp",
        "b.jps",
        "c.gpr",
        "d.MP4",
        "e.mov",
        "f.lrv",
        "photo.jpg",
        "photo.xmp",
        "photo.jpg.json",
        "Thumbs.db",
    ]
    folder = str(touch(tmp_path, names))
    assert find_photos(folder)[1] == ["photo.jpg"]
    assert count_skipped(folder) == {".insp": 1, ".jps": 1, ".gpr": 1, ".mp4": 1, ".mov": 1, ".lrv": 1}


def test_what_a_batch_writes_is_neither_taken_nor_counted(tmp_path: Path) -> None:
    names = ["a.jpg", "a.jpg.exr", "lighting.jsonl", "batch.json", "lighting.parquet", "out/a.jpg.exr"]
    folder = str(touch(tmp_path, names))
    for pattern in (folder, f"{folder}/*", f"{folder}/**/*"):
        assert find_photos(pattern)[1] == ["a.jpg"]
        assert count_skipped(pattern) == {}


def write(folder: Path, *lines: str) -> str:
    path = folder / "known.csv"
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8-sig")
    return str(path)


def test_a_row_has_the_inputs_of_the_command_line(tmp_path: Path) -> None:
    path = write(
        tmp_path,
        "file,shadow,Lat,lon,time,fov,pick,horizon,vertical,reference",
        'a.jpg,"10,40,30,20;own:5,6",48.1,11.6,2024-06-01T14:30+02:00,50,2,"0,30,60,31","5,5,5,40;50,5,50,40","1,2,3,40,2"',
        "sub/b.jpg",
        "",
    )
    table = read_photo_table(path)
    row = table.rows["a.jpg"]
    assert row.user_input.shadows == (Shadow((10.0, 40.0), (30.0, 20.0)), OwnShadow((5.0, 6.0)))
    assert (row.user_input.latitude, row.user_input.vertical_fov, row.pick) == (48.1, 50.0, 2)
    assert len(row.user_input.verticals) == 2
    assert table.rows["sub/b.jpg"] == PhotoInput()
    assert row.over(UserInput(vertical_fov=40.0, keep_location=True)).keep_location
    assert row.over(UserInput(vertical_fov=40.0)).vertical_fov == 50.0


@pytest.mark.parametrize(
    ("lines", "sentence"),
    [
        ((), "needs one column 'file'"),
        (("shadow", "1,2"), "needs one column 'file'"),
        (("file,file", "a,b"), "needs one column 'file'"),
        (("file,colour", "a,red"), "has a column 'colour'"),
        (("file,pick", ",2"), "line 2: a row has"),
        (("file", "a", "a"), "line 3: a row has"),
        (("file", "a,2"), "line 2: a row has"),
        (("file,pick", "a,4"), r"line 2: --pick is '4'"),
        (("file,latitude", "a,north"), "line 2: could not convert"),
        (("file,latitude", "a,48"), "line 2: .*longitude"),
        (("file,shadow", 'a,"1,2"'), "line 2: .*is no shadow"),
        (("file,camera", "a,absent.fspy"), "line 2: .*No such file"),
    ],
)
def test_a_table_that_is_none_is_refused(tmp_path: Path, lines: tuple[str, ...], sentence: str) -> None:
    with pytest.raises(BatchError, match=sentence):
        read_photo_table(write(tmp_path, *lines))


def test_a_row_about_no_photo_is_refused() -> None:
    table = PhotoTable({"a.jpg": PhotoInput()}, "")
    check_photo_names(table, ["a.jpg", "b.jpg"])
    with pytest.raises(BatchError, match=r"row about a\.jpg"):
        check_photo_names(table, ["b.jpg"])


def test_the_table_is_part_of_the_settings(network: Path, tmp_path: Path) -> None:
    table = read_photo_table(write(tmp_path, "file", "a"))
    assert job_settings(BatchJob(".", "out", str(network), table=table))["table"] == table.sha256
    assert job_settings(BatchJob(".", "out", str(network)))["table"] is None


def test_each_photo_of_a_batch_has_its_own_row(network: Path, tmp_path: Path) -> None:
    photos = tmp_path / "photos"
    photos.mkdir()
    for name in ("a.jpg", "b.jpg", "c.jpg"):
        (photos / name).write_bytes(encode(scene(120, 90)))
    estimator = Estimator(Model.load(network))
    photo = read_photo(photos / "a.jpg")
    suns = estimator(photo).lighting.sun_candidates
    path = write(tmp_path, "file,horizon,pick", 'a.jpg,"0,40,119,44",', "b.jpg,,2")
    result = invoke_command(
        "batch", photos, tmp_path / "out", "--table", path, "--model", network, "--workers", 1, "-q"
    )
    assert result.exit_code == 0, result.stderr
    lines = map(json.loads, (tmp_path / "out" / "lighting.jsonl").read_text().splitlines())
    found = {line["file"]: line["lighting"] for line in lines}
    drawn = estimator(photo, UserInput(horizon="0,40,119,44")).lighting
    assert found["a.jpg"]["camera"]["roll"] == drawn.camera_roll
    assert found["a.jpg"]["evidence"] == ["pixels", "drawn camera"]
    assert found["b.jpg"]["sun"]["azimuth"] == suns[1].azimuth
    assert found["c.jpg"]["sun"]["azimuth"] == suns[0].azimuth

"""Tables of what a person knows of single photos of a batch."""

import json
from pathlib import Path

import pytest

from lighting.batch.job import BatchJob, job_settings
from lighting.batch.photo_table import PhotoInput, PhotoTable, check_photo_names, read_photo_table
from lighting.errors import BatchError
from lighting.estimator import Estimator
from lighting.fusion.shadows import OwnShadow, Shadow
from lighting.fusion.user_input import UserInput
from lighting.model import Model
from lighting.photo.reader import read_photo
from tests.conftest import encode, scene
from tests.helpers.processes import invoke_command


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

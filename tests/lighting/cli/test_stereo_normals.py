"""`lighting stereo normals`: what it refuses; its results are in stereo/normals/test_job.py."""

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from lighting.files import write_exr
from tests.lighting.cli.runners import error_of, run
from tests.lighting.stereo.normals.test_day import jpeg, scene


@pytest.fixture
def day(tmp_path: Path) -> Path:
    folder = tmp_path / "day"
    folder.mkdir()
    for hour in range(3):
        jpeg(folder / f"{hour}.jpg", scene(), datetime(2024, 6, 21, 10) + timedelta(hours=hour))
    return folder


PLACE = ("--lat", "47", "--lon", "8", "--heading", "0", "--utc-offset", "2")


@pytest.mark.parametrize("option", ["--heading", "--pitch", "--roll", "--noise", "--turbidity", "--lat", "--lon"])
@pytest.mark.parametrize("value", ["nan", "inf", "400"])
def test_numbers_out_of_range_are_wrong_usage(day: Path, tmp_path: Path, option: str, value: str) -> None:
    result = run("stereo", "normals", day, *PLACE, option, value, "-o", tmp_path / "out")
    assert f"Invalid value for '{option}'" in error_of(result, 2)


def test_the_results_do_not_go_to_the_photos(day: Path, tmp_path: Path) -> None:
    (tmp_path / "same").symlink_to(day)
    for folder in (day, tmp_path / "same"):
        result = run("stereo", "normals", day, *PLACE, "-o", folder, "--overwrite")
        assert error_of(result, 2) == f"{folder} holds the photos; the results need another folder."
    assert len(list(day.iterdir())) == 3


def test_the_results_do_not_go_to_stdout(day: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert "which stdout cannot be." in error_of(run("stereo", "normals", day, *PLACE, "-o", "-"), 2)


def test_the_results_need_an_empty_folder_whose_parent_is_there(day: Path, tmp_path: Path) -> None:
    said = error_of(run("stereo", "normals", day, *PLACE, "-o", tmp_path))
    assert said == f"{tmp_path} is not empty; --overwrite replaces the results in it."
    said = error_of(run("stereo", "normals", day, *PLACE, "-o", day / "0.jpg"))
    assert said == f"{day / '0.jpg'} is a file; the results need a folder."
    said = error_of(run("stereo", "normals", day, *PLACE, "-o", tmp_path / "none" / "out"))
    assert said == f"There is no folder {tmp_path / 'none'}."
    assert [path.name for path in tmp_path.iterdir()] == ["day"]


def test_photos_reduced_to_a_point_are_one_sentence(day: Path, tmp_path: Path) -> None:
    said = error_of(run("stereo", "normals", day, *PLACE, "--size", "1", "-o", tmp_path / "out"))
    assert said == "0.jpg is reduced to 1 x 1 pixels; normals need 2 or more each way."


def test_times_in_another_coding_are_one_sentence(day: Path, tmp_path: Path) -> None:
    (day / "times.csv").write_bytes("file,time\nMärz.jpg,2024-06-21T10:00\n".encode("latin-1"))
    said = error_of(run("stereo", "normals", day, *PLACE, "-o", tmp_path / "out"))
    assert said == f"{day / 'times.csv'} is not a CSV file in UTF-8."


def test_a_photo_without_colours_is_named(day: Path, tmp_path: Path) -> None:
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"Y": np.ones((8, 8), np.float32)}).write(str(day / "depth.exr"))
    said = error_of(run("stereo", "normals", day, *PLACE, "-o", tmp_path / "out"))
    assert said == "depth.exr: The EXR file has no channel R, G, B; it needs R, G and B."


def test_a_bad_probe_is_named(day: Path, tmp_path: Path) -> None:
    file = tmp_path / "probes" / "20240621" / "080000" / "envmap.exr"
    file.parent.mkdir(parents=True)
    write_exr(file, np.full((16, 32, 3), np.nan, np.float32))
    for name in ("090000", "100000"):
        other = tmp_path / "probes" / "20240621" / name / "envmap.exr"
        other.parent.mkdir()
        write_exr(other, np.ones((16, 32, 3), np.float32))
    options = ("--probes", tmp_path / "probes", "--heading", "0", "--utc-offset", "0")
    for hour in range(3):
        jpeg(day / f"{hour}.jpg", scene(), datetime(2024, 6, 21, 8) + timedelta(hours=hour))
    said = error_of(run("stereo", "normals", day, *options, "-o", tmp_path / "out"))
    assert said == f"{file}: The map holds values that are not finite numbers."

"""Tests of stereo."""

import json
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image

from lighting.cli import cli
from lighting.files.exr import write_exr
from tests.helpers.processes import error_of, invoke_command, run_in_terminal
from tests.helpers.skies import gray_blocks, write_photo


@pytest.fixture
def day(tmp_path: Path) -> Path:
    folder = tmp_path / "day"
    folder.mkdir()
    for hour in range(3):
        write_photo(folder / f"{hour}.jpg", gray_blocks(), datetime(2024, 6, 21, 10) + timedelta(hours=hour))
    return folder


PLACE = ("--lat", "47", "--lon", "8", "--heading", "0", "--utc-offset", "2")


@pytest.mark.parametrize(
    "option", ["--heading", "--camera-elevation", "--camera-roll", "--noise", "--turbidity", "--lat", "--lon"]
)
@pytest.mark.parametrize("value", ["nan", "inf", "400"])
def test_numbers_out_of_range_are_wrong_usage(day: Path, tmp_path: Path, option: str, value: str) -> None:
    result = invoke_command("stereo", "normals", day, *PLACE, option, value, "-o", tmp_path / "out")
    assert f"{option}': {float(value)} is not " in error_of(result, 2)


def test_the_results_do_not_go_to_the_photos(day: Path, tmp_path: Path) -> None:
    (tmp_path / "same").symlink_to(day)
    for folder in (day, tmp_path / "same"):
        result = invoke_command("stereo", "normals", day, *PLACE, "-o", folder, "--overwrite")
        assert error_of(result, 2) == f"{folder} holds the photos; the results need another folder."
    assert len(list(day.iterdir())) == 3


def test_the_results_do_not_go_to_stdout(day: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert "which stdout cannot be." in error_of(invoke_command("stereo", "normals", day, *PLACE, "-o", "-"), 2)


def test_the_results_need_an_empty_folder_whose_parent_is_there(day: Path, tmp_path: Path) -> None:
    said = error_of(invoke_command("stereo", "normals", day, *PLACE, "-o", tmp_path))
    assert said == f"{tmp_path} is not empty; --overwrite replaces the results in it."
    said = error_of(invoke_command("stereo", "normals", day, *PLACE, "-o", day / "0.jpg"))
    assert said == f"{day / '0.jpg'} is a file; the results need a folder."
    said = error_of(invoke_command("stereo", "normals", day, *PLACE, "-o", tmp_path / "none" / "out"))
    assert said == f"There is no folder {tmp_path / 'none'}."
    assert [path.name for path in tmp_path.iterdir()] == ["day"]


def test_photos_reduced_to_a_point_are_one_sentence(day: Path, tmp_path: Path) -> None:
    said = error_of(invoke_command("stereo", "normals", day, *PLACE, "--size", "1", "-o", tmp_path / "out"))
    assert said == "0.jpg is reduced to 1 x 1 pixels; normals need 2 or more each way."


def test_times_in_another_coding_are_one_sentence(day: Path, tmp_path: Path) -> None:
    (day / "times.csv").write_bytes("file,time\nMärz.jpg,2024-06-21T10:00\n".encode("latin-1"))
    said = error_of(invoke_command("stereo", "normals", day, *PLACE, "-o", tmp_path / "out"))
    assert said == f"{day / 'times.csv'} is not a CSV file in UTF-8."


def test_a_photo_without_colours_is_named(day: Path, tmp_path: Path) -> None:
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"Y": np.ones((8, 8), np.float32)}).write(str(day / "depth.exr"))
    said = error_of(invoke_command("stereo", "normals", day, *PLACE, "-o", tmp_path / "out"))
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
        write_photo(day / f"{hour}.jpg", gray_blocks(), datetime(2024, 6, 21, 8) + timedelta(hours=hour))
    said = error_of(invoke_command("stereo", "normals", day, *options, "-o", tmp_path / "out"))
    assert said == f"{file}: The map holds values that are not finite numbers."


STEREO_PLAN_PLACE = ["--lat", "47", "--lon", "10"]


def run(*arguments: str | Path) -> Result:
    return CliRunner().invoke(cli, ["stereo", "plan", *map(str, arguments)], prog_name="lighting")


def test_words_and_a_picture(tmp_path: Path) -> None:
    picture = tmp_path / "plan.png"
    result = run(*STEREO_PLAN_PLACE, "--date", "2026-06-21", "--facing", "180", "-o", picture)
    assert result.exit_code == 0, result.output
    first, *windows = result.stdout.splitlines()[:5]
    assert first.startswith("2026-06-21, 47.00° N 10.00° E, clear sky; surface facing 180°")
    assert first.endswith("times UTC+01:00.")
    assert [line.split()[0] for line in windows] == ["1", "2", "3", "6"]
    assert "45° down" in result.stdout
    with Image.open(picture) as drawn:
        assert drawn.size == (1600, 900)
    assert [path.name for path in tmp_path.iterdir()] == ["plan.png"]


def test_a_quiet_plan_is_told_where_nothing_is_drawn(tmp_path: Path) -> None:
    day = (*STEREO_PLAN_PLACE, "--date", "2026-06-21", "--facing", "180", "-q")
    assert run(*day).stdout.startswith("2026-06-21, 47.00° N")
    assert run(*day, "-o", tmp_path / "plan.png").output == ""


def test_json_of_an_overcast_day_has_null_where_nothing_is_resolved() -> None:
    result = run(*STEREO_PLAN_PLACE, "--date", "2026-12-21", "--sky", "overcast", "--utc-offset", "-3.5", "--json")
    record = json.loads(result.stdout)
    assert record["utc_offset"] == -3.5
    assert record["windows"][0]["gain"] is None
    assert [window["hours"] for window in record["windows"]] == [1, 2, 3, 6]
    assert record["days"] == [{"date": "2026-12-21", "errors": [90, 90, 90, 90]}]


def test_an_overcast_day_is_called_useless() -> None:
    assert (
        "No window resolves the normals" in run(*STEREO_PLAN_PLACE, "--date", "2026-12-21", "--sky", "overcast").stdout
    )


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (["--lat", "80", "--lon", "10", "--date", "2026-12-21"], 1, "it is night all day."),
        ([*STEREO_PLAN_PLACE, "--date", "2026-06-21", "--until", "2026-06-20"], 2, "is before the first"),
        ([*STEREO_PLAN_PLACE, "--date", "2026-06-21", "--shots", "2"], 2, "--shots is 2"),
        (
            [*STEREO_PLAN_PLACE, "--date", "2026-06-21", "--noise", "nan"],
            2,
            "--noise must be a finite number, not nan.",
        ),
        (["--lat", "91", "--lon", "10", "--date", "2026-06-21"], 2, "--latitude is 91"),
        ([*STEREO_PLAN_PLACE, "--date", "2200-06-21"], 2, "year"),
        ([*STEREO_PLAN_PLACE, "--date", "2026-02-30"], 2, "'2026-02-30' is not a day such as 2026-06-21."),
        ([*STEREO_PLAN_PLACE, "--date", "21 June"], 2, "'21 June' is not a day"),
        (STEREO_PLAN_PLACE, 2, "A plan needs --lat, --lon and --date, or --probes."),
        ([*STEREO_PLAN_PLACE, "--until", "2026-06-21"], 2, "--until needs --date."),
        ([*STEREO_PLAN_PLACE, "--date", "2026-06-21", "--json", "-o", "-"], 2, "both go to stdout"),
        ([*STEREO_PLAN_PLACE, "--date", "2026-06-21", "-o", "plan.jpg"], 2, "must end in .png"),
        (["--probes", "no such folder"], 2, "does not exist"),
    ],
)
def test_what_goes_wrong_is_one_sentence(arguments: list[str], status: int, said: str) -> None:
    result = run(*arguments)
    assert result.exit_code == status
    assert said in result.stderr
    assert result.stdout == ""


def test_probes_are_read_and_their_folder_named(tmp_path: Path) -> None:
    assert "holds no probe" in run("--probes", tmp_path).stderr
    assert "--sky is a modeled one" in run("--probes", tmp_path, "--sky", "clear").stderr
    assert "--lat and --lon are of modeled skies" in run("--probes", tmp_path, *STEREO_PLAN_PLACE).stderr
    rng = np.random.default_rng(0)
    for minute in range(0, 75, 15):
        folder = tmp_path / "20260621" / f"{10 + minute // 60}{minute % 60:02d}00"
        folder.mkdir(parents=True)
        write_exr(folder / "envmap.exr", rng.random((16, 32, 3), dtype=np.float32) ** 8)
    result = run("--probes", tmp_path)
    assert result.exit_code == 0, result.output
    assert f"2026-06-21, measured skies of {tmp_path.name}" in result.stdout
    assert "1 h  10:00 to 11:00" in result.stdout


def test_of_a_probe_whose_pixels_are_damaged_nothing_else_is_said(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    files = [tmp_path / "20260621" / hour / "envmap.exr" for hour in ("100000", "110000")]
    for file in files:
        file.parent.mkdir(parents=True)
        write_exr(file, np.random.default_rng(0).random((64, 128, 3), dtype=np.float32))
    data = bytearray(files[1].read_bytes())
    data[-3000:-2900] = bytes(100)
    files[1].write_bytes(data)
    result = run("--probes", tmp_path)
    assert result.stderr == f"Error: {files[1]}: The EXR file cannot be read: it is damaged or of an unknown kind.\n"
    assert tuple(capfd.readouterr()) == ("", "")  # OpenEXR's own words


def test_the_days_of_a_range_pass_on_a_terminal() -> None:
    days = ("--date", "2026-06-21", "--until", "2026-06-22")
    assert b"2/2" in run_in_terminal("stereo", "plan", *STEREO_PLAN_PLACE, *days, stdout_too=True)[1]

"""`lighting probe`: from files on disk to maps, and what they say."""

import json
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from export.probe.report import DAY, PLACE, lighting_at
from export.probe.synthetic import Camera, expose, photograph
from lighting.cli import cli
from lighting.cli.probe import KINDS
from lighting.files.exr import read_attributes, read_exr
from lighting.probe.align import yaw_rotation
from lighting.probe.folders import probes_in
from lighting.probe.lens import KINDS as LENSES
from lighting.probe.lens import lens_of
from lighting.probe.settings import Moment
from tests.pictures import taken, write_png16

TIMES = (1 / 8000, 1 / 90, 1.0)
WHERE = ["--lat", str(PLACE[0]), "--lon", str(PLACE[1])]


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, ["probe", *map(str, arguments)])


def shoot(folder: Path, hours: int = 0, fill: float = 8.0, with_exif: bool = True) -> list[Path]:
    """Three exposures of a clear sky as 16-bit PNG, `hours` after nine in the morning UTC."""
    folder.mkdir(parents=True)
    time = DAY + timedelta(hours=hours)
    picture = photograph(lighting_at(Moment(time, *PLACE)), lens_of("equidistant", 160, 160), yaw_rotation(40.0))
    photos = expose(picture, Camera(14, fill), np.random.default_rng(hours), TIMES)
    local = (time + timedelta(hours=2)).strftime("%Y:%m:%d %H:%M:%S")
    return [
        write_png16(
            folder / f"{index}.png",
            np.rint(photo.pixels * 65535).astype(np.uint16),
            taken(TIMES[index], local) if with_exif else None,
        )
        for index, photo in enumerate(photos)
    ]


@pytest.fixture(scope="module")
def exposures(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return shoot(tmp_path_factory.mktemp("sky") / "bracket")


def test_exposures_become_a_map_that_can_be_fitted(exposures: list[Path], tmp_path: Path) -> None:
    target = tmp_path / "probe.exr"
    result = run("merge", *exposures, "--lens", "equidistant", *WHERE, "--fill-sun", "--height", 128, "-o", target)
    assert result.exit_code == 0, result.output
    assert "estimated by the model" in result.stderr
    azimuth, elevation = Moment(DAY, *PLACE).sun
    assert f"sun {azimuth:.1f}° from north, {elevation:.1f}° high" in result.stdout
    assert read_exr(target)[0].shape == (128, 256, 3)
    assert read_attributes(target)["lighting.sun_estimated"] == 1
    told = json.loads(run("fit", target, "--json").stdout)
    assert (told["sun_azimuth"], told["sun_elevation"]) == pytest.approx((azimuth, elevation), abs=0.5)
    assert told["turbidity"] == pytest.approx(3.0, abs=0.5)
    assert "turbidity" in run("fit", target, "--sun", f"{azimuth},{elevation}").stdout


def test_a_folder_of_exposures_and_a_folder_to_fill(exposures: list[Path], tmp_path: Path) -> None:
    result = run("merge", exposures[0].parent, "--lens", "equidistant", *WHERE, "--height", 64, "-o", tmp_path, "-q")
    assert result.exit_code == 0, result.output
    assert not result.stdout
    assert probes_in(tmp_path)[0].time == DAY


def test_a_series_fills_a_folder(tmp_path: Path) -> None:
    brackets = [shoot(tmp_path / f"{hours}", hours)[0].parent for hours in (0, 3, 6)]
    arguments = ("--series", "--lens", "equidistant", *WHERE, "--height", 64, "-o", tmp_path / "sky")
    result = run("merge", *brackets, *arguments)
    assert result.exit_code == 0, result.output
    assert "3 suns leave" in result.stdout
    assert [probe.time - DAY for probe in probes_in(tmp_path / "sky")] == [timedelta(hours=h) for h in (0, 3, 6)]


def test_bad_exposures_end_as_one_sentence(exposures: list[Path], tmp_path: Path) -> None:
    target = tmp_path / "probe.exr"
    base = ("--lens", "equidistant", *WHERE, "-o", target)
    for given, said in (
        ((exposures[0],), "only one"),
        ((*exposures, "--time", "2024-06-01T23:00Z"), "night"),
        ((*exposures, "--curve", "srgb", "--time", "2024-06-01T09:00Z"), "--curve linear"),
        ((*exposures, "--radius", "0"), "radius"),
    ):
        result = run("merge", *given, *base)
        assert result.exit_code == 1, result.output
        assert said in result.stderr
        assert result.stderr.count("\n") == 1
    assert not target.exists()


def test_what_is_not_known_is_asked_for(exposures: list[Path], tmp_path: Path) -> None:
    bare = shoot(tmp_path / "bare", with_exif=False)
    target = tmp_path / "probe.exr"
    for given, said in (
        ((*exposures, "-o", target), "--lat and --lon"),
        ((*exposures, *WHERE, "-o", tmp_path / "a.png"), "must end in .exr"),
        ((*exposures, *WHERE, "-o", tmp_path / "none" / "a.exr"), "no folder"),
        ((*exposures, *WHERE, "--series", "-o", target), "fills a folder"),
        ((*exposures, *WHERE, "--centre", "12", "-o", target), "two numbers"),
    ):
        result = run("merge", *given, "--lens", "equidistant")
        assert result.exit_code == 2, result.output
        assert said in result.stderr
    result = run("merge", *bare, *WHERE, "--lens", "equidistant", "-o", target)
    assert (result.exit_code, "does not say when" in result.stderr) == (1, True)


def test_a_map_without_a_sky_is_said(tmp_path: Path) -> None:
    from lighting.files.exr import write_exr

    write_exr(tmp_path / "a.exr", np.full((32, 64, 3), 0.5, np.float32))
    result = run("fit", tmp_path / "a.exr")
    assert result.exit_code == 1
    assert "No sun is found" in result.stderr


@pytest.mark.parametrize("sun", ["nan,10", "10,nan", "400,10", "10,99", "10,-1", "10", "a,b", "1,2,3"])
def test_a_sun_that_cannot_be_is_wrong_usage(tmp_path: Path, sun: str) -> None:
    (tmp_path / "a.exr").touch()
    result = run("fit", tmp_path / "a.exr", "--sun", sun)
    assert result.exit_code == 2
    assert "Invalid value for '--sun'" in result.stderr


def test_the_lenses_offered_are_those_known() -> None:
    assert KINDS == LENSES

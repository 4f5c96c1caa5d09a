"""`lighting probe`: from files on disk to maps, and what they say."""

import json
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image

from lighting.cli import cli
from lighting.cli.probe import PROBE_KINDS
from lighting.color import srgb_encode
from lighting.envmap.render import render
from lighting.files.exr import read_exr, read_exr_attributes, write_exr
from lighting.probe.alignment import yaw_rotation
from lighting.probe.bracket import probe_path, probes_in
from lighting.probe.develop import Moment
from lighting.probe.fisheye import LensKind, make_lens
from lighting.records import Lighting
from tests.helpers.brackets import SKY_DAY, SKY_PLACE, BracketCamera, clear_sky_at, expose_bracket, photograph_sky
from tests.helpers.photos import taken, write_png16
from tests.helpers.processes import error_of

TIMES = (1 / 8000, 1 / 90, 1.0)
WHERE = ["--lat", str(SKY_PLACE[0]), "--lon", str(SKY_PLACE[1])]


def run(*arguments: object) -> Result:
    return CliRunner().invoke(cli, ["probe", *map(str, arguments)])


def shoot(folder: Path, hours: int = 0, fill: float = 8.0, with_exif: bool = True) -> list[Path]:
    """Three exposures of a clear sky as 16-bit PNG, `hours` after nine in the morning UTC."""
    folder.mkdir(parents=True)
    time = SKY_DAY + timedelta(hours=hours)
    picture = photograph_sky(
        clear_sky_at(Moment(time, *SKY_PLACE)), make_lens("equidistant", 160, 160), yaw_rotation(40.0)
    )
    photos = expose_bracket(picture, BracketCamera(14, fill), np.random.default_rng(hours), TIMES)
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


@pytest.mark.needs("scipy")
def test_exposures_become_a_map_that_can_be_fitted(exposures: list[Path], tmp_path: Path) -> None:
    target = tmp_path / "probe.exr"
    result = run("merge", *exposures, "--lens", "equidistant", *WHERE, "--fill-sun", "--height", 128, "-o", target)
    assert result.exit_code == 0, result.output
    assert "the sky around it tells" in result.stderr
    azimuth, elevation = Moment(SKY_DAY, *SKY_PLACE).sun
    assert f"sun {azimuth:.1f}° from north, {elevation:.1f}° high" in result.stdout
    assert read_exr(target)[0].shape == (128, 256, 3)
    assert read_exr_attributes(target)["lighting.sun_estimated"] == 1
    told = json.loads(run("fit", target, "--json").stdout)
    assert (told["sun_azimuth"], told["sun_elevation"]) == pytest.approx((azimuth, elevation), abs=0.5)
    assert told["turbidity"] == pytest.approx(3.0, abs=0.5)
    assert "turbidity" in run("fit", target, "--sun", f"{azimuth},{elevation}").stdout


@pytest.mark.needs("scipy")
def test_a_folder_of_exposures_and_a_folder_to_fill(exposures: list[Path], tmp_path: Path) -> None:
    result = run("merge", exposures[0].parent, "--lens", "equidistant", *WHERE, "--height", 64, "-o", tmp_path, "-q")
    assert result.exit_code == 0, result.output
    assert not result.stdout
    assert probes_in(tmp_path)[0].time == SKY_DAY


@pytest.mark.needs("scipy")
def test_a_series_fills_a_folder(tmp_path: Path) -> None:
    brackets = [shoot(tmp_path / f"{hours}", hours)[0].parent for hours in (0, 3, 6)]
    arguments = ("--series", "--lens", "equidistant", *WHERE, "--height", 64, "-o", tmp_path / "sky")
    result = run("merge", *brackets, *arguments)
    assert result.exit_code == 0, result.output
    assert "3 suns leave" in result.stdout
    assert [probe.time - SKY_DAY for probe in probes_in(tmp_path / "sky")] == [timedelta(hours=h) for h in (0, 3, 6)]


def test_bad_exposures_end_as_one_sentence(exposures: list[Path], tmp_path: Path) -> None:
    target = tmp_path / "probe.exr"
    base = ("--lens", "equidistant", *WHERE, "-o", target)
    for given, said in (
        ((exposures[0],), "only one"),
        ((*exposures, "--time", "2024-06-01T23:00Z"), "night"),
        ((*exposures, "--curve", "srgb", "--time", "2024-06-01T09:00Z"), "--curve linear"),
        ((*exposures, "--center", "4000,3"), "center in the picture"),
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
        ((*exposures, *WHERE, "--center", "12", "-o", target), "two numbers"),
    ):
        result = run("merge", *given, "--lens", "equidistant")
        assert result.exit_code == 2, result.output
        assert said in result.stderr
    result = run("merge", *bare, *WHERE, "--lens", "equidistant", "-o", target)
    assert (result.exit_code, "does not say when" in result.stderr) == (1, True)


@pytest.mark.needs("scipy")
def test_a_map_without_a_sky_is_said(tmp_path: Path) -> None:
    write_exr(tmp_path / "a.exr", np.full((32, 64, 3), 0.5, np.float32))
    result = run("fit", tmp_path / "a.exr")
    assert result.exit_code == 1
    assert "No sun is found" in result.stderr


@pytest.mark.parametrize(
    ("sun", "azimuth", "side"),
    [("40,30", 40.0, "40.0° right"), ("-40,30", -40.0, "40.0° left"), ("320,30", -40.0, "40.0° left")],
)
@pytest.mark.needs("scipy")
def test_the_side_of_the_sun_is_told_as_everywhere(tmp_path: Path, sun: str, azimuth: float, side: str) -> None:
    sky = Lighting(sun_azimuth=azimuth, sun_elevation=30.0, turbidity=3.0, exposure=1.0)
    write_exr(tmp_path / "a.exr", render(sky, 64))
    assert f": sun {side} of the center, 30.0° high (given); " in run("fit", tmp_path / "a.exr", "--sun", sun).stdout
    assert json.loads(run("fit", tmp_path / "a.exr", "--sun", sun, "--json").stdout)["sun_azimuth"] == azimuth


@pytest.mark.parametrize("sun", ["nan,10", "10,nan", "400,10", "10,99", "10,-1", "10", "a,b", "1,2,3"])
def test_a_sun_that_cannot_be_is_wrong_usage(tmp_path: Path, sun: str) -> None:
    (tmp_path / "a.exr").touch()
    result = run("fit", tmp_path / "a.exr", "--sun", sun)
    assert result.exit_code == 2
    assert "Invalid value for '--sun'" in result.stderr


def test_the_lenses_offered_are_those_known() -> None:
    assert get_args(LensKind) == PROBE_KINDS


def panorama(path: Path, value: float = 0.5, height: int = 32) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    write_exr(path, np.full((height, 2 * height, 3), value, np.float32), compression="none")
    return path


def test_no_exposure_is_replaced(tmp_path: Path) -> None:
    exposures = [panorama(tmp_path / "a.exr"), panorama(probe_path(tmp_path, SKY_DAY), 0.1)]
    before = [path.read_bytes() for path in exposures]
    for output in (tmp_path / "a.exr", tmp_path):
        result = run("merge", *exposures, "--lens", "latlong", *WHERE, "--time", SKY_DAY.isoformat(), "-o", output)
        assert error_of(result, 2) == "The input and the outputs must be different files."
    assert [path.read_bytes() for path in exposures] == before


@pytest.mark.parametrize(
    ("lens", "option", "value"),
    [
        ("latlong", "--lens-fov", "90"),
        ("latlong", "--radius", "10"),
        ("latlong", "--center", "3,4"),
        ("ball", "--lens-fov", "90"),
    ],
)
def test_options_that_the_lens_does_not_have_are_wrong_usage(
    exposures: list[Path], tmp_path: Path, lens: str, option: str, value: str
) -> None:
    result = run("merge", *exposures, "--lens", lens, *WHERE, option, value, "-o", tmp_path / "a.exr")
    assert error_of(result, 2) == f"{option} does not go with --lens {lens}."


@pytest.mark.parametrize(
    ("option", "value", "said"),
    [
        ("--nd", "-3", "0 to 40"),
        ("--nd", "2000", "0 to 40"),
        ("--camera-elevation", "91", "-90 to 90"),
        ("--fov", "400", "up to 360"),
        ("--center", "nan,3", "not finite"),
        ("--radius", "-3", "must be over 0"),
        ("--yaw", "inf", "not finite"),
    ],
)
def test_numbers_that_no_picture_is_taken_by_are_wrong_usage(
    exposures: list[Path], tmp_path: Path, option: str, value: str, said: str
) -> None:
    result = run("merge", *exposures, "--lens", "equidistant", *WHERE, option, value, "-o", tmp_path / "a.exr")
    assert said in error_of(result, 2)


def test_what_is_told_twice_must_not_differ(exposures: list[Path], tmp_path: Path) -> None:
    base = ("merge", *exposures, "--lens", "equidistant", "-o", tmp_path / "a.exr")
    result = run(*base, *WHERE, "--time", "2024-06-01T08:10+02:00", "--utc-offset", "5")
    assert error_of(result, 2) == "The time already has its offset from UTC; another one contradicts it."
    assert error_of(run(*base, "--lat", 47), 2) == "--lat needs --lon too, such as --lat 48.14 --lon 11.58."
    assert "nan is not a finite number." in error_of(run(*base, "--lat", "nan", "--lon", 8), 2)


@pytest.mark.needs("scipy")
def test_a_folder_may_have_a_dot_in_its_name(exposures: list[Path], tmp_path: Path) -> None:
    for name in ("s.d", "s.exr"):
        (tmp_path / name).mkdir()
        result = run("merge", *exposures, "--lens", "equidistant", *WHERE, "--height", 64, "-q", "-o", tmp_path / name)
        assert result.exit_code == 0, result.output
        assert probes_in(tmp_path / name)[0].time == SKY_DAY


def test_a_probe_does_not_go_to_stdout(exposures: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert "not to stdout." in error_of(run("merge", *exposures, "--lens", "equidistant", *WHERE, "-o", "-"), 2)
    assert not list(tmp_path.iterdir())


def test_exposures_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"junk")
    (tmp_path / "a.exr").write_bytes(b"junk")
    for path, said in (
        (tmp_path / "a.png", " cannot be read as a PNG, TIFF or JPEG picture; it is a text."),
        (tmp_path / "a.exr", ": The file is not an OpenEXR image."),
        (panorama(tmp_path / "b.exr", np.nan), ": The picture holds values that are not finite numbers."),
    ):
        other = path.with_stem("other")
        other.write_bytes(path.read_bytes())
        result = run(
            "merge",
            path,
            other,
            "--lens",
            "latlong",
            *WHERE,
            "--time",
            SKY_DAY.isoformat(),
            "-o",
            tmp_path / "probe.exr",
        )
        assert error_of(result) == f"{path}{said}"


def _spoilt(path: Path, value: float) -> Path:
    """A sky with one pixel that has another value."""
    image = np.random.default_rng(0).uniform(0.1, 1, (32, 64, 3)).astype(np.float32)
    image[3, 4] = value
    write_exr(path, image)
    return path


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_sky_with_a_pixel_that_is_no_number_is_refused(tmp_path: Path, value: float) -> None:
    path = _spoilt(tmp_path / "a.exr", value)
    for sun in ((), ("--sun", "10,40")):
        said = error_of(run("fit", path, *sun))
        assert said == f"{path}: The map holds values that are not finite numbers."


def test_a_map_that_holds_no_sky_is_refused(tmp_path: Path) -> None:
    dark, small = panorama(tmp_path / "dark.exr", -1.0), panorama(tmp_path / "small.exr", height=1)
    assert error_of(run("fit", dark)) == f"{dark}: The sky in the map is black or negative."
    assert error_of(run("fit", small)) == f"{small}: The map has 1 row; a sky needs 16 or more to be fitted."


def _damaged_header(data: bytearray) -> None:
    data[data.index(b"channels") + 12] = 0xFF


def _damaged_pixels(data: bytearray) -> None:
    for index in range(len(data) - 3000, len(data) - 2900):
        data[index] ^= 0x5A


def _no_exr(data: bytearray) -> None:
    data[0] = 0


@pytest.mark.parametrize("spoil", [_damaged_header, _damaged_pixels, _no_exr])
def test_a_bad_exr_is_named_in_one_sentence(
    tmp_path: Path, spoil: Callable[[bytearray], None], capfd: pytest.CaptureFixture[str]
) -> None:
    path = _spoilt(tmp_path / "a.exr", 1.0)
    data = bytearray(path.read_bytes())
    spoil(data)
    path.write_bytes(data)
    said = error_of(run("fit", path))
    assert said.startswith(f"{path}: The ")
    assert "python_buffer" not in said
    assert tuple(capfd.readouterr()) == ("", "")  # nor what OpenEXR prints by itself


def test_a_sun_that_is_no_pair_is_told_what_it_should_be(tmp_path: Path) -> None:
    path = panorama(tmp_path / "a.exr")
    assert "'10' is not azimuth and elevation such as 120,35." in error_of(run("fit", path, "--sun", "10"), 2)


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.needs("scipy")
def test_a_panorama_of_whole_numbers_is_fitted_with_a_warning(tmp_path: Path, bits: int) -> None:
    """A clear sky whose sun is clipped: its turbidity comes back near enough, and a warning says so."""
    light = Lighting(sun_azimuth=30.0, sun_elevation=35.0, turbidity=3.0, exposure=1.0)
    sky = render(light, 128)
    linear = np.clip(sky / np.quantile(sky, 0.999), 0, 1)
    target = tmp_path / "sky.png"
    if bits == 8:
        Image.fromarray(np.uint8(np.round(255 * srgb_encode(linear)))).save(target)
    else:
        write_png16(target, np.round(65535 * linear).astype(np.uint16))
    result = run("fit", target, "--json", "--sun", "30,35")
    assert result.exit_code == 0, result.output
    assert "clipped: turbidity and exposure are rough." in result.stderr
    assert ("sRGB" in result.stderr) == (bits == 8)
    told = json.loads(result.stdout)
    assert told["turbidity"] == pytest.approx(3.0, abs=0.5)
    Image.fromarray(np.zeros((40, 60, 3), np.uint8)).save(target)
    assert "shape (H, 2H, 3), not (40, 60, 3)" in run("fit", target).stderr

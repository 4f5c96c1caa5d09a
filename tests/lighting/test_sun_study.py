"""`lighting day`: the sun of a day at a photo's place, its maps, and the stage as OpenUSD reads it."""

import json
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lighting.errors import ParameterError
from lighting.files.exr import read_exr
from lighting.geometry import direction
from lighting.records import Lighting
from lighting.sun_study import SunStudy, plan_study
from tests.conftest import encode, munich, scene
from tests.helpers.processes import error_of, invoke_command
from tests.helpers.scenes import outdoors

MUNICH = {"latitude": 48.14, "longitude": 11.58}
WINTER = date(2026, 12, 21)
LIGHT = outdoors(camera_heading=90.0, camera_heading_radius_90=10.0, **MUNICH)


def times(study: SunStudy) -> list[str]:
    return [f"{hour.time:%H:%M%z}" for hour in study.hours]


def test_the_suns_of_the_solstices_in_munich() -> None:
    """Sunrise at 8:01 and sunset at 16:22; noon's elevation is 90 - 48.14 - 23.44 deg."""
    study = plan_study(LIGHT, WINTER, 60)
    assert times(study) == [f"{hour:02}:00+0100" for hour in range(9, 17)]
    highest = max(plan_study(LIGHT, WINTER, 5).hours, key=lambda hour: hour.lighting.sun_elevation)
    assert f"{highest.time:%H:%M}" in ("12:10", "12:15")
    assert highest.lighting.sun_elevation == pytest.approx(90 - 48.14 - 23.44, abs=0.1)
    assert highest.lighting.sun_azimuth == pytest.approx(90.0, abs=1.0)  # the camera looks east, the sun is south
    summer = plan_study(LIGHT, date(2026, 6, 21), 60)
    assert times(summer)[0] == "06:00+0200"
    assert summer.hours[0].lighting.radius_90 == pytest.approx(10.0, abs=0.2)
    assert summer.hours[0].lighting.latitude is None
    assert plan_study(LIGHT, WINTER, 60, keep_location=True).hours[0].lighting.latitude == 48.14


@pytest.mark.parametrize("day", [date(2026, 3, 29), date(2026, 10, 25)])
def test_days_on_which_clocks_change(day: date) -> None:
    """Whole hours stay whole, and the sun is highest at the same true time."""
    study = plan_study(LIGHT, day, 60)
    assert {hour.time.minute for hour in study.hours} == {0}
    assert {hour.time.date() for hour in study.hours} == {day}
    assert len({hour.time for hour in study.hours}) == len(study.hours)


def test_power_follows_the_photo_where_its_sun_shines_and_the_model_elsewhere() -> None:
    bright = replace(LIGHT, sun_irradiance=(4.0, 4.0, 4.0), sky_irradiance=(1.0, 1.0, 1.0), sky_cover=0.1)
    suns = [plan_study(light, WINTER, 60).hours[3].lighting for light in (bright, replace(bright, exposure=2.0))]
    assert suns[0].sun_irradiance == pytest.approx(suns[1].sun_irradiance)
    covered = replace(bright, sun_visibility=0.1, sky_cover=1.0)
    study = plan_study(covered, WINTER, 60)
    assert study.hours[3].lighting.sun_irradiance is None
    assert study.hours[3].lighting.sun_visibility == 1.0
    assert any("clear sky" in warning for warning in study.warnings)


@pytest.mark.parametrize(
    ("light", "day", "minutes", "words"),
    [
        (replace(LIGHT, latitude=None), WINTER, 60, "place is not known"),
        (replace(LIGHT, camera_heading=None, camera_heading_radius_90=None), WINTER, 60, "state the heading"),
        (replace(LIGHT, latitude=78.2, longitude=15.6), WINTER, 60, "does not rise"),
        (LIGHT, WINTER, 1, "5 to 360 minutes"),
    ],
)
def test_what_is_missing_is_said(light: Lighting, day: date, minutes: float, words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        plan_study(light, day, minutes)


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    path = tmp_path / "square.jpg"
    path.write_bytes(encode(Image.fromarray(scene(320, 240)), exif=munich()))
    return path


def test_the_command_writes_maps_records_and_a_stage_with_a_moving_sun(photo: Path, network: Path) -> None:
    pxr = pytest.importorskip("pxr", reason="needs pxr")
    from pxr import Usd, UsdGeom, UsdLux, UsdValidation

    arguments = ["day", photo, "--date", "2026-12-21", "--every", "2h", "--height", "32", "--model", network, "--json"]
    result = invoke_command(*arguments)
    assert result.exit_code == 0, result.output
    told = json.loads(result.stdout)
    folder = photo.with_name("square-2026-12-21")
    assert told["output"] == str(folder)
    assert [hour["map"] for hour in told["hours"]] == ["1000.exr", "1200.exr", "1400.exr", "1600.exr"]
    assert any("relit" in warning for warning in told["warnings"])
    records = [json.loads(line) for line in (folder / "lighting.jsonl").read_text().splitlines()]
    for record in records:
        image, light = read_exr(folder / record["map"])
        assert image.shape == (32, 64, 3)
        assert light == Lighting.from_dict(record["lighting"])
        assert light.latitude is None
    assert "latitude" not in (folder / "usd" / "lighting.json").read_text()

    assert pxr
    stage = Usd.Stage.Open(str(folder / "usd" / "day.usda"))
    context = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())
    assert [error.GetErrorAsString() for error in context.Validate(stage)] == []
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode()) == (10.0, 16.0)
    sun, sky = UsdLux.DistantLight.Get(stage, "/World/Sun"), UsdLux.DomeLight.Get(stage, "/World/Sky")
    for record, code in zip(records, (10.0, 12.0, 14.0, 16.0), strict=True):
        placed = UsdGeom.Xformable(sun).ComputeLocalToWorldTransform(code)
        light = Lighting.from_dict(record["lighting"])
        toward = direction(light.sun_azimuth, light.sun_elevation)
        assert np.array(placed.GetRow3(2)) == pytest.approx(toward, abs=1e-5)
        assert sky.GetTextureFileAttr().Get(code).path == f"./{record['map']}"
        assert Path(sky.GetTextureFileAttr().Get(code).resolvedPath).is_file()
        assert sun.GetIntensityAttr().Get(code) > 0
    between = np.array(UsdGeom.Xformable(sun).ComputeLocalToWorldTransform(10.9).GetRow3(2))
    assert np.linalg.norm(between) == pytest.approx(1.0, abs=1e-3)


def test_the_command_refuses_in_one_sentence(photo: Path, tmp_path: Path, network: Path) -> None:
    assert "2026-12-21" in error_of(invoke_command("day", photo, "--date", "soon"), 2)
    assert "1h or 30min" in error_of(invoke_command("day", photo, "--date", "2026-12-21", "--every", "often"), 2)
    full = tmp_path / "full"
    full.mkdir()
    (full / "mine.txt").write_text("mine")
    assert "not empty" in error_of(invoke_command("day", photo, "--date", "2026-12-21", "-o", full))
    plain = tmp_path / "plain.jpg"
    plain.write_bytes(encode(scene(320, 240)))
    said = error_of(invoke_command("day", plain, "--date", "2026-12-21", "--model", network, "-o", tmp_path / "new"), 2)
    assert said == "The place is not known: state latitude and longitude."
    assert not (tmp_path / "new").exists()


def test_a_stated_heading_needs_no_time(tmp_path: Path, network: Path) -> None:
    path = tmp_path / "plain.jpg"
    path.write_bytes(encode(scene(320, 240)))
    place = ["--lat", "48.14", "--lon", "11.58", "--heading", "-270"]
    result = invoke_command(
        "day", path, "--date", WINTER, *place, "--every", "6h", "--height", "16", "--model", network
    )
    assert result.exit_code == 0, result.output
    (record,) = (tmp_path / "plain-2026-12-21" / "lighting.jsonl").read_text().splitlines()
    light = Lighting.from_dict(json.loads(record)["lighting"])
    assert light.sun_azimuth == pytest.approx(plan_study(LIGHT, WINTER, 360).hours[0].lighting.sun_azimuth)

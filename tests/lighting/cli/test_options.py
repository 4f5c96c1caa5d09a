"""Tests of options."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result

from lighting.estimator import Estimator
from lighting.files.exr import COMPRESSIONS, read_exr
from lighting.fusion.user_input import UserInput
from lighting.model import Model
from lighting.photo.reader import read_photo
from lighting.record_json import record_with_coefficients
from tests.conftest import encode, munich, scene
from tests.helpers.photos import drone as gimbal
from tests.helpers.photos import phone as phone_held
from tests.helpers.processes import error_of, invoke_command, run_in_terminal

COORDINATES = re.compile(r"48[.:]1|11[.:]5|latitude|longitude")
MORNING = ["--time", "2024-06-01T09:10+02:00", "--lat", "48.1375", "--lon", "11.575"]


def write(folder: Path, name: str, **tags: Any) -> Path:
    path = folder / name
    path.write_bytes(encode(scene(320, 240), exif=munich(**tags).tobytes()))
    return path


@pytest.fixture
def phone(tmp_path: Path) -> Path:
    return write(tmp_path, "phone.jpg")


def records(result: Result) -> list[dict[str, Any]]:
    assert result.exit_code == 0, result.output
    return [json.loads(line)["lighting"] for line in result.stdout.splitlines()]


def test_metadata_count_unless_turned_off(phone: Path, photo_path: Path, network: Path) -> None:
    (known,) = records(invoke_command("estimate", "--json", "--model", network, phone))
    assert known["evidence"] == ["pixels", "time+place", "heading", "focal length"]
    assert known["sun"]["elevation"] == pytest.approx(35.9, abs=0.2)
    assert known["camera"]["vertical_fov"] == pytest.approx(53.06, abs=0.01)
    assert len(known["camera"]["heading_probability"]) == 360
    (pixels,) = records(invoke_command("estimate", "--json", "--no-exif", "--model", network, phone))
    assert [pixels] == records(invoke_command("estimate", "--json", "--model", network, photo_path))
    assert pixels["evidence"] == ["pixels"]


def test_info_says_what_a_photo_knows_but_not_where(phone: Path) -> None:
    result = invoke_command("info", phone)
    known = json.loads(result.stdout)["metadata"]
    assert known["utc_time"] == "2024-06-01T07:10:00+00:00"
    assert (known["local_time"], known["utc_offset"]) == ("2024-06-01T09:10:00", 2.0)
    assert (known["heading"], known["location"]) == (60.0, True)
    assert not COORDINATES.search(result.stdout)


def held(folder: Path, name: str, kind: str, **options: Any) -> Path:
    path = folder / name
    path.write_bytes(encode(scene(320, 240), kind, **options))
    return path


def test_how_the_camera_was_held_counts_unless_turned_off(network: Path, tmp_path: Path) -> None:
    upright = held(tmp_path, "phone.jpg", "JPEG", exif=phone_held(0.0, -0.98, 0.17, 6).tobytes())
    drone = held(tmp_path, "drone.jpg", "JPEG", xmp=gimbal("-8.00"))
    for photo, elevation, source in ((upright, 9.8, "accelerometer"), (drone, -8.0, "gimbal")):
        facts = json.loads(invoke_command("info", photo).stdout)["metadata"]
        assert (facts["camera_elevation"], facts["camera_roll"]) == pytest.approx((elevation, 0.0), abs=0.1)
        assert facts["gravity_source"] == source
        pixels, known = (
            records(invoke_command("estimate", "--json", *how, "--model", network, photo))[0]
            for how in (["--no-exif"], [])
        )
        assert (pixels["evidence"], known["evidence"]) == (["pixels"], ["pixels", "gravity"])
        said, both = pixels["camera"]["elevation"], known["camera"]["elevation"]
        assert abs(both - elevation) < 0.2 * abs(said - elevation)
    (heading,) = records(invoke_command("estimate", "--json", *MORNING, "--model", network, drone))
    assert heading["evidence"] == ["pixels", "time+place", "heading", "gravity"]


def test_a_camera_that_contradicts_the_picture_is_a_warning(network: Path, tmp_path: Path) -> None:
    on_its_side = held(tmp_path, "turned.jpg", "JPEG", exif=phone_held(0.0, -1.0, 0.0, 1).tobytes())
    result = invoke_command("estimate", "--model", network, on_its_side)
    assert result.exit_code == 0
    assert "camera roll, 90°, was not used" in result.stderr
    assert "was not used: the photo shows" in result.stderr
    assert "gravity" not in result.stdout


def test_the_library_gives_the_same(phone: Path, network: Path) -> None:
    (record,) = records(
        invoke_command("estimate", "--json", "--model", network, "--fov", "40", "--heading", "10", phone)
    )
    light = Estimator(Model.load(network))(read_photo(phone), UserInput(vertical_fov=40.0, heading=10.0))
    assert record == record_with_coefficients(light.lighting, light.light_probe())


def test_what_is_said_counts_for_a_photo_without_metadata(phone: Path, photo_path: Path, network: Path) -> None:
    (said,) = records(invoke_command("estimate", "--json", "--model", network, *MORNING, photo_path))
    assert said["evidence"] == ["pixels", "time+place"]
    assert said["sun"]["elevation"] == pytest.approx(35.9, abs=0.2)
    (all_said,) = records(
        invoke_command("estimate", "--json", "--no-exif", "--model", network, *MORNING, "--fov", "40", phone)
    )
    assert all_said["evidence"] == ["pixels", "time+place", "focal length"]
    assert all_said["camera"]["vertical_fov"] == 40.0


def test_a_local_time_is_of_the_zone_of_its_place_unless_an_offset_is_stated(tmp_path: Path, network: Path) -> None:
    local = write(tmp_path, "local.jpg", OffsetTimeOriginal=None)
    (there,) = records(invoke_command("estimate", "--json", "--model", network, local))
    assert there["time"] == {"utc": "2024-06-01T07:10:00Z", "utc_offset": 2.0, "source": "zone of the place"}
    assert there["sun"]["elevation"] == pytest.approx(35.9, abs=0.2)
    stated = invoke_command("estimate", "--json", "--model", network, "--utc-offset", "+01:00", local)
    (there,) = records(stated)
    assert there["time"] == {"utc": "2024-06-01T08:10:00Z", "utc_offset": 1.0, "source": "user"}
    assert there["sun"]["elevation"] > 40.0


def test_what_a_stated_offset_replaces_is_told(phone: Path, network: Path) -> None:
    stated = invoke_command("estimate", "--json", "--model", network, "--utc-offset", "-01:00", phone)
    (there,) = records(stated)
    assert there["time"] == {"utc": "2024-06-01T10:10:00Z", "utc_offset": -1.0, "source": "user"}
    assert there["warnings"][0] == ("Your offset from UTC, -01:00, replaced the file's, +02:00 (offset in the file).")


def test_words_name_heading_and_evidence(phone: Path, photo_path: Path, network: Path) -> None:
    words = invoke_command("estimate", "--model", network, phone).stdout
    taken = r"taken 2024-06-01 09:10 \+02:00 \(offset in the file\)"
    used = r"from pixels, time\+place, heading, focal length"
    assert re.search(rf", heading \d+° \(50 % within \d+°\); {taken}; {used}$", words)
    assert "from pixels" not in invoke_command("estimate", "--model", network, photo_path).stdout


# The place


@pytest.mark.slow
def test_no_output_tells_the_place_unasked(phone: Path, network: Path, tmp_path: Path) -> None:
    exr, png = tmp_path / "sky.exr", tmp_path / "preview.png"
    outputs = [
        invoke_command("estimate", "--model", network, phone).output,
        invoke_command("estimate", "--json", "--model", network, phone).output,
        invoke_command(
            "--debug", "envmap", "--model", network, phone, "-o", exr, "--height", "16", "--preview", png
        ).output,
        invoke_command("info", exr).output,
        invoke_command("info", phone).output,
        invoke_command("estimate", "--model", network, "--time", "2024-12-24T23:00Z", phone).output,
        exr.read_bytes().decode("latin-1"),
        png.read_bytes().decode("latin-1"),
    ]
    for output in outputs:
        assert not COORDINATES.search(re.sub(r'"probability": \[.*?\]|[\d.]+e-\d+', "", output)), output[:500]


def test_the_place_is_kept_if_asked_for(phone: Path, network: Path, tmp_path: Path) -> None:
    place = {"latitude": pytest.approx(48.1375), "longitude": pytest.approx(11.575)}
    (record,) = records(invoke_command("estimate", "--json", "--keep-location", "--model", network, phone))
    assert record["place"] == place
    exr = tmp_path / "sky.exr"
    assert (
        invoke_command("envmap", "--model", network, "--keep-location", phone, "-o", exr, "--height", "16").exit_code
        == 0
    )
    light = read_exr(exr)[1]
    assert light is not None
    assert light.to_dict()["place"] == place
    assert light.to_dict()["evidence"] == ["pixels", "time+place", "heading", "focal length"]


def test_a_turned_map_keeps_the_suns_compass_azimuth(phone: Path, network: Path, tmp_path: Path) -> None:
    found = []
    for yaw in ("0", "-90"):
        assert (
            invoke_command(
                *("envmap", "--model", network, phone, "-o", tmp_path / "a.exr", "--overwrite"),
                *("--height=16", "--yaw", yaw),
            ).exit_code
            == 0
        )
        light = read_exr(tmp_path / "a.exr")[1]
        assert light is not None
        assert light.camera_heading is not None
        found.append((light.camera_heading + light.sun_azimuth) % 360.0)
    assert found[0] == pytest.approx(found[1], abs=1e-3)
    assert found[0] == pytest.approx(96.3, abs=1.0)


# Several photos


def test_photos_together_agree_on_the_sky(phone: Path, tmp_path: Path, network: Path) -> None:
    other = tmp_path / "other.jpg"
    other.write_bytes(encode(scene(200, 300)[::-1].copy()))
    args: list[str | Path] = ["estimate", "--json", "--model", network, phone, other]
    apart, together = records(invoke_command(*args)), records(invoke_command(*args, "--together"))
    assert apart[0]["sky"]["turbidity"] != apart[1]["sky"]["turbidity"]
    assert together[0]["sky"]["turbidity"] == together[1]["sky"]["turbidity"]
    assert together[1]["sun"]["elevation"] == pytest.approx(35.9, abs=0.2)
    assert all("other photos" in record["evidence"] for record in together)


def test_headings_turn_one_sun_to_the_other(phone: Path, tmp_path: Path, network: Path) -> None:
    other = write(tmp_path, "other.jpg", GPSImgDirection=None)
    args: list[str | Path] = [
        "estimate",
        "--json",
        "--model",
        network,
        phone,
        other,
        "--together",
        "--headings",
        "20,65",
    ]
    first, second = records(invoke_command(*args))
    assert (first["sun"]["azimuth"] - second["sun"]["azimuth"]) % 360 == pytest.approx(45.0, abs=1.0)
    assert (second["camera"]["heading"] - first["camera"]["heading"]) % 360 == pytest.approx(45.0, abs=1.0)


def test_unknown_headings_are_inferred(photo_path: Path, network: Path) -> None:
    result = invoke_command("estimate", "--no-exif", "--model", network, "--together", photo_path, photo_path)
    assert result.stdout.count("° clockwise from the first photo") == 2


def test_a_photo_that_cannot_be_read_is_left_out(phone: Path, tmp_path: Path, network: Path) -> None:
    (tmp_path / "bad.jpg").write_bytes(b"no photo")
    args: list[str | Path] = [
        "--together",
        "--headings",
        "0,10,90",
        phone,
        tmp_path / "bad.jpg",
        write(tmp_path, "b.jpg"),
    ]
    result = invoke_command("estimate", "--json", "--model", network, *args)
    assert result.exit_code == 1
    error, *good = map(json.loads, result.stdout.splitlines())
    assert "error" in error
    assert [Path(line["file"]).name for line in good] == ["phone.jpg", "b.jpg"]


# One sentence for whatever goes wrong


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--lat", "95", "--lon", "0"], "--latitude is 95; it must lie in -90 to 90."),
        (["--lat", "nan", "--lon", "0"], "--latitude must be a finite number"),
        (["--lon", "10"], "--lon needs --lat too, such as --lat 48.14 --lon 11.58."),
        (["--time", "2024-02-30T10:00"], "is not a time"),
        (["--time", "2024-02-20"], "a day without a time"),
        (["--time", "2200-02-20T10:00"], "1900 to 2100"),
        (["--time", "2024-06-01T10:00Z", "--utc-offset", "2"], "contradicts"),
        (["--utc-offset", "CET"], "not an offset"),
        (["--no-exif", "--utc-offset", "2"], "needs a time"),
        (["--no-exif", "--time", "2024-06-01T10:00Z"], "needs a place"),
        (["--heading", "1000"], "--heading is 1000"),
        (["--fov", "0"], "--vertical-fov is 0"),
        (["--together"], "two photos or more"),
        (["--headings", "0"], "--headings needs --together"),
        (["--together", "--headings", "0,1,2", "b.jpg"], "2 photos need 2 headings, not 3"),
        (["--together", "--headings", "0,east", "b.jpg"], "not a list of degrees"),
        (["--heading", "3", "b.jpg"], "heading is that of one photo; photos taken together have headings."),
    ],
)
def test_contradictions_are_wrong_usage(arguments: list[str], words: str) -> None:
    assert words in error_of(invoke_command("estimate", "a.jpg", *arguments), 2)


@pytest.mark.parametrize("command", ["envmap", "preview"])
def test_the_other_commands_refuse_them_too(command: str, tmp_path: Path) -> None:
    assert "--latitude is 95" in error_of(
        invoke_command(command, "a.jpg", "-o", tmp_path / "a.png", "--lat", "95", "--lon", "0"), 2
    )


def test_the_polar_night_is_one_sentence(phone: Path, network: Path) -> None:
    place = ["--time", "2024-12-21T12:00Z", "--lat", "75", "--lon", "15"]
    error = error_of(invoke_command("estimate", "--model", network, *place, phone))
    assert "nautical twilight of the polar night; civil twilight ends at 6°" in error
    result = invoke_command("estimate", "--json", "--model", network, *place, phone)
    assert result.exit_code == 1
    assert "below the horizon" in json.loads(result.stdout)["error"]


def test_night_in_the_metadata_is_a_warning(tmp_path: Path, network: Path) -> None:
    night = write(tmp_path, "night.jpg", DateTimeOriginal="2024:06:01 23:50:00")
    result = invoke_command("estimate", "--model", network, night)
    assert result.exit_code == 0
    (warning,) = result.stderr.splitlines()
    assert warning.startswith(f"Warning: {night}: The sun is 17.3° below the horizon (")
    assert invoke_command("estimate", "--quiet", "--model", network, night).stderr == ""
    assert "sun is" in invoke_command("preview", "--model", network, night, "-o", tmp_path / "a.png").stderr
    assert invoke_command("preview", "--quiet", "--model", network, night, "-o", tmp_path / "b.png").stderr == ""
    (record,) = records(invoke_command("estimate", "--json", "--quiet", "--model", network, night))
    assert record["evidence"] == ["pixels", "focal length"]
    assert len(record["warnings"]) == 1


def test_a_scene_takes_the_same_metadata(phone: Path, photo_path: Path, network: Path, tmp_path: Path) -> None:
    def evidence(name: str, *arguments: str | Path) -> list[str]:
        done = invoke_command("scene", *arguments, "--for", "mitsuba", "-o", tmp_path / name, "--model", network)
        assert done.exit_code == 0, done.output
        said: list[str] = json.loads((tmp_path / name / "lighting.json").read_text())["evidence"]
        return said

    assert evidence("known", phone) == ["pixels", "time+place", "heading", "focal length"]
    assert evidence("pixels", phone, "--no-exif") == ["pixels"]
    record = tmp_path / "known" / "lighting.json"
    stored: list[str | Path] = ["--lighting", record, "--fov", "50"]
    assert evidence("stored", photo_path, *stored) == ["pixels", "time+place", "heading", "focal length"]


@pytest.mark.parametrize("command", [["envmap"], ["render"], ["preview"]], ids=lambda c: c[0])
def test_a_bad_output_is_refused_before_any_work(command: list[str], tmp_path: Path) -> None:
    """The input does not exist either, and nobody got as far as looking."""
    (tmp_path / "device.png").symlink_to("/dev/null")
    for name, sentence in (
        ("a.gif", "must end in "),
        ("a", "There is no folder "),
        ("device.png", "is a pipe or a device, not a file."),
        ("absent/a.png", "There is no folder "),
    ):
        result = invoke_command(*command, "absent.jpg", "-o", tmp_path / name)
        assert sentence in error_of(result, 2)


@pytest.mark.parametrize("name", ["", "-"])
@pytest.mark.parametrize(
    "command",
    [
        ["batch", "."],
        ["scene", "absent.jpg", "--for", "gltf", "-o"],
        ["video", "absent.mp4", "-o"],
        ["stereo", "normals", ".", "-o"],
        ["probe", "merge", "lighting.jsonl", "--lens", "ball", "-o"],
    ],
    ids=lambda c: c[0],
)
def test_results_go_to_a_folder_that_has_a_name(
    command: list[str], name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An empty name, as an unset variable of a shell, would be the current folder, and --overwrite empty that."""
    monkeypatch.chdir(tmp_path)
    Path("lighting.jsonl").write_text("a day's work\n")
    overwrite = [] if command[0] == "probe" else ["--overwrite"]
    result = invoke_command(*command, name, *overwrite)
    assert ("stdout" if name else "is empty.") in error_of(result, 2)
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("lighting.jsonl", "a day's work\n")]


@pytest.mark.parametrize(
    "options",
    [
        ["envmap", "absent.jpg", "-o"],
        ["preview", "absent.jpg", "-o"],
        ["envmap", "absent.jpg", "-o", "a.exr", "--preview"],
        ["scene", "absent.jpg", "--for", "gltf", "-o", "out", "--lighting"],
        ["estimate", "absent.jpg", "--model"],
    ],
    ids=lambda options: f"{options[0]} {options[-1]}",
)
def test_a_file_that_an_option_names_has_a_name(options: list[str]) -> None:
    assert error_of(invoke_command(*options, ""), 2).endswith(": the name of the file is empty.")


@pytest.mark.parametrize("command", [["estimate", "absent.jpg", "--fit", "time"]], ids=lambda c: c[2])
def test_a_removed_option_says_what_there_is_instead(command: list[str]) -> None:
    name = command[2]
    assert f"{name} was removed: --together with time and place says" in error_of(invoke_command(*command), 2)
    assert name not in invoke_command(command[0], "--help").stdout


@pytest.mark.parametrize("value", ["0", "15", "33", "14", "8194", "-512", "1e3", "nan", ""])
def test_a_bad_height_is_wrong_usage(value: str, tmp_path: Path) -> None:
    assert invoke_command("render", "absent.json", "-o", tmp_path / "a.exr", "--height", value).exit_code == 2


@pytest.mark.parametrize(
    "command",
    [
        "scene absent.jpg --for usd",
        "day absent.jpg --date 2024-06-01",
        "video absent.mp4",
        f"probe merge {__file__} --lens ball",
    ],
)
def test_what_needs_a_whole_map_is_lower(command: str) -> None:
    sentence = "--height is 4098; it must be an even number from 16 to 4096."
    assert sentence in error_of(invoke_command(*command.split(), "--height", "4098"), 2)


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "north"])
def test_a_bad_yaw_is_wrong_usage(value: str, tmp_path: Path) -> None:
    assert invoke_command("render", "absent.json", "-o", tmp_path / "a.exr", "--yaw", value).exit_code == 2


def test_a_terminal_is_spared_binary_data(network: Path, photo_path: Path) -> None:
    status, shown = run_in_terminal("envmap", photo_path, "-o", "-", "--model", network, stdout_too=True)
    assert status == 2
    assert b"Binary data needs a file or a pipe, not a terminal." in shown


def test_help_names_every_compression() -> None:
    shown = invoke_command("render", "--help").stdout
    assert all(name in shown for name in COMPRESSIONS)


def test_a_bad_or_idle_compression_is_wrong_usage(tmp_path: Path) -> None:
    bad = invoke_command("render", "absent.json", "-o", tmp_path / "a.exr", "--compression", "dwaa")
    assert "'dwaa' is not known; it must be one of zip, pxr24, none." in error_of(bad, 2)
    removed = invoke_command("render", "absent.json", "-o", tmp_path / "a.exr", "--compression", "piz")
    assert "'piz' was removed; none changes no value either." in error_of(removed, 2)
    idle = invoke_command("render", "absent.json", "-o", tmp_path / "a.hdr", "--compression", "pxr24")
    assert "--compression goes with the format exr." in error_of(idle, 2)

"""Tests of estimate."""

import json
import subprocess
import sys
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageOps
from pyarrow.parquet import read_table

from lighting.cli.outputs import open_command
from lighting.envmap.render import render
from lighting.files.exr import read_exr
from lighting.record_json import record_with_coefficients, unwrap_record
from lighting.records import Lighting
from tests.helpers.predictions import without_probe
from tests.helpers.processes import LIGHTING, error_of, invoke_command, run_command

EXAMPLE = Path(__file__).parents[3] / "examples" / "wide_street.jpg"


def test_a_bad_photo_does_not_stop_the_others(network: Path, photo_path: Path, tmp_path: Path) -> None:
    (tmp_path / "bad.jpg").write_bytes(b"bad")
    bad, absent = tmp_path / "bad.jpg", tmp_path / "absent.jpg"
    result = invoke_command("estimate", "--json", bad, photo_path, absent, tmp_path, "--model", network)
    lines = [json.loads(line) for line in result.stdout.splitlines()]
    assert [line["file"] for line in lines] == [str(p) for p in (bad, photo_path, absent, tmp_path)]
    assert [set(line) for line in lines] == [{"file", "error"}, {"file", "lighting"}, *[{"file", "error"}] * 2]
    assert lines[0]["error"] == "This is a text, not a photo."
    assert lines[2]["error"] == "No such file or directory."
    assert result.stderr.splitlines() == [
        f"Error: {bad}: {lines[0]['error']}",
        f"Error: {absent}: No such file or directory.",
        f"Error: {tmp_path}: It is a folder: try `lighting batch {tmp_path}`.",
        "3 of 4 photos failed.",
    ]
    assert result.exit_code == 1


def test_one_photo_imports_nothing_that_matches_several(network: Path, photo_path: Path) -> None:
    code = "import sys; from lighting.cli import cli; cli(sys.argv[1:], standalone_mode=False); print(*sys.modules)"
    command = [sys.executable, "-c", code, "estimate", photo_path, "-q", "--model", network]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=60, check=True)
    modules = set(done.stdout.split())
    assert "lighting.estimator" in modules
    assert not {"lighting.registration", "numpy.random", "tqdm"} & modules


def test_one_bad_photo_is_not_counted(network: Path) -> None:
    assert (
        error_of(invoke_command("estimate", "absent.jpg", "--model", network))
        == "absent.jpg: No such file or directory."
    )


def test_estimate_reads_stdin(network: Path, photo_path: Path, expected: Lighting) -> None:
    result = invoke_command("estimate", "--json", "-", "--model", network, stdin=photo_path.read_bytes())
    line = json.loads(result.stdout)
    assert (line["file"], without_probe(line["lighting"])) == ("-", record_with_coefficients(expected))
    assert error_of(invoke_command("estimate", "-", "--model", network, stdin=b"")) == "stdin: The photo is empty."


def test_stdin_is_one_photo() -> None:
    assert error_of(invoke_command("estimate", "-", "-"), 2) == "Only one of the photos can be stdin."


def test_the_only_photo_that_can_be_read_is_answered_though_headings_are_given(
    network: Path, photo_path: Path, tmp_path: Path
) -> None:
    (tmp_path / "bad.jpg").write_bytes(b"bad")
    photos = photo_path, tmp_path / "bad.jpg"
    result = invoke_command("estimate", "--json", "--together", "--headings", "0,90", *photos, "--model", network)
    assert [set(json.loads(line)) for line in result.stdout.splitlines()] == [{"file", "error"}, {"file", "lighting"}]
    assert result.exit_code == 1


def test_estimate_says_where_the_light_comes_from(network: Path, photo_path: Path, expected: Lighting) -> None:
    result = invoke_command("estimate", photo_path, "--model", network)
    assert result.exit_code == 0
    (line,) = result.stdout.splitlines()
    assert result.stderr == ""
    assert line.startswith(f"{photo_path}: sun {abs(expected.sun_azimuth):.1f}° ")
    for words in (
        f"{expected.sun_elevation:.1f}° high",
        f"50 % within {expected.radius_50:.1f}°",
        f"90 % within {expected.radius_90:.1f}°",
        f"direct sunlight {100 * expected.sun_visibility:.0f} %",
        f"turbidity {expected.turbidity:.1f}",
        f"camera looks {expected.camera_elevation:.1f}° up",
        f"roll {expected.camera_roll:.1f}°",
        f"vertical field of view {expected.vertical_fov:.1f}°",
    ):
        assert words in line


def test_estimate_as_json(network: Path, photo_path: Path, expected: Lighting) -> None:
    result = invoke_command("estimate", "--json", photo_path, photo_path, "--model", network)
    first, second = map(json.loads, result.stdout.splitlines())
    assert first == second
    assert without_probe(first.pop("lighting")) == record_with_coefficients(expected)
    assert first == {"file": str(photo_path)}
    assert (result.exit_code, result.stderr) == (0, "")


def test_estimate_also_writes_records(network: Path, photo_path: Path, tmp_path: Path) -> None:
    one, several = tmp_path / "light.json", tmp_path / "lights.jsonl"
    options = ("--model", network)
    plain = invoke_command("estimate", photo_path, *options).stdout
    as_json = invoke_command("estimate", photo_path, *options, "--json").stdout
    assert invoke_command("estimate", photo_path, *options, "-o", one).stdout == f"{plain}Wrote {one}.\n"
    assert one.read_text() == as_json
    assert invoke_command("estimate", photo_path, *options, "-o", "-").stdout == as_json
    result = invoke_command("estimate", "absent.jpg", photo_path, *options, "-o", several)
    assert result.exit_code == 1
    assert [set(json.loads(line)) for line in several.read_text().splitlines()] == [
        {"file", "error"},
        {"file", "lighting"},
    ]
    again = invoke_command("estimate", photo_path, *options, "-o", one)
    assert error_of(again) == f"{one} is there already; --overwrite replaces it."
    assert invoke_command("estimate", photo_path, *options, "-o", one, "--overwrite", "-q").exit_code == 0
    wrong = error_of(invoke_command("estimate", photo_path, photo_path, *options, "-o", one), status=2)
    assert wrong.endswith(f"{one} must end in .jsonl.")


def test_light_probe_goes_to_a_file(network: Path, photo_path: Path, tmp_path: Path) -> None:
    command, file = ("light-probe", photo_path, "--model", network), tmp_path / "probe.json"
    assert invoke_command(*command, "-o", file).stdout == f"Wrote {file}.\n"
    assert file.read_text() == invoke_command(*command).stdout == invoke_command(*command, "-o", "-").stdout
    again = invoke_command(*command, "-o", file)
    assert error_of(again) == f"{file} is there already; --overwrite replaces it."


def test_json_of_a_photo_inside_a_border_says_where_it_lies(network: Path, tmp_path: Path) -> None:
    with Image.open(EXAMPLE) as example:
        photo = example.convert("RGB").resize((480, 270))
    ImageOps.expand(photo, (0, 45), "black").save(tmp_path / "a.png")
    line = json.loads(invoke_command("estimate", "--json", tmp_path / "a.png", "--model", network).stdout)
    inner = {"left": 0, "top": 45, "width": 480, "height": 270}
    assert line["crop"] == {**inner, "picture_width": 480, "picture_height": 360}
    assert set(line) == {"file", "lighting", "crop"}
    assert unwrap_record(line) == line["lighting"]
    out = tmp_path / "out"
    assert invoke_command("batch", tmp_path / "*.png", out, "--parquet", "--model", network).exit_code == 0
    assert json.loads((out / "lighting.jsonl").read_text()) == {**line, "file": "a.png"}
    assert read_table(out / "lighting.parquet")["crop"].to_pylist() == [line["crop"]]


def test_a_bad_network_is_one_sentence(photo_path: Path) -> None:
    text = error_of(invoke_command("estimate", photo_path, photo_path, "--model", photo_path))
    assert text == f"{photo_path} is not an ONNX network that can be read: Protobuf parsing failed."


def test_envmap_is_the_render_of_the_estimate(
    network: Path, photo_path: Path, tmp_path: Path, expected: Lighting
) -> None:
    invoke_command("envmap", photo_path, "-o", tmp_path / "a.exr", "--height", "32", "--model", network)
    image, lighting = read_exr(tmp_path / "a.exr")
    assert lighting == expected
    assert image == pytest.approx(render(expected, 32), rel=1e-3)


def test_quiet_envmap_prints_nothing(network: Path, photo_path: Path, tmp_path: Path) -> None:
    result = invoke_command("envmap", photo_path, "-o", tmp_path / "a.exr", "--height", "16", "--model", network, "-q")
    assert (result.exit_code, result.output) == (0, "")


@pytest.mark.parametrize("flags", [[], ["--no-sun"]])
def test_the_sun_can_be_left_out(record_path: Path, tmp_path: Path, flags: list[str]) -> None:
    invoke_command("render", record_path, "-o", tmp_path / "a.exr", "--height", "64", *flags)
    assert read_exr(tmp_path / "a.exr")[0] == pytest.approx(render(LIGHTING, 64, sun=not flags), rel=1e-3)


def test_yaw_turns_the_map_and_the_record_in_it(record_path: Path, tmp_path: Path) -> None:
    invoke_command("render", record_path, "-o", tmp_path / "a.exr", "--height", "64", "--yaw", "-180")
    image, lighting = read_exr(tmp_path / "a.exr")
    assert image == pytest.approx(np.roll(render(LIGHTING, 64), 64, axis=1), rel=1e-3)
    assert lighting is not None
    assert lighting.sun_azimuth == pytest.approx(138.8)


@pytest.mark.slow
def test_preview_draws_a_png(network: Path, photo_path: Path, tmp_path: Path) -> None:
    alone, beside = tmp_path / "alone.png", tmp_path / "beside.png"
    result = invoke_command("preview", photo_path, "-o", alone, "--model", network)
    assert result.exit_code == 0
    assert result.stderr == ""  # the network does not tell where firm ground is
    assert result.stdout.splitlines()[-1].startswith(f"Wrote {alone}.")
    options = ["--height", "64", "--yaw", "45", "--preview", str(beside)]
    both = invoke_command("envmap", photo_path, "-o", tmp_path / "a.exr", "--model", network, *options)
    last = both.stdout.splitlines()[-1]
    assert last.startswith(f"Wrote {tmp_path / 'a.exr'} and {beside}.")
    assert last.count("Open") == both.stdout.count("Open") == (open_command(str(beside)) is not None)
    with Image.open(alone) as first, Image.open(beside) as second:
        assert first.format == "PNG"
        assert min(first.size) > 500
        assert (np.asarray(first) == np.asarray(second)).all()


@pytest.mark.slow
def test_preview_to_stdout(network: Path, photo_path: Path) -> None:
    result = invoke_command("preview", "-", "-o", "-", "--model", network, stdin=photo_path.read_bytes())
    with Image.open(BytesIO(result.stdout_bytes)) as drawing:
        assert drawing.format == "PNG"
    assert result.stderr == ""


def test_a_chain_of_pipes(network: Path, photo_path: Path) -> None:
    record = run_command("estimate", "--json", "-", "--model", network, stdin=photo_path.read_bytes())
    envmap = run_command("render", "-", "-o", "-", "--height", "32", stdin=record.stdout)
    assert read_exr(BytesIO(envmap.stdout))[0].shape == (32, 64, 3)
    direct = run_command("envmap", "-", "-o", "-", "--height", "32", "--model", network, stdin=photo_path.read_bytes())
    assert direct.stdout == envmap.stdout
    assert [p.returncode for p in (record, envmap, direct)] == [0, 0, 0]
    sky_only = b"Sky only: the place needs the photo (--photo PHOTO).\n"
    assert [p.stderr for p in (record, envmap, direct)] == [b"", sky_only, b""]


@pytest.mark.parametrize("flag", [None, "--surroundings", "--no-surroundings"])
def test_the_place_is_in_the_map_where_the_network_predicts_it(
    lit_network: Path, photo_path: Path, tmp_path: Path, flag: str | None
) -> None:
    invoke_command(
        *("envmap", photo_path, "-o", tmp_path / "a.exr", "--height", "32"),
        *filter(None, [flag]),
        "--model",
        lit_network,
    )
    image, lighting = read_exr(tmp_path / "a.exr")
    assert lighting is not None
    bare = bool(np.allclose(image, render(lighting, 32), rtol=1e-3))
    assert bare == (flag == "--no-surroundings")


def test_a_preview_shows_the_place_unless_the_sky_alone_is_wanted(
    lit_network: Path, photo_path: Path, tmp_path: Path
) -> None:
    drawn = []
    for name, flags in (("a.png", []), ("b.png", ["--surroundings"]), ("c.png", ["--no-surroundings"])):
        assert (
            invoke_command("preview", photo_path, "-o", tmp_path / name, *flags, "--model", lit_network).exit_code == 0
        )
        drawn.append((tmp_path / name).read_bytes())
    assert drawn[0] == drawn[1] != drawn[2]


def test_the_place_has_detail_unless_a_smooth_one_is_wanted(
    lit_network: Path, photo_path: Path, tmp_path: Path
) -> None:
    for command, kind in (("envmap", "exr"), ("preview", "png")):
        drawn = []
        for number, flags in enumerate([[], ["--detail"], ["--no-detail"]]):
            file = tmp_path / f"{number}.{kind}"
            size = ["--height", "64"] if command == "envmap" else []
            result = invoke_command(command, photo_path, "-o", file, *size, *flags, "--model", lit_network)
            assert result.exit_code == 0
            drawn.append(file.read_bytes())
        assert drawn[0] == drawn[1] != drawn[2]


def test_the_place_can_be_asked_of_any_network(network: Path, photo_path: Path, tmp_path: Path) -> None:
    invoke_command(
        "envmap", photo_path, "-o", tmp_path / "a.exr", "--height", "32", "--surroundings", "--model", network
    )
    image, lighting = read_exr(tmp_path / "a.exr")
    assert lighting is not None
    assert not np.allclose(image, render(lighting, 32), rtol=1e-3)


def test_the_sky_is_a_choice(record_path: Path, tmp_path: Path) -> None:
    invoke_command("render", record_path, "-o", tmp_path / "a.exr", "--height", "32", "--sky", "cie-12")
    image, lighting = read_exr(tmp_path / "a.exr")
    assert lighting == replace(LIGHTING, sky_painted="cie-12")
    np.testing.assert_allclose(image, render(lighting, 32), rtol=1e-3)
    assert "'blue' is not one of 'hosek-wilkie'" in error_of(
        invoke_command("render", record_path, "-o", "a.exr", "--sky", "blue"), 2
    )

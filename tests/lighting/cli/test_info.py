"""What a file says of itself."""

import json
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image, ImageOps

from lighting.files.exr import read_exr, write_exr
from lighting.light_probe import compute_light_probe
from lighting.record_json import record_with_coefficients
from tests.conftest import TINY
from tests.helpers.processes import LIGHTING, error_of, invoke_command, run_command

EXAMPLE = Path(__file__).parents[3] / "examples" / "wide_street.jpg"
METADATA = ["local_time", "utc_offset", "gps_time", "heading", "heading_reference", "focal_length", "vertical_fov"]
METADATA += [
    "camera_elevation",
    "camera_roll",
    "gravity_source",
    "gravity_spread",
    "exposure_value",
    "camera_make",
    "camera_height",
    "utc_time",
    "time_source",
    "utc_probability",
    "orientation",
]
KNOWN_METADATA = {
    "location": False,
    "is_panorama": False,
    "is_thermal": False,
    "is_lens_consistent": True,
    "other_vertical_fovs": [],
}


def test_info_of_a_map_can_be_rendered_again(record_path: Path, tmp_path: Path) -> None:
    invoke_command("render", record_path, "-o", tmp_path / "a.exr", "--height", "32", "--yaw", "90")
    described = invoke_command("info", tmp_path / "a.exr")
    invoke_command("render", "-", "-o", tmp_path / "b.exr", "--height", "32", stdin=described.stdout_bytes)
    assert read_exr(tmp_path / "b.exr")[0] == pytest.approx(read_exr(tmp_path / "a.exr")[0], rel=1e-2)


def test_info_of_a_map_tells_the_probe_of_its_header(tmp_path: Path) -> None:
    probe = compute_light_probe(LIGHTING, sun=False, yaw=30.0)
    write_exr(tmp_path / "a.exr", np.ones((16, 32, 3), np.float32), LIGHTING, probe=probe)
    write_exr(tmp_path / "old.exr", np.ones((16, 32, 3), np.float32), LIGHTING)
    told, computed = (
        json.loads(invoke_command("info", tmp_path / name).stdout)["lighting"]["light_probe"]
        for name in ("a.exr", "old.exr")
    )
    assert told == probe.to_dict()
    assert computed == compute_light_probe(LIGHTING).to_dict()


def test_info_of_each_kind(network: Path, photo_path: Path, record_path: Path, tmp_path: Path) -> None:
    invoke_command("render", record_path, "-o", tmp_path / "a.exr", "--height", "16")
    photo, net, envmap = (
        json.loads(invoke_command("info", f).stdout) for f in (photo_path, network, tmp_path / "a.exr")
    )
    assert photo.pop("metadata") == {**dict.fromkeys(METADATA), **KNOWN_METADATA}
    assert photo == {"file": str(photo_path), "kind": "photo", "format": "JPEG", "width": 320, "height": 240}
    assert net == {"file": str(network), "kind": "network", **json.loads(TINY.to_json())}
    assert envmap.pop("lighting") == record_with_coefficients(LIGHTING, compute_light_probe(LIGHTING))
    assert envmap == {"file": str(tmp_path / "a.exr"), "kind": "environment map", "width": 32, "height": 16}


def test_info_of_a_photo_inside_a_border_says_where_it_lies(tmp_path: Path) -> None:
    with Image.open(EXAMPLE) as example:
        photo = example.convert("RGB").resize((480, 270))
    ImageOps.expand(photo, (0, 45), "black").save(tmp_path / "a.png")
    described = json.loads(invoke_command("info", tmp_path / "a.png").stdout)
    assert (described["width"], described["height"]) == (480, 270)
    inner = {"left": 0, "top": 45, "width": 480, "height": 270}
    assert described["crop"] == {**inner, "picture_width": 480, "picture_height": 360}


def test_only_what_is_twice_as_wide_as_high_is_a_map(record_path: Path, tmp_path: Path) -> None:
    invoke_command("render", record_path, "-o", tmp_path / "a.hdr", "--height", "16")
    OpenEXR.File({}, {"RGB": np.ones((20, 30, 3), np.float32)}).write(str(tmp_path / "b.exr"))
    envmap, picture = (json.loads(invoke_command("info", tmp_path / name).stdout) for name in ("a.hdr", "b.exr"))
    assert envmap == {"file": str(tmp_path / "a.hdr"), "kind": "environment map", "width": 32, "height": 16}
    assert (picture["kind"], picture["width"], picture["height"]) == ("picture", 30, 20)


def test_info_of_a_record(record_path: Path, tmp_path: Path) -> None:
    described = json.loads(invoke_command("info", record_path).stdout)
    assert described == {
        "file": str(record_path),
        "kind": "lighting record",
        "lighting": record_with_coefficients(LIGHTING, compute_light_probe(LIGHTING)),
    }
    (tmp_path / "bad.json").write_text("[1")
    error_of(invoke_command("info", tmp_path / "bad.json"))


def test_an_hdr_picture_is_known_by_its_first_bytes(record_path: Path, tmp_path: Path) -> None:
    invoke_command("render", record_path, "-o", tmp_path / "a.hdr", "--height", "16")
    whole = (tmp_path / "a.hdr").read_bytes()
    assert json.loads(invoke_command("info", "-", stdin=whole).stdout) == {
        "file": "-",
        "kind": "environment map",
        "width": 32,
        "height": 16,
    }
    assert error_of(invoke_command("info", "-", stdin=whole[:200])) == "stdin: The HDR picture is cut short or damaged."
    (tmp_path / "b.hdr").write_bytes(b"no picture")
    assert error_of(invoke_command("info", tmp_path / "b.hdr")).endswith(
        "b.hdr: The file is not a Radiance HDR picture with its top row first."
    )


def test_info_reads_stdin(photo_path: Path) -> None:
    assert json.loads(invoke_command("info", "-", stdin=photo_path.read_bytes()).stdout)["width"] == 320
    record = record_with_coefficients(LIGHTING, compute_light_probe(LIGHTING))
    for mark in (b"", b"\xef\xbb\xbf"):
        described = invoke_command("info", "-", stdin=mark + json.dumps(record).encode())
        assert json.loads(described.stdout)["lighting"] == record


def test_a_damaged_map_is_named(tmp_path: Path) -> None:
    (tmp_path / "cut.exr").write_bytes(b"\x76\x2f\x31\x01" + bytes(40))
    assert error_of(invoke_command("info", tmp_path / "cut.exr")).startswith(f"{tmp_path / 'cut.exr'}: ")


def test_of_a_map_whose_pixels_are_damaged_nothing_else_is_said(record_path: Path, tmp_path: Path) -> None:
    """OpenEXR would print what its decoder found, on both streams."""
    invoke_command("render", record_path, "-o", tmp_path / "a.exr", "--height", "64")
    whole = (tmp_path / "a.exr").read_bytes()
    (tmp_path / "a.exr").write_bytes(whole[:-3000] + bytes(2000) + whole[-1000:])
    found = run_command("info", tmp_path / "a.exr")
    assert (found.returncode, found.stdout) == (1, b"")
    assert found.stderr.decode() == (
        f"Error: {tmp_path / 'a.exr'}: The EXR file cannot be read: it is damaged or of an unknown kind.\n"
    )


@pytest.mark.parametrize("data", [b"", b"text", b"v/1\x01 and no more"])
def test_info_of_what_is_neither_is_one_sentence(data: bytes, tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(data)
    error_of(invoke_command("info", tmp_path / "file"))
    error_of(invoke_command("info", tmp_path / "absent"))
    error_of(invoke_command("info", tmp_path))


def test_info_of_a_raw_photo_without_a_preview_says_what_converts_it(tmp_path: Path) -> None:
    (tmp_path / "a.raf").write_bytes(b"FUJIFILMCCD-RAW 0201FF" + bytes(200))
    assert "RAW photo has no readable preview" in error_of(invoke_command("info", tmp_path / "a.raf"))


@pytest.mark.parametrize("command", [["info", "/dev/zero"], ["render", "/dev/zero", "-o", "map.exr"]])
def test_a_file_without_an_end_is_read_as_far_as_it_may_be(command: list[str]) -> None:
    assert "larger than" in error_of(invoke_command(*command))

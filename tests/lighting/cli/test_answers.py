"""Answers of several photos, with what failed in its place."""

import json
from pathlib import Path

from lighting.files import full_record
from lighting.records import Lighting
from tests.lighting.cli.runners import error_of, run


def test_a_bad_photo_does_not_stop_the_others(network: Path, photo_path: Path, tmp_path: Path) -> None:
    (tmp_path / "bad.jpg").write_bytes(b"bad")
    bad, absent = tmp_path / "bad.jpg", tmp_path / "absent.jpg"
    result = run("estimate", "--json", bad, photo_path, absent, tmp_path, "--model", network)
    lines = [json.loads(line) for line in result.stdout.splitlines()]
    assert [line["file"] for line in lines] == [str(p) for p in (bad, photo_path, absent, tmp_path)]
    assert [set(line) for line in lines] == [{"file", "error"}, {"file", "lighting"}, *[{"file", "error"}] * 2]
    assert lines[0]["error"] == "The file is not a JPEG, PNG, WebP, TIFF, AVIF or HEIC photo that can be read."
    assert lines[2]["error"] == "No such file or directory."
    assert result.stderr.splitlines() == [
        f"Error: {bad}: {lines[0]['error']}",
        f"Error: {absent}: No such file or directory.",
        f"Error: {tmp_path}: Is a directory.",
        "3 of 4 photos failed.",
    ]
    assert result.exit_code == 1


def test_one_bad_photo_is_not_counted(network: Path) -> None:
    assert error_of(run("estimate", "absent.jpg", "--model", network)) == "absent.jpg: No such file or directory."


def test_estimate_reads_stdin(network: Path, photo_path: Path, expected: Lighting) -> None:
    result = run("estimate", "--json", "-", "--model", network, stdin=photo_path.read_bytes())
    assert json.loads(result.stdout) == {"file": "-", "lighting": full_record(expected)}
    assert error_of(run("estimate", "-", "--model", network, stdin=b"")) == "stdin: The photo is empty."


def test_stdin_is_one_photo() -> None:
    assert error_of(run("estimate", "-", "-"), 2) == "Only one of the photos can be stdin."


def test_the_only_photo_that_can_be_read_is_answered_though_headings_are_given(
    network: Path, photo_path: Path, tmp_path: Path
) -> None:
    (tmp_path / "bad.jpg").write_bytes(b"bad")
    photos = photo_path, tmp_path / "bad.jpg"
    result = run("estimate", "--json", "--together", "--headings", "0,90", *photos, "--model", network)
    assert [set(json.loads(line)) for line in result.stdout.splitlines()] == [{"file", "error"}, {"file", "lighting"}]
    assert result.exit_code == 1

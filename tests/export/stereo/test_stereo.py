"""Tests of stereo."""

from pathlib import Path

from click.testing import CliRunner

from export.stereo import stereo_group
from export.stereo.evaluate import TABLES


def test_the_group_lists_its_commands() -> None:
    listed = CliRunner().invoke(stereo_group, ["--help"]).stdout
    for name in ("evaluate", "gain", "onnx", "speed", "train"):
        assert f"  {name} " in listed


def test_tables_are_checked_and_listed() -> None:
    result = CliRunner().invoke(stereo_group, ["evaluate", "--data", "shapes", "--table", "seasonal"])
    assert result.exit_code == 2
    assert "seasonal is none of seasons, wrong" in result.stderr
    listed = CliRunner().invoke(stereo_group, ["evaluate", "--help"]).stdout
    assert all(table in listed for table in TABLES)


def test_a_folder_without_shapes_is_named(tmp_path: Path) -> None:
    result = CliRunner().invoke(stereo_group, ["evaluate", "--data", str(tmp_path)])
    assert result.exit_code != 0
    assert "holds no scanned_objects" in str(result.exception)

"""What the commands of the network of normals are told."""

from pathlib import Path

from click.testing import CliRunner

from export.stereo.evaluate import TABLES
from export.stereo.normals_commands import stereo


def test_tables_are_checked_and_listed() -> None:
    result = CliRunner().invoke(stereo, ["evaluate", "--data", "shapes", "--table", "seasonal"])
    assert result.exit_code == 2
    assert "seasonal is none of seasons, wrong" in result.stderr
    listed = CliRunner().invoke(stereo, ["evaluate", "--help"]).stdout
    assert all(table in listed for table in TABLES)


def test_a_folder_without_shapes_is_named(tmp_path: Path) -> None:
    result = CliRunner().invoke(stereo, ["evaluate", "--data", str(tmp_path)])
    assert result.exit_code != 0
    assert "holds no scanned_objects" in str(result.exception)
